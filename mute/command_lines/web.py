"""Write the assets of the page: python -m mute.web --out web/assets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mute.command_lines.arguments import command_line, make_directory, parse
from mute.command_lines.policy_options import PolicyArgs, check_audible, policies_that_ship
from mute.controllers import load_policy
from mute.controllers.learned import Policy
from mute.support.errors import MuteError
from mute.web.assets import write_assets
from mute.web.sound_references import write_sound_references

__all__ = ["WebArgs", "main"]

_ASSETS = Path("web/assets")
_PAGE = Path("web/package.json")


@dataclass
class WebArgs(PolicyArgs):
    """Arguments of the command line."""

    out: Path = _ASSETS
    """Directory of the page's assets, whose files are replaced."""
    also: tuple[Path, ...] = ()
    """Checkpoints of further policies for the page's list of controllers, each of a task of its
    own: baselines, say. Those that ship come after them, but of tasks that are there already."""
    reference: Path | None = None
    """Walk in Python as well, and keep in this directory what the page's tests hold it to; needs
    the extra `onnx`."""
    sound_reference: Path | None = None
    """Walk on every floor as well, and keep in this directory what the page's sound is held to."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If the policy cannot be used, a file cannot be written, or the page that it is
            for is not here.
    """
    argv = command_line() if argv is None else argv
    args = parse(WebArgs, argv, "Write what the page in web/ needs of Python.")
    if args.out == _ASSETS and not _PAGE.is_file():
        raise MuteError(
            f"--out {_ASSETS}: the page is not here ({_PAGE} is missing); it comes with the "
            "checkout, not with the package: run this in its folder, or name another directory"
        )
    args = args.with_policy_found()
    policy = _audible(args.policy)
    others = [_audible(path) for path in args.also]
    tasks = [policy.task for policy in (policy, *others)]
    if len(set(tasks)) < len(tasks):
        raise MuteError(f"--also: policies must be of different tasks, got {', '.join(tasks)}")
    others += [own for own in map(_audible, policies_that_ship()) if own.task not in tasks]
    make_directory(args.out)
    try:
        files = write_assets([policy, *others], args.out)
    except ValueError as error:
        raise MuteError(f"--policy {args.policy}: {error}") from error
    if args.reference is not None:
        make_directory(args.reference, "reference")
        try:
            from mute.web.history_reference import write_history_reference
            from mute.web.reference_walks import write_reference
        except ModuleNotFoundError as error:
            raise MuteError(f"--reference needs the package {error.name}") from error
        files += write_reference(policy, args.policy, args.reference)
        files += write_history_reference(args.reference)
    if args.sound_reference is not None:
        make_directory(args.sound_reference, "sound-reference")
        files += write_sound_references(policy, args.policy, args.sound_reference)
    for file in files:
        print(f"wrote {file}")
    return 0


def _audible(path: Path) -> Policy:
    """Return a policy that can be heard.

    Raises:
        MuteError: If it cannot be used.
    """
    policy = load_policy(path)
    check_audible(policy, str(path))
    return policy
