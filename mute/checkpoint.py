"""Checkpoint files: written atomically, read without running anything that they hold.

A checkpoint is a torch archive of plain data with a small header. torch does not look at the
checksums of its own archives; here a file with a flipped bit is refused. What goes into it, and
what is done with it after loading, is left to the runner and the players.
"""

from __future__ import annotations

import glob
import io
import pickle
import re
import zipfile
from collections import OrderedDict
from pathlib import Path
from typing import Any

import torch

from mute.support.errors import MuteError
from mute.support.files import replace_file

_FORMAT = "mute-checkpoint"
_VERSION = 1
_HEADER_KEYS = ("format", "version")

_SCALAR_TYPES = (str, int, float, bool, type(None))
_TENSOR_TYPES = (torch.Tensor, torch.nn.Parameter)
_ZIP_MAGIC = b"PK\x03\x04"
_PICKLE_MAGIC = b"\x80"
_DIRECTORY = 0x10
"""Attribute of a directory in an archive: torch reads nothing of it, and takes what is there."""
_AT_ONCE = 2**20
"""Bytes that are summed at once: of a large file no more is held."""


class CheckpointError(MuteError):
    """A checkpoint that is missing, damaged, foreign, too new, or refused."""


def save_checkpoint(path: Path, payload: dict[str, Any]) -> None:
    """Write a checkpoint so that `path` always holds either the old file or the new one, whole.

    The bytes go to `<name>.<pid>.tmp` in the same directory, reach the disk, and only then take
    the place of `path`. A failure removes that file; a process killed in between leaves it behind,
    where nothing reads it.

    Args:
        path: File to write or replace; its directory is made if need be.
        payload: Tensors, str, int, float, bool and None, nested in lists, tuples and dictionaries
            with str or int keys. The keys "format" and "version" are the header's.

    Raises:
        TypeError: A value is of another type, which a safe load would refuse; names its place.
        ValueError: The payload uses a key of the header.
        CheckpointError: The file cannot be written.
    """
    for key in _HEADER_KEYS:
        if key in payload:
            raise ValueError(f"payload[{key!r}] is reserved for the checkpoint's header")
    _check_plain(payload, "payload")
    # Serialised in memory first: a payload that cannot be saved never touches the disk.
    buffer = _archive({"format": _FORMAT, "version": _VERSION, **payload})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, buffer.getbuffer())
    except OSError as error:
        raise CheckpointError(f"cannot write checkpoint {path}: {error.strerror}") from error


def load_checkpoint(path: Path, map_location: str | torch.device = "cpu") -> dict[str, Any]:
    """Read a checkpoint's payload without running code from the file.

    Args:
        path: File written by `save_checkpoint`.
        map_location: Device that the tensors are put on.

    Raises:
        CheckpointError: The file is missing, a directory, cut short, damaged, not a checkpoint of
            this project, written by a newer version, or holds pickled code or anything else than
            plain data; one line that names it.
    """
    _check_archive(path)
    _check_sums(path)
    try:
        content = torch.load(path, map_location=map_location, weights_only=True)
    except Exception as error:  # a damaged archive can make the reader raise anything
        if isinstance(error, pickle.UnpicklingError) and _holds_code(path):
            raise _code_refused(path) from None
        raise CheckpointError(
            f"{path} is not a readable checkpoint, or damaged: {first_line(error)}"
        ) from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise CheckpointError(f"{path} was written by another program, not a MUTE checkpoint")
    version = content.get("version")
    if not isinstance(version, int) or version < 1:
        raise CheckpointError(f"{path} is a MUTE checkpoint with a bad version: {version!r}")
    if version > _VERSION:
        raise CheckpointError(
            f"{path} was written by a newer MUTE: checkpoint version {version}, "
            f"this one reads up to {_VERSION}"
        )
    try:
        _check_plain(content, "it")
    except (TypeError, RecursionError) as error:
        raise CheckpointError(f"{path} is no MUTE checkpoint: {first_line(error)}") from error
    return {key: value for key, value in content.items() if key not in _HEADER_KEYS}


