"""Files are replaced whole or not at all, and what the system refuses is one line."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from mute.evaluation.tables import write_csv, write_json
from mute.support.files import DiskError, replace_file, write_file


def _fail(*arguments: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "write",
    [
        lambda path: write_file(path, b"new"),
        lambda path: write_csv(path, [{"beta": 1.0}]),
        lambda path: write_json(path, {"beta": 1.0}),
    ],
    ids=["bytes", "csv", "json"],
)
def test_a_file_that_cannot_be_written_stays_as_it_was_and_is_told_in_one_line(
    write, tmp_path, monkeypatch
):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr("mute.support.files.os.fsync", _fail)
    with pytest.raises(DiskError) as caught:
        write(path)
    assert str(caught.value) == f"cannot write {path}: No space left on device"
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_directory_that_is_missing_is_made(tmp_path):
    write_file(tmp_path / "new" / "deep" / "file", b"content")
    assert (tmp_path / "new" / "deep" / "file").read_bytes() == b"content"


def test_a_directory_in_the_place_of_a_file_is_told_by_its_name(tmp_path):
    with pytest.raises(DiskError, match=f"^cannot write {tmp_path}: Is a directory$"):
        write_file(tmp_path, b"content")
    assert list(tmp_path.parent.glob("*.tmp")) == []


def test_a_pipe_takes_the_bytes_and_is_not_replaced():
    reader, writer = os.pipe()
    replace_file(Path(f"/dev/fd/{writer}"), b"content")
    os.close(writer)
    with os.fdopen(reader, "rb") as file:
        assert file.read() == b"content"
