"""How far the estimator is from the truth while it walks."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import torch
from tensordict import TensorDict

from mute.controllers.learned import LearnedController
from mute.envs.phase import CausalContacts, hindsight_phase, hindsight_swing
from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["EstimationErrors", "EstimationMeter"]


@dataclass
class EstimationErrors:
    """Errors of the estimates over all robots and steps; None of what is not estimated."""

    velocity_rmse: float
    """Root of the mean squared error over axes, m/s."""
    height_rmse: float | None
    """Root mean squared error over the height map, m."""
    phase_mae: float | None
    """Mean absolute error where the phase is known in hindsight."""
    phase_mae_clock: float
    """The same of a clock: the time since a foot last landed or lifted over how long it stood or
    swung the last time. It feels every contact, which the estimator does not."""
    contact_time_mae: float | None
    """Mean absolute error, in a swing, of the time until the foot lands, s: of what the phase
    leaves of a swing of mean length."""
    contact_time_mae_clock: float
    """The same of the clock, s: what is left of as long a swing as the foot's last one."""
    phase_known: float
    """Share of the samples in which it is; standing feet have no phase."""

    def as_dict(self) -> dict[str, float]:
        """Return the errors by name, without those of what is not estimated."""
        return {name: value for name, value in asdict(self).items() if value is not None}


class EstimationMeter:
    """Compares a controller's estimates with the environment's privileged truth.

    To be called after each step of a trial, see `run_trial`'s `on_step`.
    """

    def __init__(
        self, env: QuadrupedEnv, controller: LearnedController, first_episodes: bool = False
    ) -> None:
        """Start at zero.

        Args:
            env: Where the robots walk.
            controller: Whose estimates are judged.
            first_episodes: Leave out what robots do once their first episode has ended.
        """
        self._env = env
        self._controller = controller
        self._first_episodes = first_episodes
        self._velocity: list[torch.Tensor] = []
        self._height: list[torch.Tensor] = []
        self._contact: list[torch.Tensor] = []
        self._phase: list[torch.Tensor] = []
        self._starts: list[torch.Tensor] = [torch.ones(env.num_envs, dtype=torch.bool)]
        self._counted: list[torch.Tensor] = [torch.ones(env.num_envs, dtype=torch.bool)]

    def __call__(self, observations: TensorDict, dones: torch.Tensor) -> None:
        """Take in the observations that were acted on, and which episodes then ended."""
        estimate = self._controller.estimate
        if estimate is None:
            raise ValueError("the controller has not acted yet")
        privileged, columns = observations["privileged"], self._env.privileged_slices
        velocity = privileged[:, columns["base_lin_vel"]]
        heights = self._env.cfg.height_map.metres(privileged[:, columns["heights"]])
        self._velocity.append((estimate.base_lin_vel - velocity).square().mean(dim=1))
        if estimate.heights.shape[1]:
            self._height.append((estimate.heights - heights).square().mean(dim=1))
        self._contact.append(privileged[:, columns["contact"]] > 0.5)
        self._phase.append(estimate.phase)
        self._starts.append(dones.clone())
        left = self._counted[-1] & ~dones if self._first_episodes else self._counted[-1]
        self._counted.append(left)

    def errors(self) -> EstimationErrors:
        """Return the errors so far."""
        feet = self._env.footfalls
        contact, starts = torch.stack(self._contact), torch.stack(self._starts[:-1])
        counted = torch.stack(self._counted[:-1])
        window = contact, starts, feet.min_steps, feet.max_steps
        truth, known = hindsight_phase(*window)
        left, length, swings = hindsight_swing(*window)
        known, swings = known & counted[..., None], swings & counted[..., None]
        usual = length[swings & (left == length)].float().mean()
        phase, clock = torch.stack(self._phase), _clock(contact, starts, feet.min_steps)
        with_phase = phase.shape[2] > 0

        def phase_error(told: torch.Tensor) -> float:
            return float((told - truth).abs()[known].mean())

        def time_error(told: torch.Tensor) -> float:
            return float((told - left).abs()[swings].float().mean()) * self._env.step_dt

        return EstimationErrors(
            velocity_rmse=float(torch.stack(self._velocity)[counted].mean().sqrt()),
            height_rmse=self._height_rmse(counted),
            phase_mae=phase_error(phase) if with_phase else None,
            phase_mae_clock=phase_error(clock[0]),
            contact_time_mae=time_error((1.0 - phase) * usual) if with_phase else None,
            contact_time_mae_clock=time_error(clock[1]),
            phase_known=float(known.float().mean()),
        )

    def _height_rmse(self, counted: torch.Tensor) -> float | None:
        if not self._height:
            return None
        return float(torch.stack(self._height)[counted].mean().sqrt())


def _clock(
    contact: torch.Tensor, starts: torch.Tensor, min_steps: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return what one says who feels every contact, and takes a foot to do as it did the last time.

    Args:
        contact: Contact of each foot. Shape: (T, N, 4), bool.
        starts: Where episodes begin. Shape: (T, N), bool.
        min_steps: Samples that it takes to believe in a change.

    Returns:
        The phase, and the samples until the foot lands, of no meaning in a stance. Shapes:
        (T, N, 4).
    """
    feet = CausalContacts(contact.shape[1], contact.shape[2], min_steps)
    phases, left = [], []
    for raw, begun in zip(contact, starts, strict=True):
        feet.update(raw)
        feet.reset(begun, raw)
        phases.append(feet.phase)
        left.append((feet.last_air_steps - feet.air_steps).clamp(min=0))
    return torch.stack(phases), torch.stack(left)
