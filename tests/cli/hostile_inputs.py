"""Inputs that no run should survive: broken files, things of the wrong kind, documents that mean harm.

`write_inputs` puts them into a folder; CASES names the command lines that are to be refused there.
"""

from __future__ import annotations

import json
import os
import pickle
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from vto_pipeline.io.meshes import read_own_mesh, write_ply
from vto_pipeline.model.mesh import TriangleMesh

SAMPLES = Path(__file__).parents[2] / "sample_data"
SHIRT, TAPE = SAMPLES / "shirt_on_form" / "shirt.ply", SAMPLES / "customer" / "measurements.yaml"
FORM = SAMPLES / "shirt_on_form" / "form.ply"

HEADER = (
    "ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
)
POINTS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
FACES = "3 0 1 2\n3 0 2 3\n3 0 3 1\n3 1 3 2\n"


def write_inputs(folder: Path) -> None:
    """Write all of them."""
    write_links_and_folders(folder)
    write_meshes(folder)
    write_solids(folder)
    write_archives(folder)
    write_pictures(folder)
    write_depth(folder)
    write_tapes(folder)
    write_documents(folder)
    write_fabrics(folder)
    write_runs(folder)


def write_links_and_folders(folder: Path) -> None:
    (folder / "loop.ply").symlink_to(folder / "loop.ply")
    (folder / "there.ply").symlink_to(folder / "back.ply")
    (folder / "back.ply").symlink_to(folder / "there.ply")
    (folder / "dangling.ply").symlink_to(folder / "nowhere.ply")
    (folder / "empty_folder").mkdir()
    (folder / "mesh_folder.ply").mkdir()
    (folder / "notes").mkdir()
    (folder / "notes" / "readme.md").write_text("nothing to see\n")
    (folder / "a_file").write_text("a file\n")
    (folder / "thesis.docx").write_bytes(b"PK\x03\x04")
    os.mkfifo(folder / "pipe.ply")


def ascii_ply(points: str = POINTS, faces: str = FACES, vertices: int = 4, count: int = 4, kind: str = "ascii") -> str:
    return HEADER.format(kind=kind, vertices=vertices, faces=count) + points + faces


def write_meshes(folder: Path) -> None:
    """Files that break their format, or keep to it and hold no surface."""
    rng = np.random.default_rng(0)
    binary = HEADER.format(kind="binary_little_endian", vertices=400, faces=400).encode()
    files: dict[str, str | bytes] = {
        "empty.ply": b"",
        "noise.ply": rng.bytes(5000),
        "header_only.ply": "ply\n",
        "no_end.ply": "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n",
        "cut.ply": binary + rng.bytes(1000),
        "billions.ply": binary.replace(b"vertex 400", b"vertex 4000000000") + rng.bytes(1000),
        "negative_count.ply": binary.replace(b"vertex 400", b"vertex -4") + rng.bytes(1000),
        "huge_polygon.ply": ascii_ply(faces="2000000000 0 1 2\n", count=1),
        "nan.ply": ascii_ply("0 0 0\n1 nan 0\n0 1 0\n0 0 1\n"),
        "infinite.ply": ascii_ply("0 0 0\n1 0 0\n0 inf 0\n0 0 1\n"),
        "overflow.ply": ascii_ply("0 0 0\n1e400 0 0\n0 1 0\n0 0 1\n"),
        "index.ply": ascii_ply(faces="3 0 1 99\n", count=1),
        "one_place.ply": ascii_ply("1 1 1\n" * 4),
        "in_line.ply": ascii_ply("0 0 0\n1 0 0\n2 0 0\n3 0 0\n"),
        "no_faces.ply": ascii_ply(faces="", count=0),
        "one_point.ply": ascii_ply("0 0 0\n", "", vertices=1, count=0),
        "miles.ply": ascii_ply("0 0 0\n1e6 0 0\n0 1e6 0\n0 0 1e6\n"),
        "specks.ply": ascii_ply("0 0 0\n1e-9 0 0\n0 1e-9 0\n0 0 1e-9\n"),
        "words.obj": "v one two three\nf 1 2 3\n",
        "zero_index.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
        "cut.stl": b"\0" * 80 + struct.pack("<I", 4_000_000_000) + b"\0" * 120,
        "cut.off": "OFF\n400 400 0\n0 0 0\n",
        "cut.glb": b"glTF" + struct.pack("<II", 2, 4000) + b"\0" * 20,
        "outside.gltf": json.dumps(
            {"asset": {"version": "2.0"}, "buffers": [{"uri": "../../../../etc/passwd", "byteLength": 100}]}
        ),
        "deep.gltf": '{"a":' * 20_000 + "1" + "}" * 20_000,
        "cut.pcd": "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9999\nHEIGHT 1\n"
        "POINTS 9999\nDATA binary\n",
        "words.xyz": "here be dragons\n" * 5,
    }
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def write_solids(folder: Path) -> None:
    """Sound surfaces that are not what they are given as."""
    ball = trimesh.creation.icosphere(4, 0.4)
    box = trimesh.creation.box((0.45, 1.7, 0.3)).subdivide().subdivide().subdivide()
    sheet = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    for name, vertices, faces in (
        ("sphere.ply", ball.vertices, ball.faces),
        ("box.ply", box.vertices, box.faces),
        ("triangle.ply", sheet[:3] * 0.5 + [0, 1.2, 0], [[0, 1, 2]]),
        ("sheet.ply", sheet, [[0, 2, 1], [0, 3, 2]]),
    ):
        write_ply(folder / name, TriangleMesh(vertices, np.asarray(faces)))
    form = read_own_mesh(FORM)
    write_ply(folder / "inside_out.ply", TriangleMesh(form.vertices, form.faces[:, ::-1]))


