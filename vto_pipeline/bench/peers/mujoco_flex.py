"""MuJoCo: a flexible body of triangles with membrane elasticity, implicit in time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.cloth.scenes import AREAL_DENSITY, FRICTION, POISSON, RADIUS, SIDE, STIFFNESS, Scene
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.errors import DivergedError
from vto_pipeline.units import GRAVITY

_THICKNESS = 1e-3  # [m]; Young's modulus times this is the scene's stiffness
_ITERATIONS, _TOLERANCE = 50, 1e-8  # of its constraint solver
_CONTACT = "0.005 1"  # time constant [s] and damping ratio of contacts

_XML = """<mujoco>
  <option timestep="{step:.12g}" solver="CG" iterations="{iterations}" tolerance="{tolerance}" integrator="discrete"
          gravity="0 {gravity} 0" jacobian="sparse"/>
  <size memory="2G"/>
  <worldbody>
    {ball}
    <flexcomp name="cloth" type="direct" dim="2" mass="{mass}" radius="{radius}" point="{points}" element="{faces}">
      <elasticity young="{young}" poisson="{poisson}" thickness="{thickness}" elastic2d="stretch"/>
      {pins}
      <contact selfcollide="{own}" friction="{friction} 0 0" solref="{contact}"/>
    </flexcomp>
  </worldbody>
</mujoco>"""


class _Flex:
    """The scene as MuJoCo's model and data."""

    def __init__(self, scene: Scene, settings: Mapping[str, Value]) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        mujoco.set_mju_user_warning(lambda text: None)  # it logs into a file here that nothing resists bending
        self._steps = int(str(settings["substeps"]))
        try:
            self._model = mujoco.MjModel.from_xml_string(_document(scene, settings))
        except ValueError as error:
            raise DivergedError(f"refused by its model compiler: {error}") from None
        self._data = mujoco.MjData(self._model)
        self._free = np.flatnonzero(scene.model.inverse_mass > 0.0)
        self._count = len(scene.start)
        self._data.qpos[:] = (scene.start - scene.rest)[self._free].ravel()  # sliders from the rest shape
        mujoco.mj_forward(self._model, self._data)

    def frame(self) -> None:
        for _ in range(self._steps):
            self._mujoco.mj_step(self._model, self._data)

    def state(self) -> ClothState:
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_flex(self._model, self._data)
        velocities = np.zeros((self._count, 3))
        velocities[self._free] = self._data.qvel.reshape(-1, 3)
        return ClothState(self._data.flexvert_xpos.reshape(-1, 3).copy(), velocities)


def start(scene: Scene, settings: Mapping[str, Value]) -> _Flex:
    """Return the scene; settings: substeps a frame, and whether cloth collides with itself.

    Raises:
        DivergedError: MuJoCo does not compile the model.
    """
    return _Flex(scene, settings)


def _document(scene: Scene, settings: Mapping[str, Value]) -> str:
    pinned = np.flatnonzero(scene.model.inverse_mass == 0.0)
    return _XML.format(
        step=FRAME / int(str(settings["substeps"])),
        iterations=_ITERATIONS,
        tolerance=_TOLERANCE,
        gravity=-GRAVITY,
        ball="" if scene.ball is None else f'<geom type="sphere" size="{RADIUS}" friction="{FRICTION} 0 0"/>',
        mass=AREAL_DENSITY * SIDE**2,
        radius=scene.skin,
        points=_listed(scene.rest),
        faces=_listed(scene.model.faces),
        young=STIFFNESS / _THICKNESS,
        poisson=POISSON,
        thickness=_THICKNESS,
        pins=f'<pin id="{_listed(pinned)}"/>' if len(pinned) else "",
        own="auto" if settings["self_collision"] else "none",
        friction=FRICTION,
        contact=_CONTACT,
    )


def _listed(values: ArrayLike) -> str:
    return " ".join(f"{value:.9g}" for value in np.asarray(values).ravel())
