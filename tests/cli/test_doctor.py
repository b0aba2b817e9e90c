"""What is installed, what is missing, and how the system is prepared."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata

import pytest

from vto_pipeline.cli import setup_system
from vto_pipeline.cli.commands import doctor
from vto_pipeline.cli.commands.doctor import Finding


def test_every_dependency_is_looked_at():
    required = {line.split(";")[0] for line in metadata.requires("vto-pipeline") or () if "extra ==" not in line}
    names = {"".join(c for c in line if c.isalnum() or c in "-_").rstrip("0123456789") for line in required}
    names = {line.split("<")[0].split(">")[0].split("=")[0].split("!")[0].strip().lower() for line in required}
    assert names - set(doctor._MODULES) == {"click", "tbb"}  # this runs on click; tbb shows in the threading layer


def test_doctor_answers_with_the_command_that_mends(vto, monkeypatch):
    monkeypatch.setattr(doctor, "_MODULES", {"numpy": "numpy", "no-such-thing": "nothing", "rich": "not_a_module"})
    monkeypatch.setattr(doctor, "missing_libraries", lambda: ["libgl1"])
    monkeypatch.setattr(doctor, "_threading", lambda: Finding("Numba threads", "ok", "tbb 2"))
    said = vto("doctor", "--json")
    assert said.code == 5
    found = {finding["name"]: finding for finding in said.data["findings"]}
    assert found["numpy"]["state"] == "ok"
    assert found["no-such-thing"]["mend"].endswith("-m pip install no-such-thing")
    assert "fails to load: ModuleNotFoundError" in found["rich"]["seen"]
    if sys.platform == "linux":
        assert found["libGL.so.1"]["mend"] == "sudo apt-get install -y --no-install-recommends libgl1"
        assert found["libX11.so.6"]["state"] == "ok" or "libx11-6" in setup_system.missing_libraries()
    assert "missing: " in said.err


def test_doctor_is_content_where_nothing_is_missing(vto, monkeypatch):
    monkeypatch.setattr(doctor, "_MODULES", {"numpy": "numpy"})
    monkeypatch.setattr(doctor, "missing_libraries", list)
    monkeypatch.setattr(doctor, "_threading", lambda: Finding("Numba threads", "ok", "tbb 2"))
    said = vto("doctor")
    assert (said.code, said.err) == (0, "")


def test_the_set_up_script_needs_nothing_but_the_standard_library(tmp_path, monkeypatch):
    script = setup_system.__file__
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", f"import runpy; runpy.run_path({script!r}, run_name='looked at')"],
        check=False,
        capture_output=True,
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_missing_system_packages_are_installed_or_named(monkeypatch):
    ran = []
    monkeypatch.setattr(setup_system, "_loads", lambda name: name != "libGL.so.1")
    monkeypatch.setattr(setup_system.sys, "platform", "linux")
    assert setup_system.missing_libraries() == ["libgl1"]
    monkeypatch.setattr(setup_system, "_rights", lambda: ["sudo", "-n"])
    monkeypatch.setattr(setup_system.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(
        setup_system.subprocess, "run", lambda command, **_: ran.append(command) or subprocess.CompletedProcess([], 0)
    )
    setup_system.install(["libgl1"])
    assert ran[-1] == [
        *("sudo", "-n", "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-qq"),
        *("install", "-y", "--no-install-recommends", "libgl1"),
    ]
    monkeypatch.setattr(setup_system, "_rights", lambda: None)
    with pytest.raises(SystemExit, match="needs root, and there is no sudo\n  hint: sudo apt-get install -y"):
        setup_system.install(["libgl1"])
