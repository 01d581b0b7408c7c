"""The figures of a walk as `play.py` tells them: one JSON object, a line a second, a summary."""

from __future__ import annotations

import math
from typing import Any

from mute.evaluation.gait import Gait
from mute.evaluation.obedience import Verdict
from mute.evaluation.session import Session

__all__ = ["captions", "live_captions", "page_captions", "report", "stretch", "summary"]

_REPORTED = (
    "speed",
    "velocity_error_sq",
    "landing_speed_mean",
    "landing_speed_rms",
    "apex_mean",
    "duty_factor",
    "stride_frequency",
    "power",
    "fall_rate",
    "unstable",
    "invalid_actions",
)
"""Figures of a `Gait` that --json prints."""


def report(session: Session) -> dict[str, Any]:
    """Return what --json prints; figures that were not to be had are None."""
    command, listener = session.command, session.listener
    gait = session.gait().as_dict()
    figures = {name: gait[name] for name in _REPORTED} | (listener.levels() if listener else {})
    figures["did_as_asked"] = session.verdict().share
    return {
        "beta": command.beta,
        "command": [command.vx, command.vy, command.wz],
        "num_envs": session.env.num_envs,
        "seconds": round(session.seconds, 6),
        "figures_from": round(session.figures_from, 6),
        **({"surface": listener.surface} if listener else {}),
        **{name: value if math.isfinite(value) else None for name, value in figures.items()},
    }


def captions(gait: Gait) -> dict[str, str]:
    """Return the figures to read as the robot walks, by name."""
    figures = {
        "speed": f"{gait.speed:z.2f} m/s",
        "tracking error": f"{gait.velocity_error_sq:.4f} (m/s)^2",
        "landing speed": f"{gait.landing_speed_mean:.3f} m/s",
        "apex": f"{100.0 * gait.apex_mean:.1f} cm",
        "duty factor": f"{gait.duty_factor:.2f}",
        "strides": f"{gait.stride_frequency:.2f} Hz",
    }
    return {name: _or_dash(text) for name, text in figures.items()}


def live_captions(session: Session) -> dict[str, str]:
    """Return the figures since this was last asked, and the level of now if there is an listener.

    The level is the first robot's, which is said where there are several.
    """
    figures = captions(session.recent_gait())
    if session.listener is not None:
        whose = " (first robot)" if session.env.num_envs > 1 else ""
        figures["level"] = _or_dash(f"{session.listener.level():.1f} dBA{whose}")
    return figures


def page_captions(session: Session) -> dict[str, str]:
    """Return what a page shows: `live_captions`, and the levels and mishaps since figures began."""
    figures, gait = live_captions(session), session.gait()
    if session.listener is not None:
        levels = session.listener.levels()
        for name in ("mnl", "pnl"):
            figures[name.upper()] = _or_dash(f"{levels[name]:.1f} dBA")
    figures["MNL and PNL of"] = f"{session.seconds - session.figures_from:.0f} s"
    if gait.fall_rate > 0.0:
        figures["fell"] = f"{100.0 * gait.fall_rate:.0f} % of the robots"
    return figures | _mishaps(gait)


def stretch(session: Session) -> str:
    """Return in words the time that the figures are of."""
    if session.figures_from == 0.0:
        return f"over {session.seconds:.1f} s"
    last = session.seconds - session.figures_from
    return f"over the last {last:.1f} of {session.seconds:.1f} s, since another driver took over"


def summary(session: Session, floor: str | None) -> dict[str, str]:
    """Return the figures of the walk, of the time that `stretch` tells, by name.

    Args:
        session: The walk.
        floor: Name of the floor that was walked on; None where it was training's, which only
            sounds as the listener's surface.
    """
    gait = session.gait()
    figures = captions(gait) | {
        "landing speed, rms": f"{gait.landing_speed_rms:.3f} m/s",
        "power": f"{gait.power:.1f} W",
        "fell": f"{100.0 * gait.fall_rate:.1f} % of the robots",
    }
    figures["did as asked"] = _told(session.verdict(), session.env.num_envs)
    figures |= _mishaps(gait)
    if session.listener is not None:
        levels = session.listener.levels()
        about = ["modelled", f"on {floor}" if floor else f"sounding as {session.listener.surface}"]
        about += ["first robot"] * (session.env.num_envs > 1)
        for name in ("mnl", "pnl"):
            figures[f"level, {name.upper()}"] = f"{levels[name]:.1f} dBA ({', '.join(about)})"
    return {name: _or_dash(text) for name, text in figures.items()}


def _mishaps(gait: Gait) -> dict[str, str]:
    """Return what went wrong beside falls, by name."""
    figures = {}
    if gait.unstable > 0:
        figures["unstable"] = f"{gait.unstable} times, and reset: the simulation blew up"
    if gait.invalid_actions > 0:
        figures["invalid actions"] = f"{gait.invalid_actions}, with NaN or infinity"
    return figures


def _told(verdict: Verdict, robots: int) -> str:
    """Return in words whether robots, of which there are so many, did what they were asked."""
    if verdict.judged == 0:
        return "too short to tell: a command needs 2.5 s"
    reasons = {
        "fell": verdict.fell,
        "went at less than 40 % of the command": verdict.too_slow,
        "went at more than 160 % of the command": verdict.too_fast,
        "did not stand still": verdict.restless,
    }
    if robots == 1:
        why = ", ".join(reason for reason, count in reasons.items() if count)
        return f"no: it {why}" if why else "yes"
    why = ", ".join(f"{count} {reason}" for reason, count in reasons.items() if count)
    return f"{verdict.obeyed} of {verdict.judged} robots" + (f": {why}" if why else "")


def _or_dash(text: str) -> str:
    return "-" if text.startswith("nan") else text
