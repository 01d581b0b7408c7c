"""Four feet of known mass fall from known heights: what is recorded is school physics."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest

from mute.acoustics.contacts import Impacts
from mute.acoustics.recorder import Recorder
from mute.envs.batch_simulation import BatchSimulation
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import FOOT_RADIUS, LEGS

GRAVITY = 9.81
TIMESTEP = 0.001
MASSES = np.array([0.3, 0.5, 0.9, 2.0])
HEIGHTS = np.array([[0.02, 0.05, 0.1, 0.3], [0.2, 0.15, 0.07, 0.03]])
"""Of each robot's feet above the floor, m."""

PLACES = np.array([[0.2, -0.1], [0.2, 0.1], [-0.2, -0.1], [-0.2, 0.1]])

# A trunk that hovers, and feet that know nothing of it nor of each other.
_MODEL = """
<mujoco>
  <option timestep="{timestep}" gravity="0 0 -{gravity}" integrator="implicitfast" cone="elliptic"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1" contype="1" conaffinity="0"/>
    <body name="trunk" pos="0 0 1" gravcomp="1">
      <freejoint/>
      <geom size="0.05" mass="5" contype="0" conaffinity="0"/>
    </body>
    {feet}
  </worldbody>
  <actuator>{motors}</actuator>
  <sensor>{sensors}</sensor>
</mujoco>
"""
_FOOT = """
<body pos="{x} {y} {radius}">
  <joint name="{leg}" type="slide" axis="0 0 1"/>
  <geom name="{leg}_foot" size="{radius}" mass="{mass}" contype="0" conaffinity="1"/>
  <site name="{leg}_foot"/>
</body>
"""
_SENSORS = {
    "pos": '<framepos name="{leg}_foot_pos" objtype="site" objname="{leg}_foot"/>',
    "vel": '<framelinvel name="{leg}_foot_vel" objtype="site" objname="{leg}_foot"/>',
    "angvel": '<frameangvel name="{leg}_foot_angvel" objtype="site" objname="{leg}_foot"/>',
    "contact": '<contact name="{leg}_foot_contact" geom1="{leg}_foot" data="found"/>',
    "force": '<contact name="{leg}_foot_force" geom1="{leg}_foot" data="force" reduce="netforce"/>',
}


def _make_model() -> mujoco.MjModel:
    feet = (
        _FOOT.format(leg=leg, mass=mass, x=x, y=y, radius=FOOT_RADIUS)
        for leg, mass, (x, y) in zip(LEGS, MASSES, PLACES, strict=True)
    )
    motors = (f'<motor joint="{leg}"/>' for leg in LEGS)
    sensors = (line.format(leg=leg) for line in _SENSORS.values() for leg in LEGS)
    return mujoco.MjModel.from_xml_string(
        _MODEL.format(
            timestep=TIMESTEP,
            gravity=GRAVITY,
            feet="".join(feet),
            motors="".join(motors),
            sensors="".join(sensors),
        )
    )


@pytest.fixture(scope="module")
def impacts() -> Impacts:
    """What is recorded while the feet of two robots fall and come to rest."""
    model = _make_model()
    simulation = BatchSimulation(model, len(HEIGHTS), num_threads=1)
    scene = SimpleNamespace(foot_forces=True, timestep=TIMESTEP)
    cfg = SimpleNamespace(scene=scene)
    env = SimpleNamespace(cfg=cfg, model=model, simulation=simulation, physics_listeners=[])
    simulation.qpos[:, 7:] = simulation.qpos.new_tensor(HEIGHTS)
    simulation.forward()
    # Floor 1 lies under the front feet, floor 0 under the others.
    recorder = Recorder(cast(QuadrupedEnv, env), lambda xy: (xy[..., 0] > 0.0).astype(np.int8))
    for _ in range(400):
        simulation.step()
        env.physics_listeners[0]()
    return recorder.take().impacts


def test_each_foot_lands_once(impacts):
    assert len(impacts) == HEIGHTS.size
    assert set(zip(impacts.robot.tolist(), impacts.foot.tolist(), strict=True)) == {
        (robot, foot) for robot in range(2) for foot in range(4)
    }


def test_it_lands_at_the_speed_and_time_of_free_fall(impacts):
    height = HEIGHTS[impacts.robot, impacts.foot]
    # Contact is found at whole steps, so both are known to half a step.
    half = 0.5 * TIMESTEP * 1.01
    np.testing.assert_allclose(
        impacts.speed, np.sqrt(2.0 * GRAVITY * height), rtol=0.0, atol=GRAVITY * half
    )
    np.testing.assert_allclose(impacts.time, np.sqrt(2.0 * height / GRAVITY), rtol=0.0, atol=half)


def test_it_lands_with_its_own_mass(impacts):
    np.testing.assert_allclose(impacts.mass, MASSES[impacts.foot], rtol=1e-9)


def test_it_lands_where_it_hung_and_on_the_floor_that_is_there(impacts):
    np.testing.assert_array_equal(impacts.floor, np.array([1, 1, 0, 0])[impacts.foot])
    np.testing.assert_allclose(impacts.position[:, :2], PLACES[impacts.foot], atol=1e-6)
    # It is found within a step of the touch.
    deepest = TIMESTEP * impacts.speed
    assert np.all(impacts.position[:, 2] <= 1e-6)
    assert np.all(impacts.position[:, 2] >= -deepest - 1e-6)
