"""The key of a whole run against the keys that its run records, and what is known to be stored before it runs."""

from __future__ import annotations

import os

import pytest
from toy_tables import CALLS, TOY

from vto_pipeline.pipeline.execution.forecast import stored_results
from vto_pipeline.pipeline.execution.key import run_key
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import make_plan

TEXT = "schema: 1\ngiven: {left: {number: left.txt}, right: {number: right.txt}}\nwant: [squared, page]\n"
VARIANTS = {
    "plain": TEXT,
    "a default spelt out": TEXT + "stages: {add: {offset: 0}}\n",
    "an offset": TEXT + "stages: {add: {offset: 1}}\n",
    "a seed": TEXT + "seed: 5\n",
    "a file of another name": TEXT.replace("left.txt", "third.txt"),
    "another file": TEXT.replace("left.txt", "right.txt"),
    "less wanted": TEXT.replace("squared, page", "squared"),
    "more wanted": TEXT.replace("squared, page", "squared, page, parity"),
    "what is made anyway wanted too": TEXT.replace("squared, page", "squared, page, total"),
    "one input less": TEXT.replace(", right: {number: right.txt}", ""),
}


def test_two_documents_have_one_key_exactly_if_their_runs_record_the_same(ask, go, tmp_path):
    (tmp_path / "third.txt").write_text("3")  # as left.txt
    keys, recorded = {}, {}
    for name, text in VARIANTS.items():
        request = ask(text)
        keys[name] = run_key(request, make_plan(request, TOY), False)
        stages = [(stage["name"], stage["key"], stage["status"] != "left_out") for stage in go(text)["stages"]]
        recorded[name] = repr((stages, request.want))
    for one in VARIANTS:
        for other in VARIANTS:
            assert (keys[one] == keys[other]) == (recorded[one] == recorded[other]), (one, other)


def test_the_key_of_a_run_is_what_decides_its_result(ask, tmp_path):
    request = ask(TEXT)
    plan = make_plan(request, TOY)
    key = run_key(request, plan, False)
    os.utime(tmp_path / "left.txt", (1, 1))
    assert run_key(request, plan, False) == key
    assert run_key(request, plan, True) != key
    (tmp_path / "left.txt").write_text("5")
    assert run_key(request, plan, False) != key


@pytest.mark.parametrize(("change", "ran"), [("", []), ("stages: {add: {offset: 1}}\n", ["add", "square"])])
def test_what_is_said_to_be_stored_does_not_run(ask, go, tmp_path, change, ran):
    go(TEXT)
    request = ask(TEXT + change)
    found = stored_results(request, make_plan(request, TOY), Store(tmp_path / "run" / "cache"))
    missing = [step.stage.name for step, result in found if result is None and not step.stage.final]
    go(TEXT + change)
    assert missing == ran == [name for name in CALLS if name != "page"]
