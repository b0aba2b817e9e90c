"""Tables that contradict themselves are refused when they are built."""

from __future__ import annotations

from dataclasses import replace

import jsonschema
import pytest
from toy_tables import GIVEN, KINDS, STAGES, TOY, AddConfig

from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.schema import json_schema
from vto_pipeline.pipeline.stage import Stage

DOUBLE = STAGES[0]


@pytest.mark.parametrize(
    ("stages", "kinds", "given", "message"),
    [
        ((*STAGES, DOUBLE), KINDS, GIVEN, "stage named twice: \\['left.double'\\]"),
        (STAGES, (*KINDS, KINDS[0]), GIVEN, "artifact named twice"),
        (STAGES, KINDS[:-1], GIVEN, "without a kind: \\['page'\\]"),
        (STAGES, KINDS, {"left.number": "nothing"}, "without a kind: \\['nothing'\\]"),
        ((*STAGES, replace(DOUBLE, name="up.double", settings=AddConfig)), KINDS, GIVEN, "two settings classes"),
        (STAGES, (*KINDS[:-1], replace(KINDS[-1], filename="total.txt")), GIVEN, "file name named twice"),
    ],
)
def test_contradictions_are_refused(stages, kinds, given, message):
    with pytest.raises(ValueError, match=message):
        Catalogue(stages, kinds, given)


def test_a_stage_that_can_be_skipped_says_what_it_passes_on():
    with pytest.raises(ValueError, match="passes must name a source"):
        Stage("a", "", ("x",), ("y", "z"), DOUBLE.run, skip=lambda i: None, passes={"y": "x"})
    with pytest.raises(ValueError, match="only name what it needs"):
        Stage("a", "", ("x",), ("y",), DOUBLE.run, passes={"y": "other"})


def test_the_json_schema_accepts_what_the_engine_accepts():
    schema = json_schema(TOY)
    jsonschema.Draft202012Validator.check_schema(schema)
    good = {"schema": 1, "given": {"left": {"number": "a"}, "word": {"value": 1}}, "want": ["total"]}
    jsonschema.validate({**good, "stages": {"add": {"offset": 3}}}, schema)
    for bad in (
        {**good, "stages": {"add": {"ofset": 3}}},
        {**good, "stages": {"add": {"offset": 300}}},
        {**good, "want": ["totla"]},
        {**good, "schema": 2},
        {"given": {}, "want": ["total"]},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(bad, schema)
