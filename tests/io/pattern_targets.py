"""Sound patterns for the fuzzer, and their readers without the sandbox."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pattern_shapes import rich_pattern
from test_pattern_dxf import gerber, polyline
from test_pattern_json import garment_code

from vto_pipeline.io.patterns.dxf.read import parse_dxf
from vto_pipeline.io.patterns.read import parse_json
from vto_pipeline.io.patterns.record import pattern_of
from vto_pipeline.io.patterns.svg.read import parse_svg
from vto_pipeline.io.patterns.write import write_pattern

DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" width="500mm" height="500mm" viewBox="0 0 500 500">
<g transform="rotate(10) scale(1.5)"><path id="p"
d="M10,10 h200 v100 q-9,9 -50,50 c1,2 3,4 -50,9 a20,30 5 0 1 -99,-9 z"/>
<circle cx="50" cy="50" r="9"/></g><text x="3" y="4">words</text></svg>"""


def _written(suffix: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        write_pattern(path, rich_pattern())
        return path.read_text(encoding="utf-8")


def _read(parse: Callable[[str, str], Any]) -> Callable[[Path], Any]:
    def read(path: Path) -> Any:
        return pattern_of(json.loads(str(parse(str(path), "")["pattern"])), "x")

    return read


def _garment_code() -> str:
    data = garment_code(label="x")
    edges = data["pattern"]["panels"]["front"]["edges"]
    edges[0]["curvature"] = {"type": "circle", "params": [25, 0, 1]}
    edges[1]["curvature"] = {"type": "cubic", "params": [[0.2, 0.1], [0.8, -0.1]]}
    edges[2]["curvature"] = [0.5, -0.1]
    data["pattern"]["stitches"] = [[{"panel": "front", "edge": 1}, {"panel": "front", "edge": 3}, "right_wrong"]]
    return json.dumps(data)


PIECE = gerber(
    polyline(1, (0.0, 0.0), (400.0, 0.0), (400.0, 300.0)),
    polyline(1, (0.0, 300.0), (400.0, 300.0)),
    polyline(1, (0.0, 300.0), (0.0, 0.0)),
    [(0, "LINE"), (8, 6), (10, 0.0), (20, 0.0), (11, 0.0), (21, 300.0)],
    [(0, "POINT"), (8, 4), (10, 400.0), (20, 100.0), (50, 180.0), (39, 4.0)],
    [(0, "ARC"), (8, 8), (10, 90.0), (20, 90.0), (40, 20.0), (50, 0.0), (51, 90.0)],
)

PATTERNS: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "pattern_ours": ("a.json", _written(".json"), _read(parse_json)),
    "pattern_garment_code": ("a.json", _garment_code(), _read(parse_json)),
    "pattern_svg_ours": ("a.svg", _written(".svg"), _read(parse_svg)),
    "pattern_svg": ("a.svg", DRAWING, _read(parse_svg)),
    "pattern_dxf": ("a.dxf", PIECE, _read(parse_dxf)),
    "pattern_dxf_ours": ("a.dxf", _written(".dxf"), _read(parse_dxf)),
}
