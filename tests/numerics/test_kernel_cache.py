"""Where compiled kernels are kept: by their sources, and never where the user said otherwise."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from types import FunctionType

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

from vto_pipeline.numerics import kernel_cache

KERNEL = "from numba import njit\n\n@njit(cache=True)\ndef one():\n    return {}\n"
CALLER = (
    "from numba import njit\nfrom toy.numerics.part import one\n\n@njit(cache=True)\ndef two():\n    return 2 * one()\n"
)


@pytest.fixture
def toy(tmp_path):
    """A package with this module, one kernel, and one that calls it from another file."""
    room = tmp_path / "toy" / "numerics"
    room.mkdir(parents=True)
    shutil.copy(kernel_cache.__file__, room)
    (tmp_path / "toy" / "__init__.py").touch()
    (room / "__init__.py").write_text("from toy.numerics.kernel_cache import use_kernel_cache\n\nuse_kernel_cache()\n")
    (room / "part.py").write_text(KERNEL.format(1))
    (room / "whole.py").write_text(CALLER)
    (room / "notes.py").write_text("TEXT = 1\n")
    return tmp_path


def run(toy, **variables):
    """Run the outer kernel in a fresh process; return its value and Numba's folder."""
    code = "from toy.numerics.whole import two; import numba; print(two(), numba.config.CACHE_DIR)"
    clean = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment = {**clean, "PYTHONPATH": str(toy), "PYTHONDONTWRITEBYTECODE": "1", **variables}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    value, folder = done.stdout.split()
    return int(value), Path(folder)


def kept(toy):
    return sorted((toy / "toy" / "__pycache__").glob("kernels-*"))


def test_a_changed_kernel_is_never_run_as_it_was(toy):
    value, first = run(toy)
    assert value == 2
    assert list(first.rglob("*.nbc"))  # something is kept
    (toy / "toy" / "numerics" / "part.py").write_text(KERNEL.format(5))
    value, second = run(toy)
    assert value == 10  # by Numba's own rule, two() would be as old as its own file
    assert first != second
    assert kept(toy) == [second]  # the old one is gone


def test_what_is_no_kernel_changes_nothing(toy):
    _, first = run(toy)
    stamps = {path: path.stat().st_mtime_ns for path in first.rglob("*.nbc")}
    (toy / "toy" / "numerics" / "notes.py").write_text("TEXT = 2\n")
    _, second = run(toy)
    assert first == second
    assert stamps == {path: path.stat().st_mtime_ns for path in second.rglob("*.nbc")}  # nor is it compiled again


def test_the_users_folder_is_respected(toy, tmp_path):
    value, folder = run(toy, NUMBA_CACHE_DIR=str(tmp_path / "mine"))
    assert (value, folder) == (2, tmp_path / "mine")
    assert list(folder.rglob("*.nbc"))
    assert not kept(toy)


def test_a_name_moved_to_another_file_counts(toy):
    _, first = run(toy)
    room = toy / "toy" / "numerics"
    (room / "part.py").rename(room / "piece.py")
    (room / "whole.py").write_text(CALLER.replace("part", "piece"))
    _, second = run(toy)
    assert first != second


def test_a_newer_numba_has_a_folder_of_its_own(monkeypatch, tmp_path):
    room = tmp_path / "numerics"
    room.mkdir()
    (room / "part.py").write_text(KERNEL.format(1))
    monkeypatch.setattr(kernel_cache, "__file__", str(room / "kernel_cache.py"))
    found = []
    for version in ("0.61.0", "0.62.0"):
        monkeypatch.setattr(numba, "__version__", version)
        monkeypatch.setattr(numba.config, "CACHE_DIR", "")
        kernel_cache.use_kernel_cache()
        found.append(numba.config.CACHE_DIR)
    assert found[0] != found[1]


class MeetingFile(IndexDataCacheFile):
    """A cache file that waits for another between choosing a name and telling others which."""

    meeting: threading.Barrier

    def _save_index(self, overloads):
        with suppress(threading.BrokenBarrierError):
            self.meeting.wait()
        super()._save_index(overloads)


class NumbasOwn(MeetingFile):
    """As it was before `serialise_cache_writes`."""

    save = IndexDataCacheFile.save.__wrapped__


