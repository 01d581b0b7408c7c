"""Several processes that learn one policy: who they are, and how they come to agree.

torchrun starts the processes, the ranks, and tells each its number. A rank has robots, seeds and
threads of its own; what is learnt is the same in all of them, to the last bit, since all apply the
same mean of their gradients. A process that is alone is one rank of one, which has nothing to agree
on: everything here then leaves values as they are and talks to nobody.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import signal
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypeVar

import numpy as np
import torch
import torch.distributed
from rsl_rl.utils import reduce_gradients_in_buckets

from mute.checkpoint import first_line
from mute.support.errors import EXIT_USER_ERROR, MuteError
from mute.support.signals import STOP_SIGNALS, exit_status

__all__ = ["Ranks", "joined_ranks", "unnoticed_ranks"]

_TIMEOUT = timedelta(minutes=10)
"""Longest wait for the other ranks: many times a rollout, of which the slowest rank's counts."""
_BUCKET_MB = 25.0
"""Most that is averaged in one message, rsl_rl's own choice."""
_PATIENCE = 5.0
"""Seconds within which torchrun notices that a process has ended."""
_LINGER = 1.0
"""Seconds that a survivor stays, so that another one does not take it for the rank that is gone."""

_T = TypeVar("_T")


@dataclass(frozen=True)
class Ranks:
    """All processes of a training, as one of them sees them; by default it is alone.

    What the methods do together, every rank must do, in the same order.
    """

    rank: int = 0
    """Number of this process."""
    world_size: int = 1
    """Number of processes."""
    local_rank: int = 0
    """Number of this process on its machine."""
    local_world_size: int = 1
    """Number of processes on this machine."""
    processes: tuple[tuple[str, int], ...] = ()
    """Machine and process id of every rank."""

    @property
    def several(self) -> bool:
        """Whether there are others."""
        return self.world_size > 1

    @property
    def first(self) -> bool:
        """Whether this is the rank that logs, saves and speaks."""
        return self.rank == 0

    @property
    def launcher(self) -> str:
        """What stands before `train.py` in the command that starts as many ranks."""
        if not self.several:
            return "python"
        machines = self.world_size // self.local_world_size
        nodes = f"--nnodes={machines} " if machines > 1 else ""
        return f"torchrun {nodes}--nproc-per-node={self.local_world_size}"

    def device(self, kind: str) -> str:
        """Return this rank's device of a kind, 'cpu' or 'cuda', and make it torch's current one.

        Raises:
            MuteError: If there are more ranks on this machine than GPUs.
        """
        if kind == "cpu" or not self.several:
            return kind
        if self.local_world_size > torch.cuda.device_count():
            raise MuteError(
                f"--nproc-per-node={self.local_world_size} needs as many GPUs, "
                f"torch sees {torch.cuda.device_count()}: start fewer, or use --device cpu"
            )
        torch.cuda.set_device(self.local_rank)
        return f"cuda:{self.local_rank}"

    def seed(self, seed: int) -> int:
        """Return this rank's own seed: the given one on the first, unrelated ones on the others."""
        if self.first:
            return seed
        word = np.random.SeedSequence([seed, self.rank]).generate_state(1, np.uint64)[0]
        return int(word >> np.uint64(1))  # torch takes 63 bits

    def mean(self, value: torch.Tensor) -> torch.Tensor:
        """Return the mean of a tensor over the ranks."""
        if not self.several:
            return value
        total = value.clone()
        torch.distributed.all_reduce(total)
        return total / self.world_size

    def any(self, flag: bool) -> bool:
        """Return whether a flag is set on any rank."""
        return bool(self.mean(torch.tensor(float(flag), device="cpu")) > 0.0)

    def average_gradients(self, parameters: Iterable[torch.nn.Parameter]) -> None:
        """Give every rank the mean of the gradients."""
        if self.several:
            reduce_gradients_in_buckets(parameters, self.world_size, _BUCKET_MB)

    def broadcast(self, value: _T) -> _T:
        """Return the first rank's value."""
        if not self.several:
            return value
        box = [value]
        torch.distributed.broadcast_object_list(box, src=0)
        return box[0]

    def gather(self, value: _T) -> list[_T]:
        """Return the values of all ranks to the first, and nothing to the others."""
        if not self.several:
            return [value]
        values: list[Any] | None = [None] * self.world_size if self.first else None
        torch.distributed.gather_object(value, values)
        return values or []

    def gather_states(self, state: dict[str, Any]) -> list[dict[str, Any]]:
        """Gather dictionaries with tensors, which arrive on the CPU from whatever device."""
        buffer = io.BytesIO()
        torch.save(state, buffer)
        return [
            torch.load(io.BytesIO(part), map_location="cpu", weights_only=True)
            for part in self.gather(buffer.getvalue())
        ]

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """Pass a `MuteError` that one rank meets in here on to all; the first one shows it.

        Nothing in here may wait for other ranks.
        """
        if not self.several:
            yield
            return
        message = None
        try:
            yield
        except MuteError as error:
            message = str(error)
        met = [(rank, text) for rank, text in enumerate(self.gather(message)) if text is not None]
        texts = [f"on rank {rank}: {text}" if rank else text for rank, text in met]
        failure = self.broadcast(texts[0] if texts else None)
        if failure is not None:
            raise MuteError(failure) if self.first else SystemExit(EXIT_USER_ERROR)

    def check_equal(self, what: str, value: object) -> None:
        """Check that all ranks have the same.

        Raises:
            MuteError: If one has not.
        """
        other = [rank for rank, theirs in enumerate(self.gather(value)) if theirs != value]
        with self.together():
            if other:
                raise MuteError(
                    f"rank {other[0]} has another {what} than rank 0: give all machines the same "
                    "command, the same files and the same kind of device"
                )

    @contextlib.contextmanager
    def watched(self, advice: Callable[[], str]) -> Iterator[None]:
        """Tell in one line which rank is gone where the others can no longer be reached.

        Args:
            advice: Called then: what stands at the end of that line.

        Raises:
            MuteError: On one of the ranks that are left; the others end without a word.
        """
        try:
            yield
        except RuntimeError as error:
            if not self.several or not _is_broken_connection(error):
                raise
        else:
            return
        self._end(advice)

    def _end(self, advice: Callable[[], str]) -> None:
        # torchrun ends the ranks that are left; they do so themselves, with a word on why.
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        here = self.processes[self.rank][0]
        local = [rank for rank, (machine, _) in enumerate(self.processes) if machine == here]
        gone = self._wait_for_gone(local)
        # Those who wait for this rank in vain shall notice at once.
        torch.distributed.destroy_process_group()
        if 0 not in local or self.rank != min(set(local) - set(gone)):
            time.sleep(_LINGER)
            raise SystemExit(EXIT_USER_ERROR)
        who = f"rank {', '.join(map(str, gone))} is gone" if gone else "a rank elsewhere is gone"
        raise MuteError(f"{who}, so the training ends; {advice()}")

    def _wait_for_gone(self, local: list[int]) -> list[int]:
        """Return which ranks of this machine have ended, waiting a little for the first."""
        deadline = time.monotonic() + _PATIENCE
        gone: list[int] = []
        while not gone and time.monotonic() < deadline:
            time.sleep(0.05)
            gone = [rank for rank in local if not _is_running(self.processes[rank][1])]
        return gone


