"""The image has the system libraries that the installation names, and everything it copies is sent to its builder."""

from __future__ import annotations

import re
from pathlib import Path

from vto_pipeline.cli.setup_system import LIBRARIES, OLDEST

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "Dockerfile").read_text().replace("\\\n", " ")


def instructions(name: str) -> list[str]:
    return re.findall(rf"^{name} (.*)$", TEXT, re.MULTILINE)


def test_it_installs_the_libraries_that_a_bare_machine_needs() -> None:
    packages = re.search(r"--no-install-recommends +(.*?) *&&", instructions("RUN")[0])
    assert packages is not None
    assert set(packages[1].split()) == set(LIBRARIES)


def test_its_python_is_new_enough() -> None:
    version = re.fullmatch(r"python:(\d+)\.(\d+)-slim-bookworm", instructions("FROM")[0])
    assert version is not None
    assert tuple(map(int, version.groups())) >= OLDEST


def test_what_it_copies_is_there_and_is_sent() -> None:
    sent = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = {name for line in instructions("COPY") for name in line.split()[:-1]}
    assert copied == sent
    assert all((ROOT / name).exists() for name in copied)


def test_it_does_not_run_as_root() -> None:
    assert TEXT.index("\nUSER vto") < TEXT.index("\nENTRYPOINT")
