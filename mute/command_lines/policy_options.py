"""How a command line names a policy: a file, 'latest', or the one that ships."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.origin import policy_origin, sound_origin
from mute.checkpoint import CheckpointError, latest_checkpoint, load_checkpoint
from mute.command_lines.arguments import task_name
from mute.controllers import load_policy
from mute.controllers.driver import Driver
from mute.controllers.mpc.driver import MpcDriver
from mute.controllers.mpc.settings import MpcCfg
from mute.controllers.onnx_policy import load_onnx_policy
from mute.support.errors import MuteError
from mute.support.resources import shipped_file
from mute.tasks import DEFAULT_TASK, make_task

__all__ = ["DriverArgs", "PolicyArgs", "check_audible", "policies_that_ship"]


_SHIPPED = shipped_file(DEFAULT_TASK)


@dataclass
class PolicyArgs:
    """The arguments of every command that takes a policy."""

    policy: Path = _SHIPPED
    """Policy to use: a checkpoint, or 'latest' for the newest one under --log-dir; by default the
    one that ships. Where robots walk, an exported .onnx file will do."""
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
        if self.policy == type(self).policy:  # the default
            return _that_ships(self.task)
        if self.policy.suffix == ".onnx":
            raise MuteError(
                f"--task goes with checkpoints, which tell theirs; {self.policy} is an export"
            )
        task = load_checkpoint(self.policy).get("task")
        if task != self.task:
            raise CheckpointError(f"{self.policy} is of task {task!r}, not {self.task!r}")
        return self.policy


@dataclass
class DriverArgs(PolicyArgs):
    """The arguments of every command that robots walk in."""

    controller: Literal["policy", "mpc", "mpc_true_velocity"] = "policy"
    """What drives the robots: the policy; mpc, a model-predictive controller, which needs none; or
    mpc_true_velocity, the same with its true velocity, which no robot can measure."""

    def with_driver_found(self) -> Self:
        """Return the same arguments, the policy, where one drives, as the file that is meant.

        Raises:
            MuteError: If a policy is named for a controller that has none, or there is none.
        """
        if self.controller == "policy":
            return self.with_policy_found()
        for name, value, default in (("policy", self.policy, _SHIPPED), ("task", self.task, None)):
            if value != default:
                raise MuteError(
                    f"--{name} goes with --controller policy alone, got {str(value)!r} with "
                    f"--controller {self.controller}"
                )
        return self

    @property
    def driver_name(self) -> str:
        """What drives the robots, in a word: the file of the policy, or the controller."""
        return str(self.policy) if self.controller == "policy" else self.controller

    def driver(self) -> Driver:
        """Return what drives the robots, once it is found.

        Raises:
            MuteError: If it cannot be used.
        """
        if self.controller != "policy":
            return self._mpc()
        if self.policy.suffix == ".onnx":
            return load_onnx_policy(self.policy)
        return load_policy(self.policy)

    def audible_driver(self) -> Driver:
        """Return what drives the robots, which can be heard, once it is found.

        Raises:
            MuteError: If it cannot be used, or acts at times that lie between the physics steps.
        """
        driver = self.driver()
        check_audible(driver, self.driver_name)
        return driver

    def _mpc(self) -> MpcDriver:
        settings = MpcCfg(true_velocity=self.controller == "mpc_true_velocity")
        return MpcDriver(settings=settings, task=self.controller)

    def origin(self) -> dict[str, str]:
        """Return what modelled levels rest on, see `sound_origin`, once it is found.

        Raises:
            MuteError: If the policy or the calibration cannot be read.
        """
        return self.driver_origin() | sound_origin()

    def driver_origin(self) -> dict[str, str]:
        """Return what drives the robots, and a digest of it: of the file, or of the settings.

        Raises:
            MuteError: If the policy cannot be read.
        """
        if self.controller == "policy":
            return policy_origin(self.policy)
        settings = json.dumps(dataclasses.asdict(self._mpc().settings)).encode()
        digest = hashlib.sha256(settings).hexdigest()
        return {"policy": self.controller, "policy_sha256": digest}


def check_audible(driver: Driver, name: str) -> None:
    """Check that what drives robots can be heard.

    Raises:
        MuteError: If it acts at times that lie between the physics steps.
    """
    try:
        listening_cfg(driver.cfg.env)
    except ValueError as error:
        raise MuteError(f"{name} cannot be heard: {error}") from error


def policies_that_ship() -> list[Path]:
    """Return the policies that come with the package, each of a task of its own, by their names."""
    return sorted(_SHIPPED.parent.glob("*.pt"))


def _that_ships(task: str) -> Path:
    path = shipped_file(task)
    if not path.is_file():
        raise MuteError(
            f"no policy ships for task {task!r} ({path} is missing): learn one with "
            f"train.py --task {task} (installed, mute-train), or name one with --policy"
        )
    return path
