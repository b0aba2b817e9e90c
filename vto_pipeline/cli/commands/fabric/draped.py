"""vto fabric --drape and --drape-photo"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vto_pipeline.cli.session import Session
from vto_pipeline.errors import ConfigError

if TYPE_CHECKING:
    from vto_pipeline.cloth.swatch.disc import DrapeTest


def measure_drape(
    session: Session,
    mass: float,
    output: Path | None,
    drapes: tuple[float, ...],
    photos: tuple[Path, ...],
    disc_photo: Path | None,
    pixel: float | None,
    specimen: float,
    disc: float,
) -> None:
    """Find the rigidity with which a fabric drapes as measured, and answer.

    Args:
        session: For answers and progress.
        mass: [g/m²].
        output: Fabric file, or none.
        drapes: Coefficients [%], one for each time that the cloth was draped anew.
        photos: Of drapes, in their place.
        disc_photo, pixel: What tells the photos' scale: the bare disc in the same view, or the length of a pixel [m].
        specimen, disc: Diameters [m].

    Raises:
        ConfigError: options that do not go together.
        InputError: a photo or a coefficient that says nothing.
    """
    from vto_pipeline.cloth.swatch.disc import DrapeTest
    from vto_pipeline.cloth.swatch.fit_drape import fit_drape
    from vto_pipeline.io.fabrics import read_fabric, write_measured
    from vto_pipeline.model.job import Job

    began = time.perf_counter()
    if not 0.0 < disc < specimen:
        raise ConfigError("the specimen must be larger than the disc that it lies on")
    test = DrapeTest(0.5 * specimen, 0.5 * disc)
    if photos and not drapes and (disc_photo is None) != (pixel is None):
        shares = _from_photos(photos, disc_photo, pixel, test)
    elif drapes and not photos and disc_photo is None and pixel is None:
        shares = [0.01 * one for one in drapes]
    else:
        raise ConfigError("expected --drape; or --drape-photo with either --disc-photo or --pixel")
    fabric = read_fabric({"name": "draped", "areal_density_gsm": mass})
    mean = sum(shares) / len(shares)
    found = fit_drape(mean, len(shares), fabric, test, Job(progress=lambda _, text: session.say(text)))
    low, high = found.interval
    data: dict[str, Any] = {
        "bending_n_m": found.rigidity,
        "bending_interval_n_m": [low, high],
        "drape_percent": 100.0 * mean,
        "drapes_percent": [100.0 * one for one in shares],
        "spread_percent": 100.0 * found.spread,
        "simulated": found.simulated,
        "direction": "both",
        "areal_density_gsm": mass,
    }
    if output is not None:
        source = (
            f"drape coefficient {100.0 * mean:.1f} %: bending {1e6 * found.rigidity:.3g} µN·m, "
            f"95 % interval {1e6 * low:.3g} to {1e6 * high:.3g}"
        )
        write_measured(output, mass, ("warp", "weft"), found.rigidity, source)
        data["file"] = str(output)
    data["seconds"] = time.perf_counter() - began
    session.answer(data, _lines(data, low, high))


def _from_photos(photos: tuple[Path, ...], disc: Path | None, pixel: float | None, test: DrapeTest) -> list[float]:
    """Return the coefficients, as shares. Areas seen askew shrink alike, so the bare disc tells the scale for them."""
    import numpy as np

    from vto_pipeline.io.fabric_formats.drape_photo import read_shadow_area

    if disc is not None:
        square = np.pi * test.support**2 / read_shadow_area(disc)
    else:
        assert pixel is not None
        square = pixel**2
    return [test.coefficient(square * read_shadow_area(photo)) for photo in photos]


def _lines(data: dict[str, Any], low: float, high: float) -> Iterator[str]:
    yield (
        f"bending {data['bending_n_m']:.3g} N·m (warp and weft alike), 95 % interval {low:.3g} to {high:.3g}; "
        f"drape coefficient {data['drape_percent']:.1f} %"
    )
    yield (
        f"  drapes of one fabric differ by {data['spread_percent']:.1f} points (standard deviation of "
        f"{data['simulated']} simulated ones): drape it anew a few times, and give each"
    )
    if "file" in data:
        yield f"  {data['file']}: the mass and this rigidity; vto drape --fabric assumes the rest and says so"
    yield f"  {data['seconds']:.1f} s"
