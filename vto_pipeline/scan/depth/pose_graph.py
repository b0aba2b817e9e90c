"""Pose graph optimisation: the path that best agrees with all measured motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class Edge:
    """Frame `source` tracked to frame `target`.

    Args:
        source, target: Which frames.
        target_from_source: The motion, shape (4, 4).
        information: Inverse covariance of it up to a common factor, shape (6, 6).
        overlap: Share of the source's points that fit the target's surface.
        confirmed: Whether matched features agree on the motion.
    """

    source: int
    target: int
    target_from_source: FloatArray
    information: FloatArray
    overlap: float
    confirmed: bool


def optimise_poses(poses: FloatArray, edges: list[Edge], reach: float) -> FloatArray:
    """Poses that agree best with all edges; edges between distant frames may be rejected.

    Choi et al. 2015.

    Args:
        poses: First guess of world_from_cam, shape (N, 4, 4).
        edges: Measured motions.
        reach: How far readings may lie apart that count as the same [m].
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    graph = registration.PoseGraph()
    for pose in poses:
        graph.nodes.append(registration.PoseGraphNode(pose))
    for e in edges:
        edge = registration.PoseGraphEdge(
            e.source, e.target, e.target_from_source, e.information, uncertain=abs(e.target - e.source) != 1
        )
        graph.edges.append(edge)
    option = registration.GlobalOptimizationOption(
        max_correspondence_distance=reach,
        edge_prune_threshold=0.25,
        preference_loop_closure=2.0,
        reference_node=0,
    )
    criteria = registration.GlobalOptimizationConvergenceCriteria()
    registration.global_optimization(graph, registration.GlobalOptimizationLevenbergMarquardt(), criteria, option)
    return np.stack([node.pose for node in graph.nodes])


def disagreement(poses: FloatArray, edge: Edge) -> float:
    """Distance between the measured and the final place of one frame seen from the other [m]."""
    final = np.linalg.inv(poses[edge.target]) @ poses[edge.source]
    return float(np.linalg.norm(final[:3, 3] - edge.target_from_source[:3, 3]))
