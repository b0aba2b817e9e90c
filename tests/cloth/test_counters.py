"""What is left out of keeping cloth apart changes nothing, and is counted."""

from unittest.mock import patch

import numpy as np
import pytest
from cloth_scenes import moved, sheet
from numpy.testing import assert_array_equal
from test_self_contact import crosses, stack, triangles

from vto_pipeline.cloth.collision.self_collision import self_contact
from vto_pipeline.cloth.collision.self_collision.counters import CollisionCounters, report_counters
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.model.job import Job


def two_ways(seed):
    """Triangles, a move on which none meet, and the same but for some that pass through others."""
    x, faces = triangles(30, seed)
    free = x + np.array([0.3, 0.0, 0.0])
    other = free.copy()
    middle = x.reshape(-1, 3, 3).mean(axis=1)
    other[:30] += np.repeat(middle[10:20] - middle[:10], 3, axis=0)  # each of ten to the middle of another
    assert crosses(other, faces)
    return x, faces, free, other


@pytest.mark.parametrize("seed", range(4))
def test_of_a_move_that_was_found_free_only_what_changes_is_looked_at_again(seed):
    x, faces, free, other = two_ways(seed)
    reach = np.full(len(x), 1e-3)
    knows, asks, forced = (SelfContact(faces, reach, 0.3, force_all=every) for every in (False, False, True))
    assert_array_equal(knows.collision_free(x, free)[0], free)
    assert knows.counters.impacts_known == 0
    for contact in (knows, forced):
        found, pairs = contact.collision_free(x, other)
        there, met = asks.collision_free(x, other)
        assert_array_equal(found, there)
        assert_array_equal(pairs.key, met.key)
        asks.set_time_span(0.0, 1.0)
    assert knows.counters.impacts_known > 0
    assert forced.counters.impacts_known == 0 == asks.counters.impacts_known


def test_the_same_move_is_not_looked_at_twice_in_a_step_but_in_the_next_and_from_elsewhere():
    x, faces = triangles(40, 2)
    contact = SelfContact(faces, np.full(len(x), 0.02), 0.3)
    end = x.copy()
    contact.collision_free(x, end)
    looked = contact.counters.impacts
    assert looked > 0
    end += 0.0  # the caller's own, which it may write to
    found, met = contact.collision_free(x, end)
    assert_array_equal(found, x)
    assert len(met.key) == 0
    assert (contact.counters.impacts, contact.counters.impacts_known) == (looked, looked)
    contact.collision_free(x + np.array([0.0, 1e-4, 0.0]), end)
    assert contact.counters.impacts >= 2 * looked
    looked = contact.counters.impacts
    contact.set_time_span(0.0, 1.0)
    contact.collision_free(x + np.array([0.0, 1e-4, 0.0]), end)
    assert contact.counters.impacts > looked


def test_what_the_caller_does_to_its_positions_is_not_taken_for_free():
    x, faces, free, other = two_ways(0)
    contact = SelfContact(faces, np.full(len(x), 1e-3), 0.3)
    end = free.copy()
    contact.collision_free(x, end)
    end[:] = other
    assert not crosses(contact.collision_free(x, end)[0], faces)


def test_what_cannot_be_proven_at_first_but_later_is_not_looked_at():
    """Where all would fall but two pinned corners, faces there would be crushed; in fact they hardly move."""
    mesh = sheet(17, 17, 0.4, 0.4)
    x, contact = mesh.vertices, SelfContact(mesh.faces, np.full(289, 1e-3), 0.3)
    for _ in range(30):
        falls = x - np.array([0.0, 0.05, 0.0])
        falls[[0, 16]] = x[[0, 16]]
        assert len(contact.find_pairs(x, falls, 1.0 / 15.0).key) == 0
        x = x + 1e-4 * np.sin(np.arange(289))[:, None]
        contact.collision_free(x, x + 1e-4)
    assert contact.counters.searched == 1
    assert contact.counters.out_of_reach == 30
    assert contact.counters.impacts == contact.counters.impacts_known == 0


def test_proofs_that_fail_are_seldom_tried():
    mesh = stack(*(moved(sheet(9, 9, 0.1, 0.1, upright=False), 0.0, 0.0, 3e-3 * k) for k in range(2)))
    contact = SelfContact(mesh.faces, np.full(162, 2e-3), 0.3)
    with patch.object(self_contact, "prove_separation", wraps=self_contact.prove_separation) as tried:
        for _ in range(100):
            contact.find_pairs(mesh.vertices, mesh.vertices, 1.0 / 60.0)
    assert contact.counters.searched == 1
    assert tried.call_count < 20


def test_what_hardly_moves_is_searched_once_and_held_as_if_always():
    mesh = stack(*(moved(sheet(9, 9, 0.1, 0.1, upright=False), 0.0, 4e-4 * k, 3e-3 * k) for k in range(3)))
    reach = np.full(len(mesh.vertices), 3e-4)
    sleepy, forced = (SelfContact(mesh.faces, reach, 0.3, force_all=every) for every in (False, True))
    rng, x = np.random.default_rng(3), mesh.vertices
    for _ in range(40):
        x = x + rng.uniform(-1e-6, 1e-6, x.shape)
        end = x + rng.uniform(-1e-7, 1e-7, x.shape)
        pairs = [contact.find_pairs(x, end, 1.0 / 60.0) for contact in (sleepy, forced)]
        assert len(pairs[0].key) > 100
        for one, other in zip(*pairs, strict=True):
            assert_array_equal(one, other)
    assert sleepy.counters.searched == 1
    assert sleepy.counters.rested == sleepy.counters.reused == 39
    assert forced.counters.searched == 40
    x[0] += [0.0, 2e-4, 0.0]  # one leaves the room it was looked for in
    sleepy.find_pairs(x, x, 1.0 / 60.0)
    assert sleepy.counters.searched == 2


def test_times_saved_are_those_of_what_was_done_times_what_was_not():
    job = Job()
    one = CollisionCounters(asked=10, out_of_reach=2, reused=4, searched=4, rested=1, search_s=2.0)
    other = CollisionCounters(body_asked=6, body_searched=2, body_s=1.0, impacts=100, impacts_known=50, impact_s=4.0)
    report_counters([one, other], [], job)
    assert job.metrics["self_searches_left_out"] == 6
    assert job.metrics["self_searches_saved_s"] == 3.0
    assert (job.metrics["body_searches_left_out"], job.metrics["body_searches_saved_s"]) == (4, 2.0)
    assert (job.metrics["impacts_left_out"], job.metrics["impacts_saved_s"]) == (50, 2.0)
    assert "60% of 10 queries needed none" in dict(job.left_out)["self-collision search"]


def test_nothing_asked_is_nothing_told():
    job = Job()
    report_counters([CollisionCounters()], [], job)
    assert job.metrics == {}
    assert job.left_out == []
