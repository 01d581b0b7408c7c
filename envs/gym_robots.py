"""What Gymnasium's single and vector environment share: robots in numpy, and options of `reset`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import torch

from .quadruped_env import NUM_ACTIONS, QuadrupedEnv
from .quadruped_env_cfg import QuadrupedEnvCfg

__all__ = ["Robots", "info_of"]

_OPTIONS = ("command", "beta")


class Robots:
    """What both environments share: a `QuadrupedEnv` in numpy, whose episodes others begin."""

    def __init__(self, cfg: QuadrupedEnvCfg) -> None:
        """Remember the task; the robots are made by the first `reset`."""
        self.cfg = cfg
        self._env: QuadrupedEnv | None = None
        self._unstable = np.zeros(cfg.num_envs, dtype=np.bool_)
        self._held = torch.zeros(cfg.num_envs, dtype=torch.bool)
        self._held_command = torch.zeros(cfg.num_envs, 4)

    @property
    def exist(self) -> bool:
        """Whether the robots were made."""
        return self._env is not None

    @property
    def env(self) -> QuadrupedEnv:
        """The robots.

        Raises:
            gymnasium.error.ResetNeeded: If there was no `reset` before.
        """
        if self._env is None:
            raise gymnasium.error.ResetNeeded("call reset before step or render")
        return self._env

    @property
    def render_fps(self) -> int:
        """Control steps a second."""
        return round(1.0 / self.cfg.step_dt)

    def reset(self, seed: int | None, options: dict[str, Any] | None) -> None:
        """Begin everywhere; with a seed, robots are made anew, as it decides their physics too.

        Raises:
            ValueError: If an option is unknown, or not as `envs.gym` says.
        """
        command, beta = _read_options(options or {}, self.cfg.num_envs)
        if seed is None:
            self.env.reset()
        else:
            self._env = QuadrupedEnv(replace(self.cfg, seed=seed))
            self._env.autoreset = False
        self._unstable = np.zeros(self.cfg.num_envs, dtype=np.bool_)
        self._held.fill_(command is not None)
        if command is None and beta is None:
            return
        target = self.env.commands.command.clone()
        if command is not None:
            target[:, :3] = command
        if beta is not None:
            target[:, 3] = beta
        self._held_command = target
        self.env.set_command(target)

    def reset_finished(self, finished: np.ndarray) -> None:
        """Begin the next episode of some robots; a held command ends with its episode."""
        mask = torch.from_numpy(finished)
        self._held &= ~mask
        self._unstable = self._unstable & ~finished
        self.env.reset(mask)

    def step(
        self, actions: np.ndarray, anew: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Advance by one control step; return rewards, terminated and truncated, (num_envs,) each.

        Args:
            actions: Joint offsets over `action_scale`. Shape: (num_envs, 12).
            anew: Robots that begin their next episode instead, whatever their action: they gain
                nothing, and nothing of theirs ends. None for none. Shape: (num_envs,), bool.

        Raises:
            ValueError: If the actions have another shape, or one that counts is not finite.
        """
        shape = (self.cfg.num_envs, NUM_ACTIONS)
        if actions.shape != shape:
            raise ValueError(f"actions must have shape {shape}, got {actions.shape}")
        idle = np.zeros(shape[0], dtype=np.bool_) if anew is None else anew
        actions = np.where(idle[:, np.newaxis], 0.0, actions)
        _check_finite(actions)
        _, rewards, dones, extras = self.env.step(torch.as_tensor(actions, dtype=torch.float32))
        self._unstable = self.env.unstable.numpy()
        self._hold_command()
        truncated = extras["time_outs"].numpy()
        terminated = dones.numpy() & ~truncated
        if idle.any():
            self.reset_finished(idle)
        return np.where(idle, np.float32(0.0), rewards), terminated & ~idle, truncated & ~idle

    def observations(self) -> np.ndarray:
        """Return what the robots see. Shape: (num_envs, OBS_DIM)."""
        # No copy: the environment makes new tensors in every step and reset, here and below.
        return self.env.get_observations()["policy"].numpy()

    def infos(self) -> dict[str, np.ndarray]:
        """Return what stands in `info`, with an axis of robots in front."""
        return {
            "privileged": self.env.get_observations()["privileged"].numpy(),
            "landing_speed": self.env.footfalls.landing_speed.numpy(),
            "unstable": self._unstable,
        }

    def _hold_command(self) -> None:
        """Take back what the environment has drawn in place of a held command."""
        if not bool(self._held.any()):
            return
        drawn = self.env.commands.command
        wanted = torch.where(self._held.unsqueeze(1), self._held_command, drawn)
        if not torch.equal(wanted, drawn):
            self.env.set_command(wanted)


def info_of(infos: dict[str, np.ndarray], index: int) -> dict[str, Any]:
    """Return one robot's part of what `Robots.infos` returned."""
    info = {name: values[index] for name, values in infos.items()}
    # Of numpy's bool Gymnasium's vector environments would make an array of objects.
    return info | {"unstable": bool(info["unstable"])}


def _check_finite(actions: np.ndarray) -> None:
    wrong = np.argwhere(~np.isfinite(actions))
    if len(wrong):
        robot, joint = wrong[0]
        raise ValueError(
            f"actions must be finite, got {actions[robot, joint]} for joint {joint} of robot"
            f" {robot}"
        )


def _read_options(
    options: dict[str, Any], num_envs: int
) -> tuple[torch.Tensor | None, torch.Tensor | None]:
    """Return command (num_envs, 3) and beta (num_envs,), None where one is left out."""
    unknown = sorted(set(options) - set(_OPTIONS))
    if unknown:
        raise ValueError(f"options may hold {list(_OPTIONS)}, got {unknown}")
    command = _option(options, "command", (num_envs, 3))
    beta = _option(options, "beta", (num_envs,))
    if beta is not None and not bool(((beta >= 0.0) & (beta <= 1.0)).all()):
        raise ValueError(f"options['beta'] must lie in [0, 1], got {options['beta']!r}")
    return command, beta


def _option(options: dict[str, Any], name: str, shape: tuple[int, ...]) -> torch.Tensor | None:
    if options.get(name) is None:
        return None
    value = np.asarray(options[name], dtype=np.float32)
    if value.shape not in (shape, shape[1:]) or not np.isfinite(value).all():
        raise ValueError(
            f"options[{name!r}] must be finite and of shape {shape[1:]} or {shape}, got"
            f" {options[name]!r}"
        )
    return torch.from_numpy(np.broadcast_to(value, shape).copy())
