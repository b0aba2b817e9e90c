"""What a batch is given in stores, and what it puts there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from toy_tables import TOY
from web_folder import served

from vto_pipeline.errors import BatchError, ConfigError, InputError
from vto_pipeline.io.documents import read_json
from vto_pipeline.pipeline.batch import inputs, publish
from vto_pipeline.pipeline.batch.inputs import INDEX, Inputs
from vto_pipeline.pipeline.batch.order import read_order
from vto_pipeline.pipeline.batch.publish import Publisher
from vto_pipeline.pipeline.batch.roots import Roots
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.batches import plan_rows

pytest.importorskip("aiohttp")
fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def web(tmp_path):
    """The folder of a web server, its address, and what is fetched from it."""
    (tmp_path / "web").mkdir()
    for name, number in (("left.txt", "3"), ("same.txt", "3"), ("right.txt", "4")):
        (tmp_path / "web" / name).write_text(number)
    with served(tmp_path / "web") as (address, fetched):
        yield tmp_path / "web", address, fetched


def ordered(folder: Path, *given: str) -> list:
    """The rows of a batch, each with one of these as left.number."""
    rows = ", ".join(f"{{given.left.number: '{one}'}}" for one in given)
    (folder / "order.yaml").write_text(f"schema: 1\nrun: {{schema: 1, given: {{}}, want: [total]}}\nrows: [{rows}]\n")
    return read_order(folder / "order.yaml")


def paths(rows: list) -> list[Path]:
    return [Path(row.data["given"]["left"]["number"]) for row in rows]


def test_each_content_is_here_once_however_many_rows_and_addresses_name_it(web, tmp_path, monkeypatch):
    _, address, fetched = web
    asked, ask = [], inputs.list_files
    monkeypatch.setattr(inputs, "list_files", lambda one: asked.append(one) or ask(one))
    rows = ordered(tmp_path, *[f"{address}/left.txt"] * 5, f"{address}/same.txt", f"{address}/right.txt")
    said: list[str] = []
    found = paths(Inputs(tmp_path / "inputs", Roots(), said.append).of_rows(rows))
    assert [path.read_text() for path in found] == ["3"] * 6 + ["4"]
    assert len(set(found[:5])) == 1
    assert found[0].parent == found[5].parent  # two names of one content, in the folder of its digest
    assert sorted(fetched) == ["/left.txt", "/right.txt", "/same.txt"]
    assert len(said) == len(asked) == 3
    assert {path.name for path in (tmp_path / "inputs").iterdir()} == {*(p.parent.name for p in found), INDEX}
    index = read_json(tmp_path / "inputs" / INDEX)
    assert (tmp_path / "inputs" / index[f"{address}/right.txt"]["path"]).read_text() == "4"


def test_copies_that_no_row_uses_are_removed(web, tmp_path):
    _, address, _ = web
    (tmp_path / "link").symlink_to(tmp_path)
    rows = ordered(tmp_path, f"{address}/left.txt", f"{address}/right.txt", f"{address}/same.txt")
    left, right, same = paths(Inputs(tmp_path / "inputs", Roots()).of_rows(rows))
    through_a_link = Inputs(tmp_path / "link" / "inputs", Roots())
    used = ["denim", str(tmp_path / "link" / left.relative_to(tmp_path))]
    assert through_a_link.remove_others(used, dry_run=True) == (1, 1)
    assert right.exists()
    assert through_a_link.remove_others(used) == (1, 1)  # the other is of the same content, in the same folder
    assert (left.exists(), right.parent.exists(), same.exists()) == (True, False, True)
    assert set(read_json(tmp_path / "inputs" / INDEX)) == {f"{address}/left.txt", f"{address}/same.txt"}
    assert Inputs(tmp_path / "inputs", Roots()).of_rows(rows)[1].data["given"]["left"]["number"] == str(right)
    assert Inputs(tmp_path / "none", Roots()).remove_others([]) == (0, 0)


def test_what_is_as_before_is_not_copied_again_and_what_has_changed_is(web, tmp_path):
    folder, address, fetched = web
    rows = ordered(tmp_path, f"{address}/left.txt", f"{address}/right.txt")
    first = paths(Inputs(tmp_path / "inputs", Roots()).of_rows(rows))
    fetched.clear()
    assert paths(Inputs(tmp_path / "inputs", Roots()).of_rows(rows)) == first
    assert fetched == []
    (folder / "left.txt").write_text("5")
    os.utime(folder / "left.txt", (0, 10))
    changed = paths(Inputs(tmp_path / "inputs", Roots()).of_rows(rows))
    assert fetched == ["/left.txt"]
    assert (changed[0].read_text(), changed[1]) == ("5", first[1])
    assert first[0].read_text() == "3"  # what was computed from it stays true
    first[1].unlink()
    assert paths(Inputs(tmp_path / "inputs", Roots()).of_rows(rows))[1].read_text() == "4"


def test_a_folder_in_a_store_is_a_folder_here(tmp_path):
    store = fsspec.filesystem("memory")
    store.pipe({"/orders/photos/a.png": b"1", "/orders/photos/more/b.png": b"2"})
    try:
        here = Inputs(tmp_path / "inputs", Roots()).here("memory://orders/photos")
    finally:
        store.rm("/orders", recursive=True)
    assert {path.relative_to(here).as_posix(): path.read_bytes() for path in here.rglob("*.png")} == {
        "a.png": b"1",
        "more/b.png": b"2",
    }
    assert here.name == "photos"


def test_a_copy_that_fails_leaves_nothing(web, tmp_path):
    _, address, _ = web
    with pytest.raises(InputError, match="ClientPayloadError") as caught:
        Inputs(tmp_path / "inputs", Roots()).of_rows(ordered(tmp_path, f"{address}/short.txt"))
    assert caught.value.where == f"row row_1, {address}/short.txt"
    assert not list((tmp_path / "inputs").iterdir())


@pytest.mark.parametrize(
    "given",
    [
        "file:///etc/hostname",
        "file://{home}/../secret.txt",
        "file://{home}/link.txt",
        "file://{home}/a?/../../secret.txt",
        "file://{home}/a#/../../secret.txt",
        "file://{home}?/secret.txt",
        "file://~/secret.txt",
        "http://127.0.0.1/left.txt",
        "https://bucket.example/orders/left.txt",
        "s3://bucket/ordersother/left.txt",
        "s3://bucket/other/left.txt",
        "s3://bucket/orders/../other/left.txt",
        "s3://bucket/orders/%2e%2e/other/left.txt",
        "s3://other@bucket/orders/left.txt",
        "S3://bucket/orders/left.txt",
        "gs://bucket/orders/left.txt",
        "filecache::s3://bucket/orders/left.txt",
        "github://a:b@c/left.txt",
    ],
)
def test_a_batch_with_roots_asks_no_store_outside_them(tmp_path, monkeypatch, given):
    """Not even whether something is there."""
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "secret.txt").write_text("7")
    if "link" in given:
        (home / "link.txt").symlink_to(tmp_path / "secret.txt")
    monkeypatch.setattr(inputs, "list_files", lambda address: pytest.fail(address))
    rows = ordered(tmp_path, given.format(home=home))
    with pytest.raises(ConfigError):
        Inputs(tmp_path / "inputs", Roots((str(home), "s3://bucket/orders"))).check(rows)


@pytest.mark.parametrize("root", ["http://host/orders", "file:///data", "zip://a", "s3://me@bucket"])
def test_what_cannot_be_a_root_is_refused(root):
    with pytest.raises(ConfigError):
        Roots((root,))


def test_what_lies_under_a_root_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    store = fsspec.filesystem("memory")
    store.pipe("/orders/left.txt", b"3")
    (tmp_path / "home").mkdir()
    (tmp_path / "home/left.txt").write_text("3")
    roots = Roots((str(tmp_path / "home"), "memory://orders/"))
    try:
        given = ("memory://orders/left.txt", f"file://{tmp_path}/home/left.txt", str(tmp_path / "home/left.txt"))
        rows, given_there = ordered(tmp_path, *given), Inputs(tmp_path / "inputs", roots)
        assert given_there.check(rows)
        assert not given_there.check(ordered(tmp_path, str(tmp_path / "home/left.txt")))
        rows = given_there.of_rows(rows)
    finally:
        store.rm("/orders", recursive=True)
    planned = plan_rows(
        rows, Store(tmp_path / "cache"), lambda *_: False, False, roots.with_folder(tmp_path / "inputs")
    )
    assert len({one.key for one in planned}) == 1  # one content, three ways to it
    with pytest.raises(ConfigError, match="lies outside"):
        plan_rows(rows, Store(tmp_path / "cache"), lambda *_: False, False, roots)


def row(name: str, status: str = "done") -> dict:
    files = [f"rows/{name}/run.json", f"rows/{name}/out/draped.ply"]
    return {"name": name, "status": status, "files": files, "picture": f"pictures/{name}.png"}


@pytest.fixture
def batch(tmp_path):
    """The folder of a batch with two rows that are done."""
    for name in ("a", "b"):
        for file in (*row(name)["files"], row(name)["picture"]):
            (tmp_path / "batch" / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "batch" / file).write_text(f"{file} of {name}")
    (tmp_path / "batch/batch.json").write_text("{}")
    return tmp_path / "batch"


def test_a_row_is_put_with_its_record_last_and_only_once(batch, tmp_path, monkeypatch):
    put, copy = [], publish.copy_there
    monkeypatch.setattr(publish, "copy_there", lambda path, address: (put.append(address), copy(path, address)))
    address = f"file://{tmp_path}/there"
    publisher = Publisher(batch, address + "/")
    assert publisher.put_row(row("a")) == 3
    assert [one.removeprefix(address) for one in put] == [
        "/rows/a/out/draped.ply",
        "/pictures/a.png",
        "/rows/a/run.json",
    ]
    assert publisher.put_row(row("b", "failed")) == 0
    for file in (*row("a")["files"], row("a")["picture"]):
        assert (tmp_path / "there" / file).read_bytes() == (batch / file).read_bytes()
    again = Publisher(batch, address)
    assert again.put_row(row("a")) == 0
    (batch / "rows/a/out/draped.ply").write_text("another")
    (tmp_path / "there/rows/a/run.json").unlink()
    assert again.put_row(row("a")) == 2
    assert (tmp_path / "there/rows/a/out/draped.ply").read_text() == "another"
    assert again.put_batch({"rows": [row("a"), row("b")]}) == f"6 files were copied to {address}"  # 2 of them before
    other = tmp_path / "elsewhere/rows/a/run.json"
    other.parent.mkdir(parents=True)
    other.write_text("x" * (batch / "rows/a/run.json").stat().st_size)  # of the same size, but not ours
    assert Publisher(batch, f"file://{tmp_path}/elsewhere").put_row(row("a")) == 3
    assert other.read_bytes() == (batch / "rows/a/run.json").read_bytes()


def test_a_store_that_fails_in_the_middle_loses_nothing_that_is_there(batch, tmp_path, monkeypatch):
    address, copy = f"file://{tmp_path}/there", publish.copy_there

    def failing(path, to):
        if to.endswith("/b/run.json"):
            raise InputError("the line is cut", where=to)
        copy(path, to)

    monkeypatch.setattr(publish, "copy_there", failing)
    with pytest.raises(BatchError, match="not all is published: the line is cut") as caught:
        Publisher(batch, address).put_batch({"rows": [row("a"), row("b")]})
    assert caught.value.exit_code == 6
    assert not (tmp_path / "there/batch.json").exists()  # it would tell of what is not there
    monkeypatch.undo()
    assert Publisher(batch, address).put_batch({"rows": [row("a"), row("b")]}).startswith("2 files")