def write_archives(folder: Path) -> None:
    """Archives that unpack to more than they say, or to code."""
    with zipfile.ZipFile(folder / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        header = b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (50000000,), }"
        archive.writestr("vertices.npy", header.ljust(128) + b"\0" * 400_000_000)
    with zipfile.ZipFile(folder / "code.npz", "w") as archive:
        archive.writestr("vertices.npy", pickle.dumps(Path("/")))
    (folder / "noise.npz").write_bytes(b"PK\x03\x04" + bytes(range(256)) * 10)
    np.savez(folder / "other.npz", a=np.zeros(3))


def write_pictures(folder: Path) -> None:
    """Folders of photos and pairs of silhouettes that show nobody and nothing."""
    rng = np.random.default_rng(1)
    for name, make in {
        "black": lambda _: np.zeros((96, 128, 3)),
        "white": lambda _: np.full((96, 128, 3), 255),
        "static": lambda _: rng.integers(0, 255, (96, 128, 3)),
        "one_pixel": lambda k: np.full((1, 1, 3), k),
    }.items():
        (folder / name).mkdir()
        for k in range(3):
            Image.fromarray(np.asarray(make(k)).astype(np.uint8)).save(folder / name / f"{k}.png")
    (folder / "one_photo").mkdir()
    Image.new("RGB", (64, 64)).save(folder / "one_photo" / "0.png")
    (folder / "no_pictures").mkdir()
    for k in range(3):
        (folder / "no_pictures" / f"{k}.jpg").write_text("I am a picture")
    (folder / "too_large").mkdir()
    for k in range(2):
        (folder / "too_large" / f"{k}.png").write_bytes(_png_of(100_000, 100_000))
    (folder / "bad_board").mkdir()
    for k in range(2):
        Image.new("RGB", (64, 64), (k, 0, 0)).save(folder / "bad_board" / f"{k}.png")
    (folder / "bad_board" / "board.yaml").write_text("columns: 9\nrows: 7\nsquare_mm: 10\nmarker_mm: 20\n")


