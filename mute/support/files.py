"""Files that are replaced whole or not at all, and one line where the system refuses."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from mute.support.errors import MuteError

__all__ = ["DiskError", "replace_file", "told_of_file", "write_file"]


class DiskError(MuteError):
    """A file that cannot be written or read: a full disk, a directory without permission."""


@contextlib.contextmanager
def told_of_file(path: Path, action: str = "write") -> Iterator[None]:
    """Turn what the system says of a file into one line.

    Args:
        path: The file.
        action: What is done with it in here.

    Raises:
        DiskError: Where the system refuses.
    """
    try:
        yield
    except OSError as error:
        raise DiskError(f"cannot {action} {path}: {error.strerror or error}") from error


def write_file(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all; its directory is made if need be.

    Raises:
        DiskError: If it cannot be written.
    """
    with told_of_file(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)


def replace_file(path: Path, data: bytes | memoryview) -> None:
    """Write a file so that `path` holds either the old content or the new, whole.

    The bytes go to `<name>.<pid>.tmp` in the same directory, reach the disk, and only then take the
    place of `path`. A failure removes that file; a process killed in between leaves it behind.
    What is no file but a device or a pipe takes the bytes as they are.

    Raises:
        OSError: The file cannot be written.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        path.write_bytes(data)
        return
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    # Makes the new name survive a power cut. Some file systems refuse, but the file is in place.
    with contextlib.suppress(OSError):
        _sync_directory(path.parent)


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
