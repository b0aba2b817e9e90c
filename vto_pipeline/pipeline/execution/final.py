"""Final stages: they use only RUN/out, so they can run again without the rest."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.folder import RECORD, existing_run, locked_run_folder
from vto_pipeline.pipeline.execution.out import OutputFolder
from vto_pipeline.pipeline.given import Given, resolve
from vto_pipeline.pipeline.stage import Stage


def make_final(
    stage: Stage,
    settings: Config,
    out: OutputFolder,
    given: Mapping[str, Given],
    run_record: Mapping[str, Any],
    job: Job,
) -> None:
    """Run one final stage on RUN/out and write what it makes there.

    Args:
        stage: The row of the table.
        settings: Its settings.
        out: Where the run's artifacts are; a partial one stands in for one that was not finished.
        given: What the run was given.
        run_record: What run.json holds.
        job: For its notes.
    """
    names = (*stage.needs, *stage.optional)
    inputs = {name: given[name].read(job) for name in names if name in given} | out.find(names)
    out.put(stage.run({**inputs, "run_record": run_record}, settings, job))


def make_finals_again(folder: Path, catalogue: Catalogue) -> list[Path]:
    """Run the final stages of a run that has ended again, with default settings; of a failed one, those it has got to.

    Args:
        folder: RUN.
        catalogue: The tables.

    Returns:
        The files written.

    Raises:
        InputError: it is not the folder of a run, or lacks what its final stages need.
    """
    run_record = read_json(existing_run(folder) / RECORD)
    given = {}
    for artifact, one in run_record["given"].items():
        try:
            value = one.get("path", one.get("value"))
            given[artifact] = resolve(one["key"], value, folder, catalogue.kind(artifact), str(folder / RECORD))
        except InputError:
            continue  # moved since: the page does without
    out = OutputFolder(folder / "out", catalogue)
    try:
        planned = {stage["name"] for stage in run_record["stages"] if stage["status"] != "left_out"}
    except (KeyError, TypeError):
        raise InputError("not the record of a run", where=str(folder / RECORD)) from None
    written, lacking = [], []
    with locked_run_folder(folder):
        for stage in catalogue.stages:
            if not stage.final or stage.name not in planned:
                continue
            missing = [
                n for n in stage.needs if n not in given and not (out.folder / catalogue.kind(n).filename).is_file()
            ]
            if missing:
                lacking.append(f"{stage.name} needs {', '.join(missing)}, which this run did not make")
                continue
            make_final(stage, stage.settings(), out, given, run_record, Job())
            written += [out.folder / catalogue.kind(artifact).filename for artifact in stage.makes]
    if lacking and not written:
        raise InputError("; ".join(lacking), where=str(folder))
    return written
