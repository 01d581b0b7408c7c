"""Whether robots do what they are asked: go when told to go, stand still when told to stand."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["GOING_SHARE", "STILL_SPEED", "Obedience", "Verdict", "along_command"]

GOING_SHARE = 0.4
"""Share of a commanded velocity from which on a robot counts as going."""

STILL_SPEED = 0.05
"""Mean horizontal speed of the trunk up to which a robot is still, m/s; noisy sensors shake it."""

_LARGEST_SHARE = 1.6
"""Share of a commanded velocity beyond which a robot does not do as asked: as far from 1."""
_GRACE = 2.0
"""Time after a new command, or a new start, in which a robot may still be getting there, s."""
_SHORTEST = 0.5
"""Shortest time after that by which it can be judged, s: about a stride."""


def along_command(
    command: torch.Tensor, lin_vel: torch.Tensor, ang_vel: torch.Tensor
) -> torch.Tensor:
    """Return the velocity along a command over the commanded one: 1 where it is followed exactly.

    Of a command that both moves and turns it is the smaller of the two ratios.

    Args:
        command: (v_x, v_y, w_z, ...) in the body frame, m/s and rad/s. Shape: (num_envs, 3 or 4).
        lin_vel: Velocity of the trunk in the body frame, m/s. Shape: (num_envs, 3).
        ang_vel: Its angular velocity in the body frame, rad/s. Shape: (num_envs, 3).

    Returns:
        Infinity where the command is zero. Shape: (num_envs,).
    """
    return _shares(command, lin_vel, ang_vel).nan_to_num(nan=torch.inf).amin(dim=1)


def _shares(command: torch.Tensor, lin_vel: torch.Tensor, ang_vel: torch.Tensor) -> torch.Tensor:
    """Return what of the commanded motion and of the commanded turn is done.

    Returns:
        NaN for what is not asked for. Shape: (num_envs, 2).
    """
    asked, turn = command[:, :2], command[:, 2]
    moving = (asked * lin_vel[:, :2]).sum(dim=1) / asked.square().sum(dim=1)
    turning = ang_vel[:, 2] / turn
    shares = torch.stack((moving, turning), dim=1)
    idle = torch.stack(((asked == 0.0).all(dim=1), turn == 0.0), dim=1)
    return shares.masked_fill(idle, torch.nan)


@dataclass(frozen=True)
class Verdict:
    """How many robots did what they were asked, and what the others did instead."""

    judged: int
    """Robots that had a command for long enough to tell, or fell."""
    obeyed: int
    """Those that did what they were asked, every time."""
    fell: int
    """Robots that fell."""
    too_slow: int
    """Robots that went at less than `GOING_SHARE` of a command, once or more often."""
    too_fast: int
    """Robots that went at more than 1.6 times a command."""
    restless: int
    """Robots that lifted a foot or moved on when they were to stand."""

    @property
    def share(self) -> float:
        """Share of the judged robots that obeyed; NaN if none was judged."""
        return self.obeyed / self.judged if self.judged else float("nan")


class Obedience:
    """Follows robots over their commands, which may change at any time.

    A robot is judged by each command that it had for long enough: the first two seconds are for
    getting there. Asked to go, its mean velocity along the command must be 0.4 to 1.6 times the
    commanded one, and so must its turning, if it is to turn; asked to stand, its feet must stay on
    the ground and its trunk where it is.
    """

    def __init__(self, env: QuadrupedEnv) -> None:
        """Begin with nothing seen.

        Args:
            env: The environment to read after each of its steps.
        """
        num_envs = env.num_envs
        self._env = env
        self._grace = round(_GRACE / env.step_dt)
        self._shortest = round(_SHORTEST / env.step_dt)
        self._command = torch.zeros(num_envs, 3)
        self._age = torch.zeros(num_envs, dtype=torch.long)
        # Steps that count under this command; sums of the six velocities and the speed over them.
        self._sums = torch.zeros(num_envs, 8, dtype=torch.float64)
        self._feet_down = torch.ones(num_envs, dtype=torch.bool)
        nobody = torch.zeros(num_envs, dtype=torch.bool)
        self._judged, self._fallen = nobody.clone(), nobody.clone()
        self._too_slow, self._too_fast, self._restless = (nobody.clone() for _ in range(3))

    def update(self, command: torch.Tensor, dones: torch.Tensor) -> None:
        """Take in the step that the environment has just made.

        Args:
            command: Commands that were in force during the step. Shape: (num_envs, 4).
            dones: Episodes that ended in it. Shape: (num_envs,).
        """
        env = self._env
        velocity = command[:, :3]
        changed = (velocity != self._command).any(dim=1)
        if bool(changed.any()):
            self._close(changed)
            self._command = velocity.clone()
        self._age += 1
        # Of an episode that has just ended the state is the next one's already.
        counts = (self._age > self._grace) & ~dones
        speed = env.base_lin_vel[:, :2].norm(dim=1, keepdim=True)
        ones = torch.ones_like(speed)
        values = torch.cat((ones, env.base_lin_vel, env.base_ang_vel, speed), dim=1)
        self._sums += torch.where(counts.unsqueeze(1), values, 0.0)
        self._feet_down &= env.footfalls.contact.all(dim=1) | ~counts
        self._fallen |= env.fallen
        if bool(dones.any()):
            self._close(dones)

    def verdict(self) -> Verdict:
        """Return how many robots obeyed so far, the commands of now included."""
        too_slow, too_fast, restless, judged = (
            past | now
            for past, now in zip(
                (self._too_slow, self._too_fast, self._restless, self._judged),
                self._present(),
                strict=True,
            )
        )
        judged = judged | self._fallen
        obeyed = judged & ~(self._fallen | too_slow | too_fast | restless)
        counted = (judged, obeyed, self._fallen, too_slow, too_fast, restless)
        return Verdict(*(int(robots.sum()) for robots in counted))

    def _present(self) -> tuple[torch.Tensor, ...]:
        """Return who is too slow, too fast, restless, and judged, by the commands of now."""
        steps = self._sums[:, :1]
        judged = steps[:, 0] >= self._shortest
        means = self._sums[:, 1:] / steps.clamp(min=1.0)
        shares = _shares(self._command, means[:, :3], means[:, 3:6])
        moved = ~self._feet_down | (means[:, 6] > STILL_SPEED)
        to_stand = (self._command == 0.0).all(dim=1)
        # A comparison with NaN, for what is not asked, is false.
        too_slow = (shares < GOING_SHARE).any(dim=1)
        too_fast = (shares > _LARGEST_SHARE).any(dim=1)
        return too_slow & judged, too_fast & judged, to_stand & moved & judged, judged

    def _close(self, mask: torch.Tensor) -> None:
        """Judge the masked robots by the command that ends, and begin anew with them."""
        too_slow, too_fast, restless, judged = (now & mask for now in self._present())
        self._too_slow |= too_slow
        self._too_fast |= too_fast
        self._restless |= restless
        self._judged |= judged
        self._age.masked_fill_(mask, 0)
        self._sums.masked_fill_(mask.unsqueeze(1), 0.0)
        self._feet_down |= mask
