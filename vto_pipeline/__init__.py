"""Virtual try-on: digitize garments, fit bodies, drape cloth, and say how good the result is.

`vto_pipeline.scan`, `fit`, `drape` and `run` do what the commands of that name do; see `vto_pipeline.api`.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_COMMANDS = ("drape", "fit", "run")


def __getattr__(name: str) -> Any:
    """Return one of the commands as a function, loaded when it is asked for; `scan` is the package, called."""
    if name == "scan":
        return import_module("vto_pipeline.scan")
    if name in _COMMANDS:
        return getattr(import_module("vto_pipeline.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
