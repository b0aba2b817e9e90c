"""What the fuzzer feeds: every reader of files from outside, with sound files to damage. For the child process.

The readers are called in the process itself, without the sandbox that surrounds them in earnest, so that whatever they
raise is seen.
"""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_captures import CAPTURES, sound_capture
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from io_shapes import write_all_formats
from motion_targets import MOTIONS, write_smpl
from pattern_targets import PATTERNS
from test_fabric_sheets import FAST, KES_CSV
from test_fabric_u3m import raw_data
from test_fuzz_readers import MESHES, OTHERS, read_one, write_others

from vto_pipeline.errors import VtoError
from vto_pipeline.io.arrays import Arrays, read_arrays, write_arrays
from vto_pipeline.io.bodies.measurements import read_measurements
from vto_pipeline.io.captures.cameras import read_trajectory
from vto_pipeline.io.documents import load_yaml, read_json
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.pipeline.batch.order import read_order

TAPE = Path(__file__).parents[2] / "sample_data" / "customer" / "measurements.yaml"
MATERIAL = {"schema": "1.1", "material": {"name": "a", "front": None, "physics": {"thickness": 0.25, "weight": 104.0}}}
TEXTS: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "document": ("a.yaml", "schema: 1\ngiven: {left: &x [1, 2], right: *x}\nwant: [page]\n", load_yaml),
    "json": ("a.json", json.dumps({"schema": 1, "rows": [1.5, None, "a"], "more": {"b": True}}), read_json),
    "tape": (
        "a.yaml",
        TAPE.read_text(),
        read_measurements,
    ),
    "fabric": (
        "a.yaml",
        "name: poplin\nareal_density_gsm: 120\nthickness_mm: 0.3\nmembrane: {warp: 1500, weft: 1200, shear: 60}\n"
        "bending: {warp: 1.1e-5, weft: 0.9e-5, hysteresis: 1.0e-3}\nfriction: 0.3\nsource: me\n",
        read_fabric,
    ),
    "fabric_fast": ("a.yaml", FAST, read_fabric),
    "fabric_kes": ("a.csv", KES_CSV, read_fabric),
    "fabric_u3m": ("a.u3m", json.dumps(MATERIAL), read_fabric),
    "fabric_curves": ("a.json", json.dumps(raw_data()), read_fabric),
    "batch": (
        "a.yaml",
        "schema: 1\nrun: {schema: 1, given: {left: {number: l.txt}}, want: [total]}\n"
        "rows: [{name: a, seed: 1}]\nevery: {seed: [1, 2]}\n",
        read_order,
    ),
    **PATTERNS,
    **MOTIONS,
    "table": ("t.csv", "name,seed,stages.add.offset\na,1,2\nb,2,\n", lambda path: read_order(_order_beside(path))),
}
TARGETS = [
    *MESHES,
    *(name for name in OTHERS if name != "a.laz"),
    *TEXTS,
    "arrays",
    "arrays_packed",
    "trajectory",
    "motion_smpl",
    *CAPTURES,
]
WORDS = (
    b"\x00",
    b"\xff",
    b"-1",
    b"99999999999",
    b"nan",
    b"1e999",
    b"../",
    b"&a [*a]",
    b"!!python/x ",
    b"{",
    b"\n",
    b'"',
)
WORDS = (
    *WORDS,
    b"7",
    b"0",
    b"a",
    b" ",
    b".5",
    b"e3",
    b": ",
    b",",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\x00\x80",
    b"\x1f\x8b",
    b"PK\x03\x04",
    b"%",
    b"\xe2\x80\xae",
)


def _order_beside(table: Path) -> Path:
    path = table.with_name("order.yaml")
    path.write_text(f"schema: 1\nrun: {{schema: 1, given: {{}}, want: [total]}}\nrows: {table.name}\n")
    return path


def sound_file(target: str, folder: Path) -> tuple[Path, Callable[[Path], Any]]:
    """Return a sound file of a target, and its reader."""
    if target in TEXTS:
        name, text, read = TEXTS[target]
        (folder / name).write_text(text)
        return folder / name, read
    if target in CAPTURES:
        return sound_capture(target, folder)
    if target in ("arrays", "arrays_packed"):
        arrays = {"vertices": np.eye(3), "faces": np.arange(3)}
        write_arrays(folder / "a.npz", arrays, compress=target == "arrays_packed")
        return folder / "a.npz", read_arrays
    if target == "motion_smpl":
        return write_smpl(folder / "a.npz")
    if target == "trajectory":
        (folder / "a.json").write_text(json.dumps({"world_from_cam": [np.eye(4).tolist()] * 2}))
        return folder / "a.json", read_trajectory
    return (write_all_formats(folder) if target in MESHES else write_others(folder))[target], read_one


def edits() -> st.SearchStrategy[list[tuple[int, int, int, bytes]]]:
    """Edits of bytes: what is done, where as a share of the file in 1/65536, over how many bytes, with what."""
    payload = st.one_of(st.sampled_from(WORDS), st.binary(min_size=1, max_size=8))
    return st.lists(
        st.tuples(st.sampled_from((0, 0, 0, 1, 2, 3)), st.integers(0, 65535), st.integers(1, 64), payload),
        min_size=1,
        max_size=4,
    )


def edited(data: bytes, changes: list[tuple[int, int, int, bytes]]) -> bytes:
    """Return the bytes overwritten, with something put in, taken out, or cut off; a third of all edits in the head."""
    for kind, share, length, payload in changes:
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


def fuzz(target: str, count: int, seed: int) -> Arrays:
    """In the child: read damaged copies of a target's sound file.

    Returns:
        executions, refused: how many there were; finding: the bytes that made the reader raise what is not refusal.
    """
    warnings.simplefilter("ignore")
    done = {"executions": 0, "refused": 0}
    finding: list[bytes] = []
    with tempfile.TemporaryDirectory() as name:
        path, read = sound_file(target, Path(name))
        data = path.read_bytes()
        read(path)

        @settings(
            max_examples=count,
            database=None,
            deadline=None,
            suppress_health_check=list(HealthCheck),
            phases=[Phase.generate, Phase.shrink],
        )
        @given(edits())
        def try_one(changes: list[tuple[int, int, int, bytes]]) -> None:
            damaged = edited(data, changes)
            path.write_bytes(damaged)
            done["executions"] += 1
            try:
                read(path)
            except VtoError:
                done["refused"] += 1
            except Exception:
                finding[:] = [damaged]  # the last that is left is the smallest
                raise

        from hypothesis import seed as seeded

        problem = ""
        try:
            seeded(seed)(try_one)()
        except Exception as error:
            problem = f"{type(error).__name__}: {error}"
    found = np.frombuffer(finding[0] if finding else b"", np.uint8)
    said = np.frombuffer(problem.encode()[:2000], np.uint8)
    return {**{key: np.array(value) for key, value in done.items()}, "finding": found, "problem": said}
