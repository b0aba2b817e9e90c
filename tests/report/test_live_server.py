"""Page and frames to browsers that come, fall behind, vanish and come back; whoever makes the frames never waits."""

from __future__ import annotations

import asyncio
import http.client
import threading
import time
import urllib.request
from contextlib import suppress
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.report.live.codec import CHANGE, KEY, STEP_M, decode
from vto_pipeline.report.live.server import LiveServer

HTML = "<!doctype html><html><body>live</body></html>"
HALF_A_STEP = STEP_M / 2 + 1e-9


@pytest.fixture
def server():
    with LiveServer(HTML, "127.0.0.1", 0) as made:
        yield made


def frame(number: int) -> np.ndarray:
    """300 vertices that wander by some millimetres a frame; the first tells the number."""
    rng = np.random.default_rng(7)
    places = rng.uniform(-1, 1, (300, 3)) + 0.003 * number
    places[0] = [number * 0.01, 0.0, 0.0]
    return places


def until(condition) -> None:
    end = time.perf_counter() + 20.0
    while not condition():
        assert time.perf_counter() < end
        time.sleep(0.002)


class Browser:
    """Connects, decodes and confirms as the page does, in a thread of its own."""

    def __init__(self, address: str, *, confirms: bool = True) -> None:
        self.got: list[tuple[int, int, np.ndarray]] = []  # kind, number, places
        self._address, self.confirms = address, confirms
        self._leave = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))
        self._thread.start()

    async def _run(self) -> None:
        from tornado.websocket import WebSocketClosedError, websocket_connect

        socket = await websocket_connect(self._address.replace("http", "ws") + "frames")
        last, owed = None, 0
        reading = asyncio.ensure_future(socket.read_message())
        while not self._leave.is_set():
            done, _ = await asyncio.wait([reading], timeout=0.01)
            with suppress(WebSocketClosedError):
                while owed and self.confirms:
                    await socket.write_message("1")
                    owed -= 1
            if not done:
                continue
            message = reading.result()
            if message is None:
                break
            last = decode(message, last)
            self.got.append((message[0], last[0], last[1] * STEP_M))
            owed += 1
            reading = asyncio.ensure_future(socket.read_message())
        socket.close()
        while await reading is not None:
            reading = asyncio.ensure_future(socket.read_message())

    def leave(self) -> None:
        self._leave.set()
        self._thread.join(10)


def sent(server: LiveServer, numbers: range, browser: Browser) -> None:
    for number in numbers:
        server.show(frame(number))
        until(lambda number=number: browser.got and abs(browser.got[-1][2][0, 0] - 0.01 * number) < HALF_A_STEP)


def test_a_browser_gets_a_key_and_then_changes(server):
    server.show(frame(0))
    browser = Browser(server.address)
    sent(server, range(6), browser)
    browser.leave()
    assert [kind for kind, _, _ in browser.got[:2]] == [KEY, CHANGE]
    assert all(kind == CHANGE for kind, _, _ in browser.got[1:])
    assert_allclose(browser.got[-1][2], frame(5), rtol=0, atol=HALF_A_STEP)


def test_who_joins_late_gets_where_all_is_now_at_once(server):
    early = Browser(server.address)
    sent(server, range(8), early)
    late = Browser(server.address)
    until(lambda: late.got)
    assert late.got[0][0] == KEY
    assert_allclose(late.got[0][2], frame(7), rtol=0, atol=HALF_A_STEP)
    sent(server, range(8, 10), late)
    assert late.got[-1][0] == CHANGE
    for browser in (early, late):
        browser.leave()


def test_who_was_away_comes_back_to_the_newest_frame(server):
    browser = Browser(server.address)
    sent(server, range(3), browser)
    browser.leave()
    until(lambda: server.clients == 0)
    for number in range(3, 40):
        server.show(frame(number))
        time.sleep(0.001)
    again = Browser(server.address)
    until(lambda: again.got)
    sent(server, range(40, 43), again)
    again.leave()
    assert again.got[0][0] == KEY
    assert_allclose(again.got[-1][2], frame(42), rtol=0, atol=HALF_A_STEP)
    assert server.joined == 2


