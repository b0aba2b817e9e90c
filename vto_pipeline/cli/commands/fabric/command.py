"""vto fabric"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vto_pipeline.cli.commands.fabric.draped import measure_drape
from vto_pipeline.cli.options import PATH, Quantity, message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.errors import ConfigError
from vto_pipeline.units import ANGLE_RAD, GRAVITY, GSM, LENGTH_M

if TYPE_CHECKING:
    from vto_pipeline.cloth.swatch.strip import Rigidity, Strip

_FACES = {":up": 1, ":down": -1}


@click.command("fabric")
@click.option("--mass", type=click.FloatRange(1, 5000), required=True, metavar="GSM", help="Mass per area, g/m².")
@click.option("--strip", "strips", multiple=True, metavar="FILE[:down]", help="Profile of a strip; may be repeated.")
@click.option("--overhang", type=Quantity(LENGTH_M), metavar="96mm", help="Length that hangs, in place of a profile.")
@click.option("--angle", type=Quantity(ANGLE_RAD), metavar="41.5deg", help="At which the tip is seen from the edge.")
@click.option("--drape", "drapes", type=click.FloatRange(0, 100), multiple=True, metavar="%", help="Drape coefficient.")
@click.option("--drape-photo", "photos", type=PATH, multiple=True, metavar="FILE", help="Of a drape test, from above.")
@click.option("--disc-photo", type=PATH, metavar="FILE", help="The same view with the bare disc: the photos' scale.")
@click.option("--pixel", type=Quantity(LENGTH_M), metavar="0.2mm", help="Length of a pixel: the photos' scale.")
@click.option("--specimen", type=Quantity(LENGTH_M), default="30cm", show_default=True, help="Across, of the cloth.")
@click.option("--disc", type=Quantity(LENGTH_M), default="18cm", show_default=True, help="Across, of what it lies on.")
@click.option(
    "--direction", type=click.Choice(["warp", "weft"]), default="warp", show_default=True, help="Along the strips."
)
@click.option("-o", "--output", type=PATH, metavar="FILE.yaml", help="Fabric file for vto drape --fabric.")
@message_options
@pass_session
def fabric_command(
    session: Session,
    mass: float,
    strips: tuple[str, ...],
    overhang: float | None,
    angle: float | None,
    direction: str,
    output: Path | None,
    **draped: Any,
) -> None:
    """Measure the bending rigidity of a fabric from strips that hang over a table's edge, or from a drape test.

    A profile is a CSV with the header x_mm,y_mm, from the table to the tip. A scan of the strip alone, as PLY with
    +Y up, serves too. Add :down where the face looks down. Repeat --drape or --drape-photo for every time the cloth
    was draped anew.

    \b
    vto fabric --mass 115 --strip up.csv --strip back.csv:down -o my_fabric.yaml
    vto fabric --mass 115 --overhang 96mm --angle 41.5deg
    vto fabric --mass 163 --drape 49.8 --drape 52.1
    vto fabric --mass 163 --drape-photo shadow.png --disc-photo disc.png
    """
    from vto_pipeline.cloth.swatch.fit import fit_strips, from_angle

    if draped["drapes"] or draped["photos"]:
        if strips or overhang is not None or angle is not None:
            raise ConfigError("expected either strips or a drape test")
        measure_drape(session, mass, output, **draped)
        return
    began = time.perf_counter()
    weight = mass * GSM * GRAVITY
    if strips and overhang is None and angle is None:
        found = fit_strips([_read(strip) for strip in strips], weight)
    elif not strips and overhang is not None and angle is not None:
        found = from_angle(overhang, angle, weight)
    else:
        raise ConfigError("expected either --strip, or both --overhang and --angle, or a drape test")
    data = {**_facts(found), "direction": direction, "areal_density_gsm": mass}
    if output is not None:
        from vto_pipeline.io.fabrics import write_measured

        write_measured(output, mass, (direction,), found.rigidity, _sentence(found))
        data["file"] = str(output)
    data["seconds"] = time.perf_counter() - began
    session.answer(data, _lines(found, data, len(strips) - sum(name.endswith(":down") for name in strips), len(strips)))


def _read(strip: str) -> Strip:
    from vto_pipeline.cloth.swatch.scanned import scanned_profile
    from vto_pipeline.cloth.swatch.strip import Strip
    from vto_pipeline.io.clouds import PARSERS, read_cloud
    from vto_pipeline.io.fabric_formats.strip_profiles import read_strip_profile

    mark = next((mark for mark in _FACES if strip.endswith(mark)), "")
    path = strip.removesuffix(mark)
    scanned = Path(path).suffix.lower() in PARSERS
    points = scanned_profile(read_cloud(Path(path)).points) if scanned else read_strip_profile(Path(path))
    return Strip(points, _FACES.get(mark, 1), path)


def _facts(found: Rigidity) -> dict[str, Any]:
    return {
        "bending_n_m": found.rigidity,
        "bending_interval_n_m": list(found.interval),
        "bending_length_mm": 1e3 * found.bending_length,
        "curl_per_m": found.curl,
        "curl_error_per_m": found.curl_error,
        "overhangs_mm": [1e3 * one for one in found.overhangs],
        "residual_mm": 1e3 * found.residual if found.curl is not None else None,
        "spread_share": found.spread,
    }


def _sentence(found: Rigidity) -> str:
    low, high = found.interval
    return (
        f"cantilever strips ({len(found.overhangs)}): bending {1e6 * found.rigidity:.3g} µN·m, "
        f"95 % interval {1e6 * low:.3g} to {1e6 * high:.3g}"
    )


def _lines(found: Rigidity, data: dict[str, Any], up: int, count: int) -> Iterator[str]:
    low, high = found.interval
    yield (
        f"bending {found.rigidity:.3g} N·m ({data['direction']}), 95 % interval {low:.3g} to {high:.3g}; "
        f"bending length {data['bending_length_mm']:.1f} mm"
    )
    if found.curl is None:
        yield "  one angle does not show curl, which is taken to be none; readings to 1 mm and 1°"
    else:
        distance = f"{data['residual_mm']:.2f} mm rms"
        yield f"  curl {found.curl:+.1f} ± {found.curl_error:.1f} 1/m; distance to the fit {distance}"
        if up in (0, count):
            yield "  one face only, so the shape alone separates curl from rigidity: add a strip with the other face up"
    if "file" in data:
        yield f"  {data['file']}: the mass and this rigidity; vto drape --fabric assumes the rest and says so"
    yield f"  {data['seconds']:.1f} s"
