"""A line chart as SVG inside the page, in the page's colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vto_pipeline.model.arrays import FloatArray

_WIDTH, _HEIGHT = 640, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 14, 14, 44


def log_chart(x: Sequence[float], lines: Mapping[str, Sequence[float | None]], x_label: str, y_label: str) -> str:
    """Draw lines over x with both axes logarithmic, as an <svg> element.

    Args:
        x: Where their points are.
        lines: Name, plain text of this package -> the points; those that are not positive and finite are left out, and
            so are lines of fewer than two. Names are shown where there are several.
        x_label, y_label: Axis titles, plain text of this package, unit included.

    Returns:
        The element, or an empty string when no line is left.
    """
    drawn = {name: points for name, y in lines.items() if len(points := _positive(x, y)) > 1}
    if not drawn:
        return ""
    every = np.concatenate(list(drawn.values()))
    low, high = np.floor(np.log10(every.min(axis=0))), np.ceil(np.log10(every.max(axis=0)))
    high = np.maximum(high, low + 1)
    pieces = _grid(low, high)
    for k, (name, points) in enumerate(drawn.items()):
        place = _to_page(np.log10(points), low, high)
        path = "M" + "L".join(f"{px:.1f},{py:.1f}" for px, py in place)
        pieces.append(f'<path class="line l{k}" d="{path}"/>')
        dots = place[:: max(1, len(place) // 40)]
        pieces += [f'<circle class="dot l{k}" cx="{px:.1f}" cy="{py:.1f}" r="2.5"/>' for px, py in dots]
        if len(drawn) > 1:
            right, down = _WIDTH - _RIGHT - 8, _TOP + 16 + 16 * k
            pieces.append(f'<text class="end l{k}" x="{right}" y="{down}">{name}</text>')
    middle_x, middle_y = 0.5 * (_LEFT + _WIDTH - _RIGHT), 0.5 * (_TOP + _HEIGHT - _BOTTOM)
    pieces.append(f'<text class="title" x="{middle_x:.0f}" y="{_HEIGHT - 6}">{x_label}</text>')
    pieces.append(f'<text class="title" transform="translate(14 {middle_y:.0f}) rotate(-90)">{y_label}</text>')
    name = f"{y_label} over {x_label}"
    return f'<svg class="chart" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{name}">{"".join(pieces)}</svg>'


def _positive(x: Sequence[float], y: Sequence[float | None]) -> FloatArray:
    points = np.array([[a, np.nan if b is None else b] for a, b in zip(x, y, strict=True)], np.float64).reshape(-1, 2)
    return np.asarray(points[(np.isfinite(points) & (points > 0)).all(axis=1)])


def _grid(low: FloatArray, high: FloatArray) -> list[str]:
    """Lines and labels at powers of ten."""
    pieces = []
    for power in range(int(low[0]), int(high[0]) + 1):
        px, _ = _to_page(np.array([[power, low[1]]]), low, high)[0]
        pieces.append(f'<path class="grid" d="M{px:.1f},{_TOP}V{_HEIGHT - _BOTTOM}"/>')
        pieces.append(f'<text class="tick" x="{px:.1f}" y="{_HEIGHT - _BOTTOM + 16}">{_power(power)}</text>')
    for power in range(int(low[1]), int(high[1]) + 1):
        _, py = _to_page(np.array([[low[0], power]]), low, high)[0]
        pieces.append(f'<path class="grid" d="M{_LEFT},{py:.1f}H{_WIDTH - _RIGHT}"/>')
        pieces.append(f'<text class="tick end" x="{_LEFT - 6}" y="{py + 4:.1f}">{_power(power)}</text>')
    return pieces


def _power(exponent: int) -> str:
    return f"{10.0**exponent:g}"


def _to_page(logs: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    share = (logs - low) / (high - low)
    x = _LEFT + share[:, 0] * (_WIDTH - _LEFT - _RIGHT)
    y = _HEIGHT - _BOTTOM - share[:, 1] * (_HEIGHT - _TOP - _BOTTOM)
    return np.column_stack([x, y])
