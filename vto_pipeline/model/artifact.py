"""A kind of artifact, and how it is stored in a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vto_pipeline.model.job import Job


@dataclass(frozen=True)
class ArtifactKind:
    """How a value is written to and read from a folder.

    Args:
        name: Identifier used in plans and by `want`.
        filename: Fixed file name under RUN/out.
        about: One line for people.
        read: Path -> value. Raises InputError on a bad file.
        write: (Path, value) -> None. The same value gives the same bytes.
        inline: What a document may hold in place of a path (a preset's name, a mapping) -> value; None where only a
            path will do. Paths inside a mapping arrive resolved, as Path.
        receive: (Path the user gave, Job) -> value, for kinds that are read otherwise when they come from outside: in a
            limited child process, with the unit guessed and every change told to the job. None: `read` serves both.
        in_folder: Folder -> whether it holds one; None where only a file will do. Asked before the folder is read, so
            that a wrong one is refused at once, however much it holds.
        stands_for: Name that a user may give in place of a path -> the folder that is meant; None: an unknown name.
            Raises MissingDependencyError where it is not installed.
        previews: Further files written beside it for other programs, never read back: (file name, writer).
    """

    name: str
    filename: str
    about: str
    read: Callable[[Path], Any]
    write: Callable[[Path, Any], None]
    inline: Callable[[Any], Any] | None = None
    receive: Callable[[Path, Job], Any] | None = None
    in_folder: Callable[[Path], bool] | None = None
    stands_for: Callable[[str], Path | None] | None = None
    previews: tuple[tuple[str, Callable[[Path, Any], None]], ...] = ()
