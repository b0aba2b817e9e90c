"""Several garments, in layers: put on one by one, inner first, then at rest jointly.

Each is draped alone first. What is worn beneath is then frozen with some room about it (`wrap_in_surface`), and the
garment is draped over that, which leaves it clear of all beneath and on the right side. At the end all move together,
as one cloth whose garments have their own fabrics, and what kept the cloth from itself keeps the layers apart.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.cloth.drape import drape, format_places, refuse_crossings
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.model.build import at_rest
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.outfit.audit import audit_outfit
from vto_pipeline.cloth.outfit.body_with_layers import wrap_in_surface
from vto_pipeline.cloth.outfit.combined_cloth import MultiFrictionBody, combine_garments
from vto_pipeline.cloth.placement.place import place_garment
from vto_pipeline.cloth.rest.phases import Phases
from vto_pipeline.cloth.rest.true_distance import with_true_distances
from vto_pipeline.errors import ComputationError, DivergedError, FallenError, InputError, IntersectingError
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.cloth import seconds_within
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.outfit import DrapedOutfit, Layer

_NEARLY = 10.0  # times the bounds of rest: near enough for a garment that others are still to be put over
_STRAY = 0.01  # of a garment's vertices: so many may peep out at a rim or an armhole
_ALONE = 0.6  # of the progress, and of the time there is: putting the garments on


def drape_layers(
    layers: Sequence[Layer],
    body: MovingBody | TriangleMesh,
    settings: DrapeConfig | Mapping[str, object] | None = None,
    job: Job | None = None,
) -> DrapedOutfit:
    """Drape garments on a body, in layers.

    Args:
        layers: Inner first. Each is where it was: on the body as it begins, or anywhere when the body is at rest.
        body: What they lie on.
        settings: Keys of `DrapeConfig`, for all.
        job: For progress, findings and what was left out.

    Returns:
        Each garment at its end. The predicted error of each is at most that of all by the root of its share of the
        vertices.

    Raises:
        ConfigError, DivergedError: as `drape`.
        InputError: as `drape`, the same garment twice, or none.
        IntersectingError: something crosses, or more than a trace of an inner garment lies outside an outer one;
            `partial` holds the garments as "NAME_draped", and "audit" and "trace".
    """
    if not layers:
        raise InputError("no garment to drape")
    config, job = checked(DrapeConfig, settings), job or Job()
    if isinstance(body, TriangleMesh):
        body = MovingBody(body.vertices[None], body.faces)
    refuse_duplicates(layers)
    return _Outfit(config, body, job).drape(layers)


def refuse_duplicates(layers: Sequence[Layer]) -> None:
    """Refuse a garment given twice: cloth in the very place of other cloth has no order of layers.

    Raises:
        InputError: two names are the same, or two meshes.
    """
    for k, layer in enumerate(layers):
        for other in layers[:k]:
            if layer.name == other.name:
                raise InputError(f"two garments are named {layer.name}", hint="give each its own name")
            one, two = layer.garment.mesh, other.garment.mesh
            if np.array_equal(one.vertices, two.vertices) and np.array_equal(one.faces, two.faces):
                raise InputError(
                    f"{other.name} and {layer.name} are the same garment in the same place",
                    hint="give each garment once; two alike must differ in size or lie apart",
                )


class _Outfit:
    """The drape of one outfit, and what its steps share."""

    def __init__(self, config: DrapeConfig, body: MovingBody, job: Job) -> None:
        self._config = config
        self._body = body
        self._still = body.final
        self._job = job
        self._began = time.perf_counter()

    def drape(self, layers: Sequence[Layer]) -> DrapedOutfit:
        """Return the garments at rest."""
        worn: list[Layer] = []
        seconds = {}
        for k, layer in enumerate(layers):
            began = time.perf_counter()
            job = self._part(layer.name, k * _ALONE / len(layers), (k + 1) * _ALONE / len(layers))
            try:
                worn.append(replace(layer, garment=self._drape_layer(layer, worn, len(layers), job)))
            except ComputationError as error:
                error.problem = f"{layer.name}: {error.problem}"
                error.partial = {f"{layer.name}_draped": error.partial.get("draped", layer.garment.mesh)}
                raise
            finally:
                self._job.notes += [f"{layer.name}: {text}" for text in job.notes]
                self._job.warnings += [f"{layer.name}, when put on: {text}" for text in job.warnings]
                self._job.left_out += [(f"{layer.name}: {what}", reason) for what, reason in job.left_out]
            seconds[layer.name] = time.perf_counter() - began
        return self._relax_together(worn, seconds)

    def _part(self, name: str, begin: float, end: float) -> Job:
        """Return a job whose progress is a part of the whole one's."""

        def progress(done: float, text: str) -> None:
            self._job.progress(begin + (end - begin) * done, f"{name}: {text}")

        return Job(progress, self._job.scratch, self._job.seed, self._job.force_all)

    def _drape_layer(self, layer: Layer, beneath: Sequence[Layer], count: int, job: Job) -> Garment:
        """Return a garment nearly at rest on the final body, outside and clear of the layers beneath."""
        garment, body = layer.garment, self._body
        settings = {
            **self._config.model_dump(),
            "place": "as_it_stands",
            "target_error_mm": min(100.0, _NEARLY * self._config.target_error_mm),
            "target_residual": min(10.0, _NEARLY * self._config.target_residual),
        }
        if self._config.time_budget_s is not None:
            settings["time_budget_s"] = _ALONE * self._config.time_budget_s / count
        if len(body.keyframes) == 1:
            garment = place_garment(garment, self._still, self._config, job)
        else:
            garment = Garment(drape(garment, body, layer.fabric, settings, job).mesh, garment.rest)
            if not beneath:
                return garment
        if not beneath:
            return Garment(drape(garment, self._still, layer.fabric, settings, job).mesh, garment.rest)
        solid = wrap_in_surface(self._still, [one.garment.mesh for one in beneath])
        settings |= {
            "grow_above_mm": 0.0,  # pushed out as the solid grows, cloth stays where it is along the body
            "clear_rounds": 0,  # a coarse triangle may cut a corner of the room that the solid has to spare
        }
        try:
            mesh = drape(garment, solid, layer.fabric, settings, job).mesh
        except IntersectingError as error:
            found = error.partial["draped"]
            assert isinstance(found, TriangleMesh)
            job.warn(f"over the spare room of the layers beneath: {error.problem}")
            mesh = found
        return Garment(mesh, garment.rest)

    def _relax_together(self, layers: Sequence[Layer], seconds: Mapping[str, float]) -> DrapedOutfit:
        """Return all garments at rest together.

        Args:
            layers: Nearly at rest, clear of each other.
            seconds: What putting each on took [s].
        """
        began = time.perf_counter()
        config, job = self._config, self._job
        together = self._part("together", _ALONE, 1.0)
        joined = combine_garments(layers, config)
        thinnest = min((layer.fabric for layer in layers), key=lambda fabric: fabric.thickness)
        phases = Phases(joined.model, joined.rest, thinnest, config, together)
        own = joined.model.friction
        collider = MultiFrictionBody(
            self._still, np.full_like(own, config.friction) if config.friction is not None else own, job
        )
        stepper = phases.stepper(joined.model, collider, config.damping)
        deadline = np.inf if config.time_budget_s is None else self._began + config.time_budget_s
        try:
            state = phases.resolve_crossings(at_rest(joined.mesh.vertices), self._still)
            settling = phases.settle_and_clear(state, stepper, self._still, deadline)
        except (DivergedError, FallenError) as error:
            error.partial = {f"{layer.name}_draped": layer.garment.mesh for layer in layers}
            raise
        phases.report_collision_work()
        final = phases.some(settling.state.positions)
        settling.trace = with_true_distances(settling.trace, settling.looks, final)
        x = settling.state.positions
        worn = [
            replace(one, garment=replace(one.garment, mesh=replace(one.garment.mesh, vertices=x[span])))
            for one, span in zip(layers, joined.vertices, strict=True)
        ]
        findings = audit_outfit(
            worn,
            joined,
            self._still,
            config,
            settled=settling.settled,
            residual=stepper.residual(settling.state),
            skin=stepper.skin,
            job=job,
        )
        job.notes += together.notes
        job.warnings += together.warnings
        job.left_out += together.left_out
        error_mm = settling.error_mm
        if not settling.settled:
            job.warn(settling.not_settled_warning)
        spent = time.perf_counter()
        job.measure(
            **{**together.metrics, **findings},
            seconds=spent - self._began,
            together_s=spent - began,
            put_on_s=dict(seconds),
            steps=stepper.steps,
            error_mm=error_mm,
            within_1_mm_s=seconds_within(settling.trace, 1.0),
            layer_error_mm={
                one.name: None if error_mm is None else error_mm * float(np.sqrt(len(x) / len(x[span])))
                for one, span in zip(worn, joined.vertices, strict=True)
            },
        )
        partial: dict[str, object] = {f"{one.name}_draped": one.garment.mesh for one in worn}
        partial |= {"audit": findings, "trace": tuple(settling.trace)}
        refuse_crossings(findings, partial)
        if findings["out_of_order_share"] > _STRAY:
            raise IntersectingError(
                f"{findings['out_of_order_vertices']} vertices of inner garments lie outside outer ones, near "
                f"{format_places(findings['out_of_order_places'])}",
                hint="give the inner garment first, and allow enough time to put each on",
                partial=partial,
            )
        return DrapedOutfit({one.name: one.garment.mesh for one in worn}, tuple(settling.trace), findings)
