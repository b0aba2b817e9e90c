"""Where results come from: the commit, and whether the code differed from it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from vto_pipeline.bench import provenance as provenance_module
from vto_pipeline.bench.provenance import provenance


def git(root: Path, *arguments: str) -> str:
    name = ["-c", "user.name=a", "-c", "user.email=a@example.com"]
    return subprocess.run(["git", "-C", root, *name, *arguments], capture_output=True, text=True, check=True).stdout


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    if shutil.which("git") is None:
        pytest.skip("no git")
    (tmp_path / "vto_pipeline").mkdir()
    (tmp_path / "vto_pipeline" / "__init__.py").write_text("")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-qm", "first")
    monkeypatch.setattr(provenance_module.vto_pipeline, "__file__", str(tmp_path / "vto_pipeline" / "__init__.py"))
    return tmp_path


def test_the_commit_says_whether_the_code_was_changed(checkout):
    head = git(checkout, "rev-parse", "HEAD")[:12]
    assert provenance("vto bench toy")["commit"] == head
    (checkout / "README.md").write_text("a page\n")  # changes no figure
    assert provenance("vto bench toy")["commit"] == head
    (checkout / "vto_pipeline" / "new.py").write_text("")
    assert provenance("vto bench toy")["commit"] == f"{head}+changes"


def test_no_commit_outside_a_checkout(checkout):
    shutil.rmtree(checkout / ".git")
    assert provenance("vto bench toy")["commit"] is None
