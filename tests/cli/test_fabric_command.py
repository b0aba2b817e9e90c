"""vto fabric."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.bench.physics.swatch.strips import Cloth, hung
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.units import GRAVITY

CLOTH = Cloth(0.115 * GRAVITY, 0.115 * GRAVITY * 0.02**3, 3.0)


@pytest.fixture
def profiles(vto):
    """up.csv in millimetres, down.csv in centimetres, as spreadsheets of other countries write it."""
    rng = np.random.default_rng(1)
    up, down = hung(CLOTH, rng, 1, 0.0).points, hung(CLOTH, rng, -1, 0.0).points
    Path("up.csv").write_text("x_mm,y_mm\n" + "".join(f"{1e3 * x:.3f},{1e3 * y:.3f}\n" for x, y in up))
    rows = "".join(f"{1e2 * x:.4f};{1e2 * y:.4f}\n".replace(".", ",") for x, y in down)
    Path("down.csv").write_text("\ufeffx [cm]; y [cm]\n" + rows)
    return vto


def test_strips_to_a_fabric_that_the_drape_reads(profiles):
    asked = ("fabric", "--mass", 115, "--strip", "up.csv", "--strip", "down.csv:down", "--direction", "weft")
    said = profiles(*asked, "-o", "mine.yaml", "--json")
    assert said.code == 0, said.err
    low, high = said.data["bending_interval_n_m"]
    assert low < CLOTH.rigidity < high
    assert said.data["bending_n_m"] == pytest.approx(CLOTH.rigidity, rel=0.1)
    assert said.data["bending_length_mm"] == pytest.approx(20.0, rel=0.03)
    fabric = read_fabric("mine.yaml")
    assert fabric.areal_density == pytest.approx(0.115)
    assert fabric.bending_weft == pytest.approx(said.data["bending_n_m"], rel=1e-3)
    assert "bending_weft" not in fabric.assumed
    assert {"bending_warp", "stretch_warp", "friction"} <= set(fabric.assumed)


def test_in_words(profiles):
    both = profiles("fabric", "--mass", 115, "--strip", "up.csv", "--strip", "down.csv:down").out
    assert "95 % interval" in both
    assert "one face only" not in both
    assert "one face only" in profiles("fabric", "--mass", 115, "--strip", "up.csv").out


def test_one_angle(vto):
    said = vto("fabric", "--mass", 115, "--overhang", "96mm", "--angle", "41.5deg", "--json")
    assert said.code == 0, said.err
    assert said.data["bending_length_mm"] == pytest.approx(48.0, rel=3e-4)  # the rule of ISO 9073-7
    assert said.data["curl_per_m"] is None


@pytest.mark.parametrize(
    ("arguments", "code", "problem"),
    [
        (["--strip", "up.csv"], 2, "--mass"),
        (["--mass", 115], 2, "either --strip, or both"),
        (["--mass", 115, "--overhang", "96mm"], 2, "either --strip, or both"),
        (["--mass", 115, "--overhang", "96", "--angle", "41.5deg"], 2, "one of the units"),
        (["--mass", 115, "--overhang", "96mm", "--angle", "1deg"], 3, "cannot be resolved"),
        (["--mass", 115, "--strip", "none.csv"], 3, "no such file"),
        (["--mass", 115, "--strip", "bare.csv"], 3, "expected a header with units"),
        (["--mass", 115, "--strip", "words.csv"], 3, "'wide' is not a number"),
        (["--mass", 115, "--strip", "nan.csv"], 3, "two finite numbers"),
        (["--mass", 115, "--strip", "few.csv"], 3, "2 points"),
        (["--mass", 115, "--strip", "up.csv", "-o", "up.csv"], 2, "cannot hold a fabric"),
    ],
)
def test_what_is_refused(arguments, code, problem, profiles):
    Path("bare.csv").write_text("x,y\n1,2\n")
    Path("words.csv").write_text("x_mm,y_mm\n1,wide\n")
    Path("nan.csv").write_text("x_mm,y_mm\n1,nan\n")
    Path("few.csv").write_text("x_mm,y_mm\n1,2\n100,3\n")
    said = profiles("fabric", *arguments)
    assert said.code == code
    assert problem in said.err
    assert Path("up.csv").read_text().startswith("x_mm")
