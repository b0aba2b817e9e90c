"""A garment that is carried through its body's motion: frames of reference, friction, steps, interruptions."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from cloth_scenes import across_a_ridge, ball, fabric
from ipc_judge import crosses, self_crosses
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth import MeshCollider, simulate
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.moving import frame as frame_module
from vto_pipeline.cloth.moving.config import FollowConfig
from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.moving.frame import FrameStepper
from vto_pipeline.errors import ConfigError, SimulationError
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.io.runs.frame_log import FrameLog, read_cloth_motion, write_cloth_motion
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath, ClothMotion

RADIUS = 0.1
FPS = 30


def smooth(share):
    """From 0 to 1 with no jump of the acceleration: 6 s⁵ - 15 s⁴ + 10 s³."""
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10 + s * (6 * s - 15))


def path(moved, seconds):
    """A ball; moved: time, its vertices at rest -> where they are."""
    body = ball(RADIUS, levels=3)
    return BodyPath(lambda t: np.array(moved(t, body.vertices)), body.faces, round(seconds * FPS) + 1, 1 / FPS)


def shifted(points, x, y, z):
    return points + np.array([x, y, z])


def turned(angle, points):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


@pytest.fixture(scope="module")
def cap():
    """A cap on a ball, at rest: about 50 degrees from the top."""
    shell = ball(1.04 * RADIUS, levels=3)
    up = shell.vertices[:, 1] > 0.65 * RADIUS
    mesh = submesh(shell, up[shell.faces].all(axis=1))[0]
    body = MeshCollider(ball(RADIUS, levels=3), friction=0.6)
    still = simulate(mesh, cloth(), colliders=[body], seconds=4.0, settings={"until": "rest", "damping": 5.0})
    assert still.report["settled"]
    return Garment(TriangleMesh(still.positions, mesh.faces), RestShape(mesh.vertices))


def cloth(friction=0.6):
    return fabric(bending=1e-4, friction=friction)


def test_a_still_body_leaves_cloth_at_rest(cap):
    motion, found = follow(cap, path(lambda t, x: x, 1.0), cloth())
    assert motion.frames.shape == (31, len(cap.mesh.vertices), 3)
    assert np.abs(motion.frames - cap.mesh.vertices).max() < 5e-4
    assert found["frames_crossing_body"] == 0 == found["frames_crossing_itself"]


def test_cloth_is_carried_along_and_lies_as_before_when_all_is_still(cap):
    """0.4 m in a second and to rest again; friction bears about 6 m/s², and 2.3 are asked for."""
    way = np.array([0.4, 0.0, 0.0])
    motion, found = follow(cap, path(lambda t, x: x + smooth(t) * way, 2.0), cloth(), {"damping": 0.0})
    assert_allclose(motion.frames[-1] - way, cap.mesh.vertices, atol=2e-3)  # it slides by less than 2 %
    middle = motion.frames[15] - smooth(0.5) * way
    assert_allclose(middle, cap.mesh.vertices, atol=2e-3)
    assert found["frames_crossing_body"] == 0


def test_friction_turns_cloth_with_the_body_and_without_it_the_cloth_stays(cap):
    def quarter(t, x):
        return turned(smooth(t) * np.pi / 2, x)

    held, _ = follow(cap, path(quarter, 1.0), cloth(0.6), {"damping": 0.0, "substeps": 4})
    free, _ = follow(cap, path(quarter, 1.0), cloth(0.0), {"damping": 0.0})
    assert_allclose(held.frames[-1], turned(np.pi / 2, cap.mesh.vertices), atol=5e-4)  # 0.3 mm: it comes to rest

    def spun(frame):
        a, b = cap.mesh.vertices[:, ::2] @ [1, 1j], frame[:, ::2] @ [1, 1j]
        return abs(np.angle((a.conj() * b).sum()))

    assert spun(free.frames[-1]) < np.deg2rad(30)  # the ball has facets, which push
    assert abs(spun(held.frames[-1]) - np.pi / 2) < np.deg2rad(0.2)


def test_what_is_not_held_keeps_its_speed_when_the_body_is_taken_away(cap):
    """In free fall beside a body that has gone down faster, the centre of mass follows g t² / 2 from its own speed."""

    def gone(t, x):
        return shifted(x, 0.5 * t, -(max(0.0, t) ** 2) * 30.0, 0.0)

    motion, _ = follow(cap, path(gone, 0.3), cloth(), {"damping": 0.0})
    middle = motion.frames.mean(axis=1)
    speed = np.diff(middle, axis=0) * FPS
    assert_allclose(np.diff(speed[3:, 1]) * FPS, -9.81, rtol=0.01)  # even steps: backward Euler falls so exactly
    assert_allclose(speed[3:, 0], speed[3, 0], atol=0.01)


@pytest.mark.parametrize(("speed", "left"), [(0.0, 1.0), (0.1, 0.5), (0.4, 0.25)])
def test_skin_that_had_to_be_thicker_thins_out_as_the_body_moves_on(cap, speed, left):
    """In a second at 0.1 m/s by half, as in half a second at more than twice that; in a pose that is held, never."""
    way = path(lambda t, x: shifted(x, speed * t, 0.0, 0.0), 1.0)
    stepper = FrameStepper(build_cloth(cap.mesh, cap.rest, cloth()), cap, way, cloth(), FollowConfig(), Job())
    thin = stepper.now.skin.copy()
    stepper.now = stepper.now._replace(skin=thin + 1e-3)
    for frame in range(1, FPS + 1):
        assert stepper.go_to(frame).attempts == 1
    assert_allclose(stepper.now.skin - thin, left * 1e-3, rtol=1e-9)


def test_a_spike_that_no_attempt_gets_cloth_over_leaves_it_clear_of_the_body(cap):
    """Contacts are held at vertices; a spike grows through the middle of a triangle, and there is but one attempt."""
    middle = cap.mesh.vertices[cap.mesh.faces].mean(axis=1)
    above = middle[np.argmax(middle[:, 1])]
    tip = np.argmin(np.linalg.norm(ball(RADIUS, levels=3).vertices - RADIUS / np.linalg.norm(above) * above, axis=1))

    def grown(t, x):
        return np.where(np.arange(len(x))[:, None] == tip, x + min(10.0 * t, 1.0) * (1.1 * above - x[tip]), x)

    way = path(grown, 0.2)
    motion, found = follow(cap, way, cloth(), {"attempts": 1})
    bodies = [TriangleMesh(way.at(way.time(k)), way.faces) for k in range(way.frames)]
    sheets = [TriangleMesh(frame, motion.faces) for frame in motion.frames]
    assert crosses(sheets[0], bodies[-1])  # it is in the way
    assert not any(crosses(sheet, body) for sheet, body in zip(sheets, bodies, strict=True))
    assert not any(map(self_crosses, sheets))
    assert found["max_stretch"] < 0.1


def test_a_patch_that_has_come_through_the_cap_under_it_is_led_out_again(cap):
    """Contacts alone would hold it there: they keep each vertex on the side of the cloth where they find it."""
    top = cap.mesh.vertices[:, 1] > 0.9 * cap.mesh.vertices[:, 1].max()
    patch = submesh(cap.mesh, top[cap.mesh.faces].all(axis=1))[0]
    upper = patch.vertices + 0.004 * patch.vertices / np.linalg.norm(patch.vertices, axis=1, keepdims=True)
    count = len(cap.mesh.vertices)
    places, faces = np.vstack([cap.mesh.vertices, upper]), np.vstack([cap.mesh.faces, patch.faces + count])
    both = Garment(TriangleMesh(places, faces), RestShape(np.vstack([cap.rest.positions, patch.vertices])))
    still = path(lambda t, x: x, 0.2)
    stepper = FrameStepper(build_cloth(both.mesh, both.rest, cloth()), both, still, cloth(), FollowConfig(), Job())
    through = places.copy()
    through[count + np.argmax(upper[:, 1]), 1] -= 0.006
    assert self_crosses(TriangleMesh(through, faces))
    stepper.now = stepper.now._replace(state=replace(stepper.now.state, positions=through))
    for frame in (1, 2):
        assert stepper.go_to(frame).attempts == 1
        sheets = TriangleMesh(stepper.now.state.positions, faces)
        assert not self_crosses(sheets)
        assert not crosses(sheets, stepper.body_at(still.time(frame)))
    assert np.abs(sheets.vertices - places).max() < 0.006  # it has not been thrown about


def test_what_contacts_leave_across_a_ridge_is_lifted_off_it_by_little(monkeypatch):
    """The ridge stands out by half a millimetre, 2 mm below a wall; half an edge at once went 34 mm."""
    sheet, body = across_a_ridge(2e-3, 5e-4)
    still = BodyPath(lambda t: np.array(body.vertices), body.faces, 6, 1 / FPS)
    garment = Garment(sheet, RestShape(sheet.vertices))
    config = FollowConfig(skin_mm=0.3, attempts=1)  # so thin that the body need not give way
    stepper = FrameStepper(build_cloth(sheet, garment.rest, cloth()), garment, still, cloth(), config, Job())
    monkeypatch.setattr(stepper._stepper, "run", lambda state, seconds: replace(state, time=state.time + seconds))
    stepper.go_to(1)
    after = TriangleMesh(stepper.now.state.positions, sheet.faces)
    assert crosses(sheet, body)
    assert not crosses(after, body)
    assert np.linalg.norm(after.vertices - sheet.vertices, axis=1).max() < 2e-3


def test_a_frame_with_cloth_in_skin_that_gave_way_though_it_was_free_is_tried_again_in_thicker_skin(cap, monkeypatch):
    """And no longer than that helps."""
    still = path(lambda t, x: x, 0.2)
    stepper = FrameStepper(build_cloth(cap.mesh, cap.rest, cloth()), cap, still, cloth(), FollowConfig(), Job())
    one = np.array([[0, 0]], np.int32)
    answers = [one, one[:0], one, one]
    monkeypatch.setattr(stepper.body, "crossing_with_room", lambda *_: answers.pop(0))
    before = stepper.now.skin.copy()
    assert stepper.go_to(1).attempts == 2
    thicker = np.flatnonzero(stepper.now.skin > before + 5e-4)
    assert_array_equal(thicker, np.sort(cap.mesh.faces[0]))
    assert stepper.go_to(2).attempts == 2
    assert not answers


def test_thicker_skin_that_brings_cloth_back_into_the_body_ends_the_attempts(cap, monkeypatch):
    """Only the skin as posed is still in the way after the first attempt; a thicker skin makes it worse."""
    still = path(lambda t, x: x, 0.2)
    stepper = FrameStepper(build_cloth(cap.mesh, cap.rest, cloth()), cap, still, cloth(), FollowConfig(), Job())
    one = np.array([[0, 0]], np.int32)
    crossing = [one[:0], one]
    monkeypatch.setattr(frame_module, "intersecting_faces", lambda *_: crossing.pop(0))
    monkeypatch.setattr(stepper.body, "crossing_with_room", lambda *_: one)
    assert stepper.go_to(1).attempts == 2
    assert not crossing


def test_half_the_step_gives_the_same_motion(cap):
    def swung(t, x):
        return shifted(x, 0.03 * (1 - np.cos(2 * np.pi * t / 0.5)), 0.0, 0.0)

    ends = [
        follow(cap, path(swung, 0.5), cloth(), {"substeps": n, "body_step_mm": 1000.0})[0].frames[-1] for n in (1, 2, 4)
    ]
    gaps = [np.sqrt(((a - b) ** 2).sum(axis=1).mean()) for a, b in pairwise(ends)]
    assert max(gaps) < 2e-4  # m; in half a step the ball moves by up to 3 mm


def test_energy_stays_bounded_while_the_body_shakes(cap):
    """What the body gives is lost again by damping: the cloth never has more than some of its body's speed."""
    amplitude, period = 0.005, 0.25  # 3.2 m/s²: friction bears about 6
    top = 2 * np.pi * amplitude / period

    def shaken(t, x):
        return shifted(x, amplitude * np.sin(2 * np.pi * t / period) * smooth(4 * t), 0.0, 0.0)

    _, found = follow(cap, path(shaken, 2.0), cloth())
    mass = 0.2 * 2 * np.pi * (1.04 * RADIUS) ** 2 * 0.5
    energy = [record["kinetic_j"] for record in found["per_frame"]]
    assert max(energy) < 4 * 0.5 * mass * top**2
    assert max(energy[30:]) < 1.5 * max(energy[:30]) + 1e-6
    assert found["frames_crossing_body"] == 0


