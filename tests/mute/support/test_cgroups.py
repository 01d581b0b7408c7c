"""A container's quota is found wherever the kernel tells it; what tells none limits nothing.

The trees are those of real systems, built in a temporary directory: `/proc/self` with its two
files, and the mounts that they name.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from mute.support.cgroups import cpu_quota

OTHERS = (
    "22 27 0:21 / /proc rw,relatime - proc proc rw",
    "31 23 0:28 / /sys/fs/cgroup ro,nosuid - tmpfs tmpfs ro,mode=755",
    "36 31 0:33 / /sys/fs/cgroup/cpuset rw shared:9 - cgroup cgroup rw,cpuset",
)
"""Lines of `mountinfo` that have nothing to do with a quota."""


class Machine:
    """A process, and the file systems that it sees its control groups in."""

    def __init__(self, top: Path) -> None:
        self.top, self.process = top, top / "proc"
        self.process.mkdir()
        self._mounts: list[str] = [*OTHERS]

    def in_groups(self, *lines: str) -> None:
        (self.process / "cgroup").write_text("\n".join([*lines, ""]))

    def mount(self, place: str, kind: str, root: str = "/", optional: str = "shared:4 ") -> Path:
        """Mount `cgroup2`, or `cgroup` of the controllers behind a comma."""
        directory = self.top / place
        directory.mkdir(parents=True, exist_ok=True)
        escaped = str(directory).replace(" ", "\\040")
        kind, _, controllers = kind.partition(",")
        options = ",".join(filter(None, ["rw", controllers]))
        line = f"41 31 0:38 {root} {escaped} rw,nosuid {optional}- {kind} {kind} {options}"
        self._mounts.append(line)
        (self.process / "mountinfo").write_text("\n".join([*self._mounts, ""]))
        return directory

    def quota(self) -> float | None:
        return cpu_quota(self.process)


@pytest.fixture
def machine(tmp_path) -> Machine:
    return Machine(tmp_path)


def _limit_v2(group: Path, line: str) -> None:
    group.mkdir(parents=True, exist_ok=True)
    (group / "cpu.max").write_text(f"{line}\n")


def _limit_v1(group: Path, quota: int, period: int) -> None:
    group.mkdir(parents=True, exist_ok=True)
    (group / "cpu.cfs_quota_us").write_text(f"{quota}\n")
    (group / "cpu.cfs_period_us").write_text(f"{period}\n")


# -- version 2 -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "expected"),
    [("200000 100000", 2.0), ("150000 100000", 1.5), ("5000 10000", 0.5), ("max 100000", None)],
)
def test_the_quota_of_the_own_group_counts(machine, line, expected):
    machine.in_groups("0::/user.slice/job")
    _limit_v2(machine.mount("unified", "cgroup2") / "user.slice/job", line)
    assert machine.quota() == expected


@pytest.mark.parametrize("own", ["max 100000", "800000 100000", None])
@pytest.mark.parametrize("level", ["a", "a/b"])
def test_the_tightest_group_around_it_holds_the_process_as_well(machine, own, level):
    machine.in_groups("0::/a/b/c")
    top = machine.mount("unified", "cgroup2")
    for name in ("a", "a/b"):
        _limit_v2(top / name, "300000 100000" if name == level else "max 100000")
    if own is not None:
        _limit_v2(top / "a/b/c", own)
    assert machine.quota() == 3.0


def test_a_group_beside_it_does_not_hold_the_process(machine):
    machine.in_groups("0::/a/b")
    top = machine.mount("unified", "cgroup2")
    _limit_v2(top / "a/b", "400000 100000")
    _limit_v2(top / "a/b/inner", "100000 100000")
    _limit_v2(top / "other", "100000 100000")
    _limit_v2(top.parent, "100000 100000")  # not of the mount any more
    assert machine.quota() == 4.0


def test_a_container_with_a_namespace_of_its_own_finds_its_quota_at_the_mount(machine):
    machine.in_groups("0::/")
    _limit_v2(machine.mount("unified", "cgroup2"), "200000 100000")
    assert machine.quota() == 2.0


def test_a_container_that_sees_the_hosts_names_finds_its_quota_at_the_mount(machine):
    machine.in_groups("0::/docker/3f/job")
    top = machine.mount("unified", "cgroup2", root="/docker/3f")
    _limit_v2(top, "200000 100000")
    _limit_v2(top / "job", "max 100000")
    assert machine.quota() == 2.0


@pytest.mark.parametrize(
    ("group", "root"), [("/kubepods/pod", "/docker/3f"), ("/../pod", "/"), ("/", "/../..")]
)
def test_where_the_own_group_cannot_be_seen_the_mount_itself_counts(machine, group, root):
    machine.in_groups(f"0::{group}")
    top = machine.mount("unified", "cgroup2", root=root)
    _limit_v2(top, "200000 100000")
    _limit_v2(top.parent / "pod", "100000 100000")
    assert machine.quota() == 2.0


def test_a_group_that_is_gone_leaves_those_around_it(machine):
    machine.in_groups("0::/a/b (deleted)")
    _limit_v2(machine.mount("unified", "cgroup2") / "a", "200000 100000")
    assert machine.quota() == 2.0


def test_blanks_and_colons_in_names_are_read(machine):
    machine.in_groups("0::/my group/a:b")
    top = machine.mount("a mount", "cgroup2", optional="")
    _limit_v2(top / "my group/a:b", "200000 100000")
    assert machine.quota() == 2.0


# -- version 1 -----------------------------------------------------------------------------------


@pytest.mark.parametrize("controllers", ["cpu", "cpu,cpuacct", "cpuacct,cpu"])
@pytest.mark.parametrize(
    ("quota", "period", "expected"),
    [(200000, 100000, 2.0), (25000, 50000, 0.5), (-1, 100000, None)],
)
def test_version_1_has_quota_and_period_in_two_files(machine, controllers, quota, period, expected):
    machine.in_groups("9:cpuset:/x", f"4:{controllers}:/a/job", "1:name=systemd:/y")
    _limit_v1(machine.mount("cpu", f"cgroup,{controllers}") / "a/job", quota, period)
    assert machine.quota() == expected


def test_in_version_1_too_the_groups_around_it_count(machine):
    machine.in_groups("4:cpu,cpuacct:/a/job")
    top = machine.mount("cpu", "cgroup,cpu,cpuacct")
    _limit_v1(top, -1, 100000)
    _limit_v1(top / "a", 300000, 100000)
    _limit_v1(top / "a/job", 600000, 100000)
    assert machine.quota() == 3.0


def test_a_version_1_container_that_sees_the_hosts_names_finds_its_quota_at_the_mount(machine):
    machine.in_groups("4:cpu,cpuacct:/docker/3f")
    _limit_v1(machine.mount("cpu", "cgroup,cpu,cpuacct", root="/docker/3f"), 200000, 100000)
    assert machine.quota() == 2.0


def test_the_group_of_another_controller_is_not_taken_for_that_of_the_processors(machine):
    machine.in_groups("5:cpuacct:/loose", "4:cpu:/tight", "3:cpuset:/loose")
    top = machine.mount("cpu", "cgroup,cpu")
    _limit_v1(top / "tight", 200000, 100000)
    _limit_v1(top / "loose", 100000, 100000)
    _limit_v1(machine.mount("cpuacct", "cgroup,cpuacct"), 100000, 100000)
    assert machine.quota() == 2.0


# -- both, and neither ---------------------------------------------------------------------------


@pytest.mark.parametrize(("v1", "v2"), [(200000, "max 100000"), (-1, "200000 100000")])
def test_a_hybrid_system_may_limit_in_either(machine, v1, v2):
    machine.in_groups("4:cpu:/a", "0::/b")
    _limit_v1(machine.mount("cpu", "cgroup,cpu") / "a", v1, 100000)
    unified = machine.mount("unified", "cgroup2")
    _limit_v2(unified / "b", v2)
    _limit_v2(unified / "a", "100000 100000")  # the name of the other version's group
    assert machine.quota() == 2.0


def test_without_files_in_proc_nothing_is_known(tmp_path):
    assert cpu_quota(tmp_path / "nowhere") is None


def test_without_the_file_of_groups_the_mount_itself_counts(machine):
    _limit_v2(machine.mount("unified", "cgroup2"), "200000 100000")
    assert machine.quota() == 2.0


def test_a_top_that_has_no_quota_limits_nothing(machine):
    machine.in_groups("0::/", "4:cpu:/")
    machine.mount("unified", "cgroup2")
    machine.mount("cpu", "cgroup,cpu")
    assert machine.quota() is None


def test_what_cannot_be_read_limits_nothing_and_hides_nothing(machine):
    machine.in_groups("0::/a/b")
    top = machine.mount("unified", "cgroup2")
    (top / "a/b/cpu.max").mkdir(parents=True)  # no file
    _limit_v2(top / "a", "200000 100000")
    assert machine.quota() == 2.0


@pytest.mark.parametrize(
    "line", ["", "max", "100000", "100000 0", "0 100000", "-1 100000", "a b", "1e5 1e5", "1 2 3"]
)
def test_what_is_no_quota_limits_nothing(machine, line):
    machine.in_groups("0::/a")
    _limit_v2(machine.mount("unified", "cgroup2") / "a", line)
    assert machine.quota() is None


@pytest.mark.parametrize("line", ["", "broken", "1 2 3 / - cgroup2", "1 2 3 / /x rw - cgroup2 x"])
def test_lines_that_say_nothing_are_passed_over(machine, line):
    machine.in_groups("broken", "0", "0::/a")
    _limit_v2(machine.mount("unified", "cgroup2") / "a", "200000 100000")
    mounts = machine.process / "mountinfo"
    mounts.write_text(f"{line}\n{mounts.read_text()}")
    assert machine.quota() == 2.0
