"""A folder whose server can stop answering, as that of a network folder: a small FUSE server, as a program and to use.

The server is a process of its own that ends after a minute. All that waits for it then gets an error, so that a test
which touches the folder by mistake fails instead of waiting for ever.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import signal
import stat
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LIFE = 60  # s
_DETACH = 2
_HEAD = struct.Struct("=IIQQIIII")  # length, operation, number, node, user, group, process, padding
_LOOKUP, _FORGET, _GETATTR, _OPEN, _READ, _RELEASE = 1, 2, 3, 14, 15, 18
_FLUSH, _INIT, _OPENDIR, _READDIR, _RELEASEDIR, _INTERRUPT, _BATCH_FORGET = 25, 26, 27, 28, 29, 36, 42
_BLOCK = 1 << 17


class Server:
    """Answers for a folder with files, until it is told to stop, or until a file is read beyond some byte.

    Args:
        files: Name -> content.
        stall_at: That byte.
    """

    def __init__(self, files: dict[str, bytes], stall_at: int | None) -> None:
        self._files, self._stall_at = list(files.items()), stall_at  # the first is node 2
        self._stalled = False
        signal.signal(signal.SIGUSR1, self.stall)

    def stall(self, *_: object) -> None:
        """Answer nothing any more."""
        self._stalled = True

    def serve(self, device: int) -> None:
        """Answer what the kernel asks."""
        while True:
            data = os.read(device, _BLOCK + 4096)
            _, operation, number, node, *_ = _HEAD.unpack_from(data)
            if operation == _READ and self._stall_at is not None:
                self._stalled |= struct.unpack_from("=QQ", data, _HEAD.size)[1] >= self._stall_at
            if self._stalled or operation in (_FORGET, _INTERRUPT, _BATCH_FORGET):
                continue
            try:
                answer, code = self._answer(operation, node, data[_HEAD.size :]), 0
            except OSError as error:
                answer, code = b"", error.errno or errno.EIO
            os.write(device, struct.pack("=IiQ", 16 + len(answer), -code, number) + answer)

    def _answer(self, operation: int, node: int, body: bytes) -> bytes:
        if operation == _INIT:
            return struct.pack("=IIIIHHIIHHI28x", 7, 31, _BLOCK, 0, 8, 6, _BLOCK, 1, 0, 0, 0)
        if operation == _LOOKUP:
            name = body.rstrip(b"\0").decode()
            found = next((k for k, (one, _) in enumerate(self._files, start=2) if one == name), None)
            if found is None:
                raise FileNotFoundError(errno.ENOENT, name)
            return struct.pack("=QQQQII", found, 0, 0, 0, 0, 0) + self._attributes(found)
        if operation == _GETATTR:
            return struct.pack("=QII", 0, 0, 0) + self._attributes(node)
        if operation in (_OPEN, _OPENDIR):
            return struct.pack("=QII", 0, 1, 0)  # reads go past the page cache
        if operation == _READ:
            _, offset, size = struct.unpack_from("=QQI", body)
            return self._files[node - 2][1][offset : offset + size]
        if operation == _READDIR:
            return self._entries(struct.unpack_from("=QQ", body)[1])
        if operation in (_RELEASE, _RELEASEDIR, _FLUSH):
            return b""
        raise OSError(errno.ENOSYS, "not served")

    def _entries(self, offset: int) -> bytes:
        found = b""
        for k, (name, _) in list(enumerate(self._files, start=1))[offset:]:
            entry = struct.pack("=QQII", k + 1, k, len(name), stat.S_IFREG >> 12) + name.encode()
            found += entry + bytes(-len(entry) % 8)
        return found

    def _attributes(self, node: int) -> bytes:
        mode, size = stat.S_IFDIR | 0o755, 0
        if node > 1:
            mode, size = stat.S_IFREG | 0o644, len(self._files[node - 2][1])
        form = struct.Struct("=QQQ 3Q3I IIII III")
        owner = (os.getuid(), os.getgid())
        return form.pack(node, size, -(-size // 512), *[0] * 6, mode, 1, *owner, 0, 4096, 0)


def main() -> None:
    """Mount the folder, say so, and serve it."""
    path, stall_at, files = json.loads(sys.stdin.readline())
    device = os.open("/dev/fuse", os.O_RDWR)
    options = f"fd={device},rootmode={stat.S_IFDIR:o},user_id={os.getuid()},group_id={os.getgid()}"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mount(b"stalled", os.fsencode(path), b"fuse", 0, options.encode()) != 0:
        sys.exit(os.strerror(ctypes.get_errno()))
    signal.alarm(LIFE)
    server = Server({name: bytes.fromhex(data) for name, data in files.items()}, stall_at)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    server.serve(device)


class StalledFolder:
    """Such a folder, at `path`."""

    def __init__(self, path: Path, server: subprocess.Popen[str]) -> None:
        self.path, self._server = path, server

    def stall(self) -> None:
        """Let it answer nothing any more."""
        self._server.send_signal(signal.SIGUSR1)

    def end(self) -> None:
        """End its server: all that waits for it gets an error."""
        self._server.kill()
        self._server.wait()


@contextmanager
def stalled_folder(path: Path, files: dict[str, bytes], stall_at: int | None = None) -> Iterator[StalledFolder]:
    """Yield a folder with files that answers until it is told not to, or until one is read beyond `stall_at`.

    The test is skipped where such a folder cannot be made.
    """
    import pytest

    path.mkdir()
    order = json.dumps([str(path), stall_at, {name: data.hex() for name, data in files.items()}])
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([sys.executable, __file__], text=True, **streams) as server:
        server.stdin.write(f"{order}\n")
        server.stdin.flush()
        if not server.stdout.readline():
            pytest.skip(f"no folder of FUSE can be mounted here: {server.stderr.read().splitlines()[-1:]}")
        folder = StalledFolder(path, server)
        try:
            yield folder
        finally:
            folder.end()
            ctypes.CDLL(None).umount2(os.fsencode(path), _DETACH)


if __name__ == "__main__":
    main()
