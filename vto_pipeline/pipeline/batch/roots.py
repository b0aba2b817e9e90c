"""What a batch from strangers may read: files in some folders, and addresses that begin in some way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.files import check_inside
from vto_pipeline.io.stores import check_address, is_address

_LOCAL = "file"
_WEB = ("http", "https")


@dataclass(frozen=True)
class Roots:
    """Folders and beginnings of addresses; what lies in none of them is refused.

    Args:
        every: Paths and addresses; where there are none, everything may be read.
    """

    every: Sequence[str] = ()

    def __post_init__(self) -> None:
        for root in self.every:
            if is_address(root):
                check_address(root, "--root")
                if urlsplit(root).scheme.lower() in (_LOCAL, *_WEB):
                    hint = "give a folder as a path; a web server may send its visitors anywhere"
                    raise ConfigError(f"{root} cannot be a root", where="--root", hint=hint)

    def with_folder(self, folder: Path) -> Roots:
        """Return them and one more folder; where everything may be read, that stays so."""
        return Roots((*self.every, str(folder))) if self.every else self

    def check_path(self, path: Path, where: str) -> None:
        """Refuse a file or folder outside all of them, or that links lead out of.

        Args:
            path: What is to be read.
            where: What names it, for the message.

        Raises:
            ConfigError: it does.
        """
        if self.every:
            check_inside(path, [Path(root) for root in self.every if not is_address(root)], where)

    def check_address(self, address: str, where: str) -> None:
        """Refuse what is no address, or does not begin as one of them does.

        Raises:
            ConfigError: it is refused.
        """
        check_address(address, where)
        protocol, _, there = address.partition("://")
        if protocol.lower() == _LOCAL:
            self.check_path(Path(there), where)
            return
        begins = [root.rstrip("/") + "/" for root in self.every if is_address(root)]
        if self.every and not any(address.startswith(begin) for begin in begins):
            raise ConfigError(f"{address} lies outside {', '.join(self.every)}", where=where, hint="see --root")


ANYWHERE = Roots()
"""No limits."""
