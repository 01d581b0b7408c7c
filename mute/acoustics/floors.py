"""The floors: what a foot feels of them, and how they sound.

Each figure carries its source, or is marked as chosen. Chosen figures set the character of a floor
(a carpet is soft and damped, a board rings low, a tile is hard and bright); the level is set by
calibration with one gain a floor, and is therefore not a claim of this table. Sources:

- friction: dry rubber slides on concrete at 0.7 (OpenStax, University Physics 1, table 6.1) to 0.8
  (Serway and Beichner, Physics for Scientists and Engineers, 5th edition, table 5.2); shoes on wood
  slide at 0.7 and begin to at 0.9 (OpenStax, the same table). To plan the steps of a biped, Brandao
  et al. (Humanoids 2016, arXiv 1706.08685) take 0.88 +- 0.12 on wood, 0.83 +- 0.15 on marble, 0.97
  +- 0.05 on ceramic and 0.82 +- 0.02 on carpet. Policies are trained around 0.8.
- stiffness of the foot: Hertz' contact of a sphere with a plane, F = 4/3 E* sqrt(R) d^(3/2), of
  radius R = 23 mm (Go1) and a rubber of 60 Shore A, E = 3.6 MPa by Gent (Rubber Chemistry and
  Technology 31, 896, 1958), Poisson's ratio 1/2, E* = 4.8 MPa: between 45 kN/m (secant) and 68 kN/m
  (tangent) at 100 N.
- decay: constant internal friction eta, d = pi f eta and T60 = ln(1000) / d (Wildes and Richards,
  in Natural Computation, MIT Press 1988; Klatzky, Pai and Krotkov, Presence 9(4), 2000, on which
  materials are heard by). Eta of the materials: cast concrete 0.005 (an estimate), screed 0.01,
  birch plywood 0.016 (Hopkins, Sound Insulation, 2007, table A2). What is built in loses more: eta
  + m' / (485 sqrt(f)) in a test stand (ISO 12354-1:2017, formula C.3), so that a slab of 200 mm
  with m' = 440 kg/m^2 has 0.06 at 300 Hz and 0.02 at 3 kHz.
- restitution: chosen low, as a leg gives way, and lower on what is soft.

What the numbers do in sound is the work of `impacts` and `scuffing`; putting friction and `solref`
into a model is that of the environments.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import log, pi
from types import MappingProxyType

from mute.support.ranges import Range, check_number

__all__ = [
    "FLOORS",
    "FOOT_STIFFNESS",
    "OWN_GAINS",
    "Floor",
    "Mode",
    "find_floors",
    "register_floor",
]

FOOT_STIFFNESS = 6e4
"""Linear stiffness of the rubber foot, N/m (see above: Hertz, linearised)."""


@dataclass(frozen=True)
class Mode:
    """One damped mode of a floor, as it is heard."""

    frequency: float
    """Hz."""
    decay_time: float
    """Time to fall by 60 dB, T60, s."""
    gain: float
    """Amplitude a of its response to an impulse of 1 N s, a exp(-d t) (cos w t - d/w sin w t), as
    pressure times distance: Pa m / (N s)."""


@dataclass(frozen=True)
class Floor:
    """A floor's physics and its sound."""

    name: str
    friction: float
    """Sliding friction coefficient of the rubber foot on it."""
    solref: tuple[float, float]
    """MuJoCo's contact reference: time constant, s, and damping ratio."""
    stiffness: float
    """Local stiffness under a foot, N/m."""
    restitution: float
    """Ratio e of rebound to approach speed of a foot."""
    modes: tuple[Mode, ...]
    """The modes that radiate, lowest first."""
    scuff_band: tuple[float, float]
    """Lower and upper 3 dB edge of the noise of a sliding foot, Hz."""
    scuff_efficiency: float
    """Radiated sound power over friction power."""
    colour: tuple[float, float, float]
    """Red, green and blue of 0 to 1, for pictures and maps."""

    @property
    def contact_stiffness(self) -> float:
        """Stiffness of foot and floor in series, N/m."""
        return 1.0 / (1.0 / FOOT_STIFFNESS + 1.0 / self.stiffness)


