"""Object stores and web servers, through fsspec: files that lie there are copied here, and files here to there.

The environment holds the credentials, in the way that each store's own library has.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar
from urllib.parse import unquote, urlsplit

from vto_pipeline.errors import ConfigError, InputError, MissingDependencyError, VtoError
from vto_pipeline.io.files import replacing
from vto_pipeline.io.stalls import Beat, answered

PROTOCOLS = ("abfs", "az", "file", "gcs", "gs", "http", "https", "memory", "oss", "s3", "s3a", "sftp")
"""What an address begins with. fsspec knows more; some of those run code, unpack archives, or open other addresses."""

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:(//|:)")
_WITH_FOLDERS = ("sftp",)  # they have to be made there; in an object store that would make a bucket, also one misspelt
_MOST_FILES = 10_000
_MOST_BYTES = 50_000_000_000
_VERSION = ("ETag", "etag", "Content-MD5", "md5Hash", "generation", "LastModified", "Last-Modified", "mtime", "created")
"""What stores tell of a file that changes when it does."""
_NOT_THERE, _REFUSED = (404, 410), (401, 403)  # of HTTP

Result = TypeVar("Result")


@dataclass(frozen=True)
class RemoteFile:
    """A file in a store.

    Args:
        name: Within the folder of the address; empty where the address is the file's own.
        path: As fsspec calls it.
        bytes: Its size; None where the store does not tell.
        version: Differs once the file does; empty where the store does not tell.
    """

    name: str
    path: str
    bytes: int | None
    version: str


def is_address(text: str) -> bool:
    """Whether a text is the address of something in a store, such as s3://bucket/shirt.ply, not a path."""
    return bool(_ADDRESS.match(text))


def check_address(address: str, where: str) -> None:
    """Refuse an address that is none, or that may mean something else than it seems to.

    Args:
        address: As written.
        where: What names it, for the message.

    Raises:
        ConfigError: an unknown protocol, one address within another, a password, or a way up.
    """
    protocol = address.partition(":")[0].lower()
    if protocol not in PROTOCOLS or "::" in address:
        raise ConfigError(
            f"{address!r} is not the address of a file or folder",
            where=where,
            hint=f"it begins with one of {', '.join(f'{one}://' for one in PROTOCOLS)}",
        )
    if "@" in urlsplit(address).netloc:
        problem = f"the address {protocol}://... holds a user or a password"
        raise ConfigError(problem, where=where, hint="leave them to the environment")
    there = address.partition("://")[2]  # not what a parser calls the path: stores do not know ? and #
    if not address.isprintable() or ".." in re.split(r"[/\\]", unquote(there)):
        raise ConfigError(f"the address {address!a} leads up, or is not plain text", where=where)
    if protocol == "file" and not there.startswith("/"):
        raise ConfigError(f"{address} does not begin at the top", where=where, hint="as in file:///data/shirt.ply")


def list_files(address: str) -> tuple[RemoteFile, ...]:
    """Return the file at an address, or all visible files of the folder there, by name.

    What lies on a web server is a folder only where the address ends in a slash: nothing else tells.

    Raises:
        InputError: nothing is there, or the store does not give it; MissingDependencyError: the store's library.
    """
    return _asked(address, lambda beat: _list(address))


def copy_here(address: str, file: RemoteFile, path: Path) -> None:
    """Copy one file of an address to a path.

    Raises:
        InputError: the store does not give it, or not all of it; MissingDependencyError: the store's library.
    """

    def work(beat: Beat) -> None:
        from fsspec.callbacks import Callback

        class Watched(Callback):
            """Counts what has arrived."""

            def relative_update(self, inc: int = 1) -> None:
                self.value += inc
                beat()
                if self.value > _MOST_BYTES:
                    raise InputError(f"more than {_MOST_BYTES} bytes", where=address)

        path.parent.mkdir(parents=True, exist_ok=True)
        store, _ = _opened(address)
        store.get_file(file.path, str(path), callback=Watched())
        if file.bytes is not None and path.stat().st_size != file.bytes:
            raise InputError(f"{path.stat().st_size} of {file.bytes} bytes have arrived", where=file.path)

    _asked(address, work)


