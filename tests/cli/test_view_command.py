"""vto view: the page of a run, to this machine only, loaded again when it changes."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from vto_pipeline.cli.commands.view.server import page_server

PAGE = (
    "<!doctype html><html><head>"
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:">'
    "</head><body><p>first</p></body></html>"
)


@pytest.fixture
def run(vto) -> Path:
    assert vto("run", "toy.yaml", "-o", "RUN").code == 0
    page = Path("RUN/out/page.html").absolute()
    page.write_text(PAGE)
    return page.parents[1]


@pytest.fixture
def server(run):
    with page_server(run, 0) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def get(server, path: str) -> str:
    with urllib.request.urlopen(f"http://127.0.0.1:{server.server_port}{path}") as answer:
        return answer.read().decode()


def test_the_page_watches_and_may_ask_only_its_own_server(server, run):
    page = get(server, "/")
    assert "<p>first</p>" in page
    assert "default-src 'none'; connect-src 'self'; img-src data:" in page
    before = get(server, "/stamp")
    assert get(server, "/stamp") == before
    (run / "out/page.html").write_text(PAGE.replace("first", "second"))
    assert get(server, "/stamp") != before
    assert "<p>second</p>" in get(server, "/")


def test_a_run_without_a_page_yet_is_waited_for(server, run):
    (run / "out/page.html").unlink()
    assert "no page yet" in get(server, "/")
    assert get(server, "/stamp") == "none"


@pytest.mark.parametrize("path", ["/run.json", "/../run.json", "/page.html"])
def test_nothing_else_is_served(server, path):
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(server, path)


def test_a_foreign_name_is_refused(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port)
    connection.request("GET", "/", headers={"Host": "evil.example"})
    assert connection.getresponse().status == 403


def test_what_is_no_run_is_refused(vto):
    said = vto("view", "nowhere", "--no-browser")
    assert said.code == 3


def test_a_taken_port_is_refused(vto, server, run):
    said = vto("view", run, "--no-browser", "--port", server.server_port)
    assert (said.code, "cannot be used" in said.err) == (3, True)


def test_an_interrupt_ends_it_well(run):
    command = [sys.executable, "-m", "vto_pipeline.cli.main", "view", str(run), "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = ""
        while not lines.rstrip().endswith("}"):
            lines += process.stdout.readline()
        address = json.loads(lines)["address"]
        with urllib.request.urlopen(address) as answer:
            assert b"first" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
