"""The tape over a whole population: sizes and random people, each body measured by an independent slicer."""

import csv
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from body_judges import crossing, slice_body
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.population import complete_measurements, population
from vto_pipeline.avatar.measuring.tape import DENSITY_KG_M3
from vto_pipeline.avatar.template.template import beyond_armscye, template
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job

HEIGHTS = ("stature", "back_neck_height", "chest_height", "waist_height", "hip_height", "inside_leg", "knee_height")
GIRTHS = ("head", "neck", "chest", "waist", "hip", "upper_arm", "wrist", "thigh", "knee", "calf", "ankle")
ASKED = (*HEIGHTS, "outer_arm_length", "back_shoulder_width", *(f"{name}_girth" for name in GIRTHS))
# middles of EN 13402-3, cm: women's bust, men's chest
LETTERS = ("XS", "S", "M", "L", "XL", "XXL", "3XL", "4XL")
SIZES = {
    "female": dict(zip(LETTERS, (78, 86, 94, 102.5, 113, 125, 137, 149), strict=True)),
    "male": dict(zip(LETTERS, (82, 90, 98, 106, 114, 123.5, 135, 147.5), strict=True)),
}


def of_size(sex: str, letter: str) -> dict[str, float]:
    stature = {"female": 1.66, "male": 1.78}[sex]
    given = {"stature": stature, "chest_girth": SIZES[sex][letter] / 100}
    return dict(complete_measurements(Measurements(given, sex=sex)).values)


def people(count: int, seed: int) -> list[tuple[str, dict[str, float]]]:
    """Draw from ANSUR II, women and men in turn."""
    rng, out = np.random.default_rng(seed), []
    while len(out) < count:
        sex = ("female", "male")[len(out) % 2]
        prior = population(sex)
        drawn = dict(zip(prior.names, rng.multivariate_normal(prior.mean, prior.covariance).tolist(), strict=True))
        if 1.45 <= drawn["stature"] <= 2.05 and 40 <= drawn["mass"] <= 160:
            out.append((sex, drawn))
    return out


def all_shapes(count: int, seed: int) -> list[tuple[str, dict[str, float]]]:
    """Spread evenly over stature and mass, of which ANSUR II's thin tails hold few; the rest as it goes with these."""
    rng, out = np.random.default_rng(seed), []
    while len(out) < count:
        sex = ("female", "male")[len(out) % 2]
        stature, mass = rng.uniform(1.45, 2.05), rng.uniform(40, 160)
        if not 17 <= mass / stature**2 <= 45:
            continue
        prior = population(sex)
        drawn = rng.multivariate_normal(prior.mean, prior.covariance)
        known = [prior.names.index("stature"), prior.names.index("mass")]
        pull = np.linalg.solve(prior.covariance[np.ix_(known, known)], np.array([stature, mass]) - drawn[known])
        drawn = drawn + prior.covariance[:, known] @ pull  # a draw moved onto what is known has the conditional law
        out.append((sex, dict(zip(prior.names, drawn.tolist(), strict=True))))
    return out


def misses(sex: str, tape: dict[str, float]) -> dict[str, float]:
    """What is wrong with the body of twenty measurements [mm, share of the volume, s]; empty when nothing is."""
    begun = time.process_time()
    body = fit_measurements(Measurements({name: tape[name] for name in ASKED}, sex=sex))
    seconds = time.process_time() - begun
    got = slice_body(body)
    wrong = {name: 1e3 * (got[name] - tape[name]) for name in ASKED}
    # 2 mm a girth, 3 mm a length
    out = {name: round(w, 1) for name, w in wrong.items() if not abs(w) <= (2 if name.endswith("girth") else 3)}
    volume = got["volume"] * DENSITY_KG_M3 / tape["mass"] - 1
    if not abs(volume) <= 0.08:
        out["volume"] = round(volume, 3)
    if seconds > 2:
        out["seconds"] = round(seconds, 2)
    if crossing(body.vertices, body.faces):
        out["crossing"] = 1.0
    return out


# mean breadth, depth and girth [mm] in the 1988 survey of the U.S. Army, Gordon et al. 1989, NATICK/TR-89/044
SURVEY_OF_1988 = {
    ("female", "hip"): (342.7, 227.1, 966.9),
    ("female", "navel"): (289.7, 203.9, 791.9),
    ("male", "hip"): (341.8, 248.6, 983.7),
    ("male", "navel"): (309.3, 226.2, 862.4),
}


def ellipse(breadth: float, depth: float) -> float:
    """Perimeter of an ellipse, by brute force."""
    t = np.linspace(0.0, 2 * np.pi, 2000)
    return float(np.hypot(np.diff(breadth / 2 * np.cos(t)), np.diff(depth / 2 * np.sin(t))).sum())


