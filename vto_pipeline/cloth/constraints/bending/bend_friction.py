"""Internal friction of bending: at each hinge a spring in series with a slider, beside what is elastic.

The slider gives way at a moment and stays where it is left: the Jenkin element of Iwan 1966, "A distributed-element
model for hysteresis". Cycled, a hinge runs through the loop that KES measures, 2HB wide; left alone, it keeps the
residual curvature HB / B. A hinge of length l slips at the moment HB l, which makes the loss of a bent sheet
HB |Δκ| per area on any mesh. With a high moment and part of the rigidity it is plastic bending with linear hardening.

During a step the slider is held and the moment is the spring's, at most the slider's: return mapping, fully implicit
(Simo & Hughes 1998, box 1.5); then `slip` moves the slider. Energy ½ e²/α up to e = α M, and M |e| - ½ α M² beyond.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bending.hinge import (
    Hinges,
    add_moment,
    apply_hinge_multiplier,
    hinge_angle_gradients,
    hinge_mobility,
)
from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.slider import huber, secant_compliance, slider_slip, wrap_angle
from vto_pipeline.numerics.mechanics.xpbd_row import bounded_step
from vto_pipeline.numerics.vector import dot, store_at


class BendFriction(NamedTuple):
    """Sliders of hinges, in the order in which they are solved.

    Args:
        vertices: Ends of the hinge, then the wings, shape (H, 4).
        rest: Rest angle [rad], shape (H,).
        slider: How far the slider has gone from there [rad], shape (H, 1); changed by `slip`.
        compliance: Of the spring [1/(N·m)], shape (H,).
        limit: Moment at which the slider gives way [N·m], shape (H,).
        damping: Zero: the damper is that of what is elastic beside it.
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    rest: NDArray[np.float64]
    slider: NDArray[np.float64]
    compliance: NDArray[np.float64]
    limit: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def bend_friction(
    hinges: Hinges,
    rest: RestShape,
    stiffness: NDArray[np.float64],
    limit: NDArray[np.float64],
) -> BendFriction:
    """Return sliders for these hinges.

    Args:
        hinges: Those of the sheet.
        rest: Its shape without forces.
        stiffness: Of the spring [N·m], positive, shape (H,).
        limit: Moment at which the slider gives way [N·m], positive, shape (H,).
    """
    order, starts, colours = blocks(hinges.vertices, rest.positions)
    return BendFriction(
        np.ascontiguousarray(hinges.vertices[order]),
        hinges.angle[order],
        np.zeros((len(order), 1)),
        1.0 / stiffness[order],
        limit[order],
        0.0,
        starts,
        colours,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _extension(i, angle, data):
    """Return by how much the spring is turned: the angle less rest angle and slider, the short way round."""
    return wrap_angle(angle - data.rest[i] - data.slider[i, 0])


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(i, x, start, inverse_mass, data, multipliers, h):
    angle, slopes = hinge_angle_gradients(i, x, data)
    weight = hinge_mobility(i, inverse_mass, data, slopes)
    if weight == 0.0:
        return
    before, soft = multipliers[i, 0], data.compliance[i] / (h * h)
    most = h * h * data.limit[i]
    shift = bounded_step(weight + soft, -_extension(i, angle, data) - soft * before, before, -most, most)
    multipliers[i, 0] = before + shift
    apply_hinge_multiplier(i, x, inverse_mass, data, slopes, shift)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(i, x, data, forces):
    angle, slopes = hinge_angle_gradients(i, x, data)
    energy, moment = huber(_extension(i, angle, data), data.compliance[i], data.limit[i])
    add_moment(i, data, slopes, -moment, forces)
    return energy


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(i, x, data, values, gradients, compliance):
    angle, slopes = hinge_angle_gradients(i, x, data)
    values[0] = _extension(i, angle, data)
    for s in range(4):
        store_at(gradients, 0, s, slopes[s])
    compliance[0, 0] = secant_compliance(values[0], data.compliance[i], data.limit[i])


@njit(cache=True, error_model="numpy", forceinline=True)
def _slip(i, x, data):
    angle, slopes = hinge_angle_gradients(i, x, data)
    if dot(slopes[2], slopes[2]) > 0.0:  # a hinge without area has no angle
        data.slider[i, 0] += slider_slip(_extension(i, angle, data), data.compliance[i], data.limit[i])


KIND = Kind(BendFriction, 1, _project, _force, _linearise, None, slip=_slip)
