"""Motors and gears, whose forces come to the robot's shell as those of the feet do.

- **Backlash.** Teeth carry what is left of the motor's torque once its rotor follows the joint, tau
  = torque - I q'' with the rotor's inertia I, as the joint feels it. Where that changes its sign,
  they part, cross the play b and meet again, and the rotor moves against the joint by I phi'' =
  tau. Of a torque that jumps to tau teeth meet with the energy b tau, of one that rises
  as tau' t with 1/8 I^(1/3) tau'^(2/3) (6 b)^(4/3). That is a pulse of torque, half a sine of pi
  sqrt(I / K) on the gear's stiffness K, of which nothing rebounds.
- **Tones.** A motor's torque is not even: a share of it alternates six times in an electrical
  period, so with the angle q of the joint as cos(6 p N q), p pole pairs, gear ratio N. The mesh of
  the gear alternates with its ring's teeth, cos(Z q).

A torque at a joint shakes the shell as the force at the foot that it stands for, torque over the
length of a link: the same share of it comes through.

Gear ratios and the rotor's inertia are Unitree's. Of the rest nothing is published: play and
stiffness as planetary gears of 60 mm have in catalogues, 20 pole pairs, uneven shares as field
oriented control leaves them (all assumed).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.microphone import distance
from mute.acoustics.sources.band_noise import spread
from mute.acoustics.sources.pending import Pending
from mute.acoustics.sources.response import audible_end
from mute.acoustics.sources.shell import shell_response

__all__ = [
    "INERTIA",
    "TONES",
    "DriveExposure",
    "DriveSound",
    "Joints",
    "Meeting",
    "Teeth",
    "pulse_duration",
    "tone_forces",
]

GEAR_RATIO = np.tile([6.0, 6.0, 9.0], 4)
"""Of hip, thigh and calf of each leg."""
INERTIA = 1.11842e-4 * GEAR_RATIO**2
"""Of the rotors, as the joints feel it, kg m^2."""
BACKLASH = 2e-3
"""Play of a gear at the joint, rad (7 minutes of arc, assumed)."""
STIFFNESS = 5e3
"""Of a gear at the joint, N m / rad (1.5 N m a minute of arc, assumed)."""
LEVER = 0.213
"""Length of a link, m (Go1)."""
POLE_PAIRS = 20
"""Of a motor (assumed)."""
RING_TEETH = 90
"""Of a gear (assumed)."""
TONES = ((6.0 * POLE_PAIRS * GEAR_RATIO, 0.01), (np.full(12, float(RING_TEETH)), 0.01))
"""Of each tone, the radians by which its phase goes on in a radian of each joint, and the share of
the torque that alternates (assumed)."""


@dataclass
class Meeting:
    """Teeth that meet, in the order of time. Each array's shape: (n,)."""

    step: NDArray
    """Physics step of the block."""
    robot: NDArray
    """Index of the robot."""
    joint: NDArray
    """Index of the joint."""
    force: NDArray
    """Impulse of the force at the foot that the pulse of torque stands for, N s."""