def test_who_fell_behind_gets_the_newest_frame_as_a_key_once_it_confirms(server):
    slow = Browser(server.address, confirms=False)
    until(lambda: server.clients == 1)
    for number in range(12):
        server.show(frame(number))
        until(lambda number=number: server.sent + server.left_out > number)
    until(lambda: len(slow.got) == 3)
    slow.confirms = True
    until(lambda: len(slow.got) > 3)
    assert slow.got[3][:2] == (KEY, 11)
    assert_allclose(slow.got[3][2], frame(11), rtol=0, atol=HALF_A_STEP)
    sent(server, range(12, 14), slow)
    slow.leave()
    assert slow.got[-1][0] == CHANGE


def test_nobody_waits_for_a_browser_that_confirms_nothing(server):
    stuck, good = Browser(server.address, confirms=False), Browser(server.address)
    until(lambda: server.clients == 2)
    longest = 0.0
    for number in range(30):
        began = time.perf_counter()
        server.show(frame(number))
        longest = max(longest, time.perf_counter() - began)
        until(lambda number=number: good.got and abs(good.got[-1][2][0, 0] - 0.01 * number) < HALF_A_STEP)
    assert len(stuck.got) <= 3
    assert len(good.got) == 30
    assert server.left_out >= 27
    assert longest < 0.25  # of a busy machine; all it does is to leave a frame behind
    for browser in (stuck, good):
        browser.leave()


def test_frames_that_come_too_fast_are_left_out_and_those_that_arrive_are_whole(server):
    browser = Browser(server.address)
    until(lambda: server.clients == 1)
    for number in range(500):
        server.show(frame(number))
    sent(server, range(500, 502), browser)
    browser.leave()
    assert len(browser.got) < 500
    for _, _, places in browser.got:  # whatever it got is one whole frame
        assert_allclose(places, frame(round(100 * places[0, 0])), rtol=0, atol=HALF_A_STEP)


def answered(server: LiveServer, path: str, headers: dict[str, str], method: str = "GET") -> int:
    place = urlsplit(server.address)
    connection = http.client.HTTPConnection(place.hostname, place.port)
    connection.request(method, path, headers=headers)
    try:
        return connection.getresponse().status
    finally:
        connection.close()


def test_the_page_is_served_and_nothing_else(server):
    with urllib.request.urlopen(server.address) as answer:
        assert answer.read().decode() == HTML
    for path in ("/run.json", "/../run.json", "/index.html"):
        assert answered(server, path, {}) == 404
    assert answered(server, "/", {}, method="POST") == 405


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def test_foreign_pages_and_foreign_names_are_refused(server):
    own = server.address.rstrip("/")
    host = own.removeprefix("http://")
    assert answered(server, "/frames", UPGRADE | {"Origin": own}) == 101
    assert answered(server, "/frames", UPGRADE | {"Origin": "http://evil.example"}) == 403
    assert answered(server, "/frames", UPGRADE | {"Host": "evil.example", "Origin": "http://evil.example"}) == 403
    assert answered(server, "/", {"Host": "evil.example"}) == 403
    assert answered(server, "/", {"Host": host}) == 200
    assert answered(server, "/", {"Host": "localhost"}) == 200


def test_a_taken_port_is_refused(server):
    port = urlsplit(server.address).port
    with pytest.raises(InputError, match="cannot be used"), LiveServer(HTML, "127.0.0.1", port):
        pass


def test_the_end_closes_connections_and_leaves_no_thread():
    with LiveServer(HTML, "127.0.0.1", 0) as server:
        browser = Browser(server.address)
        sent(server, range(2), browser)
    browser.leave()
    until(lambda: not any(thread.name == "live page" for thread in threading.enumerate()))
