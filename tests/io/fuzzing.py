"""The fuzzer: damages a sound file again and again, and reads it each time. For the child process.

What a reader may do is read, or refuse. The bytes that make it raise anything else are kept. Where it ends the process,
or hangs, the bytes stay where they were read.
"""

from __future__ import annotations

import random
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_targets import ROOMS, SLOW, sound_file

from vto_pipeline.errors import VtoError
from vto_pipeline.io.arrays import Arrays

Edit = tuple[int, int, int, bytes]
"""What is done, where as a share of the file in 1/65536, over how many bytes, with what."""

Reader = Callable[[Path], Any]
SECONDS_EACH = 20.0  # a reading that takes longer hangs; the slowest takes 0.2 s
LAST, FOUND = "last", "found"  # a link to the file that was read last; a folder
WORDS = tuple(
    b'\x00|\xff|-1|99999999999|nan|1e999|../|&a [*a]|!!python/x |{|\n|"|7|0|a| |.5|e3|: |,|\xff\xff\xff\xff'
    b"|\xff\xff\xff\x7f|\x00\x00\x00\x80|\x1f\x8b|PK\x03\x04|%|\xe2\x80\xae".split(b"|")
)


def some_edits(rng: random.Random) -> list[Edit]:
    """Draw one to four edits; every second time a word puts bytes in that mean something in some format."""

    def one() -> Edit:
        payload = rng.choice(WORDS) if rng.random() < 0.5 else rng.randbytes(rng.randint(1, 8))
        return rng.choice((0, 0, 0, 1, 2, 3)), rng.randrange(65536), rng.randint(1, 64), payload

    return [one() for _ in range(rng.randint(1, 4))]


def edited(data: bytes, edits: list[Edit]) -> bytes:
    """Return the bytes overwritten, with something put in, taken out, or cut off; a third of all edits in the head."""
    for kind, share, length, payload in edits:
        reach = min(len(data), 400) if share % 3 == 0 else len(data)
        at = share * reach // 65536
        if kind == 0:
            data = data[:at] + payload + data[at + len(payload) :]
        elif kind == 1:
            data = data[:at] + payload + data[at:]
        elif kind == 2:
            data = data[:at] + data[at + length :]
        elif length > 48:
            data = data[:at]
        else:
            data = data[:at] + data[at : at + length] * 2 + data[at + length :]
    return data


def refuses(read: Reader, path: Path, data: bytes) -> bool:
    """Read these bytes; whatever is raised that is no refusal comes through, and a hang ends the process."""
    path.write_bytes(data)
    signal.setitimer(signal.ITIMER_REAL, SECONDS_EACH)
    try:
        read(path)
    except VtoError:
        return True
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return False


def fails(read: Reader, path: Path, data: bytes) -> bool:
    """Whether these bytes make the reader raise what is no refusal."""
    try:
        refuses(read, path, data)
    except BaseException:
        return True
    return False


def keep(error: BaseException, data: bytes, path: Path, folder: str) -> None:
    """Keep the bytes of a finding, one for each place that raises."""
    at = traceback.extract_tb(error.__traceback__)[-1]
    target = path.relative_to(folder).parts[0]
    kept = Path(folder, FOUND, f"{target}-{type(error).__name__}-{Path(at.filename).stem}-{at.lineno}")
    kept.parent.mkdir(exist_ok=True)
    kept.write_bytes(data)


def fuzz_reader(path: Path, read: Reader, count: int, seed: int, folder: str) -> Arrays:
    """Read damaged copies of a sound file. What is raised that is no refusal is kept, with the fewest edits that do it.

    Returns:
        executions, refused: how many there were; seconds: how long they took [s].
    """
    last = Path(folder, LAST)
    last.unlink(missing_ok=True)
    last.symlink_to(path)
    rng = random.Random(seed)
    sound = path.read_bytes()
    read(path)
    refused, began = 0, time.perf_counter()
    for _ in range(count):
        edits = some_edits(rng)
        try:
            refused += refuses(read, path, edited(sound, edits))
        except BaseException as error:
            for edit in list(edits):
                fewer = [other for other in edits if other is not edit]
                if fails(read, path, edited(sound, fewer)):
                    edits = fewer
            keep(error, edited(sound, edits), path, folder)
    seconds = time.perf_counter() - began
    return {"executions": np.array(count), "refused": np.array(refused), "seconds": np.array(seconds)}


def fuzz_room(room: str, count: int, seed: int, folder: str) -> Arrays:
    """In the child: fuzz the readers of a room, slow ones less often. What was read last stays in the folder.

    Returns:
        As `fuzz_reader`, of each of them.
    """
    warnings.simplefilter("ignore")
    said = []
    for target in ROOMS[room]:
        place = Path(folder, target)
        place.mkdir()
        path, read = sound_file(target, place)
        said.append(fuzz_reader(path, read, max(count // SLOW.get(target, 1), 1), seed, folder))
    return {key: np.array([one[key] for one in said]) for key in said[0]}