def test_a_jump_of_ten_centimetres_between_frames_is_survived(cap):
    def jump(t, x):
        return shifted(x, 0.1 * np.clip(FPS * t - 5, 0, 1), 0.0, 0.0)

    motion, found = follow(cap, path(jump, 0.6), cloth())
    assert len(motion.frames) == 19
    assert np.isfinite(motion.frames).all()
    assert found["frames_crossing_body"] == 0 == found["frames_crossing_itself"]


def test_cloth_between_parts_of_the_body_that_close_comes_free_when_they_open(cap):
    """A second ball comes from the side, 20 mm deep into the first at the rim of the cap, and goes away again."""
    one, other = ball(RADIUS, levels=3), ball(RADIUS, levels=3)
    faces = np.vstack([one.faces, other.faces + len(one.vertices)])

    def center(t):
        return np.array([0.24 - 0.07 * (smooth(t / 0.5) - smooth((t - 0.8) / 0.5)), 0.055, 0.0])

    def at(t):
        return np.vstack([one.vertices, other.vertices + center(t)])

    motion, found = follow(cap, BodyPath(at, faces, 46, 1 / FPS), cloth())
    frames = found["per_frame"]
    closed = [k for k, frame in enumerate(frames) if frame["own_crossings"]]
    assert closed[0] > 5
    assert closed[-1] < 40
    assert all(frames[k]["yields_mm"] == 0.0 for k in range(46) if k < closed[0] - 3 or k > closed[-1] + 3)
    assert 5.0 < max(frames[k]["yields_mm"] for k in closed) < 30.0
    assert found["frames_crossing_itself"] == 0
    for k, frame in enumerate(motion.frames):
        deepest = max(RADIUS - np.linalg.norm(frame - c, axis=1).min() for c in (np.zeros(3), center(k / FPS)))
        assert deepest < 1e-3 * (frames[k]["yields_mm"] + 1.0)
    assert [k for k in range(closed[-1] + 2, 46) if frames[k]["body_crossings"] or frames[k]["penetration_mm"]] == []


