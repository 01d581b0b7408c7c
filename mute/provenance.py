"""Where a figure or a policy comes from: the commit and the kind of machine."""

from __future__ import annotations

import platform
from pathlib import Path

import git
import torch

from mute.threads import usable_cores

__all__ = ["current_commit", "machine_kind"]

_REPOSITORY = Path(__file__).resolve().parents[1]


def current_commit() -> str:
    """Return the commit of the working tree, with '-dirty' if it differs; 'unknown' outside git."""
    try:
        repository = git.Repo(_REPOSITORY)
        suffix = "-dirty" if repository.is_dirty() else ""
        return f"{repository.head.commit.hexsha}{suffix}"
    except (git.GitError, ValueError):
        return "unknown"


def machine_kind() -> str:
    """Return the processor, its cores that may be used and, where there is one, the GPU."""
    processor = platform.processor() or platform.machine()
    cpu_info = Path("/proc/cpuinfo")
    if cpu_info.exists():
        lines = cpu_info.read_text().splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        processor = names[0] if names else processor
    kind = f"{processor}, {usable_cores()} cores"
    return f"{kind}, {torch.cuda.get_device_name()}" if torch.cuda.is_available() else kind
