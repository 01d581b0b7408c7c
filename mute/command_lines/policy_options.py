"""How a command line names a policy: a file, 'latest', or the one that ships."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from mute.checkpoint import CheckpointError, latest_checkpoint, load_checkpoint
from mute.command_lines.arguments import task_name
from mute.support.errors import MuteError
from mute.support.resources import RESOURCES
from mute.tasks import DEFAULT_TASK, make_task

__all__ = ["PolicyArgs"]


_SHIPPED = RESOURCES / "go1" / f"{DEFAULT_TASK}.pt"


@dataclass
class PolicyArgs:
    """The arguments of every command that takes a policy."""

    policy: Path = _SHIPPED
    """Policy to use: a checkpoint, or 'latest' for the newest one under --log-dir; by default the
    one that ships."""
    task: str | None = None
    """Task of the policy: of the one that ships, go1_mute unless given, or of the latest, any
    unless given. A checkpoint that is named must be of it. `module:task` imports a module of yours
    first, which registers it."""
    log_dir: Path = Path("runs")
    """Directory of the runs that 'latest' looks through."""

    def __post_init__(self) -> None:
        """Import the task's module at once: it may register a floor that is asked for, too.

        Raises:
            MuteError: If it cannot be imported.
        """
        if self.task is not None:
            self.task = task_name(self.task)

    def with_policy_found(self) -> Self:
        """Return the same arguments, the policy as the file that is meant.

        Raises:
            MuteError: If there is no such task, nothing ships for it, there is no latest
                checkpoint, or the one that is named is of another task or cannot be read.
        """
        return dataclasses.replace(self, policy=self._found())

    def _found(self) -> Path:
        if self.task is not None:
            make_task(self.task)
        if str(self.policy) == "latest":
            return latest_checkpoint(self.log_dir, self.task)
        if self.task is None:
            return self.policy
        if self.policy == _SHIPPED:
            return _that_ships(self.task)
        task = load_checkpoint(self.policy).get("task")
        if task != self.task:
            raise CheckpointError(f"{self.policy} is of task {task!r}, not {self.task!r}")
        return self.policy


def _that_ships(task: str) -> Path:
    path = _SHIPPED.with_name(f"{task}.pt")
    if not path.is_file():
        raise MuteError(
            f"no policy ships for task {task!r} ({path} is missing): learn one with "
            f"train.py --task {task} (installed, mute-train), or name one with --policy"
        )
    return path
