"""What can be chosen to drive the robots in the page of `play.py --viewer web`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from mute.command_lines.policy_options import DriverArgs
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.support.errors import MuteError

if TYPE_CHECKING:
    from mute.live.panel import Choice  # loads viser

__all__ = ["misfit", "page_choices", "with_all_sensors"]


def with_all_sensors(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return an environment whose robots measure all that any controller reads."""
    observations = dataclasses.replace(cfg.observations, sensors=True)
    return dataclasses.replace(cfg, observations=observations)


def page_choices(args: DriverArgs, policies: Iterable[Path], session: Session) -> dict[str, Choice]:
    """Return what can drive a walk, by name: what does at first, and what else was named.

    The policy that ships and the model-predictive controller are among them where they fit.

    Args:
        args: What drives at first, once it is found.
        policies: Further policies: files, or `latest`.
        session: The walk.

    Raises:
        MuteError: If one of `policies` cannot be used, or was made for other robots.
    """
    from mute.live.panel import Choice

    there = session.env.cfg
    choices = {_name(args): Choice(session.controller, args.driver().quiet_factor)}
    for path in policies:
        task = args.task if str(path) == "latest" else None
        other = DriverArgs(policy=path, task=task, log_dir=args.log_dir).with_driver_found()
        driver = other.driver()
        reason = misfit(driver.cfg.env, there)
        if reason is not None:
            raise MuteError(f"--policies {other.policy} cannot drive this robot: {reason}")
        choices[_unused(other, choices)] = Choice(driver.controller(there), driver.quiet_factor)
    for other in (DriverArgs(), DriverArgs(controller="mpc")):
        driver = other.driver()
        if other.driver_name != args.driver_name and misfit(driver.cfg.env, there) is None:
            choices[_unused(other, choices)] = Choice(driver.controller(there), driver.quiet_factor)
    return choices


def misfit(wanted: QuadrupedEnvCfg, there: QuadrupedEnvCfg) -> str | None:
    """Return why what was trained on some robots cannot drive others; None if it can.

    Args:
        wanted: The robots that it was made for.
        there: Those that are to be driven.
    """
    pairs = {
        "a control step (s)": (wanted.step_dt, there.step_dt),
        "env.action_scale": (wanted.action_scale, there.action_scale),
        "env.action_clip": (wanted.action_clip, there.action_clip),
        "env.scene.stiffness": (wanted.scene.stiffness, there.scene.stiffness),
        "env.scene.damping": (wanted.scene.damping, there.scene.damping),
        "env.observations.scales": (wanted.observations.scales, there.observations.scales),
        "env.height_map": (wanted.height_map, there.height_map),
    }
    for name, (theirs, ours) in pairs.items():
        alike = abs(theirs - ours) < 1e-9 if isinstance(theirs, float) else theirs == ours
        if not alike:
            return f"it was made for robots with {name} {theirs}, these have {ours}"
    return None


def _name(args: DriverArgs) -> str:
    return args.policy.name if args.controller == "policy" else args.controller


def _unused(args: DriverArgs, taken: Iterable[str]) -> str:
    """Return a name for what drives: short, or with the directory where that is taken."""
    names = [_name(args), args.driver_name]
    names += [f"{args.driver_name} ({count})" for count in range(2, 3 + len(set(taken)))]
    return next(name for name in names if name not in taken)