def pulse_duration(joint: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return how long teeth press on each other when they meet, pi sqrt(I / K), s."""
    return np.pi * np.sqrt(INERTIA[joint] / STIFFNESS)


class Teeth:
    """Teeth of all joints that part and meet, as time goes on."""

    def __init__(self, num_robots: int) -> None:
        """Begin with the first torque, at rest on the side that it presses on."""
        self._place: NDArray | None = None
        self._speed = np.zeros((num_robots, 12))
        self._last_vel: NDArray | None = None

    def meet(self, block: ContactBlock) -> Meeting:
        """Return the teeth that meet in the next block.

        Within a physics step the torque is constant, and what it does is exact.

        Args:
            block: Physics that follows the last block's.
        """
        velocity = np.asarray(block.joint_vel, dtype=np.float64)
        before = velocity[:1] if self._last_vel is None else self._last_vel[None]
        acceleration = np.diff(velocity, axis=0, prepend=before) / block.timestep
        self._last_vel = velocity[-1]
        push = np.asarray(block.joint_torque, dtype=np.float64) / INERTIA - acceleration
        if self._place is None:
            self._place = np.where(push[0] > 0.0, BACKLASH, 0.0)
        push = push.reshape(block.steps, -1)
        place, speed = self._place.ravel(), self._speed.ravel()
        forward = push > 0.0
        joint, turn = np.nonzero((forward[1:] != forward[:-1]).T)
        begins = np.searchsorted(joint, np.arange(push.shape[1] + 1))
        # Most teeth rest on the side that the torque presses on, and stay there.
        moving = np.where(forward[0], place < BACKLASH, place > 0.0) | (speed != 0.0)
        found: list[tuple[int, int, float]] = []
        for index in np.flatnonzero(moving | (np.diff(begins) > 0)).tolist():
            turns = (turn[begins[index] : begins[index + 1]] + 1).tolist()
            rest = _Rest(float(place[index]), float(speed[index]))
            met = rest.follow(push[:, index].tolist(), turns, block.timestep)
            found += [(step, index, arrived) for step, arrived in met]
            place[index], speed[index] = rest.place, rest.speed
        found.sort()
        step, index = (np.array([each[i] for each in found], dtype=np.int64) for i in (0, 1))
        arrived = np.array([each[2] for each in found])
        robot, joint = index // 12, index % 12
        return Meeting(step, robot, joint, INERTIA[joint] * arrived / LEVER)


class _Rest:
    """Where the teeth of one joint are, and how fast they go.

    Numbers one by one: teeth part some ten times a second, for some steps each.
    """

    def __init__(self, place: float, speed: float) -> None:
        self.place, self.speed = place, speed

    def follow(self, push: list[float], turns: list[int], dt: float) -> list[tuple[int, float]]:
        """Return at which steps teeth meet, and at what speed; above 0 where the play ends.

        Args:
            push: Angular acceleration that the torque gives the rotor, by step, rad/s^2.
            turns: Steps at which its direction changes, in order.
            dt: Length of a step, s.
        """
        place, speed = self.place, self.speed
        met = []
        step, stop, coming = 0, len(push), iter([*turns, len(push)])
        while step < stop:
            own = push[step]
            if speed == 0.0 and (place >= BACKLASH if own > 0.0 else place <= 0.0):
                step = next(turn for turn in coming if turn > step)
                continue
            after = place + speed * dt + 0.5 * own * dt * dt
            if 0.0 < after < BACKLASH:
                place, speed = after, speed + own * dt
            else:
                way = BACKLASH - place if after >= BACKLASH else -place
                arrived = math.sqrt(max(speed * speed + 2.0 * own * way, 0.0))
                place, speed = (BACKLASH if after >= BACKLASH else 0.0), 0.0
                if arrived > 0.0:
                    met.append((step, arrived if place > 0.0 else -arrived))
            step += 1
        self.place, self.speed = place, speed
        return met


@dataclass
class Joints:
    """Where joints were at the end of a block, from which the next one goes on."""

    position: NDArray
    """rad. Shape: (robots, 12)."""
    torque: NDArray
    """N m. Shape: (robots, 12)."""

    @staticmethod
    def before(block: ContactBlock) -> Joints:
        """Return the joints before a first block: where its first step finds them."""
        return Joints(block.joint_pos[0], block.joint_torque[0])

    @staticmethod
    def after(block: ContactBlock) -> Joints:
        """Return the joints after a block."""
        return Joints(block.joint_pos[-1], block.joint_torque[-1])


def tone_forces(block: ContactBlock, before: Joints, bounds: NDArray) -> NDArray[np.float32]:
    """Return the alternating forces of all joints, N. Shape: (robots, samples).

    Between two physics steps angle and torque change evenly, so that nothing jumps: a jump would be
    heard.

    Args:
        block: Physics.
        before: Joints before its first step.
        bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
    """
    counts = np.diff(bounds)
    position = np.concatenate((before.position[None], block.joint_pos)).astype(np.float64)
    torque = np.concatenate((before.torque[None], block.joint_torque))
    periods = np.stack([periods for periods, _ in TONES])
    uneven = np.array([[uneven] for _, uneven in TONES], dtype=np.float32)
    share = 1.0 / counts[:, None, None]
    # Tones and joints side by side, of each step and robot.
    angle = _flat(position[:, :, None] * periods)
    size = _flat(uneven / np.float32(LEVER) * np.abs(torque)[:, :, None].astype(np.float32))
    # Within a step the phase goes on evenly: a turn by a complex factor is quicker than a cosine.
    wave = np.exp(1j * np.remainder(angle[:-1], 2.0 * np.pi)).astype(np.complex64)
    turn = np.exp(1j * share * np.diff(angle, axis=0)).astype(np.complex64)
    growth = (share * np.diff(size, axis=0)).astype(np.float32)
    size = size[:-1].copy()
    longest = int(counts.max())
    force = np.empty((block.steps, longest, block.num_robots), dtype=np.float32)
    for sample in range(longest):
        np.einsum("srj,srj->sr", wave.real, size, out=force[:, sample])
        wave *= turn
        size += growth
    return force[np.arange(longest) < counts[:, None]].T


def _flat(values: NDArray) -> NDArray:
    """Return the last two axes as one."""
    return values.reshape(*values.shape[:2], -1)


class DriveSound:
    """The sound of motors and gears, streamed."""

    def __init__(self, num_robots: int, sample_rate: int, transmissibility: float) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            transmissibility: Share of a force that comes to the shell.
        """
        self._sample_rate = sample_rate
        impulse = transmissibility * shell_response(sample_rate).impulse(0)
        impulse = impulse[: audible_end(impulse[None, : len(impulse) // 2])]
        self._filter = impulse.astype(np.float32)  # transforms in it take half the time
        self._joints: Joints | None = None
        self._teeth = Teeth(num_robots)
        self._forces, self._heard = Pending(num_robots), Pending(num_robots)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        samples = int(bounds[-1] - bounds[0])
        before = self._joints or Joints.before(block)
        self._joints = Joints.after(block)
        self._add_meetings(self._teeth.meet(block), bounds)
        force = self._forces.take(samples) + tone_forces(block, before, bounds)
        heard = oaconvolve(force.astype(np.float32), self._filter[None], axes=1)
        self._heard.add(slice(None), 0, heard)
        apart = distance(block.trunk_pos, microphone)
        return self._heard.take(samples) / spread(apart, bounds)

    def _add_meetings(self, met: Meeting, bounds: NDArray) -> None:
        """Add the pulses of teeth that meet, as means over the sample intervals."""
        offsets = bounds[met.step] - bounds[0]
        for joint in range(3):  # of each leg, which have their own duration
            duration = float(pulse_duration(np.array([joint]))[0])
            count = math.ceil(duration * self._sample_rate) + 1
            share = np.clip(np.arange(count + 1) / (duration * self._sample_rate), 0.0, 1.0)
            pulse = np.diff(0.5 - 0.5 * np.cos(np.pi * share)) * self._sample_rate
            own = met.joint % 3 == joint
            self._forces.add_all(met.robot[own], offsets[own], met.force[own, None] * pulse)


class DriveExposure:
    """What `DriveSound` comes to, from energies."""

    def __init__(self, num_robots: int, sample_rate: int, transmissibility: float) -> None:
        """Tabulate the filter.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            transmissibility: Share of a force that comes to the shell.
        """
        shell = shell_response(sample_rate)
        self._frequency = shell.frequency.copy()
        self._frequency[0] = 0.0
        weight = 10.0 ** (a_weighting_db(shell.frequency) / 10.0)
        self._heard = weight * transmissibility**2 * shell.squares[0]
        self._heard[0] = 0.0
        """A-weighted p^2 over F^2 at 1 m by frequency, Pa^2 / N^2."""
        self._pulses = np.array([self._pulse(joint) for joint in range(3)])
        self._teeth = Teeth(num_robots)

    def squares(self, block: ContactBlock) -> NDArray[np.float64]:
        """Return the A-weighted mean square pressure at 1 m, Pa^2. Shape: (steps, robots)."""
        met = self._teeth.meet(block)
        exposure = np.square(met.force) * self._pulses[met.joint % 3]
        flat = met.step * block.num_robots + met.robot
        size = block.steps * block.num_robots
        total = np.bincount(flat, weights=exposure / block.timestep, minlength=size)
        total = total.astype(np.float64).reshape(block.steps, block.num_robots)  # of none: integers
        for periods, uneven in TONES:
            frequency = np.abs(block.joint_vel) * periods / (2.0 * np.pi)
            force = uneven / LEVER * block.joint_torque
            # Below the table there is nothing to hear.
            total += (0.5 * np.square(force) * self._heard_at(frequency)).sum(axis=2)
        return total

    def _heard_at(self, frequency: NDArray) -> NDArray[np.float64]:
        """Return A-weighted p^2 over F^2 at 1 m, Pa^2 / N^2. Any shape.

        The table is even, and is read without a search.
        """
        step = self._frequency[1]
        # No number, as of somebody else's robot, is beyond the table.
        place = np.fmin(frequency / step, len(self._heard) - 1.0)
        index = np.minimum(place.astype(np.int64), len(self._heard) - 2)
        low = self._heard[index]
        return low + (place - index) * (self._heard[index + 1] - low)

    def _pulse(self, joint: int) -> float:
        """Return the exposure of a pulse of 1 N s at 1 m, Pa^2 s."""
        cycles = self._frequency * pulse_duration(np.array([joint]))[0]
        # The transform of half a sine of unit integral; at half a period both parts vanish.
        near = np.abs(1.0 - 4.0 * cycles**2) < 1e-6
        shape = np.cos(np.pi * cycles) / np.where(near, 1.0, 1.0 - 4.0 * cycles**2)
        shape = np.where(near, np.pi / 4.0, shape)
        width = self._frequency[1] - self._frequency[0]
        return float(2.0 * width * (np.square(shape) * self._heard).sum())
