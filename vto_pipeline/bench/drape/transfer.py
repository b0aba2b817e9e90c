"""How a fine mesh rides on a coarser one: speed, flipped triangles, and layers taken for each other.

`python -m vto_pipeline.bench.drape.transfer GARMENT...` takes each file as the simulation mesh. The render mesh is the
same with a vertex on each edge, and up to half a millimetre off along its normals. So it is known which triangles every
vertex belongs to. A vertex is on the wrong layer where the triangle it rides on has no corner near them.

Violent states are sums of four waves in space; rows have the most squeezed and the most stretched edge. The waves also
say where each render vertex belongs. A triangle is flipped where it faces against where its own corners belong. Those
whose simulation triangle does so too are not counted: the mesh is too coarse for the wave there. The worst state
counts.

Speed is that of a mesh refined until it has 300,000 vertices or more: of the kernel that moves its vertices, with the
turns of the simulation mesh, and with the normals of the moved mesh.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, eye

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.geometry.riding.binding import Binding, apply, bind
from vto_pipeline.geometry.riding.midpoints import split_edges
from vto_pipeline.geometry.topology import edges, face_normals, vertex_normals
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_LIFT_M = 5e-4
_STATES, _WAVES, _SLOPE = 20, 4, 0.35
_MANY = 300_000  # vertices with which the speed is measured
_REPEATS = 9

_COLUMNS = (
    *("garment", "vertices", "render_vertices", "kernel_mvertices_per_s", "mvertices_per_s"),
    *("with_normals_mvertices_per_s", "bind_s", "rest_error_mm", "flipped", "wrong_layer"),
    *("least_stretch", "largest_stretch"),
)


class Wave(NamedTuple):
    """A wave in space.

    Args:
        along: Its direction, a unit vector, shape (3,).
        across: The direction in which it moves points, a unit vector, shape (3,).
        length: [m].
        phase: [rad].
    """

    along: FloatArray
    across: FloatArray
    length: float
    phase: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Wave:
        """Return a random one."""
        along, across = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        return cls(along, across, rng.uniform(0.15, 0.6), rng.uniform(0.0, 2 * np.pi))


def violent_states() -> Iterator[list[Wave]]:
    """Yield the waves of each state in which a garment is shaken hard."""
    rng = np.random.default_rng(0)
    for _ in range(_STATES):
        yield [Wave.drawn(rng) for _ in range(_WAVES)]


def shaken(points: FloatArray, waves: list[Wave]) -> FloatArray:
    """Return where waves take points (N, 3) [m]."""
    moved = np.array(points)
    for wave in waves:
        phase = 2 * np.pi * points @ wave.along / wave.length + wave.phase
        moved += _SLOPE * wave.length / (2 * np.pi) * np.sin(phase)[:, None] * wave.across
    return moved


def wrong_layer(sim: TriangleMesh, ends: IntArray, binding: Binding) -> int:
    """Return how many vertices ride on a triangle none of whose corners is two edges or less from where they belong."""
    count, links = len(sim.vertices), edges(sim)
    step = coo_matrix((np.ones(len(links)), links.T), (count, count)).tocsr()
    near = step + step.T + eye(count, format="csr")
    near = (near @ near).tocsr()
    pairs = [(end, corner) for end in ends.T for corner in binding.corners.T]
    return int((~np.any([np.asarray(near[end, corner]).ravel() > 0 for end, corner in pairs], axis=0)).sum())


def measure_transfer(sim: TriangleMesh) -> dict[str, Value]:
    """Return the figures of one simulation mesh; see the module."""
    fine, ends = split_edges(sim)
    lift = np.random.default_rng(1).uniform(-_LIFT_M, _LIFT_M, (len(fine.vertices), 1))
    fine = TriangleMesh(fine.vertices + lift * vertex_normals(fine), fine.faces)
    binding = bind(fine, sim)
    rest = apply(binding, sim.vertices)
    parent = np.tile(np.arange(len(sim.faces)), 4)
    flipped, stretch = [], []
    before = _lengths(sim, sim.vertices)
    for waves in violent_states():
        moved, wanted = shaken(sim.vertices, waves), _normals(fine, shaken(fine.vertices, waves))
        against = (_normals(fine, apply(binding, moved)) * wanted).sum(axis=1) < 0.0
        coarse = (_normals(sim, moved)[parent] * wanted).sum(axis=1) < 0.0
        flipped.append(int((against & ~coarse).sum()))
        stretch.append(_lengths(sim, moved) / before)
    return {
        "vertices": len(sim.vertices),
        "render_vertices": len(fine.vertices),
        **_speed(sim),
        "rest_error_mm": float(1e3 * np.abs(rest - fine.vertices).max()),
        "flipped": max(flipped),
        "wrong_layer": wrong_layer(sim, ends, binding),
        "least_stretch": float(np.min(stretch)),
        "largest_stretch": float(np.max(stretch)),
    }


def _speed(sim: TriangleMesh) -> dict[str, Value]:
    many = sim
    while len(many.vertices) < _MANY:
        many, _ = split_edges(many)
    began = time.perf_counter()
    binding = bind(many, sim)
    bound = time.perf_counter() - began
    places = binding.turns.places(sim.vertices)
    millions = 1e-6 * len(many.vertices)
    return {
        "kernel_mvertices_per_s": millions / _median_s(lambda: binding.ride(places)),
        "mvertices_per_s": millions / _median_s(lambda: apply(binding, sim.vertices)),
        "with_normals_mvertices_per_s": millions
        / _median_s(lambda: vertex_normals(TriangleMesh(apply(binding, sim.vertices), many.faces))),
        "bind_s": bound,
    }


def _median_s(work: Callable[[], object]) -> float:
    work()
    spent = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        work()
        spent.append(time.perf_counter() - began)
    return float(np.median(spent))


def _normals(mesh: TriangleMesh, positions: FloatArray) -> FloatArray:
    return face_normals(TriangleMesh(positions, mesh.faces))


def _lengths(mesh: TriangleMesh, positions: FloatArray) -> FloatArray:
    one, other = positions[edges(mesh)].transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(one - other, axis=1))


def main() -> None:
    """Read the command line, measure, and print a row for each garment."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.drape.transfer", description=__doc__)
    parser.add_argument("garment", type=Path, nargs="+", help="mesh files")
    parser.add_argument("--out", type=Path, default=Path("runs/transfer"), metavar="DIR", help="for rows.jsonl")
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    for path in arguments.garment:
        table.add({"garment": path.stem, **measure_transfer(read_mesh(path))})


if __name__ == "__main__":
    main()