def test_frames_are_judged_as_ipctk_judges_them(cap):
    def nodding(t, x):
        return shifted(turned(0.5 * np.sin(4 * t), x), 0.05 * np.sin(6 * t), 0.02 * np.sin(9 * t), 0.0)

    moving = path(nodding, 1.0)
    motion, found = follow(cap, moving, cloth())
    for k in range(0, len(motion.frames), 5):
        mesh, body = TriangleMesh(motion.frames[k], motion.faces), TriangleMesh(moving.at(k / FPS), moving.faces)
        assert crosses(mesh, body) == bool(found["per_frame"][k]["body_crossings"])
        assert self_crosses(mesh) == bool(found["per_frame"][k]["self_crossings"])


class Interrupted(Exception):
    pass


def test_an_interrupted_motion_goes_on_from_its_last_frame_to_the_same_end(cap, tmp_path):
    def swung(t, x):
        return shifted(x, 0.1 * smooth(2 * t), 0.0, 0.0)

    whole, found = follow(cap, path(swung, 0.5), cloth())

    def stop(done, text):
        if done > 0.5:
            raise Interrupted

    with pytest.raises(Interrupted):
        follow(cap, path(swung, 0.5), cloth(), None, Job(progress=stop), FrameLog(tmp_path))
    kept = FrameLog(tmp_path)
    assert len(kept.frames) == 9
    job = Job()
    rest, again = follow(cap, path(swung, 0.5), cloth(), None, job, kept)
    assert "9 frames of an interrupted run are kept" in job.notes
    assert_array_equal(rest.frames[:9], whole.frames[:9])
    assert_array_equal(rest.frames, whole.frames)
    assert [r["time_s"] for r in again["per_frame"]] == [r["time_s"] for r in found["per_frame"]]


