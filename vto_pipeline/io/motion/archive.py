"""The motion of an avatar as an archive, motion.npz."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.model.motion import CONTACTS, AvatarMotion

_ARRAYS = ("poses", "translations", "planted")


def write_avatar_motion(path: Path, motion: AvatarMotion) -> None:
    """Write a motion as an archive of plain arrays; `contacts` names the columns of `planted`."""
    write_arrays(
        path,
        {
            **{name: getattr(motion, name) for name in _ARRAYS},
            "joint_names": np.array(motion.joint_names, dtype=np.str_),
            "contacts": np.array(CONTACTS, dtype=np.str_),
            "frame_time_s": np.float64(motion.frame_time),
        },
    )


def read_avatar_motion(path: Path) -> AvatarMotion:
    """Read what `write_avatar_motion` wrote.

    Raises:
        InputError: no such file; FormatError: no motion of an avatar.
    """
    arrays = read_arrays(path, required=(*_ARRAYS, "joint_names", "frame_time_s"))
    try:
        return AvatarMotion(
            tuple(map(str, arrays["joint_names"])),
            arrays["poses"],
            arrays["translations"],
            arrays["planted"],
            float(arrays["frame_time_s"]),
        )
    except (InputError, TypeError, ValueError) as e:
        raise FormatError(f"not the motion of an avatar: {e}", where=str(path)) from None
