"""Stores: against what was put into them, by a server and by libraries that are not ours."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest
from web_folder import served

from vto_pipeline.errors import ConfigError, InputError, MissingDependencyError
from vto_pipeline.io import stalls
from vto_pipeline.io.stores import check_address, copy_here, copy_there, is_address, list_files, size_there

pytest.importorskip("aiohttp")
fsspec = pytest.importorskip("fsspec")

FILES = {"a.ply": b"first" * 1000, "deep/er/b c.ply": b"second", "deep/c.txt": b""}


@pytest.fixture
def memory():
    yield "memory://studio"
    store = fsspec.filesystem("memory")
    if store.exists("/studio"):
        store.rm("/studio", recursive=True)


@pytest.fixture(params=["memory", "file", "http"])
def filled(request, memory, tmp_path):
    """The address of FILES, in each store that is on every machine; a hidden file lies beside them."""
    folder = tmp_path / "there"
    for name, held in {**FILES, ".hidden/d.txt": b"4"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(held)
    if request.param == "http":
        with served(folder) as (address, _):
            yield address
    elif request.param == "file":
        yield f"file://{folder}"
    else:
        fsspec.filesystem("memory").put(str(folder), "/studio", recursive=True)
        yield memory


def test_a_folder_arrives_as_it_is(filled, tmp_path):
    files = list_files(f"{filled}/")
    assert [(one.name, one.bytes) for one in files] == [(name, len(FILES[name])) for name in sorted(FILES)]
    for one in files:
        copy_here(f"{filled}/", one, tmp_path / "here" / one.name)
    found = {p.relative_to(tmp_path / "here").as_posix(): p.read_bytes() for p in (tmp_path / "here").rglob("*.*")}
    assert found == FILES


def test_a_file_arrives_as_it_is_and_tells_when_it_changes(filled, tmp_path):
    address = f"{filled}/a.ply"
    (one,) = list_files(address)
    assert (one.name, one.bytes) == ("", 5000)
    assert one.version
    copy_here(address, one, tmp_path / "a.ply")
    assert (tmp_path / "a.ply").read_bytes() == FILES["a.ply"]
    assert list_files(address) == (one,)


def test_what_is_not_there_is_told(filled):
    for address in (f"{filled}/nowhere.ply", f"{filled}/nowhere/"):
        with pytest.raises(InputError, match="nothing is there") as caught:
            list_files(address)
        assert caught.value.where == address
    assert size_there(f"{filled}/nowhere.ply") is None
    assert size_there(f"{filled}/a.ply") == 5000


@pytest.mark.parametrize("kind", ["memory", "file"])
def test_what_is_put_is_there_as_a_whole_or_not_at_all(kind, memory, tmp_path, monkeypatch):
    address = f"{memory if kind == 'memory' else f'file://{tmp_path}/there'}/deep/a.bin"
    source = tmp_path / "a.bin"
    source.write_bytes(b"x" * 3_000_000)
    copy_there(source, address)
    assert fsspec.open(address).open().read() == source.read_bytes()

    source.write_bytes(b"y" * 3_000_000)
    begun = []

    def failing(sink, block, write):
        if begun:
            raise ConnectionError("the line is cut")
        begun.append(write(sink, block))

    if kind == "memory":
        held = fsspec.implementations.memory.MemoryFile
        write = held.write
        monkeypatch.setattr(held, "write", lambda self, block: failing(self, block, write))
    else:

        def half(source, sink):
            sink.write(source.read(1000))
            raise ConnectionError("the line is cut")

        monkeypatch.setattr(shutil, "copyfileobj", half)
    for there in (address, address.replace("a.bin", "new.bin")):
        begun.clear()
        with pytest.raises(InputError, match="the store fails: ConnectionError: the line is cut"):
            copy_there(source, there)
    monkeypatch.undo()
    assert fsspec.open(address).open().read() == b"x" * 3_000_000
    assert [Path(one.path).name for one in list_files(address.rpartition("/")[0])] == ["a.bin"]


def test_servers_that_fail_are_told(tmp_path, monkeypatch):
    with served(tmp_path) as (address, _):
        (one,) = list_files(f"{address}/short.ply")
        with pytest.raises(InputError, match="the store fails: ClientPayloadError"):
            copy_here(f"{address}/short.ply", one, tmp_path / "short.ply")
        with pytest.raises(InputError, match="refuses access"):
            list_files(f"{address}/closed.ply")
        with pytest.raises(InputError, match="the store fails"):
            copy_there(Path(__file__), f"{address}/new.py")
        (tmp_path / "silent.ply").write_bytes(b"1")
        (one,) = list_files(f"{address}/silent.ply")  # asks for the head only
        monkeypatch.setattr(stalls, "_PATIENCE", 0.5)
        with pytest.raises(InputError, match="no answer has come") as caught:
            copy_here(f"{address}/silent.ply", one, tmp_path / "silent_here.ply")
        assert caught.value.where == f"{address}/silent.ply"
    with pytest.raises(InputError, match="the store fails"):
        list_files(f"{address}/gone.ply")  # nobody listens there any more


def test_a_store_cannot_name_files_outside_the_folder(memory, monkeypatch):
    store = fsspec.filesystem("memory")
    store.pipe("/studio/a.ply", b"1")
    for name in ("/studio/../../etc/a", "/elsewhere/a", "/studio/%2e%2e/a", "/studio/..\\a"):
        monkeypatch.setattr(type(store), "find", lambda *_, name=name, **__: {name: {"name": name, "size": 1}})
        with pytest.raises(InputError, match="does not lie in the folder"):
            list_files(memory)


@pytest.mark.parametrize(
    "address",
    [
        "simplecache::http://host/a.ply",
        "zip://a.ply::file:///etc/b.zip",
        "reference://x",
        "s3://bucket/a.ply::file:///etc/a.ply",
        "python://x",
        "s3://bucket/../other/a.ply",
        "s3://bucket/%2E%2e/a.ply",
        "sftp://user:word@host/a.ply",
        "s3://bucket/a\n.ply",
        "://a",
        "file:///data?/../../etc/a.ply",
        "file:///data#/../../etc/a.ply",
        "s3://bucket/orders?x=/../../a.ply",
        "s3://bucket/..\\a.ply",
        "file://~/a.ply",
        "file://host/a.ply",
    ],
)
def test_addresses_that_mean_something_else_are_refused(address):
    with pytest.raises(ConfigError):
        check_address(address, "here")


def test_paths_are_no_addresses():
    assert all(is_address(text) for text in ("s3://b/a.ply", "HTTP://host/a", "simplecache::s3://b/a"))
    assert not any(is_address(text) for text in ("a.ply", "/a/b.ply", "../a:b", "cotton_poplin", "C:", "12:30", ""))
    check_address("https://host:8080/a%20b.ply?version=2", "here")


@pytest.mark.skipif(find_spec("s3fs") is not None, reason="the library is there")
def test_a_library_that_is_not_there_is_named():
    with pytest.raises(MissingDependencyError, match="s3fs"):
        list_files("s3://bucket/a.ply")


def test_a_refusal_tells_where_credentials_come_from(memory, monkeypatch):
    store = fsspec.filesystem("memory")
    store.pipe("/studio/a.ply", b"1")
    (one,) = list_files(f"{memory}/a.ply")

    def refuse(*_, **__):
        raise PermissionError("403")

    monkeypatch.setattr(type(store), "get_file", refuse)
    with pytest.raises(InputError, match="refuses access") as caught:
        copy_here(f"{memory}/a.ply", one, Path("nowhere"))
    assert "environment" in caught.value.hint
