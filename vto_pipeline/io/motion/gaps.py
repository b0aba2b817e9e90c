"""Lost frames: filled from their neighbours, and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import FloatArray

_MOST_LOST = 0.5
"""Share of lost frames above which a clip is refused."""
_LONG_S = 0.25
"""A longer gap is named: a step takes twice as long."""


def fill_gaps(
    rotations: FloatArray, translations: FloatArray, lost: NDArray[np.bool_], frame_time: float, path: Path
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Replace lost frames: turns by slerp, places in straight lines; at the ends the nearest frame stands.

    Args:
        rotations: Unit quaternions, anything where lost, shape (T, J, 4).
        translations: Shape (T, J, 3).
        lost: Shape (T,).
        frame_time: [s].
        path: The file, for messages.

    Returns:
        Rotations, translations, and warnings.

    Raises:
        FormatError: more than half of the frames are lost.
    """
    if not lost.any():
        return rotations, translations, []
    frames, kept = np.arange(len(lost)), np.flatnonzero(~lost)
    if len(kept) < (1.0 - _MOST_LOST) * len(lost) or len(kept) == 0:
        problem = f"{int(lost.sum())} of {len(lost)} frames are lost: not finite, or not whole"
        raise FormatError(problem, where=str(path), hint="export the motion again")
    rotations, translations = rotations.copy(), translations.copy()
    times = np.clip(frames[lost], kept[0], kept[-1])
    for j in range(rotations.shape[1]):
        if len(kept) > 1:
            rotations[lost, j] = Slerp(kept, Rotation.from_quat(rotations[kept, j]))(times).as_quat()
        else:
            rotations[lost, j] = rotations[kept[0], j]
        for k in range(3):
            translations[lost, j, k] = np.interp(times, kept, translations[kept, j, k])
    edges = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    warnings = [f"{int(lost.sum())} lost frames are filled from their neighbours"]
    longest = int(np.argmax(ends - begins))
    seconds = float(ends[longest] - begins[longest]) * frame_time
    if seconds > _LONG_S:
        warnings.append(f"a gap of {seconds:.2f} s from frame {begins[longest]}: what happens in it is a guess")
    return rotations, translations, warnings
