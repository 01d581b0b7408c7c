"""The robot's own body, which a landing shakes through the leg: a shell that is struck, too.

One flank of the trunk stands for all of it, a plate of 0.38 m by 0.11 m as the hull has between the
hips. What sounds are many such panels, the hull's faces and the covers of hips, thighs and shanks,
of which none is like the other: they share the sound of one, but each has modes of its own, so that
no few tones are heard at every step.

The plastic is in no drawing and so assumed: ABS of 3 mm, with density, modulus, Poisson's ratio and
loss as in data sheets. Below its first mode, at some 190 Hz, such a plate is a spring and hardly
radiates; that it ends, and what is inside, is left out above. What share of a foot's force comes to
it, the transmissibility, the same at all frequencies, is the one figure of the robot that nobody
knows and that is fitted (`python -m mute.acoustics.calibration`).
"""

from __future__ import annotations

import json
from pathlib import Path

from mute.acoustics.physics.plate import Layer, bonded
from mute.support.errors import MuteError
from mute.support.resources import RESOURCES

__all__ = ["CALIBRATION_FILE", "SHELL", "SHELL_PANELS", "load_transmissibility"]

SHELL = bonded(
    [Layer(thickness=0.003, density=1050.0, modulus=2.3e9, poisson=0.35, loss=0.03)],
    size=(0.38, 0.11),
)
"""A flank of the trunk."""

SHELL_PANELS = 18
"""Six faces of the hull, and three covers of each leg."""

CALIBRATION_FILE = RESOURCES / "acoustics" / "calibration.json"
"""Made by `python -m mute.acoustics.calibration`."""


def load_transmissibility(path: Path = CALIBRATION_FILE) -> float:
    """Return the share of a foot's force that comes to the shell.

    Raises:
        MuteError: If the file is missing or broken.
    """
    try:
        value = json.loads(path.read_text())["transmissibility"]
    except OSError as error:
        raise MuteError(f"cannot read the calibration {path}: {error.strerror}") from error
    except KeyError as error:
        raise MuteError(f"{path} is no calibration: {error} is missing") from error
    except (TypeError, ValueError, RecursionError) as error:
        raise MuteError(f"{path} is no calibration: {error}") from error
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not 0.0 <= value <= 1.0:
        shown = repr(value) if len(repr(value)) < 40 else f"{repr(value)[:37]}..."
        raise MuteError(f"{path}: transmissibility must be a number in [0, 1], got {shown}")
    return float(value)
