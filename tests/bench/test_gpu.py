"""Systems kept from a simulation, their layout, and the kernels of the device run by a processor's threads."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from block_sheets import links, sheet, whole
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import LinearOperator, cg

from vto_pipeline.bench.bench import Row
from vto_pipeline.bench.cloth.scenes import sphere
from vto_pipeline.bench.cloth.solvers import run_scene
from vto_pipeline.bench.scaling.direct_solvers import own_cholesky
from vto_pipeline.bench.scaling.gpu import device
from vto_pipeline.bench.scaling.gpu.__main__ import write_document
from vto_pipeline.bench.scaling.gpu.layout import SIZES, lay_out, one_by_one
from vto_pipeline.bench.scaling.gpu.systems import System, read_systems, recorded_systems, write_systems
from vto_pipeline.bench.scaling.throughput import compiled_sweep, sheet_cloth
from vto_pipeline.cloth.constraints.sweep import multipliers
from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.cloth.implicit_step.linear_system import LinearSystem
from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.io.documents import read_json
from vto_pipeline.numerics.linear.block_matrix import to_scipy

H = 1e-3  # s


def dense(system):
    return to_scipy(system.matrix).toarray()


def solved(matrix, right):
    return cho_solve(cho_factor(matrix), right.ravel()).reshape(-1, 3)  # refuses what is not positive definite


@pytest.fixture(scope="module")
def met():
    """Systems of a sheet that falls on a ball."""
    with recorded_systems() as found:
        run_scene(replace(sphere(10), seconds=0.25), StepConfig.model_validate({}))
    return found


def test_systems_of_a_simulation_make_its_steps(met):
    assert [one.name for one in met][:2] == ["100 first", "100 last"]
    for system in met:
        matrix = dense(system)
        assert np.abs(matrix - matrix.T).max() <= 1e-12 * np.abs(matrix).max()
        wanted = solved(matrix, system.right)
        np.testing.assert_allclose(  # condition times rounding
            system.solution, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max()
        )


def test_links_are_part_of_a_system():
    rng = np.random.default_rng(2)
    matrix = sheet(6, rng)
    vertices, weights, between = links(9, 36, rng)
    system = LinearSystem(matrix, np.zeros(36, bool))
    system.blocks[:] = matrix.blocks
    right, x = rng.standard_normal((36, 3)), np.zeros((36, 3))
    with recorded_systems() as found:
        system.couple(vertices, weights)[:] = between
        assert system.eliminated(right, x)
    assert [one.name for one in found] == ["36 first", "36 last", "36 linked"]
    wanted = whole(matrix, vertices, weights, between).toarray()
    for one in found:
        np.testing.assert_allclose(dense(one), wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())  # rounding
        np.testing.assert_array_equal(one.right, right)


def test_a_file_keeps_systems(met, tmp_path):
    write_systems(tmp_path / "systems.npz", met)
    for one, other in zip(met, read_systems(tmp_path / "systems.npz"), strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(np.triu(dense(one)), np.triu(dense(other)))
        np.testing.assert_array_equal(dense(other), dense(other).T)
        np.testing.assert_array_equal(one.right, other.right)
        np.testing.assert_array_equal(one.solution, other.solution)


@pytest.fixture(scope="module")
def system():
    """A system of 81 rows, of condition a hundred, and its solution by SciPy."""
    rng = np.random.default_rng(3)
    matrix, right = sheet(9, rng, 2), rng.standard_normal((81, 3))
    values = np.linalg.eigvalsh(to_scipy(matrix).toarray())
    matrix.blocks[matrix.diagonal] -= (values[0] - 0.01 * (values[-1] - values[0])) * np.eye(3)
    return System("81", matrix, right, solved(to_scipy(matrix).toarray(), right))


def spread(layout, vectors):
    """Vectors of the vertices at their places, shape (R,)."""
    laid = np.zeros((len(layout.domains) * layout.domains.shape[1] // 3, 3))
    laid[layout.place] = vectors
    return laid.ravel()


@pytest.mark.parametrize("size", SIZES)
def test_a_layout_holds_the_matrix(system, size):
    layout = lay_out(system.matrix, size)
    assert len(np.unique(layout.place)) == 81
    rows, x = len(layout.domains) * 3 * size, spread(layout, system.right)
    product = np.zeros(rows)
    for slice_, (first, last) in enumerate(zip(layout.slices[:-1], layout.slices[1:], strict=True)):
        for entry in range(first, last):
            for axis in range(3):
                taken = layout.values[entry, axis] * x[layout.columns[entry] + axis]
                product[32 * slice_ : 32 * slice_ + 32] += taken
    wanted = to_scipy(system.matrix) @ system.right.ravel()
    found = product.reshape(-1, 3)[layout.place].ravel()
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())  # rounding
    matrix = dense(system).reshape(81, 3, 81, 3)
    for i in range(81):
        for j in range(81):
            a, b = layout.place[i], layout.place[j]
            if a // size == b // size:
                block = layout.domains.reshape(-1, size, 3, size, 3)[a // size, a % size, :, b % size]
                np.testing.assert_array_equal(block, matrix[i, :, j])


def by_domains(layout):
    """The preconditioner of a layout, for vectors of the vertices."""
    inverses = np.linalg.inv(layout.domains)

    def apply(r):
        parts = spread(layout, r.reshape(-1, 3)).reshape(len(inverses), -1)
        return np.einsum("dij,dj->di", inverses, parts).reshape(-1, 3)[layout.place].ravel()

    return LinearOperator((3 * len(layout.place),) * 2, apply, dtype=float)


def test_conjugate_gradients_by_domains_end_where_the_factorisation_does(met):
    last = met[1]
    own = own_cholesky(last.matrix)
    own.factor()
    wanted, counts = own.solve(last.right), []
    for size in SIZES:
        seen: list[object] = []
        domains = by_domains(lay_out(last.matrix, size))
        x, failed = cg(to_scipy(last.matrix), last.right.ravel(), rtol=1e-12, M=domains, callback=seen.append)
        assert failed == 0
        found = x.reshape(-1, 3)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())  # tolerance x condition
        counts.append(len(seen))
    assert counts[0] > counts[1] > counts[2]  # larger domains leave less to the iteration


def test_constraints_of_a_colour_share_no_vertex_and_none_is_lost():
    model, _ = sheet_cloth(12)
    for data in model.constraints:
        fine = one_by_one(data, 144)
        for first, last in zip(fine.colours[:-1], fine.colours[1:], strict=True):
            touched = fine.vertices[first:last].ravel()
            assert len(touched) == len(np.unique(touched)) > 0
        for one, other in ((data, fine), (fine, data)):
            figures = one.rest if hasattr(one, "rest") else one.area
            kept = other.rest if hasattr(other, "rest") else other.area
            here = {(*row, figure) for row, figure in zip(one.vertices.tolist(), figures, strict=True)}
            assert here == {(*row, figure) for row, figure in zip(other.vertices.tolist(), kept, strict=True)}


@pytest.fixture(scope="module")
def kernels(tmp_path_factory):
    """The kernels, compiled for this processor."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("kernels")
    source = Path(device.__file__).with_name("kernels.cu").read_text()
    (folder / "kernels.inc").write_text(re.sub(r"extern __shared__.*", "", source))
    command = [compiler, "-O1", "-std=c++20", "-pthread", "-shared", "-fPIC", f'-DKERNELS="{folder / "kernels.inc"}"']
    emulated = Path(__file__).with_name("emulated_kernels.cpp")
    subprocess.run([*command, "-o", str(folder / "kernels.so"), str(emulated)], check=True)
    return ctypes.CDLL(str(folder / "kernels.so"))


