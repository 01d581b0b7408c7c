"""Checkpoints survive being killed while written, and refuse what they should not read."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import pytest
import torch
from places import REPOSITORY, SHIPPED_POLICY

from mute.checkpoint import CheckpointError, latest_checkpoint, load_checkpoint, save_checkpoint


def _make_training_state() -> dict[str, object]:
    """Return a network and its Adam after one step, so that every moment is filled."""
    torch.manual_seed(0)
    network = torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.LSTM(4, 2))
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    torch.cat([parameter.flatten() for parameter in network.parameters()]).pow(2).sum().backward()
    optimizer.step()
    return {"network": network.state_dict(), "optimizer": optimizer.state_dict()}


def _assert_bit_equal(actual: object, expected: object) -> None:
    assert type(actual) is type(expected)
    if isinstance(expected, torch.Tensor):
        assert isinstance(actual, torch.Tensor)
        assert actual.dtype == expected.dtype
        assert torch.equal(actual, expected)
    elif isinstance(expected, dict):
        assert isinstance(actual, dict)
        assert list(actual) == list(expected)
        for key in expected:
            _assert_bit_equal(actual[key], expected[key])
    elif isinstance(expected, list | tuple):
        assert isinstance(actual, list | tuple)
        assert len(actual) == len(expected)
        for one, other in zip(actual, expected, strict=True):
            _assert_bit_equal(one, other)
    else:
        assert actual == expected


class _TouchOnLoad:
    """Pickles to a call that creates a file, as a hostile checkpoint would call something worse."""

    def __init__(self, marker: Path):
        self.marker = marker

    def __reduce__(self):
        return (os.mkdir, (str(self.marker),))


def test_network_and_adam_come_back_bit_equal(tmp_path):
    payload = _make_training_state()
    save_checkpoint(tmp_path / "model_1.pt", payload)
    _assert_bit_equal(load_checkpoint(tmp_path / "model_1.pt"), payload)


def test_plain_values_of_every_kind_come_back_equal(tmp_path):
    payload = {
        "random": torch.get_rng_state(),
        "numpy": np.random.default_rng(0).bit_generator.state,  # holds integers of 128 bits
        "nested": [1, -0.5, True, None, "beta", (), {"deep": ([], {3: torch.zeros(0)})}],
        "ordered": OrderedDict(a=torch.tensor([1.0, float("inf")], dtype=torch.float64)),
    }
    save_checkpoint(tmp_path / "model_1.pt", payload)
    _assert_bit_equal(load_checkpoint(tmp_path / "model_1.pt"), payload)


def test_saving_leaves_only_the_checkpoint_in_a_new_directory(tmp_path):
    save_checkpoint(tmp_path / "task" / "run" / "model_1.pt", {})
    assert [path.name for path in (tmp_path / "task" / "run").iterdir()] == ["model_1.pt"]


KILLED_WRITER = """
import os, signal, sys
from pathlib import Path
import torch
from mute.checkpoint import save_checkpoint

stage, path = sys.argv[1], Path(sys.argv[2])
syncs = 0
die = lambda: os.kill(os.getpid(), signal.SIGKILL)
real_fsync = os.fsync