def test_frames_that_a_crash_left_broken_are_made_again(cap, tmp_path):
    log = FrameLog(tmp_path)
    log.add(cap.mesh.vertices, {"time_s": 0.0}, {"time": 0.0})
    assert len(FrameLog(tmp_path).frames) == 1
    (tmp_path / "frame_000000.npz").write_bytes(b"PK")
    assert FrameLog(tmp_path).frames == []


def test_cloth_that_is_caught_ends_with_its_frame_and_keeps_those_before():
    mesh = ball(1.04 * RADIUS, levels=2)

    def torn(t, x):
        return x * (1.0 + 4.0 * np.clip(FPS * t - 3, 0, 1))

    with pytest.raises(SimulationError, match="caught in frame 4 of 7, at 0.13 s") as caught:
        follow(Garment(mesh, RestShape(mesh.vertices)), path(torn, 0.2), cloth(), {"attempts": 2})
    assert len(caught.value.partial["draped_motion"].frames) == 4
    assert caught.value.partial["motion_audit"]["frames"] == 4


@pytest.mark.parametrize(("times", "overstretched"), [(1.7, 0), (2.2, 1)])
def test_frames_that_stretch_cloth_as_none_can_be_are_told(times, overstretched):
    """A shell drawn over a ball that grows further: its edges are as much longer as the ball is wider."""
    rest, job = ball(1.02 * RADIUS, levels=3), Job()

    def size(t):
        return 1.4 + (times - 1.4) * smooth(t / 0.3)

    start = Garment(TriangleMesh(1.4 * rest.vertices, rest.faces), RestShape(rest.vertices))
    _, found = follow(start, path(lambda t, x: size(t) * x, 0.3), cloth(), None, job)
    true = [size(k / 30) for k in range(10)]
    assert_allclose([1.0 + one["max_stretch"] for one in found["per_frame"]], true, rtol=0.06)
    assert bool(found["frames_overstretched"]) == bool(overstretched)
    told = [line for line in job.warnings if "as none can be" in line]
    assert len(told) == overstretched
    assert all("in 4 frames: 6, 7, 8, 9: it is too small for this motion" in line for line in told)


def test_unknown_settings_are_refused(cap):
    with pytest.raises(ConfigError, match="frames_a_second"):
        follow(cap, path(lambda t, x: x, 0.1), cloth(), {"frames_a_second": 3})


def test_the_file_holds_frames_times_and_faces(cap, tmp_path):
    motion = ClothMotion(np.stack([cap.mesh.vertices] * 3), cap.mesh.faces, 1 / 24)
    write_cloth_motion(tmp_path / "draped_motion.npz", motion)
    with np.load(tmp_path / "draped_motion.npz") as arrays:
        assert arrays["frames"].shape == (3, len(cap.mesh.vertices), 3)
        assert_allclose(arrays["times_s"], [0, 1 / 24, 2 / 24], rtol=1e-15)
        assert_array_equal(arrays["faces"], cap.mesh.faces)
    assert read_cloth_motion(tmp_path / "draped_motion.npz").frame_time == 1 / 24