@contextlib.contextmanager
def joined_ranks() -> Iterator[Ranks]:
    """Join the ranks that torchrun has started, and part from them at the end.

    Started without torchrun, a process is alone. Ranks but the first print nothing on their
    standard output and end quietly where all are interrupted.

    Raises:
        MuteError: If the environment is not torchrun's, or a rank is gone before it could learn.
    """
    ranks = _started_ranks()
    if not ranks.several:
        yield ranks
        return
    # torch picks the backend by the device of a tensor: objects and flags stay on the CPU.
    backend = "cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "gloo"
    try:
        torch.distributed.init_process_group(backend, timeout=_TIMEOUT)
    except (RuntimeError, ValueError) as error:
        raise MuteError(f"cannot reach the other ranks: {first_line(error)}") from error
    process = (socket.gethostname(), os.getpid())
    try:
        ranks = dataclasses.replace(ranks, processes=tuple(ranks.broadcast(ranks.gather(process))))
        with ranks.watched(lambda: "nothing has been learnt yet"), _quiet_unless(ranks.first):
            yield ranks
    except KeyboardInterrupt as stop:
        if ranks.first:
            raise
        raise SystemExit(exit_status(stop)) from None
    finally:
        if torch.distributed.is_initialized():
            torch.distributed.destroy_process_group()


@contextlib.contextmanager
def unnoticed_ranks() -> Iterator[None]:
    """Hide from rsl_rl's runner, as it is made, that there are others.

    It would insist on CUDA and make a process group of its own.
    """
    size = os.environ.pop("WORLD_SIZE", None)
    try:
        yield
    finally:
        if size is not None:
            os.environ["WORLD_SIZE"] = size


def _started_ranks() -> Ranks:
    """Return what torchrun has put into the environment."""
    if os.environ.get("WORLD_SIZE", "1") == "1":
        return Ranks()
    names = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE")
    values = [os.environ.get(name, "") for name in names]
    for name, value in zip(names, values, strict=True):
        if not value.isdigit():
            raise MuteError(
                f"WORLD_SIZE is {os.environ['WORLD_SIZE']!r}, but {name} is {value!r}: start "
                "several processes with torchrun, or one without WORLD_SIZE"
            )
    rank, world_size, local_rank, local_world_size = map(int, values)
    return Ranks(rank, world_size, local_rank, local_world_size)


@contextlib.contextmanager
def _quiet_unless(speaks: bool) -> Iterator[None]:
    if speaks:
        yield
        return
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        yield


def _is_broken_connection(error: RuntimeError) -> bool:
    """Tell whether ranks could not reach each other; gloo's errors have no type of their own."""
    return isinstance(error, torch.distributed.DistError) or "gloo" in str(error).lower()


def _is_running(process_id: int) -> bool:
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # it is there, and another user's
    return True
