"""One exception family. Each kind of failure has one exit code, and each message says what to do next."""

from __future__ import annotations

from collections.abc import Mapping


class VtoError(Exception):
    """A failure the user can act on.

    Args:
        problem: What is wrong, with the value seen and what is allowed.
        where: File, line, stage or artifact it concerns; empty when there is none.
        hint: What to do about it; empty when nothing can be done.
    """

    exit_code = 1

    def __init__(self, problem: str, *, where: str = "", hint: str = "") -> None:
        super().__init__(problem)
        self.problem = problem
        self.where = where
        self.hint = hint

    def __str__(self) -> str:
        lines = [f"error: {self.problem}"]
        if self.where:
            lines.append(f"  in {self.where}")
        if self.hint:
            lines.append(f"  hint: {self.hint}")
        return "\n".join(lines)


class ConfigError(VtoError):
    """A setting or a YAML document is wrong."""

    exit_code = 2


class PlanError(VtoError):
    """A wanted artifact cannot be made from the inputs, or can be made in two ways."""

    exit_code = 2


class InputError(VtoError):
    """An input is missing, unreadable, or lacks what it should hold."""

    exit_code = 3


class FormatError(InputError):
    """A file breaks the rules of its own format."""


class ComputationError(VtoError):
    """The computation failed on valid input.

    Args:
        partial: What was reached, artifact -> value; kept under RUN/out/partial for a look at it.
    """

    exit_code = 4

    def __init__(
        self, problem: str, *, where: str = "", hint: str = "", partial: Mapping[str, object] | None = None
    ) -> None:
        super().__init__(problem, where=where, hint=hint)
        self.partial = dict(partial or {})


class ScanError(ComputationError):
    """Reconstruction failed: too little texture, lost track, no surface."""


class GarmentError(ComputationError):
    """Alignment, subtraction, openings or remeshing failed."""


class AvatarError(ComputationError):
    """No plausible body explains the input."""


class SimulationError(ComputationError):
    """The drape failed."""


class DivergedError(SimulationError):
    """Positions or energies grew without bound."""


class FallenError(SimulationError):
    """Nothing holds the garment: it fell off the body."""


class JammedError(SimulationError):
    """Contacts hold the cloth with forces that no waiting takes away."""


class IntersectingError(SimulationError):
    """The result still passes through the body or itself."""


class BatchError(VtoError):
    """Some rows of a batch are not done; the others are whole."""

    exit_code = 6


class MissingDependencyError(VtoError):
    """A library or a system package is not installed."""

    exit_code = 5
