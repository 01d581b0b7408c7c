"""What `evaluate.py paper` compares: policies by the methods that they are named for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mute.acoustics.origin import policy_origin
from mute.command_lines.policy_options import DriverArgs
from mute.command_lines.sound_options import load_audible_policy
from mute.evaluation.comparison.trainings import check_trainings
from mute.evaluation.comparison.walkers import DREAMWAQ, MPC, MUTE, Walker
from mute.support.errors import MuteError
from mute.support.provenance import place_of

__all__ = ["find_walkers", "place_of_other"]

_NAME = re.compile(r"[\w.+/() -]+")
"""Of a comparison; a comma would look like that before a quiet factor, a bar would end a cell."""


def find_walkers(
    mute: Sequence[Path], dreamwaq: Sequence[Path], others: Sequence[str], mpc: bool
) -> list[Walker]:
    """Return what is compared, from loud to quiet as the paper has it, then the others.

    Args:
        mute: MUTE's policies.
        dreamwaq: DreamWaQ's.
        others: Further ones, each `NAME=FILE`, or `FILE` that is named for its task.
        mpc: Whether the model-predictive controller is compared.

    Raises:
        MuteError: If a policy cannot be used, is not of the method that it is named for, or is no
            further training of the recipe that others of its name are of.
    """
    walkers = [_mpc()] if mpc else []
    walkers += [_learnt(DREAMWAQ, path) for path in dreamwaq]
    walkers += [_learnt(MUTE, path) for path in mute]
    _check_methods(walkers)
    walkers += [_other(word) for word in others]
    check_trainings(walkers)
    return walkers


def _mpc() -> Walker:
    mpc = DriverArgs(controller="mpc")
    origin = mpc.driver_origin()
    return Walker(MPC, mpc.driver(), origin["policy"], origin["policy_sha256"])


def _learnt(method: str | None, path: Path) -> Walker:
    policy, origin = load_audible_policy(path), policy_origin(path)
    return Walker(method or policy.task, policy, origin["policy"], origin["policy_sha256"])


def _other(word: str) -> Walker:
    """Return one of --others.

    Raises:
        MuteError: If its name is none, or that of one of the paper's methods, or it cannot be used.
    """
    name, file = _name_and_file(word)
    if name is not None and not (_NAME.fullmatch(name) and file):
        raise MuteError(
            "--others must be FILE or NAME=FILE, the name of letters, digits, spaces and . _ - + / "
            f"( ), got {word!r}"
        )
    return _checked_name(_learnt(name, Path(file)), word)


def place_of_other(word: str) -> str:
    """Return one of --others as one would give it on another machine."""
    name, file = _name_and_file(word)
    place = place_of(Path(file))
    return place if name is None else f"{name}={place}"


def _name_and_file(word: str) -> tuple[str | None, str]:
    name, named, file = word.partition("=")
    if Path(word).is_file() or not named:  # a file's own name may have an equals sign
        return None, word
    return name.strip(), file


def _checked_name(walker: Walker, word: str) -> Walker:
    if walker.method in (MPC, DREAMWAQ, MUTE):
        raise MuteError(
            f"--others must have names other than {MPC}, {DREAMWAQ} and {MUTE}, got {word!r}"
        )
    return walker


def _check_methods(walkers: Sequence[Walker]) -> None:
    """Check that policies are of the methods that they are named for.

    Raises:
        MuteError: If one of MUTE's knows no quiet factor, or one of DreamWaQ's does.
    """
    for method, option, quiet in ((MUTE, "mute", True), (DREAMWAQ, "dreamwaq", False)):
        for walker in walkers:
            if walker.method == method and walker.driver.quiet_factor != quiet:
                knows = "knows no" if quiet else "knows a"
                raise MuteError(
                    f"--{option} {walker.name} {knows} quiet factor; compare it by --others"
                )
