"""The linear systems that Newton's method meets in a simulation, kept to be solved again by other means."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from vto_pipeline.cloth.implicit_step.linear_system import LinearSystem
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, pattern


class System(NamedTuple):
    """A system A x = b of a step, contacts included.

    Args:
        name: Its rows and when it was met, such as "2113 late".
        matrix: A [N/m], symmetric positive definite, N rows of 3 x 3 blocks.
        right: b [N], shape (N, 3).
        solution: What the step made of it [m], shape (N, 3).
    """

    name: str
    matrix: BlockMatrix
    right: FloatArray
    solution: FloatArray


@contextmanager
def recorded_systems() -> Iterator[list[System]]:
    """Keep systems that are eliminated inside the block: of each size the first, the last and that of most links.

    The list is filled when the block ends. Links are contacts between vertices of the cloth; what a solid does to a
    vertex is part of the diagonal.
    """
    found: list[System] = []
    kept: dict[tuple[int, str], _Parts] = {}
    eliminated = LinearSystem.eliminated

    def recording(self: LinearSystem, right: FloatArray, x: FloatArray) -> bool:
        solved = eliminated(self, right, x)
        if solved:
            links = (*self._linked, self.levels.links.blocks.copy())
            parts = _Parts(self._starts, self._columns, self.blocks.copy(), *links, right.copy(), x.copy())
            kept.setdefault((len(x), "first"), parts)
            kept[len(x), "last"] = parts
            most = kept.get((len(x), "linked"))
            if len(parts.vertices) > (0 if most is None else len(most.vertices)):
                kept[len(x), "linked"] = parts
        return solved

    with patch.object(LinearSystem, "eliminated", recording):
        yield found
    for (count, when), parts in sorted(kept.items(), key=lambda one: one[0]):
        found.append(System(f"{count} {when}", _merged(parts), parts.right, parts.solution))


class _Parts(NamedTuple):
    """A matrix by rows, the links beside it (see `numerics.linear.links`), both sides."""

    starts: IntArray
    columns: IntArray
    blocks: FloatArray
    vertices: IntArray
    weights: FloatArray
    between: FloatArray
    right: FloatArray
    solution: FloatArray


def _merged(parts: _Parts) -> BlockMatrix:
    """Return the matrix with its links Gᵀ B G."""
    count, corners = len(parts.right), parts.vertices.shape[1]
    rows = np.repeat(np.arange(count), np.diff(parts.starts))
    rows = np.concatenate([rows, np.repeat(parts.vertices, corners, axis=1).ravel()])
    columns = np.concatenate([parts.columns, np.tile(parts.vertices, (1, corners)).ravel()])
    products = (parts.weights[:, :, None] * parts.weights[:, None, :]).reshape(-1)
    linked = products[:, None, None] * np.repeat(parts.between, corners * corners, axis=0)
    used = np.concatenate([np.ones(len(parts.columns), bool), products != 0.0])
    matrix, places = pattern(rows[used].astype(np.int32), columns[used].astype(np.int32), count)
    np.add.at(matrix.blocks, places, np.concatenate([parts.blocks, linked])[used])
    return matrix


def write_systems(path: Path, systems: Sequence[System]) -> None:
    """Write systems to an NPZ file: of their blocks those on and above the diagonal."""
    arrays: dict[str, Any] = {}
    for number, one in enumerate(systems):
        rows = np.repeat(np.arange(len(one.right)), np.diff(one.matrix.starts))
        upper = one.matrix.columns >= rows
        arrays[f"name_{number}"] = np.array(one.name)
        arrays[f"rows_{number}"] = rows[upper].astype(np.int32)
        arrays[f"columns_{number}"] = one.matrix.columns[upper]
        arrays[f"blocks_{number}"] = one.matrix.blocks[upper]
        arrays[f"right_{number}"], arrays[f"solution_{number}"] = one.right, one.solution
    np.savez_compressed(path, **arrays)


def read_systems(path: Path) -> list[System]:
    """Return the systems of a file by `write_systems`; what lies below the diagonal is mirrored."""
    systems = []
    with np.load(path) as file:
        for number in range(sum(key.startswith("name_") for key in file.files)):
            name, rows, columns, blocks, right, solution = (
                file[f"{key}_{number}"] for key in ("name", "rows", "columns", "blocks", "right", "solution")
            )
            beyond = rows != columns
            upper = np.triu(blocks[~beyond])
            blocks[~beyond] = upper + np.triu(upper, 1).transpose(0, 2, 1)
            all_rows, all_columns = np.concatenate([rows, columns[beyond]]), np.concatenate([columns, rows[beyond]])
            matrix, places = pattern(all_rows, all_columns, len(right))
            matrix.blocks[places] = np.concatenate([blocks, blocks[beyond].transpose(0, 2, 1)])
            systems.append(System(str(name), matrix, right, solution))
    return systems
