"""SIGKILL at a hundred moments of a run: nothing half-written counts, nothing finished is lost or made twice."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from pathlib import Path

from vto_pipeline.pipeline.execution.digest import digest_file
from vto_pipeline.pipeline.execution.store import MANIFEST

KILLS = 100
DOCUMENT = """\
schema: 1
given: {left: {number: left.txt}, right: {number: right.txt}}
want: [squared, label, page]
"""
PROGRAM = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from toy_tables import CALLS, TOY
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import read_request

base = Path({base!r})
left = 0

def count(frame, event, argument):
    "Counts calls of the system and of open files; the last one never happens."
    global left
    if event == "c_call" and (argument.__module__ or type(argument.__self__).__module__) in ("posix", "_io", "fcntl"):
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

def go(folder, moment):
    "Run, and die before the system call of this number; 0: live, and say how many there were."
    global left
    CALLS.clear()
    request = read_request(load_yaml(base / "toy.yaml"), base, TOY)
    plan = make_plan(request, TOY)
    left = moment
    sys.setprofile(count)
    run(request, plan, TOY, folder)
    sys.setprofile(None)
    return -left

go(base / "warm", 0)  # what is imported or remembered on the first time does not count
for line in sys.stdin:
    folder, moment = line.split()
    answer, tell = os.pipe()
    if not (child := os.fork()):
        os.write(tell, f"{{go(Path(folder), int(moment))}} {{' '.join(CALLS)}}".encode())
        os._exit(0)
    os.close(tell)
    said = os.read(answer, 10000).decode()
    os.close(answer)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), said, flush=True)
"""


class Runner:
    """A process with everything loaded, which runs the document in forked children and kills them at will."""

    def __init__(self, base: Path) -> None:
        for name, text in (("left.txt", "3"), ("right.txt", "4"), ("toy.yaml", DOCUMENT)):
            (base / name).write_text(text)
        program = PROGRAM.format(tests=str(Path(__file__).parents[1]), base=str(base))
        self._process = subprocess.Popen(
            [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def __call__(self, folder: Path, moment: int = 0) -> tuple[int, int, list[str]]:
        """Exit code, number of system calls, and the stages that ran."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{folder} {moment}\n")
        self._process.stdin.flush()
        code, *rest = self._process.stdout.readline().split()
        return int(code), int(rest[0]) if rest else 0, rest[1:]

    def close(self) -> None:
        self._process.communicate()


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the page, which tells what came from the cache."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "page.json")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def finished(run: Path) -> set[str]:
    """The stages whose result is stored; each is whole."""
    found = set()
    for path in (run / "cache").glob(f"[!.]*/*/{MANIFEST}"):
        manifest = json.loads(path.read_text())
        assert {name: digest_file(path.parent / name) for name in manifest["digests"]} == manifest["digests"]
        found.add(path.parts[-3])
    return found


def test_a_hundred_kills_lose_nothing_and_leave_nothing(tmp_path):
    runner = Runner(tmp_path)
    whole = tmp_path / "whole"
    code, calls, ran = runner(whole)
    assert (code, len(ran), calls > 2 * KILLS) == (0, 7, True)
    undisturbed, kept = contents(whole / "out"), set(contents(whole)) - {"out/page.json"}
    survived = []
    for number, moment in enumerate(sorted(random.Random(7).sample(range(1, calls), KILLS))):
        folder = tmp_path / f"killed{number}"
        assert runner(folder, moment)[0] == -signal.SIGKILL
        there = contents(folder / "out")
        assert {name: there[name] for name in there.keys() & undisturbed.keys()}.items() <= undisturbed.items()
        if (folder / "run.json").is_file():
            json.loads((folder / "run.json").read_text())
        done = finished(folder)
        survived.append(len(done))
        code, _, again = runner(folder)
        assert code == 0
        assert done.isdisjoint(again)
        assert set(again) | done == set(ran)
        assert contents(folder / "out") == undisturbed
        assert set(contents(folder)) == kept
    runner.close()
    assert set(survived) == set(range(7))  # the moments lay before, between and behind all stages
