"""A page and its frames, served to browsers from a thread of its own.

Whoever makes frames never waits: it leaves the newest behind. A browser says which frame it has got, and is sent no
more than a few beyond that; then it gets the newest. Where some were left out for it, or it comes back, that is a key.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from concurrent.futures import Future
from contextlib import suppress
from ipaddress import ip_address
from typing import Any

from vto_pipeline.errors import InputError, MissingDependencyError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.report.live.codec import Encoded, Encoder

_ON_THE_WAY = 3
"""Frames that a browser may have yet to confirm: a tenth of a second of delay at most, at the usual rate."""
_LONGEST_MESSAGE = 64  # bytes, from a browser: the number of a frame
_PATIENCE = 10.0  # s, for the thread to begin and to end


class LiveServer:
    """Serves while its context is open.

    Args:
        html: The page.
        host: Address to listen on.
        port: Of it; 0 stands for any that is free.

    Attributes:
        address: Of the page, once it serves.
        clients: How many browsers are connected now.
        joined: How many ever were.
        sent, left_out: Frames that were sent to a browser, and that were left out for one that was behind.
    """

    def __init__(self, html: str, host: str, port: int) -> None:
        self._html, self._host, self._port = html, host, port
        self.address = ""
        self.clients = self.joined = self.sent = self.left_out = 0
        self._browsers: set[Any] = set()
        self._encoder = Encoder()
        self._encoded: Encoded | None = None
        self._newest: FloatArray | None = None
        self._lock = threading.Lock()
        self._ends = asyncio.Event()
        self._loop = asyncio.new_event_loop()
        self._begun: Future[str] = Future()
        self._thread = threading.Thread(target=self._serve, name="live page", daemon=True)

    def __enter__(self) -> LiveServer:
        """Begin to serve.

        Raises:
            InputError: the port cannot be used; MissingDependencyError: no tornado.
        """
        self._thread.start()
        self.address = self._begun.result(_PATIENCE)
        return self

    def __exit__(self, *_: object) -> None:
        """Send what is left, close all connections, and end."""
        if self._loop.is_running():
            self._loop.call_soon_threadsafe(self._ends.set)
        self._thread.join(_PATIENCE)

    def show(self, places: FloatArray) -> None:
        """Hand over a frame and return at once; one that no browser was sent yet is left out for it.

        Args:
            places: Of all vertices of the page [m], shape (V, 3), not changed later.
        """
        with self._lock:
            waits, self._newest = self._newest is not None, places
        if not waits:
            self._loop.call_soon_threadsafe(self._send_all)

    def _send_all(self) -> None:
        with self._lock:
            places, self._newest = self._newest, None
        if places is None:
            return
        self._encoded = self._encoder.encode(places)
        messages: dict[bool, bytes] = {}
        for browser in list(self._browsers):
            self._send(browser, self._encoded, messages)

    def _send(self, browser: Any, frame: Encoded, messages: dict[bool, bytes]) -> None:
        """Send a frame to a browser that keeps up; messages: whether it is a key -> the message, once it is made."""
        if browser.sent - browser.confirmed >= _ON_THE_WAY:
            self.left_out += 1
            return
        is_key = browser.last != frame.number - 1
        if is_key not in messages:
            messages[is_key] = frame.key() if is_key else frame.change()
        from tornado.websocket import WebSocketClosedError

        with suppress(WebSocketClosedError):
            browser.write_message(messages[is_key], binary=True)
            browser.last = frame.number
            browser.sent += 1
            self.sent += 1

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._until_ended())
        except BaseException as error:
            if self._begun.done():
                raise
            self._begun.set_exception(error)
        finally:
            self._loop.close()

    async def _until_ended(self) -> None:
        try:
            from tornado.httpserver import HTTPServer
        except ImportError:
            raise MissingDependencyError(
                "no tornado, which serves the page", hint='pip install "vto-pipeline[live]"'
            ) from None

        family = socket.AF_INET6 if ":" in self._host else socket.AF_INET
        try:
            listening = socket.create_server((self._host, self._port), family=family)
        except OSError as error:
            raise InputError(
                f"{self._host}, port {self._port} cannot be used: {error.strerror}", hint="leave --port out"
            ) from None
        server = HTTPServer(self._application())
        listening.setblocking(False)
        server.add_socket(listening)
        name = f"[{self._host}]" if ":" in self._host else self._host
        self._begun.set_result(f"http://{name}:{listening.getsockname()[1]}/")
        await self._ends.wait()
        self._send_all()
        server.stop()
        for browser in list(self._browsers):
            browser.close()
        await server.close_all_connections()

    def _application(self) -> Any:
        """Return the page and the frames as tornado has them; nothing else is answered."""
        from tornado.web import Application, HTTPError, RequestHandler
        from tornado.websocket import WebSocketHandler

        live = self

        class Page(RequestHandler):
            def prepare(self) -> None:
                _refuse_names(self.request.host_name)

            def get(self) -> None:
                self.set_header("Cache-Control", "no-store")
                self.write(live._html)

        class Frames(WebSocketHandler):
            last: int | None = None
            sent = confirmed = 0

            def prepare(self) -> None:
                _refuse_names(self.request.host_name)

            def open(self, *_: str, **__: str) -> None:
                live._browsers.add(self)
                live.joined += 1
                live.clients = len(live._browsers)
                if live._encoded is not None:
                    live._send(self, live._encoded, {})

            def on_message(self, message: str | bytes) -> None:
                self.confirmed += 1
                if live._encoded is not None and self.last != live._encoded.number:
                    live._send(self, live._encoded, {})  # one that was left out, and may have been the last

            def on_close(self) -> None:
                live._browsers.discard(self)
                live.clients = len(live._browsers)

        def _refuse_names(name: str) -> None:
            """A page from elsewhere under a name that leads here: only addresses and this machine's own name are."""
            with suppress(ValueError):
                ip_address(name.strip("[]"))
                return
            if name != "localhost":
                raise HTTPError(403)

        return Application(
            [("/", Page), ("/frames", Frames)], websocket_max_message_size=_LONGEST_MESSAGE, log_function=lambda _: None
        )
