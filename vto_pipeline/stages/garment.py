"""Stages from a scanned surface to a garment ready for simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.scan.report import extremity_weights
from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig, rest_shape
from vto_pipeline.garment.align import AlignConfig, PosedPhotos, align_to_mannequin
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.open_seams import TakeMeshConfig, sew_open_seams
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.garment.photographed.confirmed import LookAgain
from vto_pipeline.garment.photographed.seen_ends import Scanned
from vto_pipeline.garment.simulation_mesh import SimulationMeshConfig, remesh_for_simulation
from vto_pipeline.garment.subtraction.estimated import label_over_estimate
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, extract_garment, label_garment
from vto_pipeline.garment.wearable import check_wearable
from vto_pipeline.geometry.metres import need_metres
from vto_pipeline.geometry.remeshing.repair import repair
from vto_pipeline.geometry.rigid import transform_cameras, transform_mesh
from vto_pipeline.geometry.topology import concatenate
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.scan.depth_views import frame_views, placed
from vto_pipeline.scan.photos.rematch.fillings import look_at_fillings
from vto_pipeline.scan.texture.project import TextureConfig, texture_surface

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

LOOK = ("garment_photos", "garment_cameras", "garment_points", "garment_depth_maps")
"""What the look at what was filled needs."""


def _photos(inputs: Inputs) -> PosedPhotos | None:
    """Return the photos that the scan was made from, in its frame; None without any."""
    if "garment_photos" not in inputs or "garment_cameras" not in inputs:
        return None
    return PosedPhotos(inputs["garment_photos"].paths, inputs["garment_cameras"])


def _photos_or_frames(inputs: Inputs) -> PosedPhotos | None:
    """Return the photos, or a depth camera's colour frames, that the scan was made from; None without any."""
    frames: DepthFrameSet | None = inputs.get("garment_depth")
    if frames is None or not frames.color_paths or "garment_trajectory" not in inputs:
        return _photos(inputs)
    used = placed(inputs["garment_trajectory"])
    paths = tuple(frames.color_paths[k] for k in used)
    lens = frames.intrinsics if frames.color_intrinsics is None else frames.color_intrinsics
    names = tuple(path.name for path in paths)
    cameras = CameraSet(names, (lens,) * len(used), inputs["garment_trajectory"][used])
    return PosedPhotos(paths, cameras, beside_depth=True)


def _align(inputs: Inputs, settings: AlignConfig, job: Job) -> Outputs:
    mannequin = need_metres(inputs["mannequin_surface"], "the mannequin")
    placement = align_to_mannequin(inputs["garment_surface"], mannequin, settings, job, _photos(inputs))
    return {"garment_placement": placement}


def _subtract(inputs: Inputs, settings: SubtractConfig, job: Job) -> Outputs:
    surface = inputs["garment_surface"]
    if "garment_placement" in inputs:
        surface = replace(transform_mesh(surface, inputs["garment_placement"]), metric=True)
        labels = label_garment(surface, inputs["mannequin_surface"], settings, job)
    elif "dressed_avatar" in inputs:
        body: Avatar = inputs["dressed_avatar"]
        labels = label_over_estimate(surface, body.mesh, extremity_weights(body), settings, job)
    else:
        need_metres(surface, "a garment without a mannequin")
        job.leave_out("subtraction", "no mannequin was given: the whole scan is garment")
        everything = np.ones(len(surface.vertices), dtype=bool)
        labels = SurfaceLabels(everything, everything.astype(float))
    return {"labels": labels, "garment_shell": extract_garment(surface, labels, settings, job)}


def _openings(inputs: Inputs, settings: OpeningsConfig, job: Job) -> Outputs:
    mannequin, placement, bare, photos = inputs.get("mannequin_surface"), inputs.get("garment_placement"), None, None
    if mannequin is not None and placement is not None:
        if "labels" in inputs:
            bare = BareParts(transform_mesh(inputs["garment_surface"], placement), inputs["labels"], mannequin)
        photos = _photos_or_frames(inputs)
        if photos is not None:
            photos = replace(photos, cameras=transform_cameras(photos.cameras, placement))
    look, scan = _look_at_fillings(inputs, settings, job), _scanned(inputs)
    shell = inputs["garment_shell"]
    garment, openings, observed = close_scan_holes(shell, mannequin, settings, job, bare, photos, look, scan)
    return {"garment": garment, "openings": openings, "observed": observed}


