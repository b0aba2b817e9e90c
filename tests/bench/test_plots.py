"""Plots: readable size, same bytes for same rows, honest refusal."""

from __future__ import annotations

from io import BytesIO

import pytest
from PIL import Image

from vto_pipeline.bench.plots.figure import axis_title, look_of
from vto_pipeline.bench.plots.lines import Curves, _best, draw_curves
from vto_pipeline.bench.plots.scaling_plot import draw_scaling
from vto_pipeline.bench.plots.verdict_table import _signs, draw_verdicts
from vto_pipeline.errors import InputError


def bench(error: float = 1.0) -> dict:
    rows = [
        {"scene": scene, "method": method, "seconds": 10.0**k, "errors": {"rms_mm": error / 10.0**k}}
        for scene in ("hang", "shirt")
        for method in ("xpbd", "newton")
        for k in range(3)
    ]
    return {"bench": "solvers", "rows": rows}


def test_same_rows_same_bytes() -> None:
    assert draw_curves(bench(), Curves()) == draw_curves(bench(), Curves())
    assert draw_curves(bench(), Curves()) != draw_curves(bench(error=7.0), Curves())


def test_one_panel_per_scene() -> None:
    two = Image.open(BytesIO(draw_curves(bench(), Curves())))
    one = bench()
    one["rows"] = one["rows"][:6]
    assert two.width > 1.5 * Image.open(BytesIO(draw_curves(one, Curves()))).width


def test_nothing_to_plot_is_an_error() -> None:
    with pytest.raises(InputError, match="none with an error"):
        draw_curves({"bench": "solvers", "rows": []}, Curves())
    with pytest.raises(InputError, match="none with an error"):
        draw_curves(bench(), Curves(figures=("penetration_mm",)))


def many(count: int) -> dict:
    rows = [
        {
            "scene": "hang",
            "method": f"method {m}",
            "settings": {"h": 0.1 / 2**k},
            "vertices": 10 * 4**k,
            "seconds": (m + 1) * 2.0**k,
            "errors": {"energy_j": (m + 1) * 4.0**-k, "status": "reached"},
        }
        for m in range(count)
        for k in range(4)
    ]
    return {"bench": "integrators", "rows": rows}


def test_every_method_of_many_looks_different() -> None:
    looks = {look_of(place) for place in range(56)}
    assert len(looks) == 56
    assert look_of(0, elsewhere=True).color not in {look.color for look in looks}


def test_methods_are_named_beside_the_panels() -> None:
    few, more = (Image.open(BytesIO(draw_curves(many(count), Curves("h", "step [s]")))) for count in (1, 25))
    assert few.size == more.size  # the legend has its own room, and needs no second picture


@pytest.mark.parametrize(("x", "ends_at"), [("h", 0), ("vertices", -1)])
def test_slopes_are_fitted_at_the_finest_end(x: str, ends_at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.axes import Axes

    told: list[tuple[str, tuple[float, float]]] = []
    monkeypatch.setattr(Axes, "annotate", lambda self, text, place, *rest, **more: told.append((text, place)))
    draw_curves(many(1), Curves(x, "x", slopes=True, finer_right=ends_at == -1))
    ((text, place),) = told
    step = sorted(row["settings"]["h"] if x == "h" else row["vertices"] for row in many(1)["rows"])
    assert place[0] == step[ends_at]
    assert text == {"h": "2.0", "vertices": "-1.0"}[x]  # error 4⁻ᵏ over steps 2⁻ᵏ and sizes 4ᵏ


def test_the_line_leaves_out_what_is_slower_and_worse() -> None:
    points = [(1.0, 5.0), (2.0, 7.0), (3.0, 1.0), (4.0, 1.0), (5.0, 0.5)]
    assert _best(points) == [(1.0, 5.0), (3.0, 1.0), (5.0, 0.5)]


def test_words_and_what_has_no_logarithm_are_left_out() -> None:
    drawn = many(2)
    with_words = many(2)
    with_words["rows"] += [
        {**with_words["rows"][0], "errors": {"energy_j": value}} for value in ("inf", None, 0.0, -1.0, float("nan"))
    ]
    assert draw_curves(drawn, Curves("h", "step [s]")) == draw_curves(with_words, Curves("h", "step [s]"))


def test_rows_of_other_programs_appear() -> None:
    peers = [{**row, "method": "other", "seconds": 3.0} for row in bench()["rows"][:1]]
    assert draw_curves({**bench(), "peers": peers}, Curves()) != draw_curves(bench(), Curves())


def test_units_stand_in_brackets() -> None:
    assert axis_title("rms_error_mm") == "rms error [mm]"
    assert axis_title("rms_stretch") == "rms stretch"
    assert axis_title("s") == "s"


def verdicts(*words: str) -> dict:
    rows = [{"scene": f"case {k}", "method": "newton", "errors": {"verdict": word}} for k, word in enumerate(words)]
    return {"bench": "stability", "rows": rows}


def test_each_verdict_has_its_own_sign() -> None:
    signs = _signs(["diverges", "does not recover", "passes", "gains energy", "stretches", "does not apply"])
    assert signs["passes"][0] == "✓"
    assert signs["does not apply"][0] == ""
    letters = [sign for sign, _ in signs.values()]
    assert len(set(letters)) == len(letters)
    assert signs["diverges"][0] == "D"


def test_a_verdict_changes_the_table() -> None:
    good, bad = draw_verdicts(verdicts("passes", "passes")), draw_verdicts(verdicts("passes", "diverges"))
    assert good != bad
    assert good == draw_verdicts(verdicts("passes", "passes"))
    with pytest.raises(InputError, match="none with a verdict"):
        draw_verdicts(bench())


def test_scaling_shows_what_there_is() -> None:
    size = [{"scene": "hang", "vertices": 4**k, "seconds": 4.0**k, "errors": {"status": "reached"}} for k in (5, 6)]
    fit = {"scene": "hang", "vertices": 1, "seconds": 0.0, "errors": {"exponent": 1.0, "exponent_uncertainty": "nan"}}
    kernel = {
        "scene": "kernels 64",
        "method": "forces",
        "settings": {"use_threads": 1},
        "errors": {"roofline_share": 0.4},
    }
    whole = draw_scaling({"bench": "scaling", "rows": [*size, fit, kernel]})
    assert whole != draw_scaling({"bench": "scaling", "rows": [*size, kernel]})
    assert whole != draw_scaling({"bench": "scaling", "rows": [*size, fit]})
    with pytest.raises(InputError, match="none of a size"):
        draw_scaling(bench())


def test_a_setting_can_split_a_method_into_lines() -> None:
    whole = many(1)
    for k, row in enumerate(whole["rows"]):
        row["settings"]["mesh"] = ("regular", "irregular")[k % 2]
    labels = {Curves(split="mesh").label(row) for row in whole["rows"]}
    assert labels == {"method 0, regular", "method 0, irregular"}
    assert draw_curves(whole, Curves("h", "step [s]", split="mesh")) != draw_curves(whole, Curves("h", "step [s]"))
