"""A walk that can be steered: robots, what drives them, and what is measured, step by step.

Everything that shows a walk (text, window, video) advances a `Session`. Trials with fixed commands
are `mute.evaluation`'s.
"""

from __future__ import annotations

from mute.acoustics.live_listener import LiveListener
from mute.controllers import Controller
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.gait import Gait, GaitMeter

__all__ = ["Session"]


class Session:
    """Robots on one common command, which may change at any time."""

    def __init__(
        self,
        env: QuadrupedEnv,
        controller: Controller,
        command: Command,
        settle_time: float = 1.0,
        listener: LiveListener | None = None,
    ) -> None:
        """Begin an episode of all robots.

        Args:
            env: The robots, for as many as the controller drives.
            controller: What drives them.
            command: What they are asked to do at first.
            settle_time: Time after the start of an episode that the summary leaves out, s.
            listener: Hears every step; it is entered and left by whoever walks.
        """
        self.env = env
        self.controller = controller
        self.listener = listener
        self._command = command
        self._settle_time = settle_time
        self.restart()

    @property
    def command(self) -> Command:
        """What all robots are asked to do."""
        return self._command

    @property
    def seconds(self) -> float:
        """Time walked since the start, s."""
        return self.steps * self.env.step_dt

    def set_command(self, command: Command) -> None:
        """Ask all robots for something else, from the next step on."""
        self._command = command
        self.env.set_command(command.tensor())

    def restart(self) -> None:
        """Begin anew: robots, figures and time."""
        if self.listener is not None:
            self.listener.restart()
        self.env.reset()
        self.env.set_command(self._command.tensor())
        self.controller.reset()
        self.steps = 0
        """Control steps since the start."""
        self._meter = GaitMeter(self.env, self._settle_time)
        self._recent = GaitMeter(self.env, settle_time=0.0)

    def step(self) -> None:
        """Walk one control step; a robot that falls starts again with the same command."""
        env = self.env
        command = env.commands.command.clone()
        _, _, dones, _ = env.step(self.controller.act(env.get_observations()))
        self.steps += 1
        if self.listener is not None:
            self.listener.listen()
        for meter in (self._meter, self._recent):
            meter.update(command, dones)
        if bool(dones.any()):
            self.controller.reset(dones)
            env.set_command(self._command.tensor())

    def gait(self) -> Gait:
        """Return the figures since the start."""
        return self._meter.gait()

    def recent_gait(self) -> Gait:
        """Return the figures since this was last asked."""
        gait = self._recent.gait()
        self._recent = GaitMeter(self.env, settle_time=0.0)
        return gait
