"""Every mistake in a document is met with its file, its line, and what to do."""

from __future__ import annotations

import pytest

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.model.job import Job

HEAD = "schema: 1\ngiven:\n  left: {number: left.txt}\nwant: [total]\n"


@pytest.mark.parametrize(
    ("text", "line", "problem", "hint"),
    [
        ("given: {}\nwant: [total]", None, "schema is missing; expected 1", ""),
        ("schema: 2\ngiven: {}\nwant: [total]", 1, "schema is 2; expected 1", ""),
        (HEAD + "stage: {}", 5, "stage: unknown key (got {})", "did you mean stages?"),
        (HEAD + "stages:\n  ad: {}", 6, "stages.ad: unknown key (got {})", "did you mean add?"),
        (
            HEAD + "stages:\n  add: {ofset: 3}",
            6,
            "stages.add.ofset: unknown key (got 3)",
            "did you mean offset?",
        ),
        (
            HEAD + "stages:\n  add:\n    offset: 101",
            7,
            "stages.add.offset: input should be less than or equal to 100 (got 101)",
            "",
        ),
        (
            "schema: 1\ngiven:\n  lefft: {number: a}\nwant: [total]",
            3,
            "given.lefft: unknown key (got {'number': 'a'})",
            "did you mean left?",
        ),
        (
            "schema: 1\ngiven:\n  left:\n    numbr: a\nwant: [total]",
            4,
            "given.left.numbr: unknown key (got 'a')",
            "did you mean number?",
        ),
        (
            "schema: 1\ngiven:\n  left: {number: left.txt}\nwant:\n- totla",
            5,
            "want: unknown artifact 'totla'",
            "did you mean total?",
        ),
        (HEAD + "choose: {totl: add}", 5, "choose.totl: unknown artifact", "did you mean total?"),
        (HEAD + "choose: {total: parity}", 5, "choose.total: 'parity' does not make it", "one of add, guess"),
        (HEAD + "seed: -1", 5, "seed: input should be greater than or equal to 0 (got -1)", ""),
    ],
)
def test_mistakes_are_located(ask, text, line, problem, hint):
    with pytest.raises(ConfigError) as caught:
        ask(text)
    assert caught.value.problem == problem
    assert caught.value.hint == hint
    assert caught.value.where.endswith("toy.yaml" if line is None else f"toy.yaml, line {line}")


def test_a_missing_file_is_an_input_error_with_its_neighbour(ask):
    with pytest.raises(InputError) as caught:
        ask("schema: 1\ngiven:\n  left:\n    number: lfet.txt\nwant: [total]")
    assert caught.value.problem.startswith("given.left.number: no such file or folder: ")
    assert caught.value.where.endswith("line 4")
    assert caught.value.hint.endswith("left.txt?")


def test_an_address_is_for_batches(ask):
    with pytest.raises(InputError, match=r"given.left.number: s3://bucket/left.txt lies in a store") as caught:
        ask("schema: 1\ngiven:\n  left:\n    number: s3://bucket/left.txt\nwant: [total]")
    assert caught.value.where.endswith("line 4")
    assert "vto batch" in caught.value.hint


def test_a_preset_may_stand_where_the_kind_allows_one(ask):
    assert ask("schema: 1\ngiven: {word: seven}\nwant: [total]").given["word"].read(Job()) == 7
    assert ask("schema: 1\ngiven: {word: {value: 5}}\nwant: [total]").given["word"].read(Job()) == 5
    with pytest.raises(InputError, match="unknown word 'sevn'") as caught:
        ask("schema: 1\ngiven: {word: sevn}\nwant: [total]")
    assert caught.value.where.endswith("toy.yaml, line 2")
    with pytest.raises(ConfigError, match=r"given.left.number"):
        ask("schema: 1\ngiven: {left: {number: {value: 5}}}\nwant: [total]")


def test_paths_inside_an_inline_value_are_resolved_and_missing_ones_named(ask):
    request = ask("schema: 1\ngiven: {word: {file: left.txt}}\nwant: [total]")
    assert request.given["word"].read(Job()) == 3
    assert [path.name for path in request.given["word"].paths] == ["left.txt"]
    with pytest.raises(InputError, match=r"given.word.file: no such file or folder"):
        ask("schema: 1\ngiven: {word: {file: gone.txt}}\nwant: [total]")


def test_a_preset_name_with_a_suffix_is_a_missing_file(ask):
    with pytest.raises(InputError, match="no such file or folder"):
        ask("schema: 1\ngiven: {word: seven.yaml}\nwant: [total]")


def test_overrides_win_and_complain_like_the_document(ask):
    assert ask(HEAD + "stages: {add: {offset: 1}}", ["add.offset=7"]).settings["add"].offset == 7
    assert ask(HEAD, ["add.fail=true"]).settings["add"].fail is True
    for text, problem, hint in [
        ("add.ofset=3", "stages.add.ofset: unknown key (got 3)", "did you mean offset?"),
        ("add.offset=101", "stages.add.offset: input should be less than or equal to 100 (got 101)", ""),
        ("ad.offset=3", "stages.ad: unknown stage", "did you mean add?"),
        ("offset=3", "--set takes stage.key=value (got 'offset=3')", "as in --set drape.target_error_mm=0.5"),
    ]:
        with pytest.raises(ConfigError) as caught:
            ask(HEAD, [text])
        assert (caught.value.problem, caught.value.hint) == (problem, hint)
        assert caught.value.where in (f"--set {text}", "")


def test_what_is_given_is_read_once_and_told_once(ask):
    given = ask(HEAD).given["left_number"]
    first, second = Job(), Job()
    assert given.read(first) == given.read(second) == 3
    assert (first.notes, second.notes) == (["left.txt: read as a decimal number"], [])


def test_a_folder_where_a_file_is_wanted_is_refused_unread(ask, tmp_path):
    """At once, however much the folder holds."""
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="folder is a folder; a file was wanted"):
        ask(HEAD.replace("left.txt", "folder"))


def test_a_link_to_itself_is_a_bad_input(ask, tmp_path):
    (tmp_path / "loop.txt").symlink_to(tmp_path / "loop.txt")
    with pytest.raises(InputError, match="not a path that can be opened|no such file"):
        ask(HEAD.replace("left.txt", "loop.txt"))
