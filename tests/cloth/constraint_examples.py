"""One small example of each kind of constraint, and more where builders differ."""

import numpy as np
from cloth_scenes import sheet

from vto_pipeline.cloth.constraints.bending.bend_friction import bend_friction
from vto_pipeline.cloth.constraints.bending.hinge import bend, solid_hinges
from vto_pipeline.cloth.constraints.bending.hinge_moments import hinge_moments
from vto_pipeline.cloth.constraints.bending.isometric import isometric_bend
from vto_pipeline.cloth.constraints.bending.shape_operator import shape_operator
from vto_pipeline.cloth.constraints.mass_spring import bending_springs, membrane_springs
from vto_pipeline.cloth.constraints.membrane.curve import curve
from vto_pipeline.cloth.constraints.membrane.green import green
from vto_pipeline.cloth.constraints.membrane.strain_friction import strain_friction
from vto_pipeline.cloth.constraints.membrane.strain_limit import strain_limit
from vto_pipeline.cloth.constraints.membrane.stretch import stretch
from vto_pipeline.cloth.constraints.points.attachment import attachments
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.monotone_curve import monotone_curve

MESH = sheet(4, 5, 0.3, 0.4)
FABRIC = Fabric("made up", 0.2, 3e-4, 900, 500, 100, 0.3, 1e-3, 5e-4, 0, 0.3)
SOFT_FABRIC = Fabric("softer in bending", 0.2, 3e-4, 900, 500, 100, 0.0, 1e-3, 5e-4, 0, 0.3)
KNIT = monotone_curve([0.0, 0.1, 0.2, 0.4], [0.0, 20.0, 100.0, 500.0])
WOVEN = monotone_curve([0.0, 0.02, 0.1], [0.0, 5.0, 60.0])


def crumpled(mesh=MESH, amount=0.03, seed=0):
    """Positions off those of a mesh, by about so much."""
    return mesh.vertices + np.random.default_rng(seed).normal(0, amount, mesh.vertices.shape)


def _hinge_friction(mesh, slider):
    found = solid_hinges(mesh, RestShape(mesh.vertices))
    made = bend_friction(found, RestShape(mesh.vertices), found.stiffness(FABRIC), 2e-3 * found.length)
    made.slider[:] = slider
    return made


def _strain_friction(mesh, slider):
    made = strain_friction(mesh.faces, RestShape(mesh.vertices), 0.2, (20.0, 0.0, 10.0))
    made.slider[:] = slider
    return made


def _limits(mesh):
    return strain_limit(mesh.faces, RestShape(mesh.vertices), (0.01, 0.02, 0.05), (1e-3, 2e-3, 5e-3))


def examples(mesh=MESH):
    """Return constraints by name; those on strains and angles are at work when the mesh is crumpled by 0.03 m."""
    faces, x, rest = mesh.faces, mesh.vertices, RestShape(mesh.vertices)
    pairs = np.column_stack([np.arange(len(x) - 1), np.arange(1, len(x))])
    ends = np.array([0, 1, 2])
    return {
        "attachment": attachments(ends, x[ends] + 0.02, x, 1e-3),
        "bend": bend(mesh, rest, FABRIC),
        "bend with rest angles": bend(mesh, RestShape(crumpled(mesh, seed=7), rest_angles=True), FABRIC),
        "bend_friction": _hinge_friction(mesh, 0.02),
        "bending springs": bending_springs(mesh, rest, FABRIC),
        "chain": springs(pairs, x, 1e-3),
        "curve": curve(faces, rest, WOVEN, KNIT, 100.0),
        "green": green(faces, rest, FABRIC),
        "hinge_moments": hinge_moments(shape_operator(mesh, rest, SOFT_FABRIC)),
        "isometric": isometric_bend(mesh, rest, FABRIC),
        "membrane springs": membrane_springs(mesh, rest, FABRIC),
        "shape_operator": shape_operator(mesh, rest, SOFT_FABRIC),
        "strain_friction": _strain_friction(mesh, 0.01),
        "strain_limit": _limits(mesh),
        "stretch": stretch(faces, rest, FABRIC),
    }


NAMES = sorted(examples())
MOVED_BY_SPACE = {"attachment"}  # held by something that does not turn with the cloth
WITHOUT_DAMPER = {"bend_friction", "strain_friction"}  # the damper is that of what is elastic beside them
