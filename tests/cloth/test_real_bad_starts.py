"""The real T-shirt where no one would put it, as a user would try it: which end is right is known of each."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bad_starts import finned, shifted, sleeves_up, two, upside_down
from ipc_judge import crosses

from vto_pipeline.cloth.placement.place import PlaceConfig, find_placement
from vto_pipeline.io.meshes import read_mesh, write_ply
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data"
LONGEST = 1800  # s of wall time, compiling and whatever else the machine does included
LARGER = 1.3
STAYS = ("--set", "drape.place=as_it_stands")
STARTS = {  # name -> start from the shirt in its place, further words, exit code
    "forwards into the body": (lambda shirt: shifted(shirt, 0.0, 0.0, 0.05), STAYS, 0),
    "sideways into the body": (lambda shirt: shifted(shirt, 0.05, 0.0, 0.0), STAYS, 0),
    "down into the shoulders": (lambda shirt: shifted(shirt, 0.0, -0.05, 0.0), STAYS, 0),
    "arms through the sleeves": (sleeves_up, STAYS, 0),
    "too small": (lambda shirt: TriangleMesh(shirt.vertices / LARGER, shirt.faces), (), 0),
    "in centimetres": (lambda shirt: TriangleMesh(100.0 * shirt.vertices, shirt.faces), (), 0),
    "upside down": (upside_down, (), 0),
    "left upside down": (upside_down, STAYS, 4),
    "edges of three faces": (finned, STAYS, 0),
    "two layered": (two, STAYS, 0),
}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_data,
    pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent"),
]


def drape(garment, body, run, *words):
    """Return what `vto drape` said and its exit code."""
    command = [sys.executable, "-m", "vto_pipeline.cli.main", "drape", "--garment", str(garment), "--body", str(body)]
    paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        [*command, "--fabric", "jersey", "-o", str(run), *words],
        capture_output=True,
        text=True,
        timeout=LONGEST,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
    )


@pytest.mark.parametrize("body", ["mh_male_averageweight", "mh_female_averageweight", "mh_female_maxweight"])
@pytest.mark.parametrize("name", STARTS)
def test_a_real_shirt_badly_put(name, body, tmp_path):
    person = read_mesh(DATA / "bodies" / f"{body}.ply")
    shirt = read_mesh(DATA / "garments" / "tshirt.ply")
    worn = TriangleMesh(
        find_placement(shirt, person, PlaceConfig(), Job()).start_positions(shirt.vertices), shirt.faces
    )
    start, words, code = STARTS[name]
    garment = tmp_path / "shirt.ply"
    write_ply(garment, start(worn))
    said = drape(garment, DATA / "bodies" / f"{body}.ply", tmp_path / "run", *words)
    assert said.returncode == code, said.stderr[-2000:]
    out = tmp_path / "run" / "out" / ("partial" if code == 4 else "")
    draped = read_mesh(out / "draped.ply")
    if code == 4 and not (out / "audit.json").is_file():  # refused where it starts
        assert "cannot be put on: the" in said.stderr
        assert "arm goes through the cloth at (" in said.stderr
        return
    audit = json.loads((out / "audit.json").read_text())
    assert audit["finite"] is True
    assert np.isfinite(draped.vertices).all()
    if code == 0:
        assert audit["body_intersections"] == audit["self_intersections"] == 0
        assert audit["penetration_mm"] == 0.0
        assert not crosses(draped, person)
        assert audit["largest_strain"] < (1.5 if name == "too small" else 0.6)  # nothing is torn or blown up
    else:
        places = np.array(audit["body_intersection_places"] + audit["self_intersection_places"])
        assert len(places) > 0
        assert "still cross, near (" in said.stderr
        assert (np.linalg.norm(draped.vertices[:, None] - places[None], axis=2).min(axis=0) < 0.05).all()
    if name == "too small":
        assert audit["too_small"] is True
        assert audit["over_limit_share"] > 0.02
        assert "too small" in said.stdout + said.stderr


@pytest.mark.parametrize(
    ("name", "body"), [("blouse-short", "mh_female_maxweight"), ("dress3", "mh_male_averageweight")]
)
def test_what_has_to_be_led_or_is_far_too_small_is_put_on(name, body, tmp_path):
    """A blouse that was led into a tangle jammed; a dress that should be 44 % larger was pierced by both arms."""
    garment, person = DATA / "garments" / "berkeley" / name / f"{name}-iso.obj", DATA / "bodies" / f"{body}.ply"
    said = drape(garment, person, tmp_path / "run", "--set", "simulation_mesh.edge_mm=20")
    assert said.returncode == 0, said.stderr[-2000:]
    draped, wearer = read_mesh(tmp_path / "run" / "out" / "draped.ply"), read_mesh(person)
    assert not crosses(draped, wearer)
    nape = (draped.vertices[:, 1].max() - wearer.vertices[:, 1].min()) / np.ptp(wearer.vertices[:, 1])
    assert nape == pytest.approx(0.865, abs=0.07)  # ANSUR II