def fsync(descriptor):
    global syncs
    syncs += 1
    if stage == "half written" and syncs == 1:
        os.ftruncate(descriptor, os.fstat(descriptor).st_size // 2)
        die()
    if stage == "replaced" and syncs == 2:  # the directory's
        die()
    real_fsync(descriptor)

os.fsync = fsync
if stage == "not yet replaced":
    os.replace = lambda *_: die()
save_checkpoint(path, {"weight": torch.full((1000,), 2.0)})
"""


@pytest.mark.parametrize(
    ("stage", "survivor"),
    [("half written", 1.0), ("not yet replaced", 1.0), ("replaced", 2.0)],
)
def test_a_kill_while_saving_leaves_a_whole_checkpoint(tmp_path, stage, survivor):
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, {"weight": torch.full((1000,), 1.0)})
    child = subprocess.run([sys.executable, "-c", KILLED_WRITER, stage, str(path)], cwd=REPOSITORY)
    assert child.returncode == -signal.SIGKILL
    assert torch.equal(load_checkpoint(path)["weight"], torch.full((1000,), survivor))


def test_a_failed_write_keeps_the_old_checkpoint_and_removes_its_own_file(tmp_path, monkeypatch):
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, {"iteration": 1})

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(CheckpointError, match="No space left on device"):
        save_checkpoint(path, {"iteration": 2})
    assert load_checkpoint(path) == {"iteration": 1}
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("payload", "place"),
    [
        ({"figures": [1.0, np.float64(2.0)]}, r"payload\['figures'\]\[1\] is a numpy.float64"),
        ({"a": {"b": ({1},)}}, r"payload\['a'\]\['b'\]\[0\] is a set"),
        ({"run": Path("x")}, r"payload\['run'\] is a pathlib"),
        ({"table": {(0, 1): 2.0}}, r"payload\['table'\] has the key \(0, 1\) of type tuple"),
    ],
)
def test_a_value_that_a_safe_load_refuses_is_named_before_anything_is_written(
    tmp_path, payload, place
):
    with pytest.raises(TypeError, match=place):
        save_checkpoint(tmp_path / "model_1.pt", payload)
    assert list(tmp_path.iterdir()) == []


def test_a_payload_may_not_use_the_headers_keys(tmp_path):
    with pytest.raises(ValueError, match=r"'version'.*reserved"):
        save_checkpoint(tmp_path / "model_1.pt", {"version": 3})


def test_code_inside_a_checkpoint_is_refused_and_does_not_run(tmp_path):
    path, marker = tmp_path / "model_1.pt", tmp_path / "ran"
    hostile = {"format": "mute-checkpoint", "version": 1, "network": _TouchOnLoad(marker)}
    torch.save(hostile, path)
    with pytest.raises(CheckpointError, match=r"model_1\.pt holds code, refused"):
        load_checkpoint(path)
    assert not marker.exists()
    torch.load(path, weights_only=False)  # the payload is live: an unsafe load does run it
    assert marker.exists()


def test_a_bare_pickle_is_refused_and_does_not_run(tmp_path):
    path, marker = tmp_path / "model_1.pt", tmp_path / "ran"
    path.write_bytes(pickle.dumps(_TouchOnLoad(marker)))
    with pytest.raises(CheckpointError, match="holds code, refused"):
        load_checkpoint(path)
    assert not marker.exists()


def test_another_programs_torch_file_is_refused(tmp_path):
    torch.save({"model_state_dict": {"weight": torch.zeros(2)}, "iter": 3}, tmp_path / "policy.pt")
    with pytest.raises(CheckpointError, match=r"policy\.pt was written by another program"):
        load_checkpoint(tmp_path / "policy.pt")


def test_a_newer_checkpoint_says_so(tmp_path):
    torch.save({"format": "mute-checkpoint", "version": 2}, tmp_path / "model_1.pt")
    with pytest.raises(CheckpointError, match="newer MUTE: checkpoint version 2"):
        load_checkpoint(tmp_path / "model_1.pt")


@pytest.mark.parametrize("kept", [0.01, 0.5, 0.99])
def test_a_truncated_checkpoint_says_so(tmp_path, kept):
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, _make_training_state())
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(CheckpointError, match=r"model_1\.pt is cut short"):
        load_checkpoint(path)


def test_files_of_other_kinds_are_refused_in_one_line_each(tmp_path):
    (tmp_path / "empty.pt").touch()
    (tmp_path / "text.pt").write_text("beta: 0.7\n")
    with zipfile.ZipFile(tmp_path / "archive.pt", "w") as archive:
        archive.writestr("notes.txt", "nothing")
    for name in ("empty.pt", "text.pt", "archive.pt"):
        with pytest.raises(CheckpointError, match=rf"{name} is not a .*checkpoint") as caught:
            load_checkpoint(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_a_damaged_pickle_inside_the_archive_is_an_error_of_one_line(tmp_path):
    path = tmp_path / "model_1.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("model_1/data.pkl", b"\x80\x02}q\x00(X\x05")
        archive.writestr("model_1/version", b"3\n")
    with pytest.raises(CheckpointError, match="is not a readable checkpoint") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


def _assert_refused_or_equal(path: Path, payload: dict) -> bool:
    """Load a file and return whether it is refused; what loads must be the payload, bit by bit."""
    try:
        loaded = load_checkpoint(path)
    except CheckpointError as error:
        assert "\n" not in str(error)
        assert path.name in str(error)
        return True
    _assert_bit_equal(loaded, payload)
    return False


def test_a_flipped_bit_anywhere_is_refused_or_changes_nothing(tmp_path):
    path = tmp_path / "model_1.pt"
    payload = {"weight": torch.tensor([[0.5, -1.0], [2.0, 3.0]]), "iter": 3, "figures": [1.0, 2]}
    save_checkpoint(path, payload)
    data = path.read_bytes()
    refused = 0
    for place in range(0, len(data), 3):
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8  # 3 and 8 share no factor: all bits have their turn
        path.write_bytes(damaged)
        refused += _assert_refused_or_equal(path, payload)
    # What loads is padding, times and attributes.
    assert refused > len(data) // 9


@pytest.mark.parametrize("part", ["data.pkl", "data/0", "data/1"])
def test_a_flipped_bit_of_what_is_saved_is_damage_and_so_called(tmp_path, part):
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, {"weight": torch.ones(64), "bias": torch.full((64,), 2.0)})
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        (entry,) = (one for one in archive.infolist() if one.filename.endswith(f"/{part}"))
        place = data.index(archive.read(entry))
    for offset in (0, entry.file_size // 2, entry.file_size - 1):
        for bit in range(8):
            damaged = bytearray(data)
            damaged[place + offset] ^= 1 << bit
            path.write_bytes(damaged)
            with pytest.raises(CheckpointError, match=r"model_1\.pt is damaged: Bad CRC-32"):
                load_checkpoint(path)


def test_a_part_that_is_said_to_be_a_directory_is_refused(tmp_path):
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, {"weight": torch.ones(64)})
    data = bytearray(path.read_bytes())
    # torch would leave the weight's memory as it found it.
    entry = data.rindex(b"/data/0") - len("archive")
    data[entry - 8] |= 0x10
    path.write_bytes(data)
    with pytest.raises(CheckpointError, match="is said to be a directory"):
        load_checkpoint(path)


def test_checksums_are_written_even_where_the_process_does_without(tmp_path):
    path = tmp_path / "model_1.pt"
    torch.serialization.set_crc32_options(False)
    try:
        save_checkpoint(path, {"weight": torch.ones(64)})
        assert torch.serialization.get_crc32_options() is False
    finally:
        torch.serialization.set_crc32_options(True)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
    assert torch.equal(load_checkpoint(path)["weight"], torch.ones(64))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"sizes": torch.Size([1, 2])}, r"it\['sizes'\] is a torch.Size"),
        ({"kind": torch.float32}, r"it\['kind'\] is a torch.dtype"),
        ({"names": {"a", "b"}}, r"it\['names'\] is a set"),
        ({"raw": bytearray(b"abc")}, r"it\['raw'\] is a bytearray"),
        ({(1, 2): 3}, r"it has the key \(1, 2\)"),
    ],
    ids=lambda value: next(iter(value), None) if isinstance(value, dict) else None,
)
def test_what_is_no_plain_data_is_refused_though_torch_would_take_it(tmp_path, content, words):
    path = tmp_path / "model_1.pt"
    torch.save({"format": "mute-checkpoint", "version": 1, **content}, path)
    with pytest.raises(CheckpointError, match=rf"model_1\.pt is no MUTE checkpoint: {words}"):
        load_checkpoint(path)


def test_a_list_inside_itself_is_refused(tmp_path):
    path, endless = tmp_path / "model_1.pt", []
    endless.append(endless)
    torch.save({"format": "mute-checkpoint", "version": 1, "endless": endless}, path)
    with pytest.raises(CheckpointError, match=r"model_1\.pt is no MUTE checkpoint"):
        load_checkpoint(path)


def test_the_shipped_policy_has_its_checksums_and_loads():
    assert load_checkpoint(SHIPPED_POLICY)["task"] == "go1_mute"


def test_a_missing_checkpoint_names_the_path_and_what_to_give(tmp_path):
    with pytest.raises(CheckpointError, match=r"model_9\.pt; .*model_<iteration>\.pt"):
        load_checkpoint(tmp_path / "model_9.pt")


def test_a_directory_is_no_checkpoint(tmp_path):
    with pytest.raises(CheckpointError, match="is a directory"):
        load_checkpoint(tmp_path)


def _make_run(run: Path, *names: str, modified: int) -> None:
    run.mkdir(parents=True)
    for name in names:
        (run / name).touch()
    os.utime(run, (modified, modified))


def test_latest_is_the_highest_iteration_of_the_run_modified_last(tmp_path):
    _make_run(tmp_path / "go1_mute" / "old", "model_900.pt", modified=100)
    _make_run(tmp_path / "go1_mute" / "new", "model_9.pt", "model_10.pt", modified=200)
    assert latest_checkpoint(tmp_path) == tmp_path / "go1_mute" / "new" / "model_10.pt"


def test_latest_passes_over_stale_files_and_runs_without_a_checkpoint(tmp_path):
    _make_run(
        tmp_path / "go1_mute" / "good",
        "model_5.pt",
        "model_6.pt.77.tmp",
        "model_x.pt",
        modified=100,
    )
    _make_run(tmp_path / "go1_mute" / "killed", "model_7.pt.78.tmp", modified=200)
    assert latest_checkpoint(tmp_path) == tmp_path / "go1_mute" / "good" / "model_5.pt"


def test_latest_of_one_task_passes_over_the_others(tmp_path):
    _make_run(tmp_path / "go1_mute" / "run", "model_5.pt", modified=100)
    _make_run(tmp_path / "go1_mute_paper" / "run", "model_6.pt", modified=200)
    assert latest_checkpoint(tmp_path, "go1_mute") == tmp_path / "go1_mute" / "run" / "model_5.pt"


def test_latest_without_any_run_is_an_error_that_names_the_directory(tmp_path):
    with pytest.raises(CheckpointError, match=r"no checkpoint under .*absent"):
        latest_checkpoint(tmp_path / "absent")
