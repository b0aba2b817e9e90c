"""Names of panels, by where they are and which rims they end at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.garment.unsewn.cut import Piece
from vto_pipeline.garment.unsewn.rims import Rims
from vto_pipeline.geometry.topology import face_area_vectors

_ASIDE = 0.1  # of the garment's width: a piece whose middle is farther out is on one side
_SIDEWAYS = 0.2  # of its area: a piece that faces ahead or back with less of it is a side


def panel_names(pieces: Sequence[Piece], rims: Rims | None) -> list[str]:
    """Return a name for each piece, all different, in words that the rules of sizes know.

    Args:
        pieces: In space, +Y up, +Z the front.
        rims: Of the whole garment, if its type is known.
    """
    across = np.concatenate([piece.mesh.vertices[:, 0] for piece in pieces])
    low, high = float(across.min()), float(across.max())
    names: list[str] = []
    for piece in pieces:
        area = face_area_vectors(piece.mesh)
        weight = np.linalg.norm(area, axis=1)
        middle = float(weight @ piece.mesh.vertices[piece.mesh.faces].mean(axis=1)[:, 0] / weight.sum())
        out = (middle - 0.5 * (low + high)) / (high - low)
        words = ["left" if out > 0.0 else "right"] if abs(out) > _ASIDE else []
        words += [part] if rims is not None and (part := rims.part_of(piece.vertex)) else []
        ahead = float(area[:, 2].sum())
        if abs(ahead) > _SIDEWAYS * weight.sum() or (rims is not None and rims.kind == "trousers"):
            words.append("front" if ahead > 0.0 else "back")
        name = "_".join(words or ["side"])
        same = sum(one == name or one.rpartition("_")[0] == name for one in names)
        names.append(f"{name}_{same + 1}" if same else name)
    return names
