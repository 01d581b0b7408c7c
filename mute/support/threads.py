"""How torch's worker threads wait, set before torch starts them.

A training process holds two thread pools: MuJoCo's, which steps the simulations, and OpenMP's,
which runs torch. They work in turns. By default a worker of OpenMP that has nothing to do keeps its
core busy for a while in case more work follows, and so takes it from MuJoCo's pool just when that
one runs. Waiting passively gives the core back: on 2 cores, PPO-sized batches went through a small
network 3 times as fast. How many threads a pool has is left to the pools; `OMP_NUM_THREADS` limits
torch's as everywhere. Processes that torchrun starts on one machine share its cores.
"""

from __future__ import annotations

import functools
import os

_SPIN_COUNT = 1000
"""Rounds that a waiting thread of GNU OpenMP spins before it sleeps: microseconds, enough to bridge
two operations of torch in a row. Its own default is 300 000, milliseconds."""


def configure_threads() -> None:
    """Make OpenMP's threads wait without holding their cores.

    Call it before torch is imported for the first time; OpenMP reads the environment once, as it is
    loaded, so a later call changes nothing. Child processes inherit the settings. What the user has
    set stays: a given `OMP_WAIT_POLICY` or `GOMP_SPINCOUNT` is theirs, and the other is then left
    alone as well, since each overrides a part of the other.
    """
    if "OMP_WAIT_POLICY" in os.environ or "GOMP_SPINCOUNT" in os.environ:
        return
    os.environ["OMP_WAIT_POLICY"] = "passive"
    os.environ["GOMP_SPINCOUNT"] = str(_SPIN_COUNT)


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
    limit = os.environ.get("OMP_NUM_THREADS", "")
    # torchrun sets 1 for several processes where the user has set nothing.
    unset = limit == "1" and _local_world_size() > 1
    return int(limit) if limit.isdigit() and int(limit) > 0 and not unset else core_share()


def core_share() -> int:
    """Return the number of processors for this process, of all that torchrun started here."""
    return max(1, usable_cores() // _local_world_size())


def _local_world_size() -> int:
    size = os.environ.get("LOCAL_WORLD_SIZE", "")
    return int(size) if size.isdigit() and int(size) > 0 else 1


def usable_cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
