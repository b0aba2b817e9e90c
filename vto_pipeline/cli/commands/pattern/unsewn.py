"""A garment in space taken apart: its pattern, and how well it went flat."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vto_pipeline.cli.tables import table_lines
from vto_pipeline.errors import ConfigError
from vto_pipeline.garment.unsewn.recover import Seams, recover
from vto_pipeline.garment.unsewn.unsew import Unsewn
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.patterns.seam_lines import read_seam_lines
from vto_pipeline.model.job import Job


def take_apart(path: Path, seams: str, fabric: str, unit: str | None, job: Job) -> Unsewn:
    """Return the pattern of a garment in a mesh file.

    Args:
        path: The mesh.
        seams: "auto", "charts", or a file of lines.
        fabric: Name or file.
        unit: Of length, in place of the file's or the guessed one.
        job: Receives what was found.

    Raises:
        VtoError: the garment or its seams cannot be read, or it does not come apart along them.
    """
    chosen: Seams
    if seams == "auto":
        chosen = "auto"
    elif seams == "charts":
        chosen = "charts"
    elif Path(seams).suffix.lower() in (".yaml", ".yml", ".json"):
        chosen = read_seam_lines(Path(seams))
    else:
        raise ConfigError(f"--seams {seams}: expected auto, charts, or a YAML or JSON file of lines")
    return recover(read_mesh(path, unit=unit, job=job), chosen, read_fabric(fabric), path.stem, job)


def unsewn_facts(found: Unsewn) -> list[dict[str, Any]]:
    """Return how each panel went flat, as JSON values."""
    return [
        {
            "panel": one.name,
            "area_cm2": 1e4 * one.area,
            "area_in_space_cm2": 1e4 * one.area_in_space,
            "stretch_median_share": one.stretch[0],
            "stretch_p95_share": one.stretch[1],
            "length_error_p95_mm": 1e3 * one.length_error,
        }
        for one in found.pieces
    ]


def unsewn_lines(facts: list[dict[str, Any]]) -> list[str]:
    """Return the table of them."""
    heads = ("laid flat", "cm²", "in space cm²", "stretch left, median", "p95", "edges off by, p95")
    rows = [
        (
            one["panel"],
            f"{one['area_cm2']:.1f}",
            f"{one['area_in_space_cm2']:.1f}",
            f"{one['stretch_median_share']:.2%}",
            f"{one['stretch_p95_share']:.2%}",
            f"{one['length_error_p95_mm']:.2f} mm",
        )
        for one in facts
    ]
    return table_lines(heads, rows)
