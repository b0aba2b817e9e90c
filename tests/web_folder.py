"""A folder on a web server of this machine, for tests of what is far away."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


class _Handler(SimpleHTTPRequestHandler):
    """Counts what is fetched; /short promises more than it sends, /silent sends nothing, /closed refuses."""

    fetched: list[str]
    awake: threading.Event

    def do_GET(self) -> None:
        self.fetched.append(self.path)
        if self.path.startswith("/silent"):
            self.awake.wait(30.0)
        elif self.path.startswith("/short"):
            self.send_response(200)
            self.send_header("Content-Length", "1000")
            self.end_headers()
            self.wfile.write(b"too little")
        elif self.path.startswith("/closed"):
            self.send_error(403)
        else:
            super().do_GET()

    def do_HEAD(self) -> None:
        if self.path.startswith("/short"):
            self.send_response(200)
            self.send_header("Content-Length", "1000")
            self.end_headers()
        elif self.path.startswith("/closed"):
            self.send_error(403)
        else:
            super().do_HEAD()

    def log_message(self, format: str, *args: object) -> None:
        pass


@contextmanager
def served(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the address of a folder, and the list of what is fetched from there."""
    fetched: list[str] = []
    awake = threading.Event()
    handler = type("Handler", (_Handler,), {"fetched": fetched, "awake": awake})
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder))) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}", fetched
        finally:
            awake.set()
            server.shutdown()
            thread.join()
