"""A line chart as SVG inside the page, in the page's colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.model.arrays import FloatArray

_WIDTH, _HEIGHT = 640, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 14, 14, 44


def log_chart(x: Sequence[float], y: Sequence[float], x_label: str, y_label: str) -> str:
    """Draw y over x with both axes logarithmic, as an <svg> element.

    Args:
        x, y: What to draw; points that are not positive and finite are left out.
        x_label, y_label: Axis titles, plain text of this package, unit included.

    Returns:
        The element, or an empty string when fewer than two points are left.
    """
    points = np.column_stack([np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)])
    points = points[(np.isfinite(points) & (points > 0)).all(axis=1)]
    if len(points) < 2:
        return ""
    low, high = np.floor(np.log10(points.min(axis=0))), np.ceil(np.log10(points.max(axis=0)))
    high = np.maximum(high, low + 1)
    place = _to_page(np.log10(points), low, high)
    path = "M" + "L".join(f"{px:.1f},{py:.1f}" for px, py in place)
    pieces = [*_grid(low, high), f'<path class="line" d="{path}"/>']
    pieces += [
        f'<circle class="dot" cx="{px:.1f}" cy="{py:.1f}" r="2.5"/>' for px, py in place[:: max(1, len(place) // 40)]
    ]
    middle_x, middle_y = 0.5 * (_LEFT + _WIDTH - _RIGHT), 0.5 * (_TOP + _HEIGHT - _BOTTOM)
    pieces.append(f'<text class="title" x="{middle_x:.0f}" y="{_HEIGHT - 6}">{x_label}</text>')
    pieces.append(f'<text class="title" transform="translate(14 {middle_y:.0f}) rotate(-90)">{y_label}</text>')
    name = f"{y_label} over {x_label}"
    return f'<svg class="chart" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{name}">{"".join(pieces)}</svg>'


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
