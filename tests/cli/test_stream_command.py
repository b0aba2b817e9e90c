"""vto stream: a recording through a finished run, to a browser."""

from __future__ import annotations

import asyncio
import io
import json
import re
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.avatar.template.template import template
from vto_pipeline.cli.main import main
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.io.motion.tracked.lines import LANDMARKS
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms
from vto_pipeline.report.live.codec import STEP_M, decode
from vto_pipeline.stages.entry.planning import catalogue

AROUND, RINGS = 40, 12


def skirt(body) -> TriangleMesh:
    """A tube about the hips that hangs from the waist."""
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    rings = np.linspace(1.12, 0.65, RINGS)
    points = [np.column_stack([0.24 * np.sin(angle), np.full(AROUND, y), 0.2 * np.cos(angle)]) for y in rings]
    i = np.arange(AROUND)
    faces = []
    for ring in range(RINGS - 1):
        a, b = ring * AROUND + i, ring * AROUND + (i + 1) % AROUND
        faces += [np.column_stack([a, a + AROUND, b]), np.column_stack([b, a + AROUND, b + AROUND])]
    return TriangleMesh(np.concatenate(points), np.concatenate(faces).astype(np.int32))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The folder of a run that is as `vto drape` leaves it."""
    tables, folder, body = catalogue(), tmp_path / "run", template(0.0)
    draped = skirt(body)
    made = {"draped": draped, "avatar": body, "worn_rest": RestShape(draped.vertices)}
    (folder / "out").mkdir(parents=True)
    for name, value in made.items():
        kind = tables.kind(name)
        kind.write(folder / "out" / kind.filename, value)
    given = {"fabric": {"key": "fabric", "value": "denim"}}
    (folder / "run.json").write_text(json.dumps({"stages": [], "wanted": list(made), "given": given}))
    return folder


def recording() -> bytes:
    """A step ahead, as a camera sees it, and half a second of standing, for cloth that late frames left behind."""
    clip, joints = (lambda read: (read.clip, read.joints))(read_motion("walking_step"))
    _, places = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    frames = [
        {name: places[t, k].tolist() for name, k in joints.indices.items() if name in LANDMARKS}
        for t in range(len(places))
    ]
    frames += frames[-1:] * round(0.5 / clip.frame_time)
    lines = [json.dumps({"time_s": t * clip.frame_time, "joints": frame}) for t, frame in enumerate(frames)]
    return ("\n".join(lines) + "\n").encode()


class Standard:
    """Standard input of these bytes."""

    def __init__(self, data: bytes) -> None:
        self.buffer = io.BytesIO(data)


def streamed(monkeypatch, capfd, data: bytes, *arguments: object) -> tuple[int, str, str]:
    monkeypatch.setattr("sys.stdin", Standard(data))
    code = main(["stream", *map(str, arguments), "--no-browser"])
    return code, *capfd.readouterr()


def watch(found: list[tuple[int, np.ndarray]], address: list[str]) -> None:
    """Be a browser: decode and confirm all frames."""

    async def reading() -> None:
        from tornado.websocket import websocket_connect

        socket = await websocket_connect(address[0].replace("http", "ws") + "frames")
        last = None
        while (message := await socket.read_message()) is not None:
            last = decode(message, last)
            found.append((last[0], last[1] * STEP_M))
            await socket.write_message(str(last[0]))
        socket.close()

    end = time.perf_counter() + 300
    while not address and time.perf_counter() < end:
        time.sleep(0.01)
    asyncio.run(reading())


def test_a_recording_moves_the_garment_and_a_browser_sees_it(run, monkeypatch, capfd):
    from vto_pipeline.report.live.server import LiveServer

    frames: list[tuple[int, np.ndarray]] = []
    address: list[str] = []
    begin = LiveServer.__enter__

    def entered(self):
        made = begin(self)
        address.append(self.address)
        return made

    monkeypatch.setattr(LiveServer, "__enter__", entered)
    browser = threading.Thread(target=watch, args=(frames, address))
    browser.start()
    first, *rest = recording().splitlines(keepends=True)
    bad = first.replace(b"[", b"[NaN, ", 1)
    data = first + bad + b"".join(rest)
    code, out, err = streamed(monkeypatch, capfd, data, run, "--replay", "--lead-in", "0.2s", "--json")
    browser.join(30)
    assert code == 0
    said = json.loads(out)
    assert re.search(r"refused: NaN is not a place in standard input, line 2", err)
    assert said["lines_refused"] == 1
    assert said["skeletons"] == len(rest) + 1
    assert said["frames"] == pytest.approx(said["frames_per_second"] * said["seconds"])
    assert said["frames"] + said["late"] == pytest.approx(20.0 * said["seconds"], abs=3)
    assert said["vertices"] == AROUND * RINGS
    assert said["restarts"] == 0
    assert said["browsers"] == 1
    assert said["frames_sent"] == len(frames) > 2
    body = template(0.0)
    garment = [places[: AROUND * RINGS] for _, places in frames]
    skin = [places[AROUND * RINGS :] for _, places in frames]
    assert all(np.isfinite(one).all() for one in garment)
    assert np.linalg.norm(skin[0] - body.vertices, axis=1).max() < 1e-3
    gone = [(one[-1] - one[0]).mean(axis=0) for one in (skin, garment)]
    assert np.linalg.norm(gone[0]) > 0.2
    assert np.linalg.norm((gone[1] - gone[0])[[0, 2]]) < 0.1  # the garment goes where the body goes


def test_nobody_before_the_camera_is_an_error_in_words(run, monkeypatch, capfd):
    code, _, err = streamed(monkeypatch, capfd, b'{"joints": {"left_hip": [0, 1, 0]}}\n', run)
    assert code == 3
    assert "no frame with a whole person came" in err
    assert "left_knee" in err


def test_what_cannot_move_is_refused(run, monkeypatch, capfd, tmp_path):
    assert streamed(monkeypatch, capfd, b"", tmp_path / "nowhere")[0] == 3
    (run / "out" / "avatar.npz").unlink()
    code, _, err = streamed(monkeypatch, capfd, b"", run)
    assert (code, "not an avatar" in err, "vto fit" in err) == (3, True, True)
    (run / "out" / "draped.ply").unlink()
    code, _, err = streamed(monkeypatch, capfd, b"", run)
    assert (code, "no draped garment" in err) == (3, True)


def test_without_tornado_it_says_what_to_install(run, monkeypatch, capfd):
    monkeypatch.setitem(__import__("sys").modules, "tornado.httpserver", None)
    code, _, err = streamed(monkeypatch, capfd, recording(), run)
    assert (code, "vto-pipeline[live]" in err) == (5, True)
