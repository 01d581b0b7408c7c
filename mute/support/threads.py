"""How many threads this process runs, and how they wait: one number decides for all its pools.

The number is that of the processors which the process may use: those of its affinity mask
(`taskset`, a batch scheduler), or fewer where a control group's quota grants less time (a
container), shared with the other processes that torchrun started on this machine. More threads than
that would not only wait for one another: under a quota the kernel stops all of them once they have
used up a period's time together, so 64 threads on 2 processors' time stand still for most of it.

A training process holds two thread pools: MuJoCo's, which steps the simulations, and OpenMP's,
which runs torch. They work in turns, so each may take every processor. By default a worker of
OpenMP that has nothing to do keeps its core busy for a while in case more work follows, and so
takes it from MuJoCo's pool, or from another process, just when that one runs. Waiting passively
gives the core back: on 2 cores, PPO-sized batches went through a small network 3 times as fast.

What the user says goes before: `OMP_NUM_THREADS` for torch, `--env.num-threads` for the physics.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import sys
from collections.abc import Mapping

from mute.support.cgroups import cpu_quota

__all__ = [
    "configure_threads",
    "core_share",
    "limit_operator_threads",
    "usable_cores",
    "use_collection_threads",
    "use_learning_threads",
    "without_own_settings",
]

_own: dict[str, str] = {}
"""What `configure_threads` has set in this process, and to what."""

_SPIN_COUNT = 1000
"""Rounds that a waiting thread of GNU OpenMP spins before it sleeps: microseconds, enough to bridge
two operations of torch in a row. Its own default is 300 000, milliseconds."""


def configure_threads() -> None:
    """Give OpenMP this process's share of processors, and let it wait without holding them.

    Call it before torch is imported for the first time; OpenMP reads the environment once, as it is
    loaded, so a later call changes nothing. Child processes inherit the settings. What the user has
    set stays, `OMP_NUM_THREADS` as well as a given `OMP_WAIT_POLICY` or `GOMP_SPINCOUNT`; the other
    of these two is then left alone as well, since each overrides a part of the other.
    """
    if _given_threads() is None:
        os.environ["OMP_NUM_THREADS"] = _own["OMP_NUM_THREADS"] = str(core_share())
    if "OMP_WAIT_POLICY" in os.environ or "GOMP_SPINCOUNT" in os.environ:
        return
    os.environ["OMP_WAIT_POLICY"] = _own["OMP_WAIT_POLICY"] = "passive"
    os.environ["GOMP_SPINCOUNT"] = _own["GOMP_SPINCOUNT"] = str(_SPIN_COUNT)


def without_own_settings(environ: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without what `configure_threads` has set in this process.

    It is for a program that decides about its threads itself. What the user has set stays.
    """
    return {key: value for key, value in environ.items() if _own.get(key) != value}


def limit_operator_threads() -> None:
    """Limit torch's second pool, for operators that run beside each other, where torch is loaded.

    torch sizes it by all processors of the machine. Nothing in MUTE starts it; a plugin may.
    """
    torch = sys.modules.get("torch")
    if torch is not None:
        with contextlib.suppress(RuntimeError):  # it runs already, as somebody wished
            torch.set_num_interop_threads(_learning_threads())


def use_collection_threads() -> None:
    """Let torch run on one thread around the physics engine, which uses all cores.

    The environment's tensors are too small to gain from more, and OpenMP's workers would take the
    cores from the engine's at every one of its calls.
    """
    import torch

    torch.set_num_threads(1)


def use_learning_threads() -> None:
    """Let torch run on every core it was given, for the networks, while no simulation runs."""
    import torch

    torch.set_num_threads(_learning_threads())


@functools.cache
def _learning_threads() -> int:
    return _given_threads() or core_share()


def _given_threads() -> int | None:
    """Return what `OMP_NUM_THREADS` asks for; None if the user has not set it to a number."""
    outermost = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if not outermost.isdecimal() or int(outermost) == 0:
        return None
    # torchrun sets 1 for several processes where the user has set nothing.
    return None if outermost == "1" and _local_world_size() > 1 else int(outermost)


def core_share() -> int:
    """Return the number of processors for this process, of all that torchrun started here."""
    return max(1, usable_cores() // _local_world_size())


def _local_world_size() -> int:
    size = os.environ.get("LOCAL_WORLD_SIZE", "")
    return int(size) if size.isdecimal() and int(size) > 0 else 1


def usable_cores() -> int:
    """Return the number of processors that this process may use, at least 1.

    A quota is rounded to the nearest number. With more threads than it pays for, all of them stand
    still until the kernel's next period once it is used up, and a step that is cut in two takes 0.1
    to 0.3 s instead of 0.03. Measured on 2 busy cores, 256 robots: 2 threads made 9 % fewer steps
    than 1 at a quota of 1.0 (64 threads 28 % fewer), 4 % fewer at 1.1, as many at 1.25, and 14 %
    more from 1.5 on.
    """
    quota, cores = cpu_quota(), _allowed_cores()
    return cores if quota is None else max(1, min(cores, math.floor(quota + 0.5)))


def _allowed_cores() -> int:
    """Return the number of processors that the process may run on.

    Python 3.13 knows it itself, and lets the user say another one (`PYTHON_CPU_COUNT`, `-X
    cpu_count`), which is meant for just this.
    """
    count = getattr(os, "process_cpu_count", None)
    if count is not None:
        return count() or 1
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
