"""`play.py --viewer web`: a walk in a page, and what its options mean."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Sequence
from pathlib import Path

from mute.command_lines.arguments import check_option
from mute.command_lines.play_choices import page_choices
from mute.command_lines.play_figures import page_captions
from mute.command_lines.policy_options import DriverArgs
from mute.evaluation.session import Session
from mute.rendering.height_dots import HeightDots
from mute.support.errors import MuteError
from mute.support.ranges import Range

__all__ = ["DEFAULT_HOST", "DEFAULT_PORT", "check_page", "check_place", "walk_in_page"]

DEFAULT_HOST = "127.0.0.1"
"""Where the page listens: seen by this machine alone."""
DEFAULT_PORT = 8080
"""Port of the page."""

_LAST_PORT = 65535


def check_place(in_page: bool, host: str, port: int, policies: Sequence[Path]) -> None:
    """Check the options of the page.

    Args:
        in_page: Whether there is to be one.
        host: --host.
        port: --port.
        policies: --policies.

    Raises:
        MuteError: If one is out of its range, or is given without a page.
    """
    check_option("port", port, Range(1, _LAST_PORT, whole=True))
    if not host.strip():
        raise MuteError(f"--host must be a name or an address of this machine, got {host!r}")
    if in_page:
        return
    given = {
        "host": host != DEFAULT_HOST,
        "port": port != DEFAULT_PORT,
        "policies": bool(policies),
    }
    for name in (name for name, there in given.items() if there):
        raise MuteError(f"--{name} goes with --viewer web alone")


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


def walk_in_page(
    args: DriverArgs,
    policies: Sequence[Path],
    place: tuple[str, int],
    session: Session,
    num_steps: int | None,
    dots: HeightDots | None,
) -> None:
    """Serve a page to watch and steer a walk in, until the time is over or an interrupt comes.

    Args:
        args: What drives at first, once it is found.
        policies: What else can be chosen.
        place: Host and port to listen at.
        session: The walk.
        num_steps: Control steps to walk; None for no end.
        dots: Heights to draw as dots.

    Raises:
        MuteError: If a policy cannot be used, or it cannot listen there.
    """
    from mute.live.page import show_page  # viser takes a second
    from mute.live.page_server import page_address, page_server

    choices = page_choices(args, policies, session)
    host, port = place
    with session.listener or contextlib.nullcontext(), page_server(host, port) as server:
        print(f"watch and steer at {page_address(host, server.get_port())}", flush=True)
        show_page(server, session, num_steps, lambda: page_captions(session), choices, dots)