@pytest.mark.parametrize(("kind", "patience", "safe"), [(NumbasOwn, 60.0, False), (MeetingFile, 0.2, True)])
def test_two_that_compile_at_the_same_time_never_load_each_others_code(tmp_path, kind, patience, safe):
    """The first case shows that Numba alone does not see to it; once it does, `serialise_cache_writes` may go.

    There both meet, however late the second is. Where one waits for the other to have written, they cannot.
    """
    files = [kind(str(tmp_path), "kernel", "stamp") for _ in range(2)]
    meeting = threading.Barrier(2, timeout=patience)
    for file in files:
        file.meeting = meeting
    threads = [threading.Thread(target=file.save, args=(k, f"code {k}")) for k, file in enumerate(files)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert meeting.broken is safe
    assert all(files[0].load(k) == f"code {k}" for k in (0, 1)) is safe


# Whoever compiles it waits for another to compile it, too.
MEETING = """
import os, time
from pathlib import Path
from numba import njit
from numba.extending import overload

HERE = Path(__file__).parent

def one():
    raise NotImplementedError

@overload(one)
def _one():
    (HERE / f"{os.getpid()}.compiles").touch()
    until = time.monotonic() + float(os.environ["PATIENCE"])
    while len(list(HERE.glob("*.compiles"))) < 2 and time.monotonic() < until:
        time.sleep(0.01)
    return lambda: 1

@njit(cache=True)
def two():
    return 2 * one()

@njit(cache=True)
def four():
    return two() + two()
"""
TOGETHER = """
import sys
from toy.numerics.meeting import four, two
print("ready", flush=True)
sys.stdin.readline()
print({"two": two, "four": four}[sys.argv[1]](), flush=True)
"""


@pytest.mark.parametrize(("turns", "patience", "compile"), [(False, 60, 2), (True, 2, 1)])
@pytest.mark.parametrize("kernels", [("two", "two"), ("four", "two"), ("four", "four")])
def test_two_that_need_a_kernel_at_the_same_time_compile_it_once(toy, kernels, turns, patience, compile):
    """The first case shows that Numba alone compiles it twice; once it does not, `take_turns_compiling` may go."""
    room = toy / "toy" / "numerics"
    (room / "meeting.py").write_text(MEETING)
    calls = ["use_kernel_cache", "serialise_cache_writes"] + turns * ["take_turns_compiling"]
    lines = [f"from toy.numerics.kernel_cache import {', '.join(calls)}", *(f"{name}()" for name in calls)]
    (room / "__init__.py").write_text("\n".join(lines) + "\n")
    clean = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment = {**clean, "PYTHONPATH": str(toy), "PYTHONDONTWRITEBYTECODE": "1", "PATIENCE": str(patience)}
    both = [
        subprocess.Popen([sys.executable, "-c", TOGETHER, kernel], stdin=-1, stdout=-1, text=True, env=environment)
        for kernel in kernels
    ]
    for one in both:
        assert one.stdout.readline() == "ready\n"
    for one in both:
        one.stdin.write("go\n")
        one.stdin.flush()
    answers = [one.communicate(timeout=120)[0].strip() for one in both]
    assert answers == [{"two": "2", "four": "4"}[kernel] for kernel in kernels]
    assert len(list(room.glob("*.compiles"))) == compile


def test_a_turn_that_never_ends_is_not_waited_for_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_turns", set())
    kernel = numba.njit(cache=True)(twice)
    with kernel_cache._turn(kernel), kernel_cache._turn(kernel):  # its own is not waited for
        assert kernel_cache._turns == {str(path) for path in tmp_path.rglob("*.turn")} != set()
        monkeypatch.setattr(kernel_cache, "_turns", set())  # now it is as another's
        monkeypatch.setattr(kernel_cache, "_PATIENCE", 0.2)
        assert kernel(3.0) == 6.0


def test_a_turn_ends_though_a_child_has_inherited_it(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_turns", set())
    kernel = numba.njit(cache=True)(twice)
    with kernel_cache._turn(kernel):
        (path,) = kernel_cache._turns
        open_files = {os.path.realpath(one): int(one.name) for one in Path("/proc/self/fd").iterdir()}
        child = subprocess.Popen(["sleep", "60"], pass_fds=[open_files[os.path.realpath(path)]])
    try:
        with open(path) as again:
            fcntl.flock(again, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        child.kill()
        child.wait()


def c_entries(kernel):
    return sum(len(re.findall(r"^define .*@cfunc\.", text, re.MULTILINE)) for text in kernel.inspect_llvm().values())


def twice(value):
    return 2.0 * value


@pytest.mark.filterwarnings("ignore:First-class function type feature is experimental")
def test_only_kernels_of_others_have_an_entry_for_c():
    """It is what Numba calls where a function is passed by its address."""
    theirs = numba.njit(twice)
    ours = numba.njit(FunctionType(twice.__code__, {"__name__": "vto_pipeline.numerics.vector"}))
    assert theirs(3.0) == ours(3.0) == 6.0
    assert (c_entries(theirs), c_entries(ours)) == (1, 0)

    number = numba.types.float64

    @numba.njit([number(numba.types.FunctionType(number(number)), number)])
    def applied(function, value):
        return function(value)

    assert applied(theirs, 2.0) == 4.0


_ALONE = """
import numpy as np
from vto_pipeline.numerics.linear.block_matrix import pattern
from vto_pipeline.numerics.linear.direct import DirectSolver
side = 40
at = np.arange(side * side).reshape(side, side)
one = np.concatenate([at[:, :-1].ravel(), at[:-1].ravel(), at[:-1, :-1].ravel()])
two = np.concatenate([at[:, 1:].ravel(), at[1:].ravel(), at[1:, 1:].ravel()])
matrix, places = pattern(np.concatenate([one, two]), np.concatenate([two, one]), side * side)
matrix.blocks[:] = 0.0
np.add.at(matrix.blocks, places, -np.eye(3))
matrix.blocks[matrix.diagonal] += 7.0 * np.eye(3)
solver = DirectSolver(matrix)
assert solver._plan.flops > 4e6  # enough for threads
print(solver.factorise(matrix.blocks))
"""


def test_a_parallel_factorisation_may_be_the_first_thing_that_a_process_does():
    """Twice: the kernels then come from the cache, which starts no threads for those that only call parallel ones."""
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", _ALONE], capture_output=True, text=True, timeout=300)
        assert (done.returncode, done.stdout.strip()) == (0, "True"), done.stderr
