"""Distances of vertex and face and of two edges in fractions."""

from fractions import Fraction


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def exact_figure_distance_sq(x, u, v, four):
    """Squared distance, in fractions, from the origin to {x + s u + t v}: s, t >= 0, s + t <= 1; or <= 1 each."""

    def to_segment(p, e):
        length_sq = dot(e, e)
        s = min(max(-dot(p, e) / length_sq, 0), 1) if length_sq else 0
        y = [a + s * b for a, b in zip(p, e, strict=True)]
        return dot(y, y)

    def plus(p, e, sign=1):
        return [a + sign * b for a, b in zip(p, e, strict=True)]

    rim = [to_segment(x, u), to_segment(x, v), to_segment(plus(x, u), v if four else plus(v, u, -1))]
    if four:
        rim.append(to_segment(plus(x, v), u))
    uu, uv, vv, xu, xv = dot(u, u), dot(u, v), dot(v, v), dot(x, u), dot(x, v)
    det = uu * vv - uv * uv
    if det:
        s, t = (uv * xv - vv * xu) / det, (uv * xu - uu * xv) / det
        if s >= 0 and t >= 0 and (max(s, t) <= 1 if four else s + t <= 1):
            y = plus(plus(x, [s * a for a in u]), [t * b for b in v])
            return min(min(rim), dot(y, y))
    return min(rim)


def exact_distance_sq(points, edges):
    """Squared distance of vertex and face (p, a, b, c), or of the edges ab and cd."""
    p = [[Fraction(x) for x in row] for row in points]

    def minus(i, j):
        return [a - b for a, b in zip(p[i], p[j], strict=True)]

    figure = (minus(0, 2), minus(1, 0), minus(2, 3)) if edges else (minus(1, 0), minus(2, 1), minus(3, 1))
    return exact_figure_distance_sq(*figure, edges)


def exact_distance(points, edges):
    """Its root, rounded: points as floats, shape (4, 3)."""
    return float(exact_distance_sq(points.tolist(), edges)) ** 0.5
