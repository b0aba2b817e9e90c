"""The page of a run, served to a browser of this machine."""

from __future__ import annotations

from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.pipeline.execution.folder import existing_run

_STRICT = b"default-src 'none'"  # of the page: what it may load
_WATCH = b"""<script>
let seen = null;
setInterval(async () => {
  const answer = await fetch("/stamp").catch(() => null);
  const stamp = answer && answer.ok ? await answer.text() : seen;
  if (seen !== null && stamp !== seen) location.reload();
  seen = stamp;
}, 1000);
</script>
</body>"""
_WAIT = b"<!doctype html><html><body><p>This run has made no page yet.</p></body></html>"


def page_server(run: Path, port: int) -> ThreadingHTTPServer:
    """Return a server of a run's page, to be closed; port 0 stands for any that is free.

    Raises:
        InputError: not the folder of a run, or the port is taken.
    """
    page = existing_run(run) / "out" / "page.html"

    class Handler(_PageHandler):
        path_of_page = page

    try:
        return ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except OSError as error:
        raise InputError(f"port {port} cannot be used: {error.strerror}", hint="leave --port out") from None


class _PageHandler(BaseHTTPRequestHandler):
    """Answers with the page, or with when it was written."""

    path_of_page: Path

    def do_GET(self) -> None:
        if self.headers.get("Host") not in {f"{name}:{self._port}" for name in ("127.0.0.1", "localhost")}:
            self.send_error(HTTPStatus.FORBIDDEN)  # a page from elsewhere, under a name that leads here
        elif self.path == "/":
            self._send(self._page(), "text/html; charset=utf-8")
        elif self.path == "/stamp":
            self._send(self._stamp(), "text/plain")
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    @property
    def _port(self) -> int:
        assert isinstance(self.server, ThreadingHTTPServer)
        return self.server.server_port

    def _page(self) -> bytes:
        try:
            page = self.path_of_page.read_bytes()
        except FileNotFoundError:
            page = _WAIT
        return page.replace(_STRICT, _STRICT + b"; connect-src 'self'", 1).replace(b"</body>", _WATCH)

    def _stamp(self) -> bytes:
        try:
            return str(self.path_of_page.stat().st_mtime_ns).encode()
        except FileNotFoundError:
            return b"none"

    def _send(self, data: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: a line for each second of watching is of no use."""
