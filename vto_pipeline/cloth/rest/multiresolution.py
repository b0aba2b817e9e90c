"""Coarse to fine: a garment first comes to rest on coarser meshes, where steps are cheap, and with softer threads.

A step costs more than in proportion to the vertices, and a fine mesh has as far to go as a coarse one. So what is a
matter of the way (the body growing, riding along, falling into place) is done once, on the coarsest mesh. Each finer
one starts from where the one before lies and has no more to settle than what that one could not show: smaller folds,
and the stiffness of its own triangles. After Zhang, Dumas, Fei, Jacobson, James & Kaufman 2022, "Progressive simulation
for cloth quasistatics".
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.body_motion import VariableSpeedBody
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothModel, ClothState, at_rest, build_cloth
from vto_pipeline.cloth.model.coarsening import coarser_ones
from vto_pipeline.cloth.placement.clear_body import edge_stretches
from vto_pipeline.cloth.placement.collision_free_start import freed_of_body
from vto_pipeline.cloth.rest.convergence import SettlingResult
from vto_pipeline.cloth.rest.foresight import rms
from vto_pipeline.cloth.rest.phases import ENLARGED, ROUGH, Phases
from vto_pipeline.cloth.rest.softened import softened
from vto_pipeline.cloth.rest.true_distance import some_positions, with_true_distances
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.errors import IntersectingError
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_FIRST = 0.5  # of the progress, and of the time there is: the coarser meshes


class RestOnMesh(NamedTuple):
    """How a garment came to rest on one mesh.

    Args:
        model: The cloth.
        phases: What it went through.
        stepper: The cloth among its colliders.
        settling: How it went.
        put_on: Where it was put on, before the body moved and it settled.
        warned: How many warnings there were then.
        before: What it went through on coarser meshes.
    """

    model: ClothModel
    phases: Phases
    stepper: Stepper
    settling: SettlingResult
    put_on: Garment
    warned: int
    before: tuple[Phases, ...] = ()


def come_to_rest(
    garment: Garment, body: MovingBody, fabric: Fabric, config: DrapeConfig, job: Job, deadline: float
) -> RestOnMesh:
    """Return the garment at rest on the body as it ends; the trace begins with those of the coarser meshes.

    Args:
        garment: Where it starts, about the body as it begins.
        body: What it lies on.
        fabric: What it is made of.
        config: All settings.
        job: For progress, findings and what was left out.
        deadline: `time.perf_counter` at which to stop settling.

    Raises:
        InputError, ConfigError: as `build_cloth` and `Stepper.prepare`.
        DivergedError: positions are no longer finite.
        IntersectingError: a limb goes through cloth, wherever the garment is led; `partial` holds it as "draped".
    """
    model = build_cloth(garment.mesh, garment.rest, fabric, materials=config, job=job)
    return _CoarseToFine(garment, model, fabric, config, job).run(body, deadline)


class _TooCoarse(NamedTuple):
    """Why a mesh is too coarse for its layers to lie between one another and the body.

    What is wedged there never comes to rest, and a finer mesh would begin with it.

    Args:
        why: What is wrong with it.
        vertices: How many it has.
    """

    why: str
    vertices: int


class _CoarseToFine:
    """The way of one garment down its meshes, coarsest first."""

    def __init__(self, garment: Garment, model: ClothModel, fabric: Fabric, config: DrapeConfig, job: Job) -> None:
        self._began = time.perf_counter()
        self._garment = garment
        self._model = model
        self._fabric = fabric
        self._config = config
        self._job = job
        skin_mm = 1e3 * default_skin(model.edge_length) if config.skin_mm is None else config.skin_mm
        self._rough = config.model_copy(update={"skin_mm": skin_mm})
        self._coarser = coarser_ones(garment, config.coarsen_above, job)

    def run(self, body: MovingBody, deadline: float) -> RestOnMesh:
        """Return the garment at rest on its own mesh.

        Raises:
            IntersectingError: also of one that must start larger for the body to be in it, and fails on a coarser mesh.
        """
        trace: list[TraceRow] = []
        looks: list[FloatArray] = []
        before: tuple[Phases, ...] = ()
        garments = [self._garment, *(one.garment for one in self._coarser)]
        start, motion, fresh = garments[-1], body, True
        for level in range(len(self._coarser), 0, -1):
            now = time.perf_counter()
            went = self._rest_on_coarser(level, start, motion, now + _FIRST * (deadline - now), fresh=fresh)
            if isinstance(went, _TooCoarse):
                self._refuse_if_too_small(went.why)
                self._job.leave_out(f"coming to rest on {went.vertices} vertices first", f"too coarse: {went.why}")
                start, motion, fresh = garments[level - 1], body, True
                continue
            found, finer = went
            trace += found.settling.trace
            looks += found.settling.looks
            before += (found.phases,)
            self._job.note(
                f"first came to rest on {len(start.mesh.vertices)} vertices: {time.perf_counter() - now:.1f} s, "
                f"{found.stepper.steps} steps"
            )
            start, fresh = finer, False
            motion = MovingBody(body.keyframes[-1:], body.faces)
        reached = self._rest_on_own(start, motion, deadline, fresh=fresh)
        settling = reached.settling
        final = reached.phases.some(settling.state.positions)
        settling.trace = with_true_distances(trace + settling.trace, looks + settling.looks, final)
        return reached._replace(before=before)

    def _rest_on_coarser(
        self, level: int, garment: Garment, body: MovingBody, deadline: float, *, fresh: bool
    ) -> tuple[RestOnMesh, Garment] | _TooCoarse:
        """Return the garment at rest on a coarser mesh, and where the next finer one begins.

        Args:
            level, garment, body, deadline, fresh: See `_rest_on`.
        """
        told = len(self._job.warnings)
        fails = _TooCoarse("parts of the body go through the cloth", len(garment.mesh.vertices))
        for closely in (False,) if self._config.body_features else (False, True):
            if closely and not self._may_try_again(garment, deadline):
                break
            found = self._rest_on(level, garment, body, deadline, fresh=fresh, closely=closely)
            if isinstance(found, _TooCoarse):
                fails = found
                break
            finer = self._finer_start(level, found.settling.state.positions, body.final)
            if finer is not None:
                return found, finer
            garment, fresh = found.put_on, False
        del self._job.warnings[told:]  # a finer mesh tells its own
        return fails

    def _finer_start(self, level: int, positions: FloatArray, body: TriangleMesh) -> Garment | None:
        """Return the next finer garment where this one lies, moved a little so that it is clear of the body.

        Args:
            level: Of the coarser mesh.
            positions: Of its vertices [m], shape (V, 3).
            body: Where it is now.

        Returns:
            None where that cannot be: cloth would be held for ever by what goes through it.
        """
        finer = self._garment if level == 1 else self._coarser[level - 2].garment
        there, faces = self._coarser[level - 1].prolong(positions), finer.mesh.faces
        if self._config.self_collision and len(intersecting_faces(TriangleMesh(there, faces), body)) > 0:
            freed = freed_of_body(there, faces, finer.rest.positions, self._fabric.thickness, body)
            if freed is None:
                return None
            there = freed
        return Garment(TriangleMesh(there, faces), finer.rest)

    def _rest_on_own(self, garment: Garment, body: MovingBody, deadline: float, *, fresh: bool) -> RestOnMesh:
        """Return the garment at rest on its own mesh.

        Ears, fingers and toes may be finer than that, and come between its vertices. Then it is done once more, and the
        body's corners and edges keep out of the cloth, too.

        Args:
            garment, body, deadline, fresh: See `_rest_on`.
        """
        found = self._rest_on(0, garment, body, deadline, fresh=fresh)
        assert isinstance(found, RestOnMesh)  # only coarser ones are given up
        config, settling = self._config, found.settling
        if config.body_features or not config.self_collision or settling.caught or settling.jammed:
            return found
        lies = TriangleMesh(settling.state.positions, garment.mesh.faces)
        if len(intersecting_faces(lies, body.final)) == 0 or not self._may_try_again(garment, deadline):
            return found
        del self._job.warnings[found.warned :]
        again = self._rest_on(0, found.put_on, body, deadline, fresh=False, closely=True)
        assert isinstance(again, RestOnMesh)
        return again

    def _may_try_again(self, garment: Garment, deadline: float) -> bool:
        """Return whether there is time to go through a mesh once more, and say that it is done."""
        in_time = time.perf_counter() < deadline
        if in_time:
            count = len(garment.mesh.vertices)
            self._job.note(f"parts of the body came between {count} vertices: once more, so that they cannot")
        return in_time

    def _rest_on(
        self, level: int, garment: Garment, body: MovingBody, deadline: float, *, fresh: bool, closely: bool = False
    ) -> RestOnMesh | _TooCoarse:
        """Return the garment at rest on one mesh: 0 is its own, the last the coarsest.

        Args:
            level: Of which mesh.
            garment: Where it starts.
            body: What it lies on.
            deadline: `time.perf_counter` at which to stop settling.
            fresh: Whether it starts where the garment was given, not where a coarser mesh came to rest.
            closely: Whether the body's corners and edges keep out of the cloth in any case.
        """
        model, config, job = self._model, self._config, self._job
        if level > 0:
            config, job = self._rough, self._part(level)
            model = self._soft(garment, config)
        if closely:
            config = config.model_copy(update={"body_features": True})
        phases = Phases(model, garment.rest, self._fabric, config, job)
        phases.some = partial(self._some, level)
        first = TriangleMesh(body.keyframes[0], body.faces)
        state = phases.resolve_crossings(at_rest(garment.mesh.vertices))
        untangled = warned = len(job.warnings)
        if fresh:  # the others start outside the body, but for corners that edges have cut
            try:
                grown = phases.grow_body(state, first)
            except IntersectingError as error:
                if level == 0:
                    raise
                return _TooCoarse(error.problem, len(model.mass))
            warned = len(job.warnings)
            state = phases.resolve_crossings(grown, first)
        put_on = Garment(TriangleMesh(state.positions, model.faces), garment.rest)
        collider = phases.collider(phases.give_way(body, put_on.mesh), put_on.mesh)
        stepper = phases.stepper(model, collider, config.damping)
        stepper.prepare(state.positions)
        job.note(f"{stepper.choice.method}, {stepper.substeps} steps per 1/60 s: {stepper.choice.reason}")
        try:
            state = phases.follow_body(state, stepper, collider, body.final)
        except IntersectingError as error:
            if level == 0:
                raise
            return _TooCoarse(error.problem, len(model.mass))
        before = time.perf_counter() - self._began
        if level > 0:
            cut = fresh and phases.crossings_left > 0  # else corners that are left in the body are a finer mesh's
            settling = phases.settle_and_clear(state, stepper, body.final, deadline, (ROUGH,), clears=cut)
            lies = TriangleMesh(settling.state.positions, model.faces)
            if cut and len(left := intersecting_faces(lies, body.final)) > 0:
                return _TooCoarse(f"{len(left)} pairs of triangles still intersect", len(model.mass))
        else:
            softer = phases.stepper(self._soft(garment, config), collider, config.damping)
            settling = _by_softer_threads(phases, softer, stepper, state, body.final, deadline)
            if not stepper.has_exact_rest and settling.residual >= config.target_residual:
                self._measure_distance(garment, collider, body.final, settling, deadline)
        if level > 0 and (settling.jammed or settling.caught):
            weights = f"with forces of {settling.residual:.0f} times the weight"
            what = "it is caught in the body" if settling.caught else "its layers are jammed"
            return _TooCoarse(f"{what}, {weights}", len(model.mass))
        settling.trace = [replace(row, seconds=before + row.seconds, level=level) for row in settling.trace]
        if level > 0:  # how it was put on is done but once; what else matters in the end warns again
            self._job.warnings += job.warnings[untangled:warned]
            others = job.warnings[:untangled] + job.warnings[warned:]
            self._job.notes += [f"on {len(model.mass)} vertices: {text}" for text in others]
        return RestOnMesh(model, phases, stepper, settling, put_on, warned)

    def _measure_distance(
        self,
        garment: Garment,
        collider: VariableSpeedBody,
        body: TriangleMesh,
        settling: SettlingResult,
        deadline: float,
    ) -> None:
        """Set the error to the way that Newton's method goes on from there, in as much time again at most.

        A method that solves its steps in part comes to stand where forces are left over, and foresees no motion.
        """
        began = time.perf_counter()
        name = str(self._config.solver)
        config = self._config.model_copy(update={"solver": "newton", "substeps": None, "sweeps": None})
        job = Job(lambda done, text: self._job.progress(0.9 + 0.05 * done, f"how far {name} is from rest: {text}"))
        judge = Phases(self._model, garment.rest, self._fabric, config, job)
        softer = judge.stepper(self._soft(garment, config), collider, config.damping)
        stepper = judge.stepper(self._model, collider, config.damping)
        until = min(deadline, began + settling.trace[-1].seconds)
        found = _by_softer_threads(judge, softer, stepper, at_rest(settling.state.positions), body, until)
        apart = rms(found.state.positions - settling.state.positions)
        settling.error = apart + found.error if np.isfinite(found.error) else max(settling.error, apart)
        settling.trace[-1] = replace(settling.trace[-1], error_mm=1e3 * settling.error)
        settling.settled = settling.settled and 1e3 * settling.error <= config.target_error_mm
        how = "to rest" if found.settled else "and is not at rest then"
        self._job.note(
            f"from where {name} stands, newton moved the cloth by {1e3 * apart:.1f} mm (rms) in "
            f"{time.perf_counter() - began:.0f} s, {how}"
        )

    def _soft(self, garment: Garment, config: DrapeConfig) -> ClothModel:
        """Return a garment's cloth with softer threads."""
        fabric, materials = softened(self._fabric, config)
        return build_cloth(garment.mesh, garment.rest, fabric, materials=materials)

    def _some(self, level: int, positions: FloatArray) -> FloatArray:
        """Return where some vertices of the garment's own mesh are when those of a coarser one are here [m]."""
        for coarse in self._coarser[:level][::-1]:
            positions = coarse.prolong(positions)
        return some_positions(len(self._model.mass))(positions)

    def _refuse_if_too_small(self, why: str) -> None:
        """Raise an error if a garment that failed on a coarser mesh was put in its place in another size than its own.

        Cloth that is drawn so far about a body passes through it at its first chance: a finer mesh takes minutes to
        find the same.
        """
        mesh, rest = self._garment.mesh, self._garment.rest.positions
        times = float(np.median(edge_stretches(mesh.vertices, rest, mesh.faces)))
        if times > ENLARGED:
            raise IntersectingError(
                f"too small: this body needs the garment {times - 1:.0%} larger, and on a coarser mesh {why}",
                hint="give a larger size, or a body that it is meant for",
                partial={"draped": mesh},
            )

    def _part(self, level: int) -> Job:
        """Return a job whose progress is a part of the first half of the whole one's."""
        count, whole = len(self._coarser), self._job

        def progress(done: float, text: str) -> None:
            whole.progress(_FIRST * (count - level + done) / count, f"on a coarser mesh: {text}")

        return Job(progress, whole.scratch, whole.seed, whole.force_all)


def _by_softer_threads(
    phases: Phases, softer: Stepper, stepper: Stepper, state: ClothState, body: TriangleMesh, deadline: float
) -> SettlingResult:
    """Return how a cloth came to rest: nearly so with softer threads, then as it is; where those jam, no farther.

    Args:
        phases: Of its mesh.
        softer, stepper: The cloth among its colliders, with softer threads and as it is.
        state: Where to begin.
        body: Where it is now.
        deadline: `time.perf_counter` at which to stop.
    """
    began = time.perf_counter()
    nearly = phases.settle(state, softer, body, began + _FIRST * (deadline - began))
    stepper.steps += softer.steps
    if nearly.jammed or nearly.caught:
        return nearly
    stepper.contact_memory = softer.contact_memory  # what pushes now pushes still
    spent = time.perf_counter() - began
    start = replace(at_rest(nearly.state.positions), time=nearly.state.time)
    settling = phases.settle_and_clear(start, stepper, body, deadline)
    settling.trace = nearly.trace + [replace(row, seconds=spent + row.seconds) for row in settling.trace]
    settling.looks = nearly.looks + settling.looks
    return settling
