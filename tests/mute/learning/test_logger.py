"""What a run leaves behind of its curves: resumed, damaged, and where the disk is full."""

from __future__ import annotations

import errno
import json
import logging
import socket
import threading
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.summary.writer.record_writer import RecordWriter

from mute.learning.logger import CurveWriter, quiet_writer_thread
from mute.support.files import DiskError


def _write(writer: CurveWriter, iterations: range, value: float) -> None:
    for iteration in iterations:
        writer.add_scalar("Loss/value", value, iteration)
        writer.end_iteration(iteration)
    writer.stop()


def _iterations(path: Path) -> list[int]:
    return [json.loads(line)["iteration"] for line in path.read_text().splitlines()]


# -- a run that goes on --------------------------------------------------------------------------


def test_curves_logged_after_the_checkpoint_and_a_line_cut_short_are_dropped(tmp_path, caplog):
    path = tmp_path / "curves.jsonl"
    path.write_text('{"iteration": 0}\n{"iteration": 1}\n{"iteration": 2}\n{"iterat')
    writer = CurveWriter(str(tmp_path), first_iteration=2)
    writer.add_scalar("Loss/value", 0.5, 2)
    assert writer.end_iteration(2) == {"Loss/value": 0.5}
    writer.stop()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines == [{"iteration": 0}, {"iteration": 1}, {"iteration": 2, "Loss/value": 0.5}]
    # That is how a killed process leaves it, and nothing to speak of.
    assert caplog.records == []
    assert not list(tmp_path.glob("curves.damaged*"))


def test_a_last_line_that_lacks_its_end_alone_is_kept(tmp_path):
    path = tmp_path / "curves.jsonl"
    path.write_text('{"iteration": 0}\n{"iteration": 1}')
    _write(CurveWriter(str(tmp_path), first_iteration=2), range(2, 3), 0.5)
    assert _iterations(path) == [0, 1, 2]


def test_tensorboard_reads_a_run_in_order_that_is_resumed_within_the_second(tmp_path, monkeypatch):
    # On a machine whose name sorts after ours: without a wait, its file would be read last.
    monkeypatch.setattr(socket, "gethostname", lambda: "~host")
    _write(CurveWriter(str(tmp_path)), range(4), 1.0)
    monkeypatch.setattr(socket, "gethostname", lambda: "host")
    _write(CurveWriter(str(tmp_path), first_iteration=2), range(2, 4), 2.0)
    events = EventAccumulator(str(tmp_path)).Reload().Scalars("Loss/value")
    assert [(event.step, event.value) for event in events] == [(0, 1), (1, 1), (2, 2), (3, 2)]


# -- damage --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "damage",
    [
        b"\x00\xff\xfe\x80garbage",
        b"3",
        b'["iteration", 1]',
        b'{"Loss/value": 0.5}',
        b'{"iteration": "one"}',
        b'{"iteration": NaN}',
        b"[" * 100_000,
        b"",
    ],
    ids=["binary", "number", "list", "no key", "word", "NaN", "deep", "empty"],
)
def test_a_damaged_line_is_left_out_with_a_warning_and_kept_beside(damage, tmp_path, caplog):
    path = tmp_path / "curves.jsonl"
    content = b'{"iteration": 0}\n' + damage + b'\n{"iteration": 1}\n'
    path.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        writer = CurveWriter(str(tmp_path), first_iteration=2)
    _write(writer, range(2, 3), 0.5)
    assert _iterations(path) == [0, 1, 2]
    kept = tmp_path / "curves.damaged.jsonl"
    assert kept.read_bytes() == content
    (record,) = caplog.records
    assert record.getMessage() == (f"{path}: 1 damaged lines are left out; {kept} has them all")


def test_what_was_kept_of_damaged_curves_is_not_written_over(tmp_path):
    for content in (b"one\n", b"two\n"):
        (tmp_path / "curves.jsonl").write_bytes(content)
        CurveWriter(str(tmp_path), first_iteration=1).stop()
    assert (tmp_path / "curves.damaged.jsonl").read_bytes() == b"one\n"
    assert (tmp_path / "curves.damaged-1.jsonl").read_bytes() == b"two\n"


def test_curves_that_cannot_be_read_are_told_by_their_name(tmp_path):
    path = tmp_path / "curves.jsonl"
    path.mkdir()
    with pytest.raises(DiskError) as caught:
        CurveWriter(str(tmp_path), first_iteration=1)
    assert str(caught.value) == f"cannot read {path}: Is a directory"


# -- a full disk ---------------------------------------------------------------------------------


def _full(*arguments: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_curves_stay_whole_where_they_cannot_be_written_anew(tmp_path, monkeypatch):
    path = tmp_path / "curves.jsonl"
    path.write_text('{"iteration": 0}\n{"iteration": 1}\n')
    monkeypatch.setattr("mute.support.files.os.replace", _full)
    with pytest.raises(DiskError, match=r"curves\.jsonl: No space left on device$"):
        CurveWriter(str(tmp_path), first_iteration=1)
    assert path.read_text() == '{"iteration": 0}\n{"iteration": 1}\n'
    assert list(tmp_path.glob("*.tmp")) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_curves_on_a_full_disk_are_told_in_one_line(tmp_path):
    writer = CurveWriter(str(tmp_path))
    path = tmp_path / "curves.jsonl"
    path.symlink_to("/dev/full")
    writer.add_scalar("Loss/value", 0.5, 0)
    with pytest.raises(DiskError) as caught:
        writer.end_iteration(0)
    assert str(caught.value) == f"cannot write {path}: No space left on device"
    writer.stop()


def test_what_tensorboards_thread_cannot_write_is_told_in_one_line(tmp_path, monkeypatch):
    others, reported = threading.enumerate(), []
    monkeypatch.setattr(threading, "excepthook", reported.append)
    writer = CurveWriter(str(tmp_path))
    monkeypatch.setattr(RecordWriter, "write", _full)
    with quiet_writer_thread():
        with pytest.raises(DiskError) as caught:
            for iteration in range(100):  # told in the first or the second, as the threads run
                writer.add_scalar("Loss/value", 0.5, iteration)
                writer.end_iteration(iteration)
        for thread in threading.enumerate():
            if thread not in others:
                thread.join(timeout=60)
    assert reported == []  # its module has the name that is looked for
    assert str(caught.value) == (
        f"cannot write TensorBoard's curves in {tmp_path}: No space left on device"
    )


def test_another_threads_mistake_is_still_reported(monkeypatch):
    reported = []
    monkeypatch.setattr(threading, "excepthook", reported.append)
    with quiet_writer_thread():
        thread = threading.Thread(target=_full)
        thread.start()
        thread.join()
    assert [args.exc_type for args in reported] == [OSError]
