"""Where a figure or a policy comes from: the commit, the files that went in, and the machine."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from mute.support.errors import MuteError
from mute.support.quiet_git import import_git
from mute.support.threads import usable_cores

__all__ = ["REPOSITORY", "current_commit", "digest_of", "file_sha256", "machine_kind", "place_of"]

REPOSITORY = Path(__file__).resolve().parents[2]
"""Top of the checkout; of an installed package, the directory that it is in."""


def current_commit(repository: Path | None = None) -> str:
    """Return the commit of a working tree, this one's by default, with '-dirty' if it differs.

    It is 'unknown' outside a working tree, and where there is no git program to look at one.
    Files in `docs`, where results are written one after the other, may differ: no result depends on
    them.
    """
    git = import_git()
    try:
        tree = git.Repo(repository or REPOSITORY)
        suffix = "-dirty" if tree.is_dirty(path=":(exclude)docs") else ""
        return f"{tree.head.commit.hexsha}{suffix}"
    except (git.GitError, OSError, ValueError):
        return "unknown"


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal.

    Raises:
        MuteError: If it cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise MuteError(f"cannot read {path}: {error.strerror}") from error


def place_of(path: Path) -> str:
    """Return where a file is, for those who have it on another machine.

    From the top of the checkout; elsewhere `TASK/RUN/FILE` if it is of a run, or its name alone.
    """
    path = path.resolve()
    if path.is_relative_to(REPOSITORY):
        return path.relative_to(REPOSITORY).as_posix()
    of_a_run = (path.parent / "config.yaml").is_file()
    return "/".join(path.parts[-3:]) if of_a_run else path.name


def digest_of(data: Mapping[str, Any]) -> str:
    """Return sixteen hexadecimal digits that name plain data, whatever the order of its keys."""
    text = json.dumps(data, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()[:16]


def machine_kind() -> str:
    """Return the processor, its cores that may be used and, where there is one, the GPU."""
    processor = platform.processor() or platform.machine()
    cpu_info = Path("/proc/cpuinfo")
    if cpu_info.exists():
        lines = cpu_info.read_text().splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        processor = names[0] if names else processor
    cores = usable_cores()
    kind = f"{processor}, {cores} core{'s' * (cores > 1)}"
    return f"{kind}, {torch.cuda.get_device_name()}" if torch.cuda.is_available() else kind