def _scanned(inputs: Inputs) -> Scanned | None:
    """Return the whole scan and its cameras in the frame of the garment; None where they are not known."""
    cameras, frames = inputs.get("garment_cameras"), inputs.get("garment_depth")
    if frames is not None and "garment_trajectory" in inputs:
        views = frame_views(frames, inputs["garment_trajectory"])
        cameras = CameraSet(views.names, views.intrinsics, views.world_from_cam)
    if cameras is None or "garment_surface" not in inputs:
        return None
    placement = inputs.get("garment_placement", np.eye(4))
    return Scanned(transform_mesh(inputs["garment_surface"], placement), transform_cameras(cameras, placement))


def _look_at_fillings(inputs: Inputs, settings: OpeningsConfig, job: Job) -> LookAgain | None:
    """Return what looks in the photos for what was filled, in the frame of the garment; None without photos."""
    if not settings.look_again:
        return None
    if any(name not in inputs for name in LOOK):
        job.leave_out("a look at what was filled", "the scan has no photos with depth")
        return None
    photos, cameras, points, maps = (inputs[name] for name in LOOK)
    garment_from_scan = inputs.get("garment_placement", np.eye(4))
    scan_from_garment = np.linalg.inv(garment_from_scan)
    mannequin = inputs.get("mannequin_surface") if "garment_placement" in inputs else None
    besides = None if mannequin is None else transform_mesh(mannequin, scan_from_garment)

    def look(garment: TriangleMesh, filled: NDArray[np.bool_]) -> tuple[FloatArray, NDArray[np.bool_]]:
        surface = transform_mesh(garment, scan_from_garment)
        places, found = look_at_fillings(surface, filled, besides, photos, cameras, points, maps, job)
        return transform_mesh(replace(surface, vertices=places), garment_from_scan).vertices, found

    return look


def _idle_look(settings: OpeningsConfig) -> tuple[str, ...]:
    """Inputs of the look at what was filled, when it is left out."""
    return () if settings.look_again else LOOK[2:]


def _texture(inputs: Inputs, settings: TextureConfig, job: Job) -> Outputs:
    cameras, scene = inputs["garment_cameras"], inputs.get("garment_surface")
    if "garment_placement" in inputs:
        cameras = transform_cameras(cameras, inputs["garment_placement"])
        scene = None if scene is None else transform_mesh(scene, inputs["garment_placement"])
    things = [thing for thing in (scene, inputs.get("mannequin_surface")) if thing is not None]
    occluder = concatenate(things) if things else None
    form = None
    if scene is not None and scene.colors is not None and "labels" in inputs and "garment_placement" in inputs:
        form = scene.colors[~inputs["labels"].garment]
    texture = texture_surface(inputs["garment"], occluder, inputs["garment_photos"], cameras, settings, job, form)
    return {"garment_texture": texture}


def _sew(inputs: Inputs, settings: SewConfig, job: Job) -> Outputs:
    pattern = inputs["garment_pattern"]
    sewn = sew(pattern, settings, job)
    return {"garment_mesh": in_shape(sewn, job, pattern.worn), "panels": pattern}


def _take_mesh(inputs: Inputs, settings: TakeMeshConfig, job: Job) -> Outputs:
    garment = repair(need_metres(inputs["garment_mesh"], "a garment"), settings, job)
    if "garment_pattern" not in inputs:  # a pattern says itself what is sewn
        garment = sew_open_seams(garment, 1e-3 * settings.sew_mm, job)
    openings = list_openings(garment)
    check_wearable(garment, openings)
    job.measure(openings=len(openings), vertices=len(garment.vertices))
    return {"garment": garment, "openings": openings, "observed": np.ones(len(garment.vertices), dtype=bool)}


