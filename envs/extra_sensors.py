"""What a robot measures that no policy sees: its accelerometer, and how long its feet press."""

from __future__ import annotations

import torch

from .base_state import specific_force
from .sensors import RobotSensors
from .simulation import Simulation

__all__ = ["ExtraSensors"]


class ExtraSensors:
    """Follows the control steps, of which each reading is a mean."""

    def __init__(self, simulation: Simulation, sensors: RobotSensors, step_dt: float) -> None:
        """Begin at rest, in the air.

        Args:
            simulation: The engine.
            sensors: What its sensors read.
            step_dt: Control period, s.
        """
        self._simulation, self._sensors, self._step_dt = simulation, sensors, step_dt
        self._lin_vel_before = torch.zeros_like(simulation.qvel[:, :3])
        self._contact_share = torch.zeros_like(sensors.foot_contact)

    def begin(self) -> None:
        """Begin a control step, before its physics."""
        self._lin_vel_before = self._simulation.qvel[:, :3].clone()

    def end(self) -> None:
        """End it, after its physics; a push that comes afterwards is felt as acceleration."""
        touched = self._sensors.foot_contact_substeps > 0.0
        self._contact_share = touched.float().mean(dim=0)

    def reset(self, mask: torch.Tensor) -> None:
        """Begin anew for the masked robots, as they are now. Mask shape: (num_envs,)."""
        column = mask[:, None]
        begun = self._simulation.qvel[:, :3]
        self._lin_vel_before = torch.where(column, begun, self._lin_vel_before)
        contact = (self._sensors.foot_contact > 0.0).float()
        self._contact_share = torch.where(column, contact, self._contact_share)

    def read(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the parts of `SENSOR_WIDTHS`, exact, the force in the trunk's frame.

        Returns:
            Shapes: (num_envs, 3) and (num_envs, 4).
        """
        qpos, qvel = self._simulation.qpos, self._simulation.qvel
        change = qvel[:, :3] - self._lin_vel_before
        return specific_force(qpos, change / self._step_dt), self._contact_share

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        return {name: getattr(self, name).clone() for name in _STATE}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        for name in _STATE:
            setattr(self, name, state[name].to(self._simulation.device, copy=True))


_STATE = ("_lin_vel_before", "_contact_share")