def _modes(loss_factor: float, scale: float, *modes: tuple[float, float]) -> tuple[Mode, ...]:
    """Return modes of one internal friction, from their frequencies and relative weights.

    Gains rise with the square of the frequency, by which a contact's spectrum falls, so that the
    weights are what one hears of each mode.
    """
    return tuple(
        Mode(
            frequency,
            log(1e3) / (pi * frequency * loss_factor),
            scale * weight * (frequency / 1e3) ** 2,
        )
        for frequency, weight in modes
    )


_floors: dict[str, Floor] = {
    floor.name: floor
    for floor in (
        Floor(
            name="wood",  # boards or parquet on joists
            friction=0.8,  # chosen: as in training, amid the 0.7 to 0.9 above
            solref=(0.015, 1.0),  # chosen: somewhat harder than the 0.02 s of training
            stiffness=1e6,  # chosen: a board between two joists bends
            restitution=0.40,  # chosen
            # Chosen: a low, dense bank that rings ("hollow"); eta 0.06, chosen: four times that of
            # plywood, as boards rub on each other.
            modes=_modes(
                0.06,
                160.0,
                (92.0, 1.0),
                (151.0, 1.0),
                (243.0, 1.0),
                (367.0, 1.0),
                (548.0, 0.8),
                (821.0, 0.6),
                (1240.0, 0.4),
                (1930.0, 0.25),
            ),
            scuff_band=(250.0, 2000.0),  # chosen
            scuff_efficiency=5e-7,  # chosen
            colour=(0.72, 0.53, 0.34),
        ),
        Floor(
            name="carpet",  # tufted carpet with its backing, on a slab
            friction=0.9,  # chosen: above the 0.82, as pile interlocks with the rubber
            solref=(0.025, 1.0),  # chosen: softer than training
            # Chosen: softer than the foot. With the 0.38 to 0.67 kg of a landing foot a contact
            # takes 15 to 19 ms here, and 8 to 11 ms on the hard floors.
            stiffness=2.5e4,
            restitution=0.37,  # chosen
            # Chosen: three dull thuds, gone after a few periods; eta 0.4, chosen.
            modes=_modes(0.4, 1600.0, (85.0, 1.0), (190.0, 1.0), (410.0, 0.8)),
            scuff_band=(400.0, 4000.0),  # chosen: pile brushing
            scuff_efficiency=3e-7,  # chosen
            colour=(0.42, 0.47, 0.60),
        ),
        Floor(
            name="tile",  # porcelain tiles bedded on screed
            friction=0.7,  # chosen: a smooth glaze, at the low end of marble above
            solref=(0.010, 1.0),  # chosen: hard
            stiffness=2e7,  # chosen: much harder than the foot
            restitution=0.45,  # chosen
            # Chosen: bright, with a clack of a tenth of a second; eta 0.025, chosen within the 0.02
            # to 0.06 of a slab above.
            modes=_modes(
                0.025,
                100.0,
                (430.0, 0.4),
                (712.0, 0.6),
                (1090.0, 1.0),
                (1660.0, 1.0),
                (2410.0, 1.0),
                (3380.0, 0.8),
                (4720.0, 0.6),
            ),
            scuff_band=(1000.0, 6000.0),  # chosen: squeak and hiss
            scuff_efficiency=7e-7,  # chosen
            colour=(0.85, 0.85, 0.82),
        ),
        Floor(
            name="concrete",  # a bare trowelled slab
            friction=0.75,  # middle of the 0.7 to 0.8 above
            solref=(0.008, 1.0),  # chosen: the hardest
            stiffness=1e8,  # chosen: rigid beside the foot
            restitution=0.45,  # chosen
            # Chosen: bright too, but a thick slab has its modes elsewhere and loses more into what
            # it lies on; eta 0.05, chosen within the 0.02 to 0.06 above.
            modes=_modes(
                0.05,
                155.0,
                (285.0, 0.6),
                (590.0, 1.0),
                (940.0, 1.0),
                (1420.0, 0.8),
                (2050.0, 0.6),
                (2980.0, 0.4),
            ),
            scuff_band=(600.0, 5000.0),  # chosen: grit
            scuff_efficiency=8e-7,  # chosen
            colour=(0.60, 0.60, 0.60),
        ),
    )
}
_own_gains: dict[str, float | str] = {}

