"""A batch that reads from an S3 store and puts its results there: a server by others that speaks S3."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_batch_command import ORDER, TOY_PROGRAM

from vto_pipeline.cli.commands import batch
from vto_pipeline.errors import InputError
from vto_pipeline.io.stores import copy_here, copy_there, list_files, size_there

for package in ("distributed", "moto", "s3fs"):
    pytest.importorskip(package)
boto3 = pytest.importorskip("boto3")

pytestmark = pytest.mark.filterwarnings("default")  # of dask, and of clients that are closed late
SERVER = "import sys; from moto.server import main; main(sys.argv[1:])"
PATIENCE = 120.0  # s
TABLE = "name,given.left.number,stages.add.offset\na,s3://given/november/left.txt,1\nb,s3://given/november/left.txt,2\n"


class Store:
    """The server, and a client of its own that knows nothing of ours."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"http://127.0.0.1:{self._port}"
        command = [sys.executable, "-W", "ignore", "-c", SERVER, "-H", "127.0.0.1", "-p", str(self._port)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        began = time.monotonic()
        while not self._answers():
            assert self.process.poll() is None
            assert time.monotonic() - began < PATIENCE
            time.sleep(0.1)
        self.client = boto3.client("s3", endpoint_url=self.address)
        for bucket in ("given", "made"):
            self.client.create_bucket(Bucket=bucket)

    def _answers(self) -> bool:
        with socket.socket() as asked:
            return asked.connect_ex(("127.0.0.1", self._port)) == 0

    def put(self, name: str, content: bytes) -> None:
        self.client.put_object(Bucket="given", Key=name, Body=content)

    def made(self) -> dict[str, bytes]:
        """All that lies in the bucket for results."""
        listed = self.client.list_objects_v2(Bucket="made").get("Contents", [])
        return {one["Key"]: self.client.get_object(Bucket="made", Key=one["Key"])["Body"].read() for one in listed}

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """Credentials and address come from the environment, as a user gives them."""
    for name, value in (("ACCESS_KEY_ID", "a"), ("SECRET_ACCESS_KEY", "b"), ("DEFAULT_REGION", "us-east-1")):
        monkeypatch.setenv(f"AWS_{name}", value)
    server = Store()
    monkeypatch.setenv("AWS_ENDPOINT_URL", server.address)
    import fsspec

    fsspec.get_filesystem_class("s3").clear_instance_cache()  # of the server of another test
    yield server
    server.end()


@pytest.fixture
def ordered(vto, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """`vto`, with a batch of two rows whose number lies in the store."""
    monkeypatch.setattr(batch, "PROGRAM", (sys.executable, "-c", TOY_PROGRAM))
    store.put("november/left.txt", b"3")
    (tmp_path / "order.yaml").write_text(ORDER)
    (tmp_path / "table.csv").write_text(TABLE)
    return vto


def published(folder: str) -> dict[str, bytes]:
    """What batch.json says is the rows', and the summary, by the names that they have in the store."""
    record = json.loads(Path(folder, "batch.json").read_text())
    names = {name for row in record["rows"] for name in row["files"]} | {"page.html", "batch.csv", "batch.json"}
    return {f"nov/{name}": Path(folder, name).read_bytes() for name in names}


def test_a_batch_reads_there_and_what_it_makes_is_there_byte_for_byte(ordered, store: Store) -> None:
    command = ("batch", "order.yaml", "-o", "november", "--workers", "1", "--publish", "s3://made/nov")
    said = ordered(*command)
    assert said.code == 0, said.err
    squares = {name: Path(f"november/rows/{name}/out/squared.txt").read_text() for name in "ab"}
    assert squares == {"a": str((2 * 3 + 2 * 4 + 1) ** 2), "b": str((2 * 3 + 2 * 4 + 2) ** 2)}
    made = store.made()
    expected = published("november")
    assert made.keys() >= expected.keys()
    assert {name: made[name] for name in expected} == expected
    assert len(list(Path("november/inputs").glob("*/left.txt"))) == 1  # two rows name it

    again = ordered(*command)
    assert again.code == 0, again.err
    assert "2 of 2 rows are done and unchanged" in again.err
    assert "0 files were copied to s3://made/nov" in again.err

    store.put("november/left.txt", b"5")  # what has changed there is another input here
    store.client.delete_object(Bucket="made", Key="nov/rows/b/out/squared.txt")
    changed = ordered(*command)
    assert changed.code == 0, changed.err
    assert store.made()["nov/rows/b/out/squared.txt"] == str((2 * 5 + 2 * 4 + 2) ** 2).encode()
    expected = published("november")
    assert {name: store.made()[name] for name in expected} == expected


def test_what_is_not_there_is_told_before_anything_runs(ordered, store: Store, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE.replace("left.txt,2", "nowhere.txt,2"))
    said = ordered("batch", "order.yaml", "-o", "november")
    assert said.code == 3, said.err
    assert "nothing is there" in said.err
    assert "s3://given/november/nowhere.txt" in said.err.replace("\n", "")
    (tmp_path / "table.csv").write_text(TABLE)
    said = ordered("batch", "order.yaml", "-o", "november", "--publish", "s3://no-such-bucket/nov")
    assert said.code == 3, said.err
    assert "bucket does not exist" in said.err.replace("\n", " ")
    assert "s3://no-such-bucket/nov/batch.json" in said.err.replace("\n", "")
    assert not Path("november/rows").exists()
    assert {one["Name"] for one in store.client.list_buckets()["Buckets"]} == {"given", "made"}


def test_a_store_that_goes_away_costs_no_row_and_is_caught_up_with(ordered, store: Store, monkeypatch) -> None:
    said = ordered("batch", "order.yaml", "-o", "november", "--workers", "1")
    assert said.code == 0, said.err
    store.end()
    command = ("batch", "order.yaml", "-o", "november", "--workers", "1", "--publish", "s3://made/nov")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    said = ordered(*command)
    assert said.code in (3, 6), said.err
    assert "Traceback" not in said.err
    assert Path("november/rows/a/out/squared.txt").is_file()


def test_large_files_come_and_go_whole(store: Store, tmp_path: Path) -> None:
    """In parts, as s3fs sends what is larger than 50 MB."""
    content = np.random.default_rng(0).bytes(67_654_321)
    (tmp_path / "large.bin").write_bytes(content)
    copy_there(tmp_path / "large.bin", "s3://made/deep/folder/large.bin")
    assert store.made() == {"deep/folder/large.bin": content}
    assert size_there("s3://made/deep/folder/large.bin") == len(content)
    (found,) = list_files("s3://made/deep")
    assert (found.name, found.bytes) == ("folder/large.bin", len(content))
    assert found.version
    copy_here("s3://made/deep", found, tmp_path / "back.bin")
    assert (tmp_path / "back.bin").read_bytes() == content
    assert size_there("s3://made/other.bin") is None
    with pytest.raises(InputError, match="nothing is there"):
        list_files("s3://made/other.bin")


def test_an_upload_that_breaks_off_leaves_nothing(store: Store, tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "large.bin").write_bytes(bytes(120_000_000))
    import s3fs

    parts, upload = [], s3fs.core.S3File._upload_chunk

    def broken(file, final=False):
        parts.append(final)
        if len(parts) == 2:
            raise OSError("the line is dead")
        return upload(file, final)

    monkeypatch.setattr(s3fs.core.S3File, "_upload_chunk", broken)
    with pytest.raises(InputError, match="the line is dead"):
        copy_there(tmp_path / "large.bin", "s3://made/large.bin")
    assert store.made() == {}
    assert "Uploads" not in store.client.list_multipart_uploads(Bucket="made")
