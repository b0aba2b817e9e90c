"""What an error costs elsewhere and here."""

from __future__ import annotations

import json

import pytest

from vto_pipeline.bench.bench import Row
from vto_pipeline.bench.cloth.comparison import compare, level_as_json, read_peers
from vto_pipeline.errors import FormatError


def ours(seconds: float, stretch: float, *, method: str = "xpbd", height: float = 0.5) -> Row:
    return Row("hang 32", method, {"substeps": 4}, 1024, seconds, {"rms_stretch": stretch, "mean_height_m": height})


def theirs(seconds: float, stretch: float, height: float = 0.5, **more) -> str:
    row = {"scene": "hang", "N": 32, "peer": "other", "params": {"iters": 5}, "seconds": seconds}
    return json.dumps({**row, "rms_stretch": stretch, "com_z": height, **more})


def write(folder, *lines):
    path = folder / "peers.jsonl"
    path.write_text("\n".join(lines) + "\n")
    return path


REFERENCE = ours(99.0, 1e-5, method="reference")


def test_best_time_at_each_error_a_peer_reaches(tmp_path):
    peers = read_peers(write(tmp_path, theirs(1.0, 1e-3), theirs(3.0, 1e-4), theirs(9.0, 2e-4), theirs(4.0, 5e-3)))
    mine = [REFERENCE, ours(0.2, 2e-3), ours(0.5, 9e-4), ours(6.0, 1.5e-4)]
    levels = compare(mine, peers)
    assert [level.error for level in levels] == [5e-3, 1e-3, 2e-4, 1e-4]
    assert [level.peer_seconds for level in levels] == [1.0, 1.0, 3.0, 3.0]  # the tighter run also reaches the looser
    assert [level.seconds for level in levels] == [0.2, 0.5, 6.0, None]
    assert [level.ratio for level in levels] == [0.2, 0.5, 2.0, None]
    assert level_as_json(levels[0])["ratio"] == 0.2


def test_a_sheet_that_has_not_fallen_does_not_count(tmp_path):
    peers = read_peers(write(tmp_path, theirs(1.0, 1e-3), theirs(0.1, 1e-6, height=0.6)))
    levels = compare([REFERENCE, ours(0.5, 1e-4), ours(0.1, 1e-4, height=0.515)], peers)
    assert [(level.error, level.seconds) for level in levels] == [(1e-3, 0.5)]


def test_no_reference_no_verdict(tmp_path):
    assert compare([ours(0.5, 1e-4)], read_peers(write(tmp_path, theirs(1.0, 1e-3)))) == []


def test_the_reference_is_not_a_competitor(tmp_path):
    (level,) = compare([REFERENCE], read_peers(write(tmp_path, theirs(1.0, 1e-3))))
    assert (level.method, level.ratio) == ("", None)


def test_rows_that_blew_up_are_passed_over(tmp_path):
    burst = json.dumps({"scene": "hang", "N": 32, "peer": "other", "params": {}, "seconds": 1.0, "exploded": True})
    (row,) = read_peers(write(tmp_path, burst, "", theirs(1.0, 1e-3, ke=0.5, reps=2, threads_asked=None)))
    assert (row.scene, row.vertices, row.runs, row.threads) == ("hang 32", 1024, 2, 0)
    assert row.errors == {"rms_stretch": 1e-3, "mean_height_m": 0.5, "kinetic_j": 0.5}


@pytest.mark.parametrize(("line", "said"), [("{", "not a JSON object"), ('{"N": 3}', "without scene"), ("5", "not a")])
def test_a_bad_line_is_named(tmp_path, line, said):
    with pytest.raises(FormatError, match=said) as caught:
        read_peers(write(tmp_path, theirs(1.0, 1e-3), line))
    assert "line 2" in caught.value.where
