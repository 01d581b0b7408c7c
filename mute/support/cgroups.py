"""How much processor time the control groups of this process grant it: a container's quota.

Linux alone has them. The kernel holds a process to the quota of its own group and of every group
around that one, up to the mount. Both versions are read: `cpu.max` of version 2, and
`cpu.cfs_quota_us` over `cpu.cfs_period_us` of version 1; a hybrid system mounts both. Where nothing
can be read, nothing is said: the kernel enforces the quota in any case. Which processors a process
may run on is no part of this; its affinity mask says so.

Source: the kernel's `admin-guide/cgroup-v2.rst` and `scheduler/sched-bwc.rst`; `proc(5)` and
`cgroups(7)` for the two files in `/proc`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

__all__ = ["cpu_quota"]

_PROCESS = Path("/proc/self")


def cpu_quota(process: Path = _PROCESS) -> float | None:
    """Return how many processors' time a process may use; None if that is not limited, or unknown.

    Args:
        process: Its directory in `/proc`.
    """
    unified, cpu = _own_groups(process)
    limits: list[float | None] = []
    for kind, root, mount_point in _mounts(process):
        if kind == "cgroup2":
            limits += map(_unified_limit, _groups(unified, root, mount_point))
        else:
            limits += map(_cfs_limit, _groups(cpu, root, mount_point))
    return min((limit for limit in limits if limit is not None), default=None)


def _own_groups(process: Path) -> tuple[str, str]:
    """Return the process's group in version 2 and in version 1's hierarchy of `cpu`."""
    unified = cpu = "/"
    for line in _read(process / "cgroup").split("\n"):
        number, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")  # a group's name may hold colons itself
        if number == "0" and not controllers:
            unified = group
        elif "cpu" in controllers.split(","):
            cpu = group
    return unified, cpu


def _mounts(process: Path) -> Iterator[tuple[str, str, Path]]:
    """Yield the version, the group at the top and the place of each mount that may limit."""
    for line in _read(process / "mountinfo").split("\n"):
        where, _, what = line.partition(" - ")
        places, kinds = where.split()[3:5], what.split()
        if len(places) < 2 or len(kinds) < 3:
            continue
        if kinds[0] == "cgroup2" or (kinds[0] == "cgroup" and "cpu" in kinds[2].split(",")):
            root, mount_point = map(_unescaped, places)
            yield kinds[0], root, Path(mount_point)


def _unescaped(path: str) -> str:
    """Return a path whose blanks are written as octal numbers."""
    return re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), path)


def _groups(group: str, root: str, mount_point: Path) -> Iterator[Path]:
    """Yield the directories of a group and of those around it, up to the mount.

    In a container the mount's top may be the group itself, or one that its own namespace of groups
    does not name; then only the top can be read.
    """
    path, top = PurePosixPath(group), PurePosixPath(root)
    seen = path.is_relative_to(top) and ".." not in path.parts
    own = mount_point / path.relative_to(top) if seen else mount_point
    while own != mount_point:
        yield own
        own = own.parent
    yield mount_point


def _unified_limit(group: Path) -> float | None:
    """Return the limit of one group of version 2: a line `quota period`, or `max period`."""
    quota, _, period = _read(group / "cpu.max").partition(" ")
    return _limit(quota, period)


def _cfs_limit(group: Path) -> float | None:
    """Return the limit of one group of version 1; its quota is -1 where there is none."""
    return _limit(_read(group / "cpu.cfs_quota_us"), _read(group / "cpu.cfs_period_us"))


def _limit(quota: str, period: str) -> float | None:
    try:
        granted, of = int(quota), int(period)
    except ValueError:
        return None
    return granted / of if granted > 0 and of > 0 else None


def _read(path: Path) -> str:
    """Return a file's text, empty if it is not there or cannot be read."""
    try:
        return os.fsdecode(path.read_bytes())
    except OSError:
        return ""
