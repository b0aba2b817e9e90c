"""Skinned bodies from other software: SMPL-family archives, MakeHuman folders, glTF with a skin."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.formats.clean_up import check_sound
from vto_pipeline.io.lengths import to_metres
from vto_pipeline.io.meshes import parse
from vto_pipeline.model.body import SkinnedBody
from vto_pipeline.model.job import Job


def read_skinned(path: Path, *, unit: str | None = None, job: Job | None = None) -> SkinnedBody:
    """Read a body and its skeleton at rest.

    Args:
        path: An .npz archive of the SMPL family, a folder with MakeHuman's base.obj, rig and weights, or glTF with one
            skin.
        unit: Unit of length in the file, a key of `units.LENGTH_M`; None: guessed from the size.
        job: Notified of the guessed unit.

    Returns:
        The body [m]; the axes are the file's.

    Raises:
        InputError: no such file, or no unit fits; FormatError: it breaks its format, or has no skeleton.
    """
    path = Path(path)
    arrays = parse(path)
    if "weights" not in arrays:
        problem = "a mesh without a skeleton; expected one skin that covers every part"
        raise FormatError(problem, where=str(path), hint="read it as a mesh")
    check_sound(arrays, path)
    both = to_metres(np.concatenate([arrays["vertices"], arrays["joints"]]), unit, path, job)
    count = len(arrays["vertices"])
    try:
        return SkinnedBody(
            both[:count],
            arrays["faces"],
            tuple(map(str, arrays["joint_names"])),
            both[count:],
            arrays["parents"],
            arrays["weights"],
        )
    except InputError as e:
        raise FormatError(e.problem, where=str(path), hint=e.hint) from None
