"""A surface through an unorganised cloud: normals, Poisson, and trimming of what Poisson closed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.errors import InputError, ScanError
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.canonical import canonical_mesh, drop_small_pieces, drop_vertices
from vto_pipeline.scan.normals import oriented_normals

MIN_POINTS = 100
"""Fewer points are no surface."""

COARSE_M = 0.02
"""Points further apart leave girths and lengths uncertain by as much."""

MAX_DEPTH = 11
"""Of the octree; one more takes four times the memory."""


class SurfaceConfig(Config):
    """Settings of the surface through a cloud."""

    outlier_sigmas: float = Field(3.0, gt=0, le=20, description="Points more isolated than this are dropped")
    neighbours: int = Field(20, ge=6, le=200, description="Points that a normal is fitted to")
    cell_spacings: float = Field(1.0, gt=0.2, le=10, description="Finest octree cell, in spacings of the points")
    gap_spacings: float = Field(3.0, gt=0.5, le=50, description="Surface this far from any point is cut away")
    rim_spacings: float = Field(1.0, gt=0.1, le=50, description="Rims are cut back to this distance from the points")
    thin_percent: float = Field(1.0, ge=0, lt=100, description="Share of least supported surface cut away as well [%]")
    min_piece: float = Field(0.01, ge=0, le=1, description="Smallest piece kept, as a share of the largest's area")


def reconstruct_cloud(cloud: PointCloud, config: SurfaceConfig, job: Job) -> TriangleMesh:
    """Reconstruct the surface a cloud lies on; where there are no points it stays open.

    Kazhdan and Hoppe 2013 (screened Poisson), by Open3D, solved by one thread so that it is reproducible.

    Args:
        cloud: Points [m]; normals are used where they are given.
        config: Settings.
        job: Notified of what was left out and cut off.

    Raises:
        InputError: too few points, or all on one line or plane.
        ScanError: no surface came out.
    """
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    cloud = _without_outliers(_distinct(cloud), config, job)
    spacing = _spacing(cloud.points)
    if spacing > COARSE_M:
        job.warn(
            f"the points lie {1000 * spacing:.0f} mm apart: the surface between them is a guess, and what is measured "
            "on it may be off by as much"
        )
    job.progress(0.1, f"normals of {len(cloud.points)} points")
    normals = oriented_normals(cloud, config.neighbours, job)
    job.progress(0.5, "Poisson")
    extent = 1.1 * float(np.ptp(cloud.points, axis=0).max())
    depth = int(np.clip(np.ceil(np.log2(extent / (config.cell_spacings * spacing))), 5, MAX_DEPTH))
    given = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
    given.normals = o3d.utility.Vector3dVector(np.array(normals))
    if cloud.colors is not None:
        given.colors = o3d.utility.Vector3dVector(cloud.colors / 255.0)
    solved, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(given, depth=depth, n_threads=1)
    vertices, colors = np.asarray(solved.vertices), None
    if len(solved.triangles) == 0:
        raise ScanError(f"no surface through {len(cloud.points)} points", hint="is it a scan of one object, in metres?")
    if cloud.colors is not None:
        colors = np.clip(np.round(255 * np.asarray(solved.vertex_colors)), 0, 255).astype(np.uint8)
    job.progress(0.9, "trimming")
    distance, _ = cKDTree(cloud.points).query(vertices)
    whole = TriangleMesh(vertices, np.asarray(solved.triangles), colors)
    loose = distance > config.rim_spacings * spacing
    loose |= np.asarray(density) < np.percentile(np.asarray(density), config.thin_percent)
    bad = _patches_with(whole, loose, distance > config.gap_spacings * spacing)
    mesh = drop_vertices(whole, bad)
    mesh = drop_small_pieces(canonical_mesh(mesh.vertices, mesh.faces, mesh.colors), config.min_piece, job)
    residual, _ = cKDTree(mesh.vertices).query(cloud.points)
    job.measure(
        spacing_mm=round(1000 * spacing, 3),
        octree_depth=depth,
        trimmed_share=round(float(bad.mean()), 4),
        points_off_surface_share=round(float((residual > config.gap_spacings * spacing).mean()), 4),
        points=len(mesh.vertices),
        triangles=len(mesh.faces),
    )
    return mesh


def _distinct(cloud: PointCloud) -> PointCloud:
    """Points sorted, each place once, so that the order in the file does not matter.

    Raises:
        InputError: too few points, or all on one line or plane.
    """
    _, first = np.unique(cloud.points, axis=0, return_index=True)
    part = _subset(cloud, first)
    if len(part.points) < MIN_POINTS:
        raise InputError(f"{len(part.points)} distinct points; at least {MIN_POINTS} are needed for a surface")
    spread = np.linalg.svd(part.points - part.points.mean(0), compute_uv=False)
    if spread[2] < 1e-6 * spread[0]:
        shape = "line" if spread[1] < 1e-6 * spread[0] else "plane"
        raise InputError(f"all {len(part.points)} points lie on one {shape}, which has no inside and no outside")
    return part


def _subset(cloud: PointCloud, chosen: NDArray[Any]) -> PointCloud:
    normals = None if cloud.normals is None else cloud.normals[chosen]
    return PointCloud(cloud.points[chosen], normals, None if cloud.colors is None else cloud.colors[chosen])


def _without_outliers(cloud: PointCloud, config: SurfaceConfig, job: Job) -> PointCloud:
    """Leave out points whose mean distance to their neighbours is unusual."""
    distance, _ = cKDTree(cloud.points).query(cloud.points, k=min(config.neighbours, len(cloud.points) - 1) + 1)
    gap = distance[:, 1:].mean(1)
    keep = gap <= gap.mean() + config.outlier_sigmas * gap.std()
    if not keep.all():
        job.note(f"left out {int((~keep).sum())} isolated points of {len(keep)}")
    return _subset(cloud, keep)


def _spacing(points: FloatArray) -> float:
    """Side of the square a point has for itself [m]: √2 of it is the way to the sixth neighbour, gridded or random."""
    distance, _ = cKDTree(points).query(points, k=7)
    return float(np.median(distance[:, 6]) / np.sqrt(2))


def _patches_with(mesh: TriangleMesh, loose: NDArray[np.bool_], core: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Connected patches of loose vertices (V,) that hold a core vertex: a small gap between points is no opening."""
    links = edges(mesh)
    links = links[loose[links].all(axis=1)]
    graph = coo_matrix((np.ones(len(links)), links.T), shape=(len(loose), len(loose)))
    _, patch = connected_components(graph, directed=False)
    opened = np.zeros(len(loose), dtype=bool)
    opened[patch[core & loose]] = True
    return np.asarray(loose & opened[patch])