def latest_checkpoint(log_dir: Path, task: str | None = None) -> Path:
    """Find the newest run's newest checkpoint.

    Runs are directories `log_dir/<task>/<run>/` that hold `model_<iteration>.pt`. The newest run
    is the one whose directory was modified last; its newest checkpoint has the highest iteration.

    Args:
        log_dir: Directory of all runs.
        task: Look at this task's runs only; None means every task's.

    Raises:
        CheckpointError: There is none.
    """
    runs = log_dir.glob(f"{glob.escape(task) if task else '*'}/*/")
    newest = {run: path for run in runs if (path := newest_checkpoint(run)) is not None}
    if not newest:
        raise CheckpointError(f"no checkpoint under {log_dir / (task or '')}; start a run first")
    # The name decides between directories of the same instant.
    run = max(newest, key=lambda directory: (directory.stat().st_mtime_ns, directory.name))
    return newest[run]


def newest_checkpoint(run: Path) -> Path | None:
    """Return the checkpoint of a run with the highest iteration; None if it has none."""
    named = ((re.fullmatch(r"model_(\d+)\.pt", path.name), path) for path in run.iterdir())
    found = [(int(match[1]), path) for match, path in named if match and path.is_file()]
    return max(found)[1] if found else None


def _check_plain(value: object, place: str) -> None:
    """Raise TypeError at the first value, named by its place, that a safe load would refuse.

    Types are compared exactly: a numpy float is a float, and yet its pickle is not.
    """
    if type(value) in _SCALAR_TYPES or type(value) in _TENSOR_TYPES:
        return
    if isinstance(value, list | tuple) and type(value) in (list, tuple):
        for index, item in enumerate(value):
            _check_plain(item, f"{place}[{index}]")
        return
    if not isinstance(value, dict) or type(value) not in (dict, OrderedDict):
        raise TypeError(f"{place} is a {_type_name(value)}, which a checkpoint cannot hold")
    for key, item in value.items():
        if type(key) not in (str, int):
            raise TypeError(
                f"{place} has the key {key!r} of type {_type_name(key)}; use str or int"
            )
        _check_plain(item, f"{place}[{key!r}]")


def _type_name(value: object) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}".removeprefix("builtins.")


def _check_archive(path: Path) -> None:
    """Raise CheckpointError unless the file can be read and looks like a torch archive.

    Keeps torch from falling back to its older formats, which are bare pickles.
    """
    try:
        with path.open("rb") as file:
            start = file.read(len(_ZIP_MAGIC))
    except FileNotFoundError:
        raise CheckpointError(
            f"no checkpoint at {path}; give the path of a model_<iteration>.pt"
        ) from None
    except IsADirectoryError:
        raise CheckpointError(f"{path} is a directory, not a checkpoint file") from None
    except OSError as error:
        raise CheckpointError(f"cannot read checkpoint {path}: {error.strerror}") from error
    if start.startswith(_PICKLE_MAGIC):
        raise _code_refused(path)
    if start != _ZIP_MAGIC:
        raise CheckpointError(f"{path} is not a checkpoint")


def _archive(content: dict[str, Any]) -> io.BytesIO:
    """Return torch's archive, with its checksums even where the process does without."""
    buffer = io.BytesIO()
    sums = torch.serialization.get_crc32_options()
    torch.serialization.set_crc32_options(True)
    try:
        torch.save(content, buffer)
    finally:
        torch.serialization.set_crc32_options(sums)
    return buffer


def _check_sums(path: Path) -> None:
    """Raise CheckpointError unless the archive is whole and every part has its checksum."""
    try:
        if not zipfile.is_zipfile(path):  # the archive's directory stands at its end
            raise CheckpointError(f"{path} is cut short or damaged")
        with zipfile.ZipFile(path) as archive:
            # By entry, not by name as `testzip` does: a flipped bit can make two names alike.
            for entry in archive.infolist():
                if entry.is_dir() or entry.external_attr & _DIRECTORY:
                    raise zipfile.BadZipFile(f"{entry.filename!r} is said to be a directory")
                with archive.open(entry) as part:
                    while part.read(_AT_ONCE):
                        pass
    except CheckpointError:
        raise
    except Exception as error:  # a flipped bit can make the reader raise anything
        raise CheckpointError(f"{path} is damaged: {first_line(error)}") from error


def _holds_code(path: Path) -> bool:
    """Tell whether the archive's pickle names anything that a safe load does not allow."""
    try:
        return bool(torch.serialization.get_unsafe_globals_in_checkpoint(path))
    except Exception:  # the pickle is damaged, too
        return False


def _code_refused(path: Path) -> CheckpointError:
    return CheckpointError(f"{path} holds code, refused: loading it could run anything")


def first_line(error: Exception) -> str:
    """Return the first line of an error's message, or its type where it has none."""
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
