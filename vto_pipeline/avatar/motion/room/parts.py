"""Which parts of an avatar are kept off which others: the trunk off the legs, a leg off the other, arms off all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.motion.room.apart import Apart, Part, spread
from vto_pipeline.model.body import Avatar

_SIDES = ("left", "right")
_ARM = ("shoulder", "elbow", "wrist")
_LEG = ("hip", "knee", "ankle")
_CORE = ("pelvis", "spine", "chest", "neck", "head")
_ROOM_M = 0.015
_BARELY_M = 0.005  # between parts that no sleeve hangs between
_ARMPIT_M = 0.07  # from the shoulder: so far, skin and cloth are pressed between arm and trunk in everyone
_HAND_M = 0.025  # between the places of a hand that are looked at: fingers are thin
_RIGID = 0.95  # share of the weights of one bone from which on a place of an arm goes with that bone
_BLENDS = 0.2  # share of a limb's weights from which on a place of another part is armpit, shoulder or groin


class Arms(Apart):
    """Arms, left and right, that are kept off trunk, head and legs, with the room that a sleeve needs.

    Args:
        avatar: Any of our bodies.
    """

    def __init__(self, avatar: Avatar) -> None:
        chains = [_named(avatar, side, _ARM) for side in _SIDES]
        shoulders = _named(avatar, "left", ("clavicle", *_ARM)) + _named(avatar, "right", ("clavicle", *_ARM))
        legs = _named(avatar, "left", _LEG) + _named(avatar, "right", _LEG)
        others = _owned(avatar, [*map(avatar.joint_names.index, _CORE), *legs])
        others &= avatar.weights[:, shoulders].sum(axis=1) < _BLENDS
        body = spread(np.flatnonzero(others), avatar.bind_vertices)
        parts = []
        for chain in chains:
            own = _owned(avatar, chain) & (avatar.weights.max(axis=1) >= _RIGID)
            own &= np.linalg.norm(avatar.bind_vertices - avatar.joints[chain[0]], axis=1) > _ARMPIT_M
            hand = _owned(avatar, chain[-1:])
            thick, thin = np.flatnonzero(own & ~hand), np.flatnonzero(own & hand)
            places = spread(thick, avatar.bind_vertices), spread(thin, avatar.bind_vertices, _HAND_M)
            parts.append(Part(chain[0], tuple(chain), np.concatenate(places), body, _ROOM_M))
        super().__init__(avatar, parts)


class Legs(Apart):
    """Shanks and feet, left and right, each kept off the other leg and the seat.

    Args:
        avatar: Any of our bodies.
    """

    def __init__(self, avatar: Avatar) -> None:
        chains = [_named(avatar, side, _LEG) for side in _SIDES]
        parts = []
        for (hip, *below), other in zip(chains, chains[::-1], strict=True):
            others = _owned(avatar, [avatar.joint_names.index("pelvis"), *other])
            surface = spread(np.flatnonzero(others), avatar.bind_vertices)
            places = spread(np.flatnonzero(_owned(avatar, below)), avatar.bind_vertices)
            parts.append(Part(hip, (hip, *below), places, surface, _BARELY_M))
        super().__init__(avatar, parts)


class Trunk(Apart):
    """The trunk above the waist, that is kept off the legs.

    Args:
        avatar: Any of our bodies.
    """

    def __init__(self, avatar: Avatar) -> None:
        spine = avatar.joint_names.index("spine")
        above = [j for j in range(len(avatar.joints)) if spine in _up(avatar, j)]
        legs = [j for side in _SIDES for j in _named(avatar, side, _LEG)]
        thighs = _owned(avatar, legs) & (avatar.weights[:, legs].sum(axis=1) > 1.0 - _BLENDS)
        surface = spread(np.flatnonzero(thighs), avatar.bind_vertices)
        chest = [j for j in above if j != spine and not avatar.joint_names[j].endswith(_ARM)]
        places = spread(np.flatnonzero(_owned(avatar, chest)), avatar.bind_vertices)
        super().__init__(avatar, [Part(spine, tuple(above), places, surface, _BARELY_M)])


def _named(avatar: Avatar, side: str, parts: Sequence[str]) -> list[int]:
    return [avatar.joint_names.index(f"{side}_{part}") for part in parts]


def _owned(avatar: Avatar, joints: Sequence[int]) -> NDArray[np.bool_]:
    """Return which vertices move with these joints more than with any other, shape (V,)."""
    owned: NDArray[np.bool_] = np.isin(avatar.weights.argmax(axis=1), joints)
    return owned


def _up(avatar: Avatar, joint: int) -> list[int]:
    """Return a joint and those above it."""
    chain = [joint]
    while avatar.parents[chain[-1]] >= 0:
        chain.append(int(avatar.parents[chain[-1]]))
    return chain
