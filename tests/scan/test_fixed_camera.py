"""Features of a background that stays, told from those of what turns; made-up places, so that the truth is known."""

from __future__ import annotations

import numpy as np

from vto_pipeline.scan.photos.matching.fixed_camera import moving_matches, still_features

PHOTOS, OBJECT, WALL = 24, 60, 90


def turning(fixed: bool, seed=0):
    """Places (K, 2) and matches: an object that turns by 15 degrees a photo, seen for 75, before a wall."""
    random = np.random.default_rng(seed)
    angle, height = random.uniform(0, 2 * np.pi, OBJECT), random.uniform(100, 500, OBJECT)
    wall = random.uniform([0, 0], [800, 600], (WALL, 2))
    places, seen = {}, {}
    for photo in range(PHOTOS):
        turn = angle + 2 * np.pi * photo / PHOTOS
        on_object = np.stack([400 + 150 * np.sin(turn), height], axis=1)
        shift = 0 if fixed else 60.0 * photo
        places[f"{photo}"] = np.concatenate([on_object, wall + np.array([shift, 0])]) + random.normal(
            0, 0.3, (OBJECT + WALL, 2)
        )
        hidden = (np.abs(wall[:, 0] - 400) < 150) & (np.abs(wall[:, 1] - 300) < 200)
        seen[f"{photo}"] = np.concatenate([np.cos(turn) > np.cos(np.radians(37)), ~hidden])
    matches = {}
    for one in range(PHOTOS):
        for other in range(one + 1, PHOTOS):
            both = np.flatnonzero(seen[f"{one}"] & seen[f"{other}"])
            matches[f"{one}", f"{other}"] = np.stack([both, both], axis=1).astype(np.uint32)
    return places, matches


def test_the_wall_behind_a_turntable_is_found_and_the_object_is_not():
    places, matches = turning(fixed=True)
    found = still_features(places, matches, 800)
    assert found.fixed_camera
    used = {name: np.zeros(OBJECT + WALL, bool) for name in places}
    for (one, other), rows in matches.items():
        used[one][rows[:, 0]] = used[other][rows[:, 1]] = True
    for name, still in found.still.items():
        assert still[OBJECT:][used[name][OBJECT:]].all()
        assert not still[:OBJECT].any()
    left = moving_matches(matches, found.still)
    assert set(left) == set(matches)
    for pair, rows in left.items():
        assert (rows < OBJECT).all()
        assert len(rows) == (matches[pair] < OBJECT).all(axis=1).sum()


def test_a_camera_that_moves_is_not_called_fixed():
    places, matches = turning(fixed=False)
    found = still_features(places, matches, 800)
    assert not found.fixed_camera
    assert found.share == 0.0
