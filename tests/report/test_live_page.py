"""The page of a stream in a real browser: it decodes, draws, and comes back after the server was gone."""

from __future__ import annotations

import asyncio
import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from io import BytesIO
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import trimesh
from PIL import Image

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.report.layers import PageLayer
from vto_pipeline.report.live.page import live_page
from vto_pipeline.report.live.server import LiveServer

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--remote-debugging-port=0"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=800,800"),
)
PATIENCE = 120.0

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")


class Page:
    """A page under the browser's debugging protocol."""

    def __init__(self, folder: Path, address: str) -> None:
        command = [str(BROWSER), *FLAGS, f"--user-data-dir={folder / 'profile'}", address]
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        assert self._process.stderr is not None
        for line in self._process.stderr:
            found = re.search(r"DevTools listening on ws://([^/]+)/", line)
            if found:
                break
        with urllib.request.urlopen(f"http://{found[1]}/json") as answer:
            self._socket = next(one for one in json.load(answer) if one["type"] == "page")["webSocketDebuggerUrl"]

    def ask(self, method: str, **parameters: object) -> dict:
        """Send one command and return its result."""

        async def once() -> dict:
            from tornado.websocket import websocket_connect

            socket = await websocket_connect(self._socket, max_message_size=2**26)
            await socket.write_message(json.dumps({"id": 1, "method": method, "params": parameters}))
            while True:
                said = json.loads(await socket.read_message())
                if said.get("id") == 1:
                    break
            socket.close()
            while await socket.read_message() is not None:
                pass
            return said["result"]

        return asyncio.run(once())

    def value(self, expression: str) -> object:
        return self.ask("Runtime.evaluate", expression=expression)["result"].get("value")

    def photograph(self) -> np.ndarray:
        data = base64.b64decode(self.ask("Page.captureScreenshot")["data"])
        return np.asarray(Image.open(BytesIO(data)).convert("RGB")).astype(int)

    def close(self) -> None:
        self._process.terminate()
        self._process.communicate(timeout=20)


def until(condition) -> None:
    end = time.perf_counter() + PATIENCE
    while not condition():
        assert time.perf_counter() < end
        time.sleep(0.05)


def middle_of_red(pixels: np.ndarray) -> float:
    """The row that is in the middle of what is red; the page has nothing else that is."""
    red = (pixels[..., 0] > 1.7 * pixels[..., 1]) & (pixels[..., 0] > 80)
    assert red.sum() > 500
    return float(np.nonzero(red)[0].mean())


def test_the_page_shows_what_is_sent_and_comes_back(tmp_path):
    shape = trimesh.creation.icosphere(3, 0.2)
    garment = TriangleMesh(shape.vertices, shape.faces)
    body = TriangleMesh(0.5 * shape.vertices, shape.faces)
    layers = [PageLayer("Garment", garment, "garment", "#d62728"), PageLayer("Body", body, "body", "#d6b59c")]
    page = live_page("Stream", layers)

    def places(height: float) -> np.ndarray:
        return np.concatenate([garment.vertices[page.sources[0]] + [0.0, height, 0.0], body.vertices[page.sources[1]]])

    with LiveServer(page.html, "127.0.0.1", 0) as server:
        browser, port = Page(tmp_path, server.address), urlsplit(server.address).port
        try:
            rows = []
            for height in (0.0, 0.1, 0.1, -0.1):
                before = int(browser.value("document.body?.dataset.shown || 0"))
                server.show(places(height))
                until(lambda before=before: int(browser.value("document.body?.dataset.shown || 0")) > before)
                time.sleep(0.5)  # to be drawn
                rows.append(middle_of_red(browser.photograph()))
            a_tenth = rows[0] - rows[1]
            assert a_tenth > 20  # pixels, upwards
            assert abs(rows[2] - rows[1]) < 1
            assert abs(rows[3] - rows[0] - a_tenth) < 0.2 * a_tenth  # perspective
            assert server.sent >= 4
        except BaseException:
            browser.close()
            raise
    try:
        until(lambda: "no connection" in str(browser.value("document.getElementById('state').textContent")))
        with LiveServer(page.html, "127.0.0.1", port) as again:
            again.show(places(0.1))
            until(lambda: again.sent >= 1)
            until(lambda: "live" in str(browser.value("document.getElementById('state').textContent")))
            time.sleep(0.5)
            assert abs(middle_of_red(browser.photograph()) - rows[1]) < 2
    finally:
        browser.close()
