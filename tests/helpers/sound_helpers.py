"""Blocks of physics made by hand, and an A-weighting that is not the code's own."""

import numpy as np
from numpy.typing import ArrayLike

from mute.acoustics.contacts import ContactBlock, Impacts

FLOORS = ("wood", "carpet", "tile", "concrete")
FEET = np.array([[0.19, -0.13, 0.0], [0.19, 0.13, 0.0], [-0.19, -0.13, 0.0], [-0.19, 0.13, 0.0]])
RATE = 48000


def make_block(
    steps=1000,
    robots=1,
    timestep=0.001,
    landings=(),
    friction_power: ArrayLike = 0.0,
    joint_torque: ArrayLike = 0.0,
    joint_vel: ArrayLike = 0.0,
    floor=0,
):
    """Make a robot that stands at the origin; landings are (step, robot, foot, speed, mass)."""
    landings = np.array(landings, dtype=float).reshape(-1, 5)
    step, robot, foot = landings[:, :3].astype(int).T
    impacts = Impacts(
        time=step * timestep,
        robot=robot,
        foot=foot,
        speed=landings[:, 3],
        mass=landings[:, 4],
        floor=np.full(len(step), floor),
        position=FEET[foot],
    )
    per_foot = np.broadcast_to(friction_power, (steps, robots, 4))
    speed = np.broadcast_to(joint_vel, (steps, robots, 12))
    return ContactBlock(
        start=0.0,
        timestep=timestep,
        impacts=impacts,
        friction_power=per_foot,
        foot_pos=np.broadcast_to(FEET, (steps, robots, 4, 3)),
        floor=np.full((steps, robots, 4), floor),
        joint_pos=timestep * (np.cumsum(speed, axis=0) - speed[:1]),
        joint_vel=speed,
        joint_torque=np.broadcast_to(joint_torque, (steps, robots, 12)),
        trunk_pos=np.broadcast_to([0.0, 0.0, 0.3], (steps, robots, 3)),
        trunk_quat=np.broadcast_to([1.0, 0.0, 0.0, 0.0], (steps, robots, 4)),
    )


def random_walk(seconds=2.0, robots=1, seed=0, landings_per_second=10, timestep=0.001, floor=0):
    """Make robots at 0.5 m/s whose feet land at random and slide, and whose joints swing."""
    rng = np.random.default_rng(seed)
    steps = round(seconds / timestep)
    count = round(seconds * landings_per_second) * robots
    landings = np.stack(
        (
            np.sort(rng.integers(0, steps, count)),
            rng.integers(0, robots, count),
            rng.integers(0, 4, count),
            rng.uniform(0.2, 0.6, count),
            rng.uniform(0.3, 1.5, count),
        ),
        axis=1,
    )
    slides = rng.exponential(0.3, (steps, robots, 4)) * (rng.random((steps, robots, 4)) < 0.5)
    torque, speed = (_swings(rng, steps, robots, timestep, size) for size in (10.0, 4.0))
    block = make_block(steps, robots, timestep, landings, slides, torque, speed, floor)
    way = np.array([0.5 * timestep, 0.0, 0.0])  # so that no foot strikes the same place for ever
    ahead = np.arange(steps)[:, None, None] * way
    block.trunk_pos = block.trunk_pos + ahead
    block.foot_pos = block.foot_pos + ahead[:, :, None]
    block.impacts.position = block.impacts.position + landings[:, :1] * way
    return block


def _swings(rng, steps, robots, timestep, size):
    """Make what goes to and fro a few times a second, otherwise for each joint."""
    joints = (robots, 12)
    rate, phase = rng.uniform(1.0, 4.0, joints), rng.uniform(0.0, 2.0 * np.pi, joints)
    time = timestep * np.arange(steps)[:, None, None]
    return size * rng.uniform(0.4, 1.0, joints) * np.sin(2.0 * np.pi * rate * time + phase)


def a_weighted_level(pressure, rate=RATE):
    """Compute dB(A) of the mean square over the last axis, in the frequency domain."""
    f = np.fft.rfftfreq(pressure.shape[-1], 1.0 / rate)
    poles = (f**2 + 20.6**2) * (f**2 + 12194.0**2)
    poles *= np.sqrt((f**2 + 107.7**2) * (f**2 + 737.9**2))
    weight = 12194.0**2 * f**4 / poles * 10.0 ** (2.0 / 20.0)
    power = np.abs(np.fft.rfft(pressure.astype(float), axis=-1) * weight) ** 2
    mean_square = 2.0 * power.sum(axis=-1) / pressure.shape[-1] ** 2
    return 10.0 * np.log10(mean_square / 20e-6**2)


def level(pressure):
    """Compute dB of the mean square over the last axis."""
    return 10.0 * np.log10(np.mean(np.square(pressure.astype(float)), axis=-1) / 20e-6**2)