def _png_of(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds no pixel."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


def write_depth(folder: Path) -> None:
    """Folders of depth frames without readings, poses or sense."""
    camera = {"width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5}
    turned = np.stack([2 * np.eye(4)] * 3)
    for name, intrinsics, poses, frame in (
        ("depth_blank", camera, None, np.zeros((48, 64), np.uint16)),
        ("depth_8_bit", camera, None, np.full((48, 64), 90, np.uint8)),
        ("depth_size", {**camera, "width": 640}, None, np.full((48, 64), 900, np.uint16)),
        ("depth_focal", {**camera, "fx": -60}, None, np.full((48, 64), 900, np.uint16)),
        ("depth_poses", camera, turned.tolist(), np.full((48, 64), 900, np.uint16)),
        ("depth_few_poses", camera, turned[:1].tolist(), np.full((48, 64), 900, np.uint16)),
    ):
        (folder / name / "depth").mkdir(parents=True)
        for k in range(3):
            Image.fromarray(frame).save(folder / name / "depth" / f"{k}.png")
        (folder / name / "intrinsics.json").write_text(json.dumps(intrinsics))
        if poses is not None:
            (folder / name / "poses.json").write_text(json.dumps({"world_from_cam": poses}))


def write_tapes(folder: Path) -> None:
    """Measurements of nobody, and YAML that is no measurements."""
    files: dict[str, str | bytes] = {
        "waist.yaml": "sex: female\nmeasurements: {stature: 170, waist_girth: 5}\n",
        "giant.yaml": "measurements: {stature: 900}\n",
        "flat.yaml": "stature: 172\n",
        "inches.yaml": "unit: in\nmeasurements: {stature: 172}\n",
        "misspelt.yaml": "measurements: {statur: 172}\n",
        "negative.yaml": "measurements: {stature: 172, hip_girth: -95}\n",
        "nan.yaml": "measurements: {stature: .nan}\n",
        "word.yaml": "measurements: {stature: tall}\n",
        "robot.yaml": "sex: robot\nmeasurements: {stature: 172}\n",
        "size.yaml": "sex: male\nsize: S\nmeasurements: {chest_girth: 140}\n",
        "no_size.yaml": "sex: male\nsize: QQQ\n",
        "nothing.yaml": "",
        "list.yaml": "- stature\n- 172\n",
        "scalar.yaml": "172\n",
        "bomb.yaml": "a: &a [x, x, x, x, x, x, x, x, x]\n"
        + "".join(f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)),
        "itself.yaml": "measurements: &m\n  stature: *m\n",
        "deep.yaml": "[" * 5000 + "]" * 5000,
        "twice.yaml": "measurements:\n  stature: 172\n  stature: 182\n",
        "latin.yaml": "measurements: {stature: 172} # größe\n".encode("latin-1"),
        "tabs.yaml": "measurements:\n\tstature: 172\n",
        "code.yaml": "!!python/object/apply:os.system ['true']\n",
        "nul.yaml": b"measurements: {stature: 172}\0\n",
    }
    (folder / "tapes").mkdir()
    for name, content in files.items():
        (folder / "tapes" / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def write_documents(folder: Path) -> None:
    """Documents that ask for what is not there, or in words nobody knows."""
    given = f"given:\n  body: {{measurements: {TAPE}}}\n"
    want = "want: [avatar]\n"
    files = {
        "no_schema.yaml": given + want,
        "later.yaml": "schema: 99\n" + given + want,
        "no_want.yaml": "schema: 1\n" + given,
        "want_nothing.yaml": "schema: 1\n" + given + "want: []\n",
        "want_word.yaml": "schema: 1\n" + given + "want: [happiness]\n",
        "want_nested.yaml": "schema: 1\n" + given + "want: [[avatar], [[page]]]\n",
        "want_more.yaml": "schema: 1\n" + given + "want: [render_mesh]\n",
        "unknown.yaml": "schema: 1\n" + given + want + "stage: {}\n",
        "setting.yaml": "schema: 1\n" + given + want + "stages:\n  fit_measurements: {colour: red}\n",
        "range.yaml": "schema: 1\n" + given + want + "stages:\n  drape: {target_error_mm: -3}\n",
        "type.yaml": "schema: 1\n" + given + want + "stages: 7\n",
        "given_number.yaml": "schema: 1\ngiven: 5\n" + want,
        "given_null.yaml": "schema: 1\ngiven: {body: {measurements: [1, 2]}}\n" + want,
        "missing.yaml": "schema: 1\ngiven: {body: {cloud: nowhere.ply}}\n" + want,
        "linked.yaml": "schema: 1\ngiven: {body: {cloud: loop.ply}}\n" + want,
        "nul_path.yaml": 'schema: 1\ngiven: {body: {cloud: "a\\0b.ply"}}\n' + want,
        "long_path.yaml": f"schema: 1\ngiven: {{body: {{cloud: {'x' * 5000}.ply}}}}\n" + want,
        "unit.yaml": f"schema: 1\ngiven: {{body: {{surface: {{file: {FORM}, unit: parsec}}}}}}\n" + want,
        "wrong_unit.yaml": f"schema: 1\ngiven: {{body: {{surface: {{file: {FORM}, unit: mm}}}}}}\n" + want,
        "garments.yaml": f"schema: 1\ngiven: {{garments: [shirt], body: {{measurements: {TAPE}}}}}\n" + want,
        "seed.yaml": "schema: 1\n" + given + want + "seed: one\n",
        "fabric.yaml": f"schema: 1\ngiven: {{fabric: moonbeam, body: {{measurements: {TAPE}}}}}\n" + want,
    }
    (folder / "documents").mkdir()
    (folder / "documents" / "loop.ply").symlink_to(folder / "documents" / "loop.ply")
    for name, content in files.items():
        (folder / "documents" / name).write_text(content)


def write_fabrics(folder: Path) -> None:
    """Fabrics that no loom makes."""
    for name, content in {
        "weightless.yaml": "name: nothing\nareal_density_gsm: 0\n",
        "negative.yaml": "name: nothing\nareal_density_gsm: 120\nmembrane: {warp: -5}\n",
        "no_density.yaml": "name: nothing\n",
        "text.csv": "no,fabric,at,all\n",
        "cut.u3m": '{"schema": "1.1"',
    }.items():
        (folder / f"fabric_{name}").write_text(content)


def write_runs(folder: Path) -> None:
    """Folders that look like runs."""
    for name, record in {
        "run_cut": '{"stages": [',
        "run_list": "[1, 2, 3]",
        "run_empty": "{}",
        "run_types": '{"stages": 5, "given": 7}',
        "run_strange": '{"stages": [{"name": 1}], "given": {"happiness": {"key": "x"}}}',
    }.items():
        (folder / name).mkdir()
        (folder / name / "run.json").write_text(record)


def _scan(source: str, *more: str, role: str = "garment") -> tuple[str, ...]:
    return ("scan", source, "--role", role, *more)


def _tape(name: str) -> tuple[str, ...]:
    return ("fit", "--measurements", f"tapes/{name}.yaml")


def _pair(folder: str, stature: str = "1.7") -> tuple[str, ...]:
    return ("fit", "--front", f"{folder}/0.png", "--side", f"{folder}/1.png", "--stature", stature)


def _drape(garment: str, *more: str) -> tuple[str, ...]:
    return ("drape", "--garment", garment, *(more or ("--measurements", str(TAPE))))


def _on(body: str) -> tuple[str, ...]:
    return _drape(str(SHIRT), "--body", body)


def _run(name: str) -> tuple[str, ...]:
    return ("run", f"documents/{name}.yaml")


MESHES = """
empty.ply noise.ply header_only.ply no_end.ply cut.ply billions.ply negative_count.ply huge_polygon.ply
nan.ply infinite.ply overflow.ply index.ply one_place.ply in_line.ply one_point.ply miles.ply specks.ply
words.obj zero_index.obj cut.stl cut.off cut.glb outside.gltf deep.gltf cut.pcd words.xyz
""".split()  # noqa: SIM905  # one a line would be a page
"""Each is given to `vto scan`."""

TAPES = """
waist giant flat inches misspelt negative nan word robot size no_size nothing list scalar bomb itself deep
twice latin tabs code nul
""".split()  # noqa: SIM905  # one a line would be a page

DOCUMENTS = """
no_schema later no_want want_nothing want_word want_nested want_more unknown setting range type given_number
given_null missing linked nul_path long_path unit wrong_unit garments seed fabric
""".split()  # noqa: SIM905  # one a line would be a page

CASES: dict[str, tuple[str, ...]] = {
    **{f"scan {name}": _scan(name) for name in MESHES},
    "scan nothing": _scan("nowhere.ply"),
    "scan a link to itself": _scan("loop.ply"),
    "scan links in a circle": _scan("there.ply", role="body"),
    "scan a link to nothing": _scan("dangling.ply"),
    "scan a pipe": _scan("pipe.ply"),
    "scan an empty folder": _scan("empty_folder"),
    "scan a folder of notes": _scan("notes"),
    "scan a folder called as a mesh": _scan("mesh_folder.ply"),
    "scan a word file": _scan("thesis.docx"),
    "scan an endless name": _scan("x" * 5000 + ".ply"),
    "scan black photos": _scan("black"),
    "scan photos of static": _scan("static"),
    "scan photos of one pixel": _scan("one_pixel"),
    "scan one photo": _scan("one_photo"),
    "scan text as photos": _scan("no_pictures"),
    "scan ten thousand million pixels": _scan("too_large"),
    "scan with an impossible board": _scan("bad_board"),
    **{
        f"scan {name}": _scan(name, role="body")
        for name in ("depth_blank", "depth_8_bit", "depth_size", "depth_focal", "depth_poses", "depth_few_poses")
    },
    "scan a sphere as a garment": _scan("sphere.ply"),
    "scan a bare form as a garment": _scan(str(FORM)),
    "scan for an unknown role": _scan(str(SHIRT), role="hat"),
    "scan on a mannequin that is not there": _scan(str(SHIRT), "--mannequin", "nowhere.ply"),
    "scan on a mannequin without faces": _scan(str(SHIRT), "--mannequin", "no_faces.ply"),
    **{f"fit {name}.yaml": _tape(name) for name in TAPES},
    "fit a folder": ("fit", "--measurements", "notes"),
    "fit a link to itself": ("fit", "--measurements", "loop.ply"),
    "fit a mesh as a tape": ("fit", "--measurements", str(SHIRT)),
    "fit two things at once": ("fit", "--measurements", str(TAPE), "--scan", str(SHIRT)),
    "fit half a pair": ("fit", "--front", "black/0.png", "--stature", "1.7"),
    "fit black pictures": _pair("black"),
    "fit white pictures": _pair("white"),
    "fit static": _pair("static"),
    "fit pictures of one pixel": _pair("one_pixel"),
    "fit a stature in centimetres": _pair("black", "172"),
    "fit a stature of nothing": _pair("black", "0"),
    "fit a stature that is no number": _pair("black", "nan"),
    "fit text as pictures": ("fit", "--front", "a_file", "--side", "a_file", "--stature", "1.7"),
    "fit a shirt": ("fit", "--scan", str(SHIRT)),
    "fit a box": ("fit", "--scan", "box.ply"),
    "fit a sheet": ("fit", "--scan", "sheet.ply"),
    "fit a triangle": ("fit", "--scan", "triangle.ply"),
    "drape nothing": _drape("nowhere.ply"),
    "drape a sphere": _drape("sphere.ply"),
    "drape a body": _drape(str(FORM)),
    "drape a body inside out": _drape("inside_out.ply"),
    "drape a triangle": _drape("triangle.ply"),
    "drape a sheet": _drape("sheet.ply"),
    "drape a mile": _drape("miles.ply"),
    "drape without a body": ("drape", "--garment", str(SHIRT)),
    "drape on two bodies": _drape(str(SHIRT), "--body", str(FORM), "--measurements", str(TAPE)),
    "drape on no surface": _on("no_faces.ply"),
    "drape on what is not finite": _on("nan.ply"),
    "drape on a bomb": _on("bomb.npz"),
    "drape on code": _on("code.npz"),
    "drape on a broken archive": _on("noise.npz"),
    "drape on another archive": _on("other.npz"),
    "drape on a folder": _on("notes"),
    "drape a garment twice": ("drape", "--garment", str(SHIRT), *_on(str(FORM))[1:]),
    "drape three fabrics": _drape(str(SHIRT), "--body", str(FORM), *(["--fabric", "denim"] * 3)),
    "drape moonbeams": _drape(str(SHIRT), "--body", str(FORM), "--fabric", "moonbeam"),
    **{
        f"drape fabric_{name}": _drape(str(SHIRT), "--body", str(FORM), "--fabric", f"fabric_{name}")
        for name in ("weightless.yaml", "negative.yaml", "no_density.yaml", "text.csv", "cut.u3m")
    },
    "drape into a file": (*_on(str(FORM)), "-o", "a_file"),
    "drape under a file": (*_on(str(FORM)), "-o", "a_file/run"),
    "drape where no folder can be": (*_on(str(FORM)), "-o", "/proc/no/such/place"),
    "drape into other things": (*_on(str(FORM)), "-o", "notes"),
    **{f"run {name}": _run(name) for name in DOCUMENTS},
    "run nothing": ("run", "nowhere.yaml"),
    "run a folder": ("run", "notes"),
    "run a link to itself": ("run", "loop.ply"),
    "run a setting without a value": ("run", "documents/want_more.yaml", "--set", "drape"),
    "run an unknown setting": ("run", "documents/want_more.yaml", "--set", "drape.happiness=3"),
    "plan a bomb": ("plan", "tapes/bomb.yaml"),
    "plan a depth": ("plan", "tapes/deep.yaml"),
    "plan a loop": ("plan", "documents/linked.yaml"),
    "plan what cannot be made": ("plan", "documents/want_more.yaml"),
    "plan for an unknown stage": ("plan", "documents/want_more.yaml", "--set", "knit.rows=3"),
    "report on nothing": ("report", "nowhere"),
    "report on a file": ("report", "a_file"),
    "report on a folder of notes": ("report", "notes"),
    **{
        f"report on {name}": ("report", name)
        for name in ("run_cut", "run_list", "run_empty", "run_types", "run_strange")
    },
}
"""What is tried -> the command line."""
