"""The wheel holds all that the package needs, and works where there is no checkout."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TAPE = "unit: cm\nsex: female\nmeasurements: {stature: 170, bust_girth: 93, waist_girth: 78, hip_girth: 101}\n"


def call(*command: object, cwd: Path) -> str:
    done = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy of what git knows, or would: nothing that lies about in the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    if not (ROOT / ".git").exists():
        pytest.skip("no checkout")
    listed = call(
        "git", "ls-files", "-co", "--exclude-standard", "--", "vto_pipeline", "*.md", "*.toml", "LICENSE", cwd=ROOT
    )
    for name in filter(lambda name: (ROOT / name).is_file(), listed.split("\n")):
        (folder / "source" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "source" / name).write_bytes((ROOT / name).read_bytes())
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", folder, folder / "source"]
    done = subprocess.run(build, capture_output=True, text=True)
    if "No matching distribution found for setuptools" in done.stderr:
        pytest.skip("the builder cannot be fetched here")
    assert done.returncode == 0, done.stderr
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.slow
def test_it_holds_every_file_of_the_package(wheel):
    source = wheel.parent / "source"
    expected = {str(path.relative_to(source)) for path in (source / "vto_pipeline").rglob("*") if path.is_file()}
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == expected


@pytest.mark.slow
def test_it_works_in_an_environment_without_the_checkout(wheel, tmp_path):
    """The libraries are those of this environment, whose link to the checkout does not count there."""
    call(sys.executable, "-m", "venv", "--without-pip", tmp_path / "env", cwd=tmp_path)
    python = tmp_path / "env" / "bin" / "python"
    call(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=tmp_path)
    where = call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=tmp_path).strip()
    (Path(where) / "libraries.pth").write_text(sysconfig.get_path("purelib"))
    (tmp_path / "tape.yaml").write_text(TAPE)
    package = call(python, "-c", "import vto_pipeline; print(vto_pipeline.__file__)", cwd=tmp_path)
    assert package.startswith(str(tmp_path / "env"))
    vto = tmp_path / "env" / "bin" / "vto"
    assert call(vto, "--version", cwd=tmp_path).startswith("vto, version")
    assert "waist" in call(vto, "fit", "--measurements", "tape.yaml", "-o", "run", "-q", cwd=tmp_path)
    assert (tmp_path / "run" / "out" / "avatar.npz").is_file()
    (tmp_path / "batch.yaml").write_text(
        "schema: 1\nrun: {schema: 1, given: {body: {measurements: tape.yaml}}, want: [avatar, page]}\n"
        "every: {stages.pose.pose: [t_pose, a_pose]}\n"
    )
    call(vto, "batch", "batch.yaml", "-o", "batch", "--workers", "1", cwd=tmp_path)
    assert (tmp_path / "batch" / "page.html").is_file()
