"""A walk that can be steered: robots, what drives them, and what is measured, step by step.

Everything that shows a walk (text, window, video) advances a `Session`. Trials with fixed commands
are `mute.evaluation`'s.
"""

from __future__ import annotations

from typing import Protocol

import torch

from mute.acoustics.live_listener import LiveListener
from mute.controllers import Controller
from mute.controllers.command import Command
from mute.envs.commands import BETA
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.gait import Gait, GaitMeter
from mute.evaluation.obedience import Obedience, Verdict

__all__ = ["Follower", "Session"]


class Follower(Protocol):
    """Follows a walk, beside the listener."""

    def follow(self) -> None:
        """Take in the control step that was just made."""

    def restart(self) -> None:
        """Take note that all robots are about to begin anew."""


class Session:
    """Robots on one common command, which may change at any time."""

    def __init__(
        self,
        env: QuadrupedEnv,
        controller: Controller,
        command: Command,
        settle_time: float = 1.0,
        listener: LiveListener | None = None,
        stand_time: float = 0.0,
    ) -> None:
        """Begin an episode of all robots.

        Args:
            env: The robots, for as many as the controller drives.
            controller: What drives them.
            command: What they are asked to do at first.
            settle_time: Time after the start of an episode that the summary leaves out, s.
            listener: Hears every step; it is entered and left by whoever walks.
            stand_time: Time at the start of each episode for which a robot is asked to stand
                before it gets the command, s.
        """
        self.env = env
        self.controller = controller
        self.listener = listener
        self.followers: list[Follower] = []
        """Further ones who are told of every step, in the order in which they came."""
        self._command = command
        self._going = command
        self._settle_time = settle_time
        self._stand_steps = round(stand_time / env.step_dt)
        self.restart()

    @property
    def command(self) -> Command:
        """What all robots are asked to do, once they have stood."""
        return self._command

    @property
    def seconds(self) -> float:
        """Time walked since the start, s."""
        return self.steps * self.env.step_dt

    @property
    def figures_from(self) -> float:
        """Time at which the figures began, s: the start, or the last change of what drives."""
        return self._begun * self.env.step_dt

    def set_command(self, command: Command) -> None:
        """Ask all robots for something else, from the next step on."""
        self._command = command
        self._ask()

    def stop_or_go(self) -> None:
        """Ask all robots to stand or, if that is what they were asked, to go on as before."""
        now = self._command
        if now.stands:
            going = self._going
            self.set_command(Command(going.vx, going.vy, going.wz, now.beta))
        else:
            self._going = now
            self.set_command(Command(0.0, 0.0, 0.0, now.beta))

    def drive_with(self, controller: Controller) -> None:
        """Let something else drive from the next step on, without a past; figures begin anew.

        The robots go on as they are.

        Args:
            controller: Drives as many robots.
        """
        controller.reset()
        self.controller = controller
        if self.listener is not None:
            self.listener.begin_anew()
        self._begin_figures()

    def push(self, forward: float, left: float) -> None:
        """Push all robots at once.

        Args:
            forward: Change of the trunk's velocity along its heading, m/s.
            left: The same to its left, m/s.
        """
        ahead = self.env.heading
        across = torch.stack((-ahead[:, 1], ahead[:, 0]), dim=1)
        self.env.simulation.qvel[:, :2] += forward * ahead + left * across

    def restart(self) -> None:
        """Begin anew: robots, figures and time."""
        if self.listener is not None:
            self.listener.restart()
        for follower in self.followers:
            follower.restart()
        self.env.reset()
        self._ask()
        self.controller.reset()
        self.steps = 0
        """Control steps since the start."""
        self._begin_figures()

    def step(self) -> None:
        """Walk one control step; a robot that falls starts again with the same command."""
        env = self.env
        if self._stand_steps and bool((env.episode_length_buf == self._stand_steps).any()):
            self._ask()
        command = env.commands.command.clone()
        _, _, dones, _ = env.step(self.controller.act(env.get_observations()))
        self.steps += 1
        if self.listener is not None:
            self.listener.listen()
        for follower in self.followers:
            follower.follow()
        for meter in (self._meter, self._recent, self._obedience):
            meter.update(command, dones)
        if bool(dones.any()):
            self.controller.reset(dones)
            self._ask()

    def gait(self) -> Gait:
        """Return the figures since `figures_from`."""
        return self._meter.gait()

    def verdict(self) -> Verdict:
        """Return how many robots did what they were asked since the start, or the last driver's."""
        return self._obedience.verdict()

    def recent_gait(self) -> Gait:
        """Return the figures since this was last asked, or since `figures_from`."""
        gait = self._recent.gait()
        self._recent = GaitMeter(self.env, settle_time=0.0)
        return gait

    def _begin_figures(self) -> None:
        self._begun = self.steps
        self._meter = GaitMeter(self.env, self._settle_time)
        self._recent = GaitMeter(self.env, settle_time=0.0)
        self._obedience = Obedience(self.env)

    def _ask(self) -> None:
        """Give every robot the command, but for those that are to stand first."""
        command = self._command.tensor().repeat(self.env.num_envs, 1)
        standing = self.env.episode_length_buf < self._stand_steps
        command[standing, :BETA] = 0.0
        self.env.set_command(command)