def _simulation_mesh(inputs: Inputs, settings: SimulationMeshConfig, job: Job) -> Outputs:
    garment, laid = inputs["garment"], None
    if "garment_pattern" in inputs and np.array_equal(inputs["garment_mesh"].faces, garment.faces):
        laid = inputs["garment_mesh"].texture  # `sew` puts the panels there; what repairs a mesh drops it
    return {"sim_mesh": remesh_for_simulation(garment, settings, job, laid)}


def _rest_shape(inputs: Inputs, settings: RestShapeConfig, job: Job) -> Outputs:
    body, fabric = inputs.get("mannequin_surface"), inputs.get("fabric")
    given = inputs.get("garment_mesh")
    return {"rest_shape": rest_shape(inputs["sim_mesh"], settings, job, body, fabric, given)}


def _idle(settings: RestShapeConfig) -> tuple[str, ...]:
    """Inputs that the rest shape ignores in a mode, so that another fabric reuses it."""
    idle = () if settings.mode in ("gravity_removed", "inverse") else ("mannequin_surface", "fabric")
    return idle if settings.mode in ("auto", "panels") else (*idle, "garment_mesh")


STAGES: tuple[Stage, ...] = (
    Stage(
        name="align",
        about="the scan aligned to the mannequin (robust ICP on its bare parts, or its outline in the photos)",
        needs=("garment_surface", "mannequin_surface"),
        optional=("garment_photos", "garment_cameras"),
        makes=("garment_placement",),
        run=_align,
        settings=AlignConfig,
        uses=("libigl", "opencv-python-headless", "pyfqmr"),
    ),
    Stage(
        name="subtract",
        about="the scan split into garment and mannequin (graph cut)",
        needs=("garment_surface",),
        optional=("mannequin_surface", "garment_placement", "dressed_avatar"),
        makes=("labels", "garment_shell"),
        run=_subtract,
        settings=SubtractConfig,
        uses=("libigl", "open3d", "scipy"),
    ),
    Stage(
        name="openings",
        about="scan holes filled, neck, hem and cuffs kept",
        needs=("garment_shell",),
        optional=(
            "mannequin_surface",
            "garment_surface",
            "garment_placement",
            "labels",
            "garment_depth",
            "garment_trajectory",
            *LOOK,
        ),
        idle=_idle_look,
        makes=("garment", "openings", "observed"),
        run=_openings,
        settings=OpeningsConfig,
        uses=("libigl", "opencv-python-headless", "open3d"),
    ),
    Stage(
        name="texture",
        about="the garment laid flat in charts, each texel coloured from the photos that show it",
        needs=("garment", "garment_photos", "garment_cameras"),
        optional=("garment_surface", "garment_placement", "labels", "mannequin_surface"),
        makes=("garment_texture",),
        run=_texture,
        settings=TextureConfig,
        uses=("xatlas", "opencv-python-headless", "pyfqmr"),
    ),
    Stage(
        name="sew",
        about="a pattern's panels in triangles, their seams welded, bent in space without stretch",
        needs=("garment_pattern",),
        makes=("garment_mesh", "panels"),
        run=_sew,
        settings=SewConfig,
        uses=("manifold3d", "numba", "scipy"),
    ),
    Stage(
        name="take_mesh",
        about="a finished garment mesh, repaired, seams that its file leaves open sewn",
        needs=("garment_mesh",),
        optional=("garment_pattern",),
        makes=("garment", "openings", "observed"),
        run=_take_mesh,
        settings=TakeMeshConfig,
        uses=("libigl",),
    ),
    Stage(
        name="simulation_mesh",
        about="the garment in even triangles, for simulation",
        needs=("garment",),
        optional=("garment_pattern", "garment_mesh"),
        makes=("sim_mesh",),
        run=_simulation_mesh,
        settings=SimulationMeshConfig,
        uses=("gpytoolbox", "libigl", "pyfqmr"),
    ),
    Stage(
        name="rest_shape",
        about="the shape of the cloth without forces",
        needs=("sim_mesh",),
        optional=("garment_mesh", "mannequin_surface", "fabric"),
        idle=_idle,
        makes=("rest_shape",),
        run=_rest_shape,
        settings=RestShapeConfig,
        uses=("numba", "libigl"),
    ),
)