FLOORS: Mapping[str, Floor] = MappingProxyType(_floors)
"""The floors by name."""

OWN_GAINS: Mapping[str, float | str] = MappingProxyType(_own_gains)
"""For each floor that was registered its gain, or the floor whose gain it has.

The others have theirs from the calibration."""


def register_floor(floor: Floor, gain: float | str) -> None:
    """Make a floor known by its name.

    Args:
        floor: The floor.
        gain: What its sound is multiplied by, as no calibration knows it; or the name of a floor
            that it has the gain of.

    Raises:
        ValueError: If there is such a floor already, or a figure is out of its range.
    """
    if not isinstance(floor, Floor):
        raise ValueError(f"register_floor takes a Floor, got {floor!r}")
    if floor.name in FLOORS:
        raise ValueError(f"the floor {floor.name!r} is registered already; give it another name")
    _check(floor)
    if isinstance(gain, str):
        find_floors([gain])
        gain = OWN_GAINS.get(gain, gain)
    else:
        check_number(f"floor {floor.name}: gain", gain, _POSITIVE)
    _floors[floor.name] = floor
    _own_gains[floor.name] = gain


def _check(floor: Floor) -> None:
    """Refuse a floor that cannot be."""
    if not isinstance(floor.name, str) or not re.fullmatch(r"[a-z][a-z0-9_-]*", floor.name):
        raise ValueError(
            "a floor's name must be small letters, digits, '_' and '-', a letter first, "
            f"got {floor.name!r}"
        )
    if not floor.modes:
        raise ValueError(f"floor {floor.name}: modes must hold at least one")
    place = f"floor {floor.name}"
    for name, length in (("solref", 2), ("scuff_band", 2), ("colour", 3)):
        value = getattr(floor, name)
        if not isinstance(value, tuple) or len(value) != length:
            raise ValueError(f"{place}: {name} must be {length} numbers, got {value!r}")
    for number, mode in enumerate(floor.modes):
        if not isinstance(mode, Mode):
            raise ValueError(f"{place}: modes[{number}] must be a Mode, got {mode!r}")
        for name, value in vars(mode).items():
            check_number(f"{place}: modes[{number}].{name}", value, _POSITIVE)
    for name, allowed in _RANGES.items():
        value = getattr(floor, name)
        for number in value if isinstance(value, tuple) else (value,):
            check_number(f"{place}: {name}", number, allowed)
    if not floor.scuff_band[0] < floor.scuff_band[1]:
        raise ValueError(f"{place}: scuff_band must rise, got {floor.scuff_band}")
    if floor.restitution == 1.0:
        raise ValueError(f"{place}: restitution must be < 1, got 1.0")


_POSITIVE = Range(0.0, above=True)
_RANGES = {
    "friction": Range(0.0, 10.0, above=True),
    "solref": Range(0.0, 10.0, above=True),
    "stiffness": _POSITIVE,
    "restitution": Range(0.0, 1.0),
    "scuff_band": _POSITIVE,
    "scuff_efficiency": _POSITIVE,
    "colour": Range(0.0, 1.0),
}


def find_floors(names: Iterable[str]) -> tuple[Floor, ...]:
    """Return the floors of these names, in their order.

    Raises:
        ValueError: If a floor is not known.
    """
    names = tuple(names)
    for name in names:
        if name not in FLOORS:
            raise ValueError(f"floor {name!r} is not known; use one of {', '.join(FLOORS)}")
    return tuple(FLOORS[name] for name in names)
