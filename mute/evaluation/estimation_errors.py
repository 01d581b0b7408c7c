"""How far the estimator is from the truth while it walks."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import torch
from tensordict import TensorDict

from mute.controllers.learned import LearnedController
from mute.envs.phase import hindsight_phase, hindsight_swing
from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["EstimationErrors", "EstimationMeter"]


@dataclass
class EstimationErrors:
    """Errors of the estimates over all robots and steps."""

    velocity_rmse: float
    """Root of the mean squared error over axes, m/s."""
    height_rmse: float
    """Root mean squared error over the height map, m."""
    phase_mae: float
    """Mean absolute error where the phase is known in hindsight."""
    phase_mae_clock: float
    """The same of a clock: the time since a foot last landed or lifted over how long it stood or
    swung the last time. It feels every contact, which the estimator does not."""
    contact_time_mae: float
    """Mean absolute error, in a swing, of the time until the foot lands, s: of what the phase
    leaves of a swing of mean length."""
    contact_time_mae_clock: float
    """The same of the clock, s."""
    phase_known: float
    """Share of the samples in which it is; standing feet have no phase."""

    def as_dict(self) -> dict[str, float]:
        """Return the errors by name."""
        return asdict(self)


class EstimationMeter:
    """Compares a controller's estimates with the environment's privileged truth.

    To be called after each step of a trial, see `run_trial`'s `on_step`.
    """

    def __init__(self, env: QuadrupedEnv, controller: LearnedController) -> None:
        """Start at zero."""
        self._env = env
        self._controller = controller
        self._velocity: list[torch.Tensor] = []
        self._height: list[torch.Tensor] = []
        self._contact: list[torch.Tensor] = []
        self._phase: list[torch.Tensor] = []
        self._clock: list[torch.Tensor] = []
        self._starts: list[torch.Tensor] = [torch.ones(env.num_envs, dtype=torch.bool)]

    def __call__(self, observations: TensorDict, dones: torch.Tensor) -> None:
        """Take in the observations that were acted on, and which episodes then ended."""
        estimate = self._controller.estimate
        if estimate is None:
            raise ValueError("the controller has not acted yet")
        privileged, columns = observations["privileged"], self._env.privileged_slices
        velocity = privileged[:, columns["base_lin_vel"]]
        heights = self._env.cfg.height_map.metres(privileged[:, columns["heights"]])
        self._velocity.append((estimate.base_lin_vel - velocity).square().mean())
        self._height.append((estimate.heights - heights).square().mean())
        self._contact.append(privileged[:, columns["contact"]] > 0.5)
        self._phase.append(estimate.phase)
        self._clock.append(privileged[:, columns["phase"]])
        self._starts.append(dones.clone())

    def errors(self) -> EstimationErrors:
        """Return the errors so far."""
        feet = self._env.footfalls
        window = torch.stack(self._contact), torch.stack(self._starts[:-1])
        truth, known = hindsight_phase(*window, feet.min_steps, feet.max_steps)
        left, length, swings = hindsight_swing(*window, feet.min_steps, feet.max_steps)
        usual = length[swings].float().mean()

        def errors(phase: torch.Tensor) -> tuple[float, float]:
            late = ((1.0 - phase[swings]) * usual - left[swings]).abs().mean()
            return float((phase - truth).abs()[known].mean()), float(late) * self._env.step_dt

        phase_mae, contact_time_mae = errors(torch.stack(self._phase))
        phase_mae_clock, contact_time_mae_clock = errors(torch.stack(self._clock))
        return EstimationErrors(
            velocity_rmse=float(torch.stack(self._velocity).mean().sqrt()),
            height_rmse=float(torch.stack(self._height).mean().sqrt()),
            phase_mae=phase_mae,
            phase_mae_clock=phase_mae_clock,
            contact_time_mae=contact_time_mae,
            contact_time_mae_clock=contact_time_mae_clock,
            phase_known=float(known.float().mean()),
        )
