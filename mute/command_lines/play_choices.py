"""What can be chosen to drive the robots in the page of `play.py --viewer web`."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path

from mute.command_lines.policy_options import DriverArgs
from mute.controllers import Controller, load_policy
from mute.controllers.driver import Driver
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.support.errors import MuteError

__all__ = ["check_page", "misfit", "page_choices", "with_all_sensors"]


def check_page() -> None:
    """Check that what serves the page is installed.

    Raises:
        MuteError: If it is not.
    """
    missing = [name for name in ("viser", "mjviser") if importlib.util.find_spec(name) is None]
    if missing:
        raise MuteError(
            f"--viewer web needs {' and '.join(missing)}: pip install 'mute[web]', or in a "
            "checkout pip install -e '.[web]'"
        )


def with_all_sensors(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return an environment whose robots measure all that any controller reads."""
    observations = dataclasses.replace(cfg.observations, sensors=True)
    return dataclasses.replace(cfg, observations=observations)


def page_choices(
    args: DriverArgs, policies: Sequence[Path], session: Session
) -> dict[str, Callable[[], Controller]]:
    """Return what makes each controller that can be chosen, by name: what walks comes first.

    Args:
        args: What walks.
        policies: Further policies.
        session: Whose robots are to be driven.
    """
    first = session.controller
    own = args.policy.stem if args.controller == "policy" else args.controller
    choices: dict[str, Callable[[], Controller]] = {own: lambda: first}
    for path in policies:
        name = path.stem if path.stem not in choices else str(path)
        choices[name] = lambda path=path: _fitting(load_policy(path), session)
    if args.controller == "policy":
        mpc = DriverArgs(controller="mpc")
        choices["mpc"] = lambda: _fitting(mpc.driver(), session)
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


def _fitting(driver: Driver, session: Session) -> Controller:
    """Return a controller of the session's robots.

    Raises:
        MuteError: If it was made for others.
    """
    reason = misfit(driver.cfg.env, session.env.cfg)
    if reason is not None:
        raise MuteError(reason)
    return driver.controller(session.env.cfg)