def pointers(*arrays):
    return [ctypes.c_void_p(one.ctypes.data) for one in arrays]


@pytest.mark.parametrize(("size", "blocks", "threads"), [(1, 3, 24), (8, 2, 24), (32, 1, 96)])
def test_the_kernel_solves(kernels, system, size, blocks, threads):
    layout = lay_out(system.matrix, size)
    width = layout.domains.shape[1]
    rows, solutions = len(layout.domains) * width, []
    inverses, right = np.linalg.inv(layout.domains), spread(layout, system.right)
    for _ in range(2):
        vectors, parts, gate, found = (
            np.full(6 * rows, np.nan),
            np.zeros(4 * blocks),
            np.zeros(1, np.uint64),
            np.zeros(2),
        )
        kernels.solve(
            *(blocks, threads, rows, *pointers(layout.slices, layout.columns, layout.values), width),
            *pointers(inverses, right, vectors, parts, gate),
            *(ctypes.c_double(1e-11), 500, *pointers(found)),
        )
        solutions.append(vectors[:rows].reshape(-1, 3)[layout.place])
    seen: list[object] = []
    cg(to_scipy(system.matrix), system.right.ravel(), rtol=1e-11, M=by_domains(layout), callback=seen.append)
    assert abs(found[0] - len(seen)) <= 1 < 0.1 * len(seen)  # sums in another order
    assert found[1] <= 1e-11
    largest = np.abs(system.solution).max()
    np.testing.assert_allclose(solutions[0], system.solution, rtol=0, atol=1e-8 * largest)  # tolerance x condition
    assert solutions[0].tobytes() == solutions[1].tobytes()


