"""Backward planning on the toy tables: what runs, what is left out and why, what is missing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from toy_tables import TOY

from vto_pipeline.errors import PlanError
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.given import Given
from vto_pipeline.pipeline.lacking import lacking
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import Request

BOTH = "schema: 1\ngiven: {left: {number: left.txt}, right: {number: right.txt}}\n"
LEFT = "schema: 1\ngiven: {left: {number: left.txt}}\n"


def names(plan):
    return [step.stage.name for step in plan.steps]


def test_only_what_is_needed_runs_in_order(ask):
    plan = make_plan(ask(BOTH + "want: [squared]"), TOY)
    assert names(plan) == ["left.double", "right.double", "add", "square"]
    assert plan.steps[2].inputs == ("left_doubled", "right_doubled")
    assert plan.left_out == {
        "guess": "word not given",
        "parity": "nothing wanted depends on it",
        "label": "nothing wanted depends on it",
        "page": "nothing wanted depends on it",
    }


def test_an_optional_input_is_absent_where_it_cannot_be_made(ask):
    plan = make_plan(ask(LEFT + "want: [total]"), TOY)
    assert plan.steps[-1].inputs == ("left_doubled",)
    assert plan.left_out["right.double"] == "right.number not given"


def test_an_optional_input_that_the_settings_have_no_use_for_is_neither_made_nor_taken(ask):
    sparing = replace(TOY.stages[2], idle=lambda settings: ("right_doubled",) if settings.offset == 0 else ())
    tables = Catalogue((*TOY.stages[:2], sparing, *TOY.stages[3:]), TOY.kinds, TOY.given)
    alone = make_plan(ask(BOTH + "want: [total]"), tables)
    assert names(alone) == ["left.double", "add"]
    assert alone.steps[-1].inputs == ("left_doubled",)
    assert alone.left_out["right.double"] == "nothing wanted depends on it"
    both = make_plan(ask(BOTH + "want: [total]\nstages: {add: {offset: 1}}"), tables)
    assert names(both) == ["left.double", "right.double", "add"]
    assert both.steps[-1].inputs == ("left_doubled", "right_doubled")


def test_given_is_preferred_over_making(ask):
    plan = make_plan(ask("schema: 1\ngiven: {left: {number: left.txt, doubled: right.txt}}\nwant: [total]"), TOY)
    assert names(plan) == ["add"]
    assert plan.left_out["left.double"] == "left.doubled is given"


def test_a_final_stage_comes_last_and_causes_nothing_to_be_made(ask):
    plan = make_plan(ask(LEFT + "want: [page, total]"), TOY)
    assert names(plan) == ["left.double", "add", "page"]
    assert plan.steps[-1].inputs == ("total", "left_number")


def test_the_missing_leaf_is_named_not_its_consequences(ask):
    with pytest.raises(PlanError) as caught:
        make_plan(ask("schema: 1\ngiven: {right: {number: right.txt}}\nwant:\n- label"), TOY)
    assert caught.value.problem == "label cannot be made: left or word not given"
    assert caught.value.hint == "give one of left.number, left.doubled, word"
    assert caught.value.where.endswith("toy.yaml, line 4")


def test_several_missing_leaves_are_named_together():
    both = replace(TOY.stages[2], needs=("left_doubled", "right_doubled"), optional=())
    tables = Catalogue((*TOY.stages[:2], both), TOY.kinds, TOY.given)
    request = Request({}, ("total",), {section: kind() for section, kind in tables.sections.items()})
    with pytest.raises(PlanError) as caught:
        make_plan(request, tables)
    assert caught.value.problem == "total cannot be made: left and right not given"
    assert caught.value.hint == "give one of left.number, left.doubled, and right.number"


def test_two_ways_ask_for_a_choice(ask):
    text = "schema: 1\ngiven: {left: {number: left.txt}, word: seven}\nwant: [label]\n"
    with pytest.raises(PlanError) as caught:
        make_plan(ask(text), TOY)
    assert caught.value.problem == "total can be made in 2 ways: by add or guess"
    assert "choose: {total: add}" in caught.value.hint
    plan = make_plan(ask(text + "choose: {total: guess}"), TOY)
    assert names(plan) == ["guess", "parity", "label"]
    assert plan.left_out["add"] == "not chosen: guess makes it"


def test_an_impossible_choice_is_refused(ask):
    text = "schema: 1\ngiven: {left: {number: left.txt}}\nwant: [total]\nchoose: {total: guess}"
    with pytest.raises(PlanError, match="total cannot be made by guess: word not given"):
        make_plan(ask(text), TOY)


def test_an_artifact_is_not_made_from_itself():
    halve = replace(TOY.stages[0], name="halve", needs=("total",), makes=("left_doubled",))
    tables = Catalogue((halve, *TOY.stages), TOY.kinds, TOY.given)
    settings = {section: kind() for section, kind in tables.sections.items()}
    given = Given("left.number", "", lambda job: 3)
    plan = make_plan(Request({"left_number": given}, ("total",), settings), tables)
    assert names(plan) == ["left.double", "add"]
    assert lacking("total", [], tables) == [["left.number", "left.doubled", "word"]]  # and the search ends
