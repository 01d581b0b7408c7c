"""What the robot is asked to do: velocity commands and the quiet factor beta."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mute.support.ranges import Range, check_ordered, check_ranges

__all__ = ["BETA", "CommandSampler", "CommandsCfg"]

BETA = 3
"""Column of the quiet factor in the command tensor."""


@dataclass
class CommandsCfg:
    """Ranges of the commands, in the body frame."""

    lin_vel_x: tuple[float, float] = (-1.0, 1.0)
    """Forward velocity, m/s."""
    lin_vel_y: tuple[float, float] = (-0.5, 0.5)
    """Velocity to the left, m/s."""
    ang_vel_z: tuple[float, float] = (-1.0, 1.0)
    """Yaw rate, rad/s."""
    beta: tuple[float, float] = (0.0, 1.0)
    """Quiet factor; 0 asks for speed, 1 for silence."""
    beta_end_fraction: float = 0.0
    """Share of the episodes whose beta is an end of its range, each end as often as the other:
    robots that differ a little at both learn to differ much."""
    standing_fraction: float = 0.1
    """Share of the velocity commands that are zero."""
    single_axis_fraction: float = 0.0
    """Share of the velocity commands that are of one axis alone, forward, sideways or a turn, as
    people drive."""
    slow_fraction: float = 0.0
    """Share of the velocity commands that are slow."""
    slow_share: float = 0.3
    """Share of the velocity ranges that slow ones are drawn from."""
    deadband: float = 0.0
    """Size of a velocity command, (v_x, v_y, w_z) in m/s and rad/s taken together, below which it
    is made zero: nobody can tell whether a robot follows it, or whether it should stand."""
    resampling_time: float = 10.0
    """Time between new velocity commands within an episode, s."""
    initial_share: float = 1.0
    """Share of the velocity ranges that a training starts with: far from the command the tracking
    reward is flat, so fast commands teach a standing robot nothing."""
    ramp: tuple[float, float] = (0.0, 0.0)
    """Seconds of simulated time per environment between which that share grows to 1."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: If a range is empty, or a number is out of its own.
        """
        check_ranges(self, "env.commands", _RANGES)
        check_ordered(self, "env.commands", "lin_vel_x", "lin_vel_y", "ang_vel_z", "beta", "ramp")

    def drawn_evenly(self, standing_fraction: float = 0.1) -> CommandsCfg:
        """Return the same ranges, drawn from evenly whichever way a task does, to measure with.

        Args:
            standing_fraction: Share of the velocity commands that are zero.
        """
        return CommandsCfg(
            lin_vel_x=self.lin_vel_x,
            lin_vel_y=self.lin_vel_y,
            ang_vel_z=self.ang_vel_z,
            beta=self.beta,
            standing_fraction=standing_fraction,
        )


_RANGES = {
    "lin_vel_x": Range(-100.0, 100.0),
    "lin_vel_y": Range(-100.0, 100.0),
    "ang_vel_z": Range(-100.0, 100.0),
    "beta": Range(0.0, 1.0),
    "beta_end_fraction": Range(0.0, 1.0),
    "standing_fraction": Range(0.0, 1.0),
    "single_axis_fraction": Range(0.0, 1.0),
    "slow_fraction": Range(0.0, 1.0),
    "slow_share": Range(0.0, 1.0),
    "deadband": Range(0.0, 100.0),
    "resampling_time": Range(0.0, 1e12, above=True),
    "initial_share": Range(0.0, 1.0),
    "ramp": Range(0.0, 1e12),
}


class CommandSampler:
    """Draws velocity commands, and beta once an episode (paper, section II-C)."""

    def __init__(
        self, cfg: CommandsCfg, num_envs: int, generator: torch.Generator, device: torch.device
    ) -> None:
        """Allocate the commands; nothing is drawn before `resample`."""
        self.cfg = cfg
        self.generator = generator
        self.command = torch.zeros(num_envs, 4, device=device)
        """Commands (v_x, v_y, w_z, beta). Shape: (num_envs, 4)."""
        ranges = torch.tensor(
            [cfg.lin_vel_x, cfg.lin_vel_y, cfg.ang_vel_z, cfg.beta], device=device
        )
        self._low = ranges[:, 0]
        self._span = ranges[:, 1] - ranges[:, 0]

    @property
    def beta(self) -> torch.Tensor:
        """Quiet factor of each environment. Shape: (num_envs,)."""
        return self.command[:, BETA]

    @property
    def standing(self) -> torch.Tensor:
        """Which environments are asked to stand still. Shape: (num_envs,)."""
        return (self.command[:, :BETA] == 0.0).all(dim=1)

    def largest(self, progress: float = 1.0) -> float:
        """Return the largest forward speed that is asked for, m/s.

        Args:
            progress: How far the ranges have grown, see `resample`.
        """
        return self.cfg.lin_vel_x[1] * self._grown(progress)

    def resample(self, mask: torch.Tensor, with_beta: bool, progress: float = 1.0) -> None:
        """Draw new velocity commands for the masked environments, in place.

        Args:
            mask: Which environments get a new command. Shape: (num_envs,).
            with_beta: Whether beta is drawn too, as it is at the start of an episode.
            progress: How far the ranges have grown, from 0 (the initial share) to 1 (all).
        """
        cfg = self.cfg
        shaped = cfg.slow_fraction > 0.0 or cfg.single_axis_fraction > 0.0
        size = self.command.shape[0], 8 if shaped else 5
        draw = torch.rand(size, generator=self.generator, device=mask.device)
        if cfg.beta_end_fraction > 0.0:
            draw[:, BETA] = _to_ends(draw[:, BETA], cfg.beta_end_fraction)
        fresh = self._low + self._span * draw[:, :4]
        velocity = fresh[:, :BETA]
        velocity *= self._grown(progress)
        if shaped:
            self._shape(velocity, draw[:, 5:])
        standing = draw[:, 4] < cfg.standing_fraction
        if cfg.deadband > 0.0:
            standing |= velocity.square().sum(dim=1) < cfg.deadband**2
        velocity.masked_fill_(standing.unsqueeze(1), 0.0)
        if not with_beta:
            fresh[:, BETA] = self.command[:, BETA]
        torch.where(mask.unsqueeze(1), fresh, self.command, out=self.command)

    def _grown(self, progress: float) -> float:
        """Return the share of the ranges that commands are drawn from by now."""
        return self.cfg.initial_share + (1.0 - self.cfg.initial_share) * progress

    def _shape(self, velocity: torch.Tensor, draw: torch.Tensor) -> None:
        """Slow some of the commands down and leave some a single axis, in place.

        Args:
            velocity: Velocity commands. Shape: (num_envs, 3).
            draw: Random numbers in [0, 1). Shape: (num_envs, 3).
        """
        slow = draw[:, 0] < self.cfg.slow_fraction
        velocity *= torch.where(slow, self.cfg.slow_share, 1.0).unsqueeze(1)
        alone = draw[:, 1] < self.cfg.single_axis_fraction
        axis = (draw[:, 2:] * BETA).long()
        others = torch.arange(BETA, device=axis.device) != axis
        velocity.masked_fill_(alone.unsqueeze(1) & others, 0.0)


def _to_ends(draw: torch.Tensor, fraction: float) -> torch.Tensor:
    """Return numbers in [0, 1] of which a fraction are 0 or 1, from even ones."""
    if fraction == 1.0:
        return draw.round()
    return ((draw - 0.5 * fraction) / (1.0 - fraction)).clamp(0.0, 1.0)
