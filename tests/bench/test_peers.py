"""Other programs on our scenes: what is not installed is left out, and what they move is measured as ours is."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench import peers
from vto_pipeline.bench.bench import Watch
from vto_pipeline.bench.cloth.scenes import hang
from vto_pipeline.bench.peers.peer import Peer, measure_peer
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.errors import DivergedError, MissingDependencyError


class Stretched:
    """A program that stretches the cloth by a share in each frame."""

    def __init__(self, scene, settings) -> None:
        self.positions, self.share, self.frames = scene.rest.copy(), settings["share"], 0

    def frame(self) -> None:
        self.frames += 1
        if self.share > 1.0:
            raise DivergedError("blew up")

    def state(self) -> ClothState:
        moved = self.positions * (1.0 + self.share * self.frames)
        return ClothState(moved, np.zeros_like(moved))


@pytest.fixture
def stretched(monkeypatch) -> Peer:
    module = ModuleType("stretched_cloth")
    module.start = Stretched  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "stretched_cloth", module)
    return Peer("Stretched", "numpy", "stretched_cloth", lambda scene: [{"share": 1e-4}])


def test_two_seconds_of_frames_are_run_and_measured(stretched):
    timing, errors = measure_peer(stretched, hang(8), {"share": 1e-4})
    assert errors["status"] == "ended"
    assert_allclose(errors["rms_stretch"], 120 * 1e-4, rtol=1e-6)  # 120 frames of 1/60 s; rounding only
    assert timing.runs == 3


def test_cloth_that_blows_up_is_a_row_that_says_so(stretched):
    assert measure_peer(stretched, hang(8), {"share": 2.0})[1] == {"status": "blew up"}
    assert measure_peer(stretched, hang(8), {"share": np.nan})[1] == {"status": "diverged"}


def test_none_installed_is_a_missing_dependency(monkeypatch):
    absent = Peer("Absent", "no_such_package_here", "stretched_cloth", lambda scene: [])
    monkeypatch.setattr(peers, "PEERS", (absent,))
    with pytest.raises(MissingDependencyError, match="peers"):
        next(iter(peers.rows(True, Watch())))


@pytest.mark.parametrize("peer", peers.PEERS, ids=lambda peer: peer.name)
def test_an_installed_peer_hangs_the_sheet_where_statics_has_it(peer):
    if not peer.installed:
        pytest.skip(f"no package {peer.package}")
    scene = hang(8)
    _, errors = measure_peer(peer, scene, peer.budgets(scene)[0])
    # a sheet that hardly stretches hangs flat from its corners: its middle half a metre below them
    assert_allclose(errors["mean_height_m"], 0.5, rtol=0, atol=0.01)
    assert errors["rms_stretch"] < 0.01
