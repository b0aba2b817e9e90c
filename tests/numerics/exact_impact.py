"""First contact of moving points in fractions: roots of the coplanarity cubic, isolated; signs there, decided."""

from fractions import Fraction
from itertools import pairwise


class Coplanar(Exception):
    """All four points stay in one plane, or the figure has no area at a root: not for this judge."""


def plus(a, b, sign=1):
    size = max(len(a), len(b))
    a, b = a + [0] * (size - len(a)), b + [0] * (size - len(b))
    return trim([x + sign * y for x, y in zip(a, b, strict=True)])


def times(a, b):
    out = [Fraction(0)] * (len(a) + len(b) - 1) if a and b else []
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return trim(out)


def trim(a):
    a = list(a)
    while a and a[-1] == 0:
        a.pop()
    return a


def value(a, t):
    total = Fraction(0)
    for x in reversed(a):
        total = total * t + x
    return total


def remainder(a, b):
    a = list(a)
    while len(a) >= len(b):
        factor, shift = a[-1] / b[-1], len(a) - len(b)
        a = trim([x - factor * b[i - shift] if i >= shift else x for i, x in enumerate(a)][:-1])
    return a


def common(a, b):
    while b:
        a, b = b, remainder(a, b)
    return a


def derivative(a):
    return trim([k * x for k, x in enumerate(a)][1:])


def roots_within(a, low, high):
    """Number of distinct roots in (low, high], by Sturm's theorem; low must not be a root."""
    chain = [a, derivative(a)]
    while chain[-1]:
        chain.append([-x for x in remainder(chain[-2], chain[-1])])

    def changes(t):
        signs = [v > 0 for v in (value(one, t) for one in chain[:-1]) if v]
        return sum(x != y for x, y in pairwise(signs))

    return changes(low) - changes(high)


def isolated_roots(a):
    """Yield, in order, intervals (low, high] that hold one root of [0, 1] each; (t, t) where it is found exactly."""
    if value(a, 0) == 0:
        yield Fraction(0), Fraction(0)
    low = Fraction(0)
    while value(a, low) == 0:  # step past a root at 0
        low += Fraction(1, 10**9)
    todo = [(low, Fraction(1))]
    while todo:
        low, high = todo.pop()
        count = roots_within(a, low, high)
        if count == 1:
            yield low, high
        elif count > 1:
            middle = (low + high) / 2
            while value(a, middle) == 0:
                middle = (low + middle) / 2
            todo += [(middle, high), (low, middle)]


def sign_at_root(g, f, low, high):
    """Sign of g at the one root of f in (low, high]."""
    if low == high:
        v = value(g, low)
        return (v > 0) - (v < 0)
    if not g:
        return 0
    shared = common(f, g)
    if len(shared) > 1 and value(shared, low) != 0 and roots_within(shared, low, high):
        return 0
    while value(g, low) == 0 or roots_within(g, low, high):
        low, high = halve(f, low, high)
        if low == high:
            return sign_at_root(g, f, low, high)
    v = value(g, high)
    return (v > 0) - (v < 0)


def halve(f, low, high):
    middle = (low + high) / 2
    if value(f, middle) == 0:
        return middle, middle
    return (low, middle) if roots_within(f, low, middle) else (middle, high)


def not_after(t, f, low, high):
    """Whether t is no later than the one root of f in (low, high]."""
    t = Fraction(t)
    while low < t <= high and value(f, t) != 0:
        low, high = halve(f, low, high)
    return t <= high


def cross(a, b):
    return [plus(times(a[i - 2], b[i - 1]), times(a[i - 1], b[i - 2]), -1) for i in range(3)]


def dot(a, b):
    total = []
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def first_contact(start, end, edges):
    """Cubic and interval of the root at which the features first touch, or None."""
    p = [
        [trim([Fraction(float(x)), Fraction(float(y)) - Fraction(float(x))]) for x, y in zip(a, b, strict=True)]
        for a, b in zip(start, end, strict=True)
    ]

    def minus(i, j):
        return [plus(x, y, -1) for x, y in zip(p[i], p[j], strict=True)]

    if edges:
        u, v, x = minus(1, 0), minus(3, 2), minus(2, 0)
    else:
        u, v, x = minus(2, 1), minus(3, 1), minus(0, 1)
    normal = cross(u, v)
    f, area = dot(normal, x), dot(normal, normal)
    if not f:
        raise Coplanar
    first = dot(normal, cross(x, v))  # share of u, times area
    second = dot(normal, cross(x, u)) if edges else dot(normal, cross(u, x))
    most = [plus(area, first, -1), plus(area, second, -1)] if edges else [plus(plus(area, first, -1), second, -1)]
    square_free = f
    shared = common(f, derivative(f))
    if len(shared) > 1:
        square_free = quotient(f, shared)
    for low, high in isolated_roots(square_free):
        if sign_at_root(area, square_free, low, high) == 0:
            raise Coplanar
        if all(sign_at_root(g, square_free, low, high) >= 0 for g in (first, second, *most)):
            return square_free, low, high
    return None


def quotient(a, b):
    a, out = list(a), [Fraction(0)] * (len(a) - len(b) + 1)
    while len(a) >= len(b):
        factor, shift = a[-1] / b[-1], len(a) - len(b)
        out[shift] = factor
        a = trim([x - factor * b[i - shift] if i >= shift else x for i, x in enumerate(a)][:-1])
    return out