@pytest.mark.parametrize(("sex", "row"), list(SURVEY_OF_1988))
def test_sections_are_as_round_as_people_are(sex: str, row: str) -> None:
    """Girth over an ellipse's of the same extents: of the template and of an average body, by trimesh.

    By another survey than the one that bodies are made by, whose calipers pressed less: 1.07, 1.01, 1.05, 1.02. By
    ANSUR II's own extents it would be 1.10, 1.06, 1.09, 1.05, and the tape's own spread is 0.016.
    """
    breadth, depth, girth = SURVEY_OF_1988[sex, row]
    mean = population(sex)
    tape = {name: float(mean.mean[mean.names.index(name)]) for name in ("stature", "mass")}
    for body in (template(0.0 if sex == "female" else 1.0), fit_measurements(Measurements(tape, sex=sex))):
        v = body.bind_vertices
        trunk = trimesh.Trimesh(v, body.faces[~beyond_armscye()[body.faces].any(axis=1)], process=False)
        at = trunk.section([0, 1, 0], [0, v[body.loops[row], 1].mean(), 0]).vertices[:, [0, 2]]
        ours = ConvexHull(at).area / ellipse(*np.ptp(at, axis=0))
        assert_allclose(ours, girth / ellipse(breadth, depth), rtol=0, atol=0.015)


@pytest.mark.parametrize(("sex", "letter"), [("female", "XS"), ("female", "4XL"), ("male", "M"), ("male", "4XL")])
def test_sizes_fast(sex: str, letter: str) -> None:
    assert not misses(sex, of_size(sex, letter))


def test_people_fast() -> None:
    assert not {k: m for k, (sex, tape) in enumerate(people(6, seed=5)) if (m := misses(sex, tape))}


@pytest.mark.parametrize(("sex", "letter"), [("female", "XS"), ("female", "XL"), ("male", "S"), ("male", "XL")])
def test_rows_lie_where_the_body_shows_them(sex: str, letter: str) -> None:
    """By trimesh alone: the seat is rearmost at the hip's row, the trunk narrowest near the waist's.

    ANSUR II says how high both lie; a body whose seat or waist is elsewhere has the asked girths in the wrong place.
    """
    tape = of_size(sex, letter)
    body = fit_measurements(Measurements({name: tape[name] for name in ("stature", "chest_girth")}, sex=sex))
    v, tall = body.bind_vertices, tape["stature"]
    trunk = trimesh.Trimesh(v, body.faces[~beyond_armscye()[body.faces].any(axis=1)], process=False)
    low = v[(v[:, 1] > 0.46 * tall) & (v[:, 1] < 0.58 * tall)]
    assert_allclose(v[body.loops["hip"], 1].mean(), low[np.argmin(low[:, 2]), 1], rtol=0, atol=0.015)
    heights = np.arange(0.59, 0.69, 0.003) * tall
    girths = [ConvexHull(trunk.section([0, 1, 0], [0, y, 0]).vertices[:, [0, 2]]).area for y in heights]
    assert_allclose(v[body.loops["waist"], 1].mean(), heights[np.argmin(girths)], rtol=0, atol=0.025)


@pytest.mark.slow
@pytest.mark.parametrize("letter", LETTERS)
@pytest.mark.parametrize("sex", ["female", "male"])
def test_sizes(sex: str, letter: str) -> None:
    assert not misses(sex, of_size(sex, letter))


def all_misses(drawn: list[list[tuple[str, dict[str, float]]]]) -> dict[tuple[int, int], dict[str, float]]:
    """What is wrong with whom, by seed and number."""
    found = {(seed, k): misses(*one) for seed, group in enumerate(drawn) for k, one in enumerate(group)}
    return {who: wrong for who, wrong in found.items() if wrong}


@pytest.mark.slow
def test_people() -> None:
    """Of 400 drawn at most 1 % miss, and these only their volume: girths and lengths are given, the volume follows.

    A small woman of 43 kg is 9.2 % too large: her tape says more of her size than of how bony she is.
    """
    found = all_misses([people(50, seed) for seed in range(8)])
    assert len(found) <= 4, found
    assert all(set(wrong) == {"volume"} and abs(wrong["volume"]) < 0.10 for wrong in found.values()), found


@pytest.mark.slow
def test_all_shapes() -> None:
    """Of 200 spread evenly over stature and mass at most 2 % miss, and nobody by much.

    The causes are two: a volume that follows from the tape up to 9 % off, and thighs of more than 150 kg that are one
    at the thigh's row, where a tape goes round both.
    """
    found = all_misses([all_shapes(50, seed) for seed in range(4)])
    assert len(found) <= 4, found
    drawn = {(seed, k): tape for seed in range(4) for k, (_, tape) in enumerate(all_shapes(50, seed))}
    for who, wrong in found.items():
        if set(wrong) == {"volume"}:
            assert abs(wrong["volume"]) < 0.10, (who, wrong)
        else:
            assert drawn[who]["mass"] > 150.0, (who, wrong)
            assert "thigh_girth" in wrong, (who, wrong)


