"""Size advice: customers who are built around a size get that size; ties, tight zones and bodies beyond the run."""

from __future__ import annotations

import numpy as np
import pytest

from vto_pipeline.assess.allowance import Allowance, read_allowances
from vto_pipeline.assess.size_advice import rank_sizes
from vto_pipeline.errors import InputError

BUST = {"S": 0.86, "M": 0.94, "L": 1.025, "XL": 1.13, "XXL": 1.25}
"""Middles of EN 13402-3 for women [m]."""
SHIRTS = {size: {"chest": bust + 0.057} for size, bust in BUST.items()}
TROUSERS = {size: {"waist": bust - 0.18 + 0.022, "hip": bust + 0.06 + 0.045} for size, bust in BUST.items()}
SMALLER = dict(zip(list(BUST)[1:], list(BUST), strict=False))


def inside(rng, allowance, high):
    return rng.uniform(allowance.low + 1e-6, (high if allowance.high is None else allowance.high) - 1e-6)


@pytest.mark.parametrize(("kind", "run"), [("shirt", SHIRTS), ("trousers", TROUSERS)])
def test_fifty_customers_get_the_size_they_were_built_around(kind, run):
    """Each has, in every zone, the wanted ease in one size; the next ones are 8 cm and more away."""
    rng = np.random.default_rng(7)
    allowances = read_allowances(kind)
    right = 0
    for _ in range(50):
        true = str(rng.choice(list(run)))
        body = {zone: girth - inside(rng, allowances[zone], 0.05) for zone, girth in run[true].items()}
        ranked = rank_sizes(run, body, allowances)
        right += ranked[0].size == true
        assert ranked[0].fits
        assert not any(one.fits for one in ranked[1:])
    assert right == 50


def test_fifty_customers_between_two_sizes_get_the_larger_one():
    """The waist is one for the smaller size, the hip for the larger: the smaller one does not go round the hip."""
    rng = np.random.default_rng(8)
    allowances = read_allowances("trousers")
    for _ in range(50):
        true = str(rng.choice(list(SMALLER)))
        body = {
            "waist": TROUSERS[SMALLER[true]]["waist"] - inside(rng, allowances["waist"], 0.05),
            "hip": TROUSERS[true]["hip"] - inside(rng, allowances["hip"], 0.05),
        }
        ranked = rank_sizes(TROUSERS, body, allowances)
        assert (ranked[0].size, ranked[0].wearable, ranked[0].fits) == (true, True, False)
        small = next(one for one in ranked if one.size == SMALLER[true])
        assert not small.wearable


def test_tight_counts_twice_as_much_as_loose_and_the_middle_decides_a_tie():
    wanted = {"chest": Allowance(0.04, 0.08, "")}
    run = {"S": {"chest": 1.0}, "M": {"chest": 1.06}}

    def ranked(chest):
        return [one.size for one in rank_sizes(run, {"chest": chest}, wanted)]

    assert ranked(0.97) == ["M", "S"]  # tight by 1, twice that is 2; loose by 1
    assert ranked(0.964) == ["S", "M"]  # tight by 0.4, twice that is 0.8; loose by 1.6
    run = {"S": {"chest": 1.0}, "M": {"chest": 1.01}}
    assert ranked(0.946) == ["M", "S"]  # both fit, with 5.4 and 6.4 cm of the 4 to 8
    assert ranked(0.944) == ["S", "M"]


def test_a_size_that_does_not_go_round_the_body_comes_last():
    """By its misfit alone, 1.5 cm counted twice, it would be before one that is loose by 5.5 cm."""
    run = {"S": {"waist": 0.795}, "M": {"waist": 0.87}}
    ranked = rank_sizes(run, {"waist": 0.80}, {"waist": Allowance(0.01, 0.015, "")})
    assert [(one.size, one.wearable) for one in ranked] == [("M", True), ("S", False)]
    assert ranked[1].misfit < ranked[0].misfit


def test_the_reason_is_in_words_and_zones_without_a_bound_only_need_room():
    wanted = {"waist": Allowance(0.02, 0.025, ""), "thigh": Allowance(0.025, None, "")}
    (one,) = rank_sizes(
        {"40": {"waist": 0.80, "thigh": 0.70, "hip": 1.2}}, {"waist": 0.77, "thigh": 0.6, "hip": 1.0}, wanted
    )
    assert one.reason() == (
        "waist +3.0 cm of ease (wanted: 2.0 to 2.5), loose by 0.5; thigh +10.0 cm of ease (wanted: 2.5 or more); "
        "hip +20.0 cm of ease (wanted: none known)"
    )
    assert one.misfit == pytest.approx(0.005)
    (flared,) = rank_sizes({"40": {"waist": 0.80}}, {"waist": 0.70}, wanted, ["waist"])
    assert flared.fits


def test_a_body_beyond_the_run_and_one_without_measures():
    ranked = rank_sizes(SHIRTS, {"chest": 1.4}, read_allowances("shirt"))
    assert ranked[0].size == "XXL"
    assert not any(one.wearable for one in ranked)
    assert "smaller than the body" in ranked[0].reason()
    with pytest.raises(InputError, match=r"of the garment \(chest\), of the body \(waist\)"):
        rank_sizes(SHIRTS, {"waist": 0.8}, read_allowances("shirt"))
