"""What a first run costs, written down as a results file."""

from __future__ import annotations

import json
import os
import sys

from vto_pipeline.bench import first_run


def test_time_and_disk_of_a_system(tmp_path, monkeypatch):
    (tmp_path / ".venv" / "lib").mkdir(parents=True)
    (tmp_path / ".venv" / "lib" / "big").write_bytes(os.urandom(3_000_000))  # which no disk makes smaller
    (tmp_path / ".venv" / "link").symlink_to(tmp_path / ".venv" / "lib" / "big")
    monkeypatch.chdir(tmp_path)
    release = {"PRETTY_NAME": "Ubuntu 22.04.4 LTS", "ID": "ubuntu", "VERSION_ID": "22.04"}
    monkeypatch.setattr(first_run.platform, "freedesktop_os_release", lambda: release)
    monkeypatch.setattr(sys, "argv", ["first_run", "--demo", "240", "--test", "900", "--results", str(tmp_path)])
    first_run.main()
    written = json.loads((tmp_path / "first_run_ubuntu_22_04.json").read_text())
    demo, test = written["rows"]
    assert (demo["scene"], demo["method"], demo["seconds"]) == ("Ubuntu 22.04.4 LTS", "make demo", 240.0)
    assert (test["method"], test["seconds"]) == ("make test", 900.0)
    assert 0.003 <= demo["errors"]["disk_gb"] < 0.0031  # whole blocks, and the link not twice
    assert written["command"] == "make first-run"