def test_the_kernel_sweeps_as_we_do(kernels):
    model, x = sheet_cloth(9)
    x = x + 1e-3 * np.random.default_rng(1).standard_normal(x.shape)
    bend, stretch = (one_by_one(data, 81) for data in model.constraints)
    here, lambdas, sweep = x.copy(), multipliers((bend, stretch)), compiled_sweep()
    there, strained, bent = x.copy(), np.zeros((len(stretch.vertices), 3)), np.zeros(len(bend.vertices))
    for _ in range(4):
        sweep(here, x, model.inverse_mass, (bend, stretch), lambdas, H, False)
    gate = np.zeros(1, np.uint64)
    triangles = (stretch.colours, stretch.vertices, stretch.gradients, stretch.area, stretch.compliance, strained)
    hinges = (bend.colours, bend.vertices, bend.rest, bend.compliance, bent, gate)
    kernels.sweep(
        *(3, 4, 4, ctypes.c_double(H), *pointers(there, model.inverse_mass)),
        *(len(stretch.colours) - 1, *pointers(*triangles), len(bend.colours) - 1, *pointers(*hinges)),
    )
    assert np.abs(here - x).max() > 1e-4
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-13)  # metres: rounding of an arctangent and sums
    for ours, theirs in zip(lambdas, (bent[:, None], strained), strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-10 * np.abs(ours).max())


def test_rows_become_a_results_file(tmp_path):
    sweep = {
        "part": "sweeps",
        "scene": "sheet 12",
        "method": "own sweep",
        "vertices": 144,
        "threads": 2,
        "seconds": 0.5,
    }
    limits = {"part": "limits", "scene": "a device", "method": "limits", "wait_us": 1.5}
    (tmp_path / "rows.jsonl").write_text(f"{json.dumps(sweep)}\n{json.dumps(limits)}\n")
    write_document(tmp_path)
    document = read_json(tmp_path / "gpu.json")
    one, other = (Row.from_json(plain) for plain in document["rows"])
    assert (one.scene, one.method, one.vertices, one.seconds) == ("sheet 12", "own sweep", 144, 0.5)
    assert (one.settings, one.threads) == ({"part": "sweeps"}, 2)
    assert one.errors == {}
    assert other.errors == {"wait_us": 1.5}
    assert {"bench", "command", "commit", "date", "machine", "rows", "fronts"} <= set(document)


def test_a_machine_without_a_device_is_told_so(monkeypatch):
    monkeypatch.setattr(device, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match="cupy") as refused:
        device.Device()
    assert "pip install cupy-cuda13x" in str(refused.value)
