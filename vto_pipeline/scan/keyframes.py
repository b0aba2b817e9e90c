"""Photos from a video: the sharpest frame of each stretch of motion."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.video import extract_frames, measure_frames
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.frames import PhotoSet, Video
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_LEAST = 3  # photos that a reconstruction needs


class KeyframesConfig(Config):
    """Settings of the choice of frames."""

    most: int = Field(60, ge=3, le=1000, description="Frames taken at most")
    step: float = Field(
        0.03, gt=0, le=1, description="Motion from one to the next, at least [share of the picture's diagonal]"
    )


def take_keyframes(video: Video, config: KeyframesConfig, job: Job) -> PhotoSet:
    """Return the frames of a video that serve as photos, in the job's scratch folder.

    Args:
        video: The video.
        config: Settings.
        job: Receives how many frames there are, and which were taken.

    Raises:
        ScanError: the camera hardly moves.
        FormatError: the video cannot be decoded.
    """
    if job.scratch is None:
        raise ValueError("frames need a folder to lie in: the job has no scratch")
    job.progress(0.0, "measuring the frames of the video")
    sharpness, motion = measure_frames(video)
    chosen = choose_keyframes(sharpness, motion, config)
    if len(chosen) < _LEAST:
        problem = f"the picture moves by {motion.sum():.2f} of its diagonal in {len(motion)} frames"
        hint = "walk all the way round the object; a turntable has to turn"
        raise ScanError(f"{problem}: too little for {_LEAST} photos", where=str(video.path), hint=hint)
    job.progress(0.6, f"taking {len(chosen)} frames")
    paths = extract_frames(video, chosen.tolist(), job.scratch)
    job.measure(
        frames=len(motion),
        keyframes=len(chosen),
        motion_diagonals=round(float(motion.sum()), 3),
        sharpness_of_chosen=round(float(np.median(sharpness[chosen]) / max(np.median(sharpness), 1e-12)), 3),
    )
    job.note(f"{len(chosen)} of {len(motion)} frames taken, the sharpest of each stretch of motion")
    return PhotoSet(paths, (None,) * len(paths), video.board)


def choose_keyframes(sharpness: FloatArray, motion: FloatArray, config: KeyframesConfig) -> IntArray:
    """Return the indices of the frames to take, ascending.

    The whole motion is divided into equal stretches, and the sharpest frame of each is taken: a camera that rests gives
    one frame, and a blurred one is taken only where there is no better.

    Args:
        sharpness, motion: As `measure_frames` gives them, shape (N,).
        config: Settings.
    """
    travelled = np.cumsum(motion)
    count = min(int(travelled[-1] / config.step), config.most) if len(motion) else 0
    if count < 1:
        return np.zeros(0, dtype=np.int32)
    stretch = np.minimum((travelled / travelled[-1] * count).astype(np.int64), count - 1)
    order = np.lexsort((np.arange(len(motion)), -sharpness, stretch))  # the earlier of two that are alike
    first = np.unique(stretch[order], return_index=True)[1]
    return np.sort(order[first]).astype(np.int32)