# ANSUR II's name for measurements that are defined alike here
SAME = {
    "chestcircumference": "chest_girth",
    "waistcircumference": "navel_girth",
    "buttockcircumference": "hip_girth",
    "neckcircumference": "neck_girth",
    "calfcircumference": "calf_girth",
    "wristcircumference": "wrist_girth",
    "crotchheight": "inside_leg",
    "cervicaleheight": "back_neck_height",
    "chestheight": "chest_height",
    "sleeveoutseam": "outer_arm_length",
    "shoulderlength": "shoulder_length",
    "biacromialbreadth": "back_shoulder_width",
    "hipbreadth": "hip_breadth",
    "waistdepth": "waist_depth",
    "headcircumference": "head_girth",
    "anklecircumference": "ankle_girth",
    "waistheightomphalion": "navel_height",
}
# a section of the body over what a caliper reads that presses (see avatar.population): women, men
PRESSED = {"hip_breadth": (1.03, 1.04), "waist_depth": (1.04, 1.035)}
REGRESSIONS = Path(__file__).parents[3] / "shared" / "reference" / "data" / "ansur2_regressions.csv"
PREDICTORS = {
    "stature_weight": ("stature", "mass"),
    "stature_chest_waist_hip": ("stature", "chest_girth", "navel_girth", "hip_girth"),
}


@pytest.mark.slow
@pytest.mark.skipif(not REGRESSIONS.exists(), reason="the reference table is not here")
@pytest.mark.parametrize("known", PREDICTORS)
@pytest.mark.parametrize("sex", ["female", "male"])
def test_what_is_not_measured_is_no_worse_than_a_regression(sex: str, known: str) -> None:
    """The body itself, not only its expectation: measured and held against people drawn from ANSUR II."""
    with REGRESSIONS.open(newline="") as file:
        rows = {r["variable"]: r for r in csv.DictReader(file) if (r["sex"], r["predictors"]) == (sex, known)}
    drawn = [tape for other, tape in people(80, seed=21) if other == sex]
    ours, theirs = {}, {}
    for tape in drawn:
        given = {name: tape[name] for name in PREDICTORS[known]}
        got = measure(fit_measurements(Measurements(given, sex=sex))).values
        known_mm = [value if name == "mass" else 1e3 * value for name, value in given.items()]
        for variable, name in SAME.items():
            if variable in rows:
                slopes = [float(rows[variable][f"b{k + 1}"]) for k in range(len(known_mm))]
                expected = float(rows[variable]["b0"]) + np.dot(slopes, known_mm)
                expected *= PRESSED.get(name, (1.0, 1.0))[sex == "male"]
                ours.setdefault(name, []).append(abs(got[name] - tape[name]) * 1e3)
                theirs.setdefault(name, []).append(abs(expected - tape[name] * 1e3))
    assert len(ours) >= 10
    # both see the same 40 people: 5 % of an error of 10 to 30 mm, and the half millimetre the fit itself may leave
    worse = {
        k: (np.mean(ours[k]), np.mean(theirs[k])) for k in ours if np.mean(ours[k]) > 1.05 * np.mean(theirs[k]) + 0.5
    }
    assert not worse


@pytest.mark.parametrize(
    ("sex", "tape"),
    [
        ("neutral", {"stature": 1.20, "mass": 25.0}),
        ("male", {"stature": 2.10, "mass": 100.0}),
        ("male", {"stature": 1.80, "mass": 200.0}),
        ("female", {"stature": 1.55, "mass": 35.0}),
        ("female", {"stature": 1.70, "hip_girth": 1.60, "chest_girth": 0.95}),
        ("male", {"stature": 1.70, "inside_leg": 1.20}),
    ],
)
def test_extremes_are_answered_and_told(sex: str, tape: dict[str, float]) -> None:
    job = Job()
    body = fit_measurements(Measurements(tape, sex=sex), None, job)
    got = measure(body)
    for name, value in tape.items():
        assert_allclose(got.values[name], value, rtol=0, atol=0.2 if name == "mass" else 2e-3)
    usual = measure(fit_measurements(Measurements({"stature": 1.75, "mass": 75.0}, sex=sex)))
    assert all(sigma > 0 for sigma in got.sigmas.values())
    assert job.warnings or got.sigmas["neck_girth"] > usual.sigmas["neck_girth"], "far from the survey, and silent"
    if crossing(body.vertices, body.faces):
        assert job.warnings


def test_misses_are_told_with_what_was_reached() -> None:
    job = Job()
    # the hips' own breadth, twice: no body has both
    tape = {"stature": 1.70, "hip_girth": 0.80, "hip_breadth": 0.50, "hip_depth": 0.40}
    fit_measurements(Measurements(tape, sex="female"), None, job)
    assert any("hip_breadth: asked for 50.0 cm, reached" in warning for warning in job.warnings)


def test_uncertainty_of_what_was_measured_and_of_what_was_not() -> None:
    known = measure(fit_measurements(Measurements({"stature": 1.70, "chest_girth": 0.98, "mass": 70.0}, sex="female")))
    assert set(known.sigmas) == set(known.values)
    assert known.sigmas["stature"] <= 0.006
    assert 0.0004 < known.sigmas["chest_girth"] < 0.015  # its slope along the body over 5 mm
    # the conditional spread of ANSUR II given stature and mass is 22 mm (hip) for women, less with the chest known
    assert 0.010 < known.sigmas["hip_girth"] < 0.030