def copy_there(path: Path, address: str) -> None:
    """Copy a file to an address; it is there as a whole or not at all.

    Raises:
        InputError: the store does not take it; MissingDependencyError: the store's library.
    """

    def work(beat: Beat) -> None:
        store, there = _opened(address)
        with path.open("rb") as source:
            if "file" in _protocols(store):  # its own transactions go by way of /tmp, maybe on another disk
                with replacing(Path(there)) as beside, beside.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
                return
            if set(_WITH_FOLDERS) & set(_protocols(store)):
                store.makedirs(there.rpartition("/")[0], exist_ok=True)
            with store.transaction, store.open(there, "wb") as sink:
                while block := source.read(1 << 20):
                    sink.write(block)
                    beat()

    _asked(address, work)


def size_there(address: str) -> int | None:
    """Return the size of the file at an address [B], None where there is none.

    Raises:
        InputError: the store does not answer; MissingDependencyError: the store's library.
    """

    def work(beat: Beat) -> int | None:
        store, there = _opened(address)
        try:
            return int(store.info(there)["size"])
        except FileNotFoundError:
            return None

    return _asked(address, work)


def _list(address: str) -> tuple[RemoteFile, ...]:
    store, there = _opened(address)
    info = {"type": "directory"} if address.endswith("/") else store.info(there)
    if info["type"] != "directory":
        return (_described("", info),)
    found = {_within(name, there): info for name, info in store.find(there, detail=True).items()}
    shown = sorted((name, info) for name, info in found.items() if not _is_hidden(name))
    if len(shown) > _MOST_FILES:
        raise InputError(f"{len(shown)} files; the most is {_MOST_FILES}", where=address)
    files = [
        _described(name, info if info.get("size") is not None else store.info(info["name"])) for name, info in shown
    ]
    if not files:
        raise InputError("nothing is there", where=address)
    if (total := sum(one.bytes or 0 for one in files)) > _MOST_BYTES:
        raise InputError(f"{total} bytes; the most is {_MOST_BYTES}", where=address)
    return tuple(files)


def _within(name: str, folder: str) -> str:
    """Return the name of a file within the folder that was listed; a store may name anything.

    Raises:
        InputError: it does not lie there.
    """
    folder = folder.rstrip("/") + "/"
    inner = PurePosixPath(unquote(name.removeprefix(folder)))
    if not name.startswith(folder) or inner.is_absolute() or ".." in inner.parts or "\\" in str(inner):
        raise InputError(f"the store lists {name!r}, which does not lie in the folder", where=folder)
    return str(inner)


def _is_hidden(name: str) -> bool:
    return any(part.startswith(".") for part in PurePosixPath(name).parts)


def _described(name: str, info: dict[str, Any]) -> RemoteFile:
    version = "; ".join(f"{key} {info[key]}" for key in _VERSION if info.get(key))
    size = info.get("size")
    return RemoteFile(name, info["name"], None if size is None else int(size), version)


def _opened(address: str) -> tuple[Any, str]:
    """Return the store of an address, with nothing remembered, and the path there."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise MissingDependencyError(
            "object stores need fsspec", where=address, hint="pip install 'vto-pipeline[store]'"
        ) from None
    store, there = url_to_fs(address)
    store.invalidate_cache()
    return store, there


def _protocols(store: Any) -> tuple[str, ...]:
    return (store.protocol,) if isinstance(store.protocol, str) else tuple(store.protocol)


def _asked(address: str, work: Callable[[Beat], Result]) -> Result:
    """Return what work with a store returns; what its library raises, of whatever class, becomes an error in words."""
    with _in_words(address):
        return answered(Path(address), work)


@contextmanager
def _in_words(address: str) -> Iterator[None]:
    try:
        yield
    except VtoError as error:
        error.where = address if error.where == str(Path(address)) else error.where  # a path has lost a slash
        raise
    except ImportError as error:
        raise MissingDependencyError(f"no library for this store: {error}", where=address) from None
    except Exception as error:
        cause = error.__cause__ if isinstance(error, FileNotFoundError) and error.__cause__ else error  # of web servers
        status = getattr(cause, "status", None)
        if isinstance(cause, FileNotFoundError) or status in _NOT_THERE:
            raise InputError("nothing is there", where=address) from None
        if isinstance(cause, PermissionError) or status in _REFUSED:
            hint = "credentials come from the environment, as the store's own library reads them"
            raise InputError(f"the store refuses access: {cause}"[:300], where=address, hint=hint) from None
        raise InputError(f"the store fails: {type(cause).__name__}: {cause}"[:300], where=address) from None
