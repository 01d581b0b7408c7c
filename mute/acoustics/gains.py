"""The calibration of the sound model that ships: one gain a floor, with where it comes from.

It is fitted to levels that the paper measured. That of a recording, Pa at full scale of a real
microphone, is in `metering.calibrator`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mute.acoustics.floors import FLOORS, OWN_GAINS
from mute.support.errors import MuteError
from mute.support.resources import RESOURCES

__all__ = ["GAINS_FILE", "load_gains"]

GAINS_FILE = RESOURCES / "acoustics" / "calibration.json"
"""Made by `python -m mute.acoustics.calibration`."""


def load_gains(path: Path = GAINS_FILE) -> dict[str, float]:
    """Return the gain of each floor: the calibration's, or its own of one that was registered.

    Raises:
        MuteError: If the file is missing, broken, or lacks a floor.
    """
    try:
        floors = json.loads(path.read_text())["floors"]
        gains = {name: floors[name]["gain"] for name in FLOORS if name not in OWN_GAINS}
    except OSError as error:
        raise MuteError(f"cannot read the calibration {path}: {error.strerror}") from error
    except KeyError as error:
        raise MuteError(f"{path} is no calibration: {error} is missing") from error
    except (TypeError, ValueError, RecursionError) as error:
        raise MuteError(f"{path} is no calibration: {error}") from error
    for name, gain in gains.items():
        number = isinstance(gain, int | float) and not isinstance(gain, bool)
        if not number or not 0.0 < gain <= sys.float_info.max:
            shown = repr(gain) if len(repr(gain)) < 40 else f"{repr(gain)[:37]}..."
            raise MuteError(f"{path}: the gain of {name} must be a number > 0, got {shown}")
    gains = {name: float(gain) for name, gain in gains.items()}
    own = {name: gains[g] if isinstance(g, str) else g for name, g in OWN_GAINS.items()}
    return gains | own
