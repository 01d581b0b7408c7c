"""The sound of a walk as it goes, control step by control step, for whoever plays it.

It is the sound that a file of the walk would hold: the same `Soundscape`, whose blocks may be cut
anywhere, takes the physics of each control step as soon as it is made. So it comes one control step
late, and nothing of it is approximated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock, Impacts
from mute.acoustics.microphone import Microphone
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import LEGS

__all__ = ["LiveSound", "warm_up"]

_BLOWS = ((0.3, 0.5), (0.3, 0.002), (3.0, 0.5), (3.0, 0.002))
"""Masses and speeds of blows that take all lengths of transforms, kg and m/s."""


class LiveSound:
    """Makes the sound of the first robot of an environment, and hands it on."""

    def __init__(
        self,
        env: QuadrupedEnv,
        surface: str,
        play: Callable[[NDArray[np.float32]], None],
        sample_rate: int,
        seed: int = 0,
        microphone: Microphone | None = None,
        sources: Sequence[str] = SOURCES,
    ) -> None:
        """Begin to listen; it takes a second or two, so that no later step does.

        Args:
            env: The environment, with `scene.foot_forces`; call `follow` after each of its steps.
            surface: Name of the floor to hear.
            play: Is given each control step's sound pressure, Pa. Shape: (samples,).
            sample_rate: Hz.
            seed: Of the noise in the sound.
            microphone: Where to listen. Default: on the trunk.
            sources: What to hear, of `soundscape.SOURCES`.

        Raises:
            MuteError: If there is no calibration.
            ValueError: If floor, source or sample rate is not allowed, or the environment measures
                no forces.
        """
        self._env = env
        self._play = play
        self._recorder = Recorder(env, robots=slice(1))
        self.restart()  # a robot that is set down first does not land
        warm_up(surface, sample_rate, env.cfg.scene.timestep)
        self._soundscape = Soundscape(1, [surface], microphone, sample_rate, seed, sources)

    def follow(self) -> None:
        """Hear the control step that the environment has just made."""
        ended = self._env.episode_length_buf[:1] == 0
        if bool(ended.any()):
            self._recorder.restart(ended.numpy(), self._env.unstable.numpy()[:1])
        self._play(self._soundscape.render(self._recorder.take())[0])

    def restart(self) -> None:
        """Take note that the robot is about to be reset; the sound goes on."""
        self._recorder.restart(np.ones(1, dtype=bool))

    def close(self) -> None:
        """Stop listening, if that has not been done."""
        self._recorder.close()


def warm_up(surface: str, sample_rate: int, timestep: float) -> None:
    """Make the filters that blows on a floor need, which take up to a quarter of a second each.

    Else the first landings of a walk would be late.

    Args:
        surface: Name of the floor.
        sample_rate: Hz.
        timestep: Physics step, s.

    Raises:
        MuteError: If there is no calibration.
        ValueError: If the floor or the sample rate is not allowed.
    """
    Soundscape(1, [surface], sample_rate=sample_rate).render(_blows(timestep))


def _blows(timestep: float) -> ContactBlock:
    """Return a physics step in which a robot at rest strikes the floor in many ways."""
    mass, speed = np.array(_BLOWS).T
    whole = np.zeros(len(mass), dtype=np.int64)
    at = np.zeros((len(mass), 3))
    feet, joints, trunk = (1, 1, len(LEGS)), (1, 1, 12), (1, 1, 3)
    return ContactBlock(
        start=0.0,
        timestep=timestep,
        impacts=Impacts(np.zeros(len(mass)), whole, whole, speed, mass, whole, at),
        friction_power=np.ones(feet),
        foot_pos=np.zeros((*feet, 3)),
        floor=np.zeros(feet, dtype=np.int64),
        joint_pos=np.zeros(joints),
        joint_vel=np.zeros(joints),
        joint_torque=np.zeros(joints),
        trunk_pos=np.full(trunk, 0.3),
        trunk_quat=np.array([[[1.0, 0.0, 0.0, 0.0]]]),
    )
