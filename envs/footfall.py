"""Feet over time: contacts and phase at the control rate, landings at the physics rate.

A landing peak lasts about 20 ms, so its speed is read from every physics step. Which contact is a
landing is decided by the debounced contacts of `envs.phase`, some control steps later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch

from mute.support.ranges import Range, check_ranges

from .phase import CausalContacts

__all__ = ["FootfallCfg", "Footfalls"]

_NUM_FEET = 4


@dataclass
class FootfallCfg:
    """How contacts become footfalls."""

    min_segment: float = 0.04
    """Shortest contact or swing that counts, s; shorter ones are merged into their neighbours."""
    max_segment: float = 1.0
    """Longest contact or swing that has a phase, s; longer ones are standing."""
    landing_window: float = 0.02
    """Time before contact in which the largest downward speed is the landing speed, s."""

    def __post_init__(self) -> None:
        """Check the times.

        Raises:
            ValueError: If one is out of its range.
        """
        time = Range(0.0, 10.0, above=True)
        names = ("min_segment", "max_segment", "landing_window")
        check_ranges(self, "env.footfall", dict.fromkeys(names, time))


class Footfalls:
    """Follows the feet of every robot: contact, phase, landings and swings.

    Order within a control step: `record` the physics steps, then `update`.
    """

    def __init__(
        self,
        cfg: FootfallCfg,
        num_envs: int,
        timestep: float,
        decimation: int,
        device: torch.device | str = "cpu",
    ) -> None:
        """Allocate the history.

        Args:
            cfg: Times.
            num_envs: Number of robots.
            timestep: Physics step, s.
            decimation: Physics steps a control step.
            device: Where the history lives.
        """
        step_dt = timestep * decimation
        self.min_steps = max(1, round(cfg.min_segment / step_dt))
        """Shortest segment, in control steps."""
        self.max_steps = round(cfg.max_segment / step_dt)
        """Longest segment with a phase, in control steps."""
        self._step_dt = step_dt
        self._decimation = decimation
        self._window = max(1, round(cfg.landing_window / timestep))
        # A landing is confirmed min_steps - 1 control steps late and looks back over its window.
        self._depth = (self.min_steps + math.ceil(self._window / decimation)) * decimation
        shape = (num_envs, _NUM_FEET)
        self._drop = torch.zeros(self._depth, *shape, device=device)
        self._touch = torch.zeros(self._depth, *shape, dtype=torch.bool, device=device)
        self._step = torch.arange(self._depth, dtype=torch.float32, device=device)[:, None, None]
        self._countdown = self._depth - self._step
        self._contacts = CausalContacts(
            num_envs, _NUM_FEET, min_steps=self.min_steps, device=device
        )
        self.vel_z = torch.zeros(1 + decimation, *shape, device=device)
        """Vertical velocity at the last physics step before the control step and at its own, m/s.
        Shape: (1 + decimation, num_envs, 4)."""
        self.drop_sq = torch.zeros(shape, device=device)
        """Mean over the physics steps of max(-v_z, 0)^2, (m/s)^2. Shape: (num_envs, 4)."""
        self.raise_sq = torch.zeros_like(self.drop_sq)
        """Mean over the physics steps of max(v_z, 0)^2, (m/s)^2. Shape: (num_envs, 4)."""
        self.contact_share = torch.zeros_like(self.drop_sq)
        """Share of the physics steps with contact. Shape: (num_envs, 4)."""
        self.raw_contact = torch.zeros_like(self.drop_sq, dtype=torch.bool)
        """Contact at any physics step of the control step. Shape: (num_envs, 4)."""
        self.landing_speed = torch.zeros_like(self.drop_sq)
        """Landing speed where `touchdown`, else 0, m/s. Shape: (num_envs, 4)."""
        self.swing_apex = torch.zeros_like(self.drop_sq)
        """How far the highest point of the current or, in stance, last swing was above the highest
        ground that it came near, m. Shape: (num_envs, 4)."""
        self._highest = torch.full_like(self.drop_sq, _NOWHERE)
        self._highest_ground = torch.full_like(self.drop_sq, _NOWHERE)

    @property
    def contact(self) -> torch.Tensor:
        """Debounced contact, bool. Shape: (num_envs, 4)."""
        return self._contacts.contact

    @property
    def touchdown(self) -> torch.Tensor:
        """Feet whose landing was confirmed in this control step, bool. Shape: (num_envs, 4)."""
        return self._contacts.touchdown

    @property
    def stride_time(self) -> torch.Tensor:
        """Duration of the swing that `touchdown` ends and of the stance before it, s, else 0.

        Of a stance that began with the episode nothing is known but what is usual. Shape:
        (num_envs, 4).
        """
        steps = self._contacts.last_air_steps + self._contacts.last_stance_steps
        return steps * self.touchdown * self._step_dt

    @property
    def phase(self) -> torch.Tensor:
        """Causal phase, from the durations of the foot's last segments. Shape: (num_envs, 4)."""
        return self._contacts.phase

    def record(self, foot_vel_z: torch.Tensor, found: torch.Tensor) -> None:
        """Take in the physics steps of a control step, the oldest first.

        Args:
            foot_vel_z: Vertical velocity of each foot in the world, m/s.
                Shape: (decimation, num_envs, 4).
            found: Number of contacts of each foot. Shape: (decimation, num_envs, 4).
        """
        keep = self._depth - self._decimation
        self._drop[:keep] = self._drop[self._decimation :].clone()
        self._touch[:keep] = self._touch[self._decimation :].clone()
        torch.clamp(-foot_vel_z, min=0.0, out=self._drop[keep:])
        torch.gt(found, 0.0, out=self._touch[keep:])
        self.vel_z = torch.cat((self.vel_z[-1:], foot_vel_z))

    def update(self, height: torch.Tensor, ground: torch.Tensor) -> None:
        """Close the control step: contacts, phase, landings and apexes.

        Args:
            height: Of the lowest point of each foot, world, m. Shape: (num_envs, 4).
            ground: Height of the highest ground near it, m. Shape: (num_envs, 4).
        """
        recent = slice(self._depth - self._decimation, self._depth)
        self.drop_sq = self._drop[recent].square().mean(dim=0)
        self.raise_sq = self.vel_z[1:].clamp(min=0.0).square().mean(dim=0)
        touch = self._touch[recent]
        self.contact_share = touch.float().mean(dim=0)
        self.raw_contact = touch.any(dim=0)
        # Before the update: a foot that the update declares landed has reached its apex already.
        in_stance = self._contacts.contact.clone()
        self._contacts.update(self.raw_contact)
        lifting = in_stance & ~self._contacts.contact
        self._highest = _highest(self._highest, height, lifting, in_stance)
        self._highest_ground = _highest(self._highest_ground, ground, lifting, in_stance)
        self.swing_apex = torch.where(
            in_stance & ~lifting, self.swing_apex, self._highest - self._highest_ground
        )
        self.landing_speed = self._landing_speed()

    def reset(self, mask: torch.Tensor, found: torch.Tensor) -> None:
        """Forget the masked robots' past.

        Args:
            mask: Robots that begin an episode. Shape: (num_envs,).
            found: Number of contacts of each foot now. Shape: (num_envs, 4).
        """
        raw = found > 0.0
        column = mask.unsqueeze(1)
        self._contacts.reset(mask, raw)
        self._drop.masked_fill_(column, 0.0)
        self.vel_z = self.vel_z.masked_fill(column, 0.0)
        torch.where(column, raw, self._touch, out=self._touch)
        self.raw_contact = torch.where(column, raw, self.raw_contact)
        for name in ("drop_sq", "raise_sq", "contact_share", "landing_speed", "swing_apex"):
            setattr(self, name, getattr(self, name).masked_fill(column, 0.0))
        for name in ("_highest", "_highest_ground"):
            setattr(self, name, getattr(self, name).masked_fill(column, _NOWHERE))

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        state = {name: getattr(self, name).clone() for name in _STATE_TENSORS}
        contacts = self._contacts.state_dict()
        return state | {f"contacts/{name}": value for name, value in contacts.items()}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        apex = state["swing_apex"]
        # Earlier versions have an apex above level ground alone.
        known = {"_highest": apex, "_highest_ground": torch.zeros_like(apex), "vel_z": self.vel_z}
        state = known | state
        for name in _STATE_TENSORS:
            setattr(self, name, state[name].to(self._drop.device, copy=True))
        prefix = "contacts/"
        contacts = {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
        self._contacts.load_state_dict(contacts)

    def _landing_speed(self) -> torch.Tensor:
        """Return the largest downward speed in the window that ends with each first contact.

        The physics step that first finds contact still carries the velocity of the approach: the
        contact force acts from the next one on. It belongs to the window.
        """
        # The run of contact that was just confirmed began min_steps - 1 control steps ago.
        begin = self._depth - self.min_steps * self._decimation
        # The largest countdown that is met with contact is the first: an argmax takes ten times as
        # long on a CPU.
        first = self._depth - (self._touch[begin:] * self._countdown[begin:]).amax(dim=0)
        inside = (self._step <= first) & (self._step > first - self._window)
        # Of all feet, though few have landed: to pick these out, a GPU would have to be waited for.
        return torch.where(self.touchdown, (self._drop * inside).amax(dim=0), 0.0)


_STATE_TENSORS = (
    "vel_z",
    "_drop",
    "_touch",
    "drop_sq",
    "raise_sq",
    "contact_share",
    "raw_contact",
    "landing_speed",
    "swing_apex",
    "_highest",
    "_highest_ground",
)


_NOWHERE = -1e6
"""Below every height, m: what a swing that begins in the air has been at so far."""


def _highest(
    before: torch.Tensor, now: torch.Tensor, lifting: torch.Tensor, in_stance: torch.Tensor
) -> torch.Tensor:
    """Return the highest of each foot's swing so far; of who lifts, what it is now."""
    rising = torch.maximum(before, now)
    return torch.where(lifting, now, torch.where(in_stance, before, rising))
