"""The floors: how they are built, which is all that their physics and their sound come from.

A floor has no gain and no modes of its own choosing: what a foot feels and what one hears follow
from its layers, by `physics.contact`, `physics.plate` and `physics.ringing`. Figures are from a
source, or marked as assumed. Sources:

- Hopkins, Sound Insulation (2007), table A2: density, longitudinal wave speed c_L (from which
  E = rho c_L^2 (1 - nu^2)), Poisson's ratio and internal loss of building materials.
- ISO 12354-1:2017, formula C.3: a heavy plate in a building loses m'' / (485 sqrt(f)) at its edges.
- What floats: mineral wool under a screed has 8 MN / m^3 (ISO 12354-2:2017, example of annex G), a
  foam of 2 to 3 mm under laminate 100 MN / m^3 (assumed).
- Light floors lose more than their material does, to joists, screws and underlays: 0.03 to 0.05,
  assumed, amid what is measured of timber floors.
- Carpet: improvement on a slab under the tapping machine of 5 dB at 100 Hz, 18 at 250, 31 at 500
  and 53 at 1 kHz (Foret et al., Forum Acusticum 2011). The pile's law is the one of its form,
  pressure = stiffness depth^1.5, that gives these: within 3 dB root mean square, a test says.
- Rubber foot: a sphere of 23 mm (Go1), 60 Shore A, E = 3.6 MPa by Gent (Rubber Chemistry and
  Technology 31, 896, 1958), Poisson's ratio 1/2, and half of the energy given back (a rebound
  resilience of 50 %, assumed: rubbers lie between 30 and 70 %).
- Friction: dry rubber slides on concrete at 0.7 (OpenStax, University Physics 1, table 6.1) to 0.8
  (Serway and Beichner, Physics for Scientists and Engineers, 5th edition, table 5.2); shoes on wood
  slide at 0.7 and begin to at 0.9 (OpenStax, the same table). To plan the steps of a biped, Brandao
  et al. (Humanoids 2016, arXiv 1706.08685) take 0.88 +- 0.12 on wood, 0.83 +- 0.15 on marble, 0.97
  +- 0.05 on ceramic and 0.82 +- 0.02 on carpet.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import exp, log, pi, sin, sqrt, tan
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq

from mute.acoustics.physics.contact import (
    ContactLaw,
    hertz_stiffness,
    series_modulus,
)
from mute.acoustics.physics.plate import Layer, Plate, bonded
from mute.envs.scene import FOOT_RADIUS
from mute.support.ranges import Range, check_number

__all__ = [
    "FLOORS",
    "RUBBER",
    "USUAL_LANDING",
    "Covering",
    "Floor",
    "find_floors",
    "register_floor",
]

RUBBER = (3.6e6, 0.5)
"""Young's modulus of the foot, Pa, and its Poisson's ratio."""

RUBBER_RESTITUTION = sqrt(0.5)
"""Rebound over approach speed of the rubber on what is hard."""

USUAL_LANDING = (0.5, 0.45)
"""Effective mass, kg, and speed, m/s, of a landing that stands for all, where one must."""


@dataclass(frozen=True)
class Covering:
    """A soft layer upon a floor, each spot of which gives way by itself."""

    stiffness: float
    """s of pressure = s depth^1.5, Pa / m^1.5."""
    restitution: float
    """Rebound over approach speed of a hard, flat body."""

    def under_a_sphere(self, radius: float) -> tuple[float, float]:
        """Return k and n of F = k d^n for a hard sphere: 4 pi / 5 R s and 5/2.

        The spot at the distance a of the middle is pressed a^2 / 2 R less.
        """
        return 0.8 * pi * radius * self.stiffness, 2.5

    def under_a_plate(self, area: float) -> tuple[float, float]:
        """Return k and n of F = k d^n for a hard plate, whose area is in m^2."""
        return self.stiffness * area, 1.5


@dataclass(frozen=True)
class Floor:
    """A floor as it is built."""

    name: str
    friction: float
    """Sliding friction coefficient of the rubber foot on it."""
    layers: tuple[Layer, ...]
    """Of the plate that is struck, bonded, from the top down."""
    colour: tuple[float, float, float]
    """Red, green and blue of 0 to 1, for pictures and maps."""
    size: tuple[float, float] = (4.0, 3.0)
    """Length and width of the plate, m."""
    edges: float = 0.0
    """Loss at the plate's edges at 1 Hz, see `Plate.edges`."""
    covering: Covering | None = None
    """What lies upon it."""
    underlay: float = 0.0
    """Dynamic stiffness by area of what it floats on, N / m^3; 0 if it does not."""

    @cached_property
    def plate(self) -> Plate:
        """The plate that is struck."""
        return bonded(self.layers, self.edges, self.size, self.underlay)

    @cached_property
    def contact(self) -> ContactLaw:
        """How a foot presses on it."""
        top = self.layers[0]
        modulus = series_modulus(RUBBER, (top.modulus, top.poisson))
        rubber = (hertz_stiffness(FOOT_RADIUS, modulus), 1.5)
        if self.covering is None:
            return ContactLaw(*rubber, RUBBER_RESTITUTION, self.plate.mobility)
        pile = self.covering.under_a_sphere(FOOT_RADIUS)
        stiffness, exponent, share = _in_series(rubber, pile)
        kept = share * RUBBER_RESTITUTION**2 + (1.0 - share) * self.covering.restitution**2
        return ContactLaw(stiffness, exponent, sqrt(kept), self.plate.mobility)

    @cached_property
    def solref(self) -> tuple[float, float]:
        """MuJoCo's contact reference: time constant, s, and damping ratio.

        Its spring is linear, and its ground does not give way: it has the duration and the rebound
        of one landing alone, that of 0.5 kg at 0.45 m/s. A spring and a dashpot of the ratio
        zeta = sin a that do not pull press for (pi - 2 a) / (omega cos a), and give back
        exp(-tan(a) (pi - 2 a)) of the speed, e^-2 at least (where the force of x'' + 2 zeta omega
        x' + omega^2 x = 0 comes to 0).
        """
        mass, speed = USUAL_LANDING
        blow = self.contact.blow(mass, speed)
        rebound = sqrt(max(1.0 - float(blow.lost) / (0.5 * mass * speed**2), exp(-3.9)))

        def missing(angle: float) -> float:
            return tan(angle) * (pi - 2.0 * angle) + log(rebound)

        angle = float(brentq(missing, 0.0, 0.5 * pi - 1e-6))  # pyright: ignore[reportArgumentType]
        return float(blow.duration) / (tan(angle) * (pi - 2.0 * angle)), sin(angle)


def _in_series(
    first: tuple[float, float], second: tuple[float, float]
) -> tuple[float, float, float]:
    """Return k and n of two springs F = k d^n one upon the other, and the first one's energy share.

    It is the power law that they follow best between 2 and 100 N, in logarithms.
    """
    force = np.geomspace(2.0, 100.0, 64)
    depths = [(force / k) ** (1.0 / n) for k, n in (first, second)]
    exponent, offset = np.polyfit(np.log(sum(depths)), np.log(force), 1)
    # The energy of a spring is F d / (n + 1).
    energies = [
        float((force * depth).sum()) / (n + 1.0)
        for depth, (_, n) in zip(depths, (first, second), strict=True)
    ]
    return float(np.exp(offset)), float(exponent), energies[0] / sum(energies)


def _material(
    density: float, wave_speed: float, poisson: float, loss: float, thickness: float
) -> Layer:
    """Return a layer by the speed of longitudinal waves in it, m/s."""
    modulus = density * wave_speed**2 * (1.0 - poisson**2)
    return Layer(thickness, density, modulus, poisson, loss)


_CONCRETE_EDGES = 1.0 / 485.0
"""Loss at the edges at 1 Hz over the surface mass, m^2 / kg (ISO 12354-1, C.3)."""

_CHIPBOARD = _material(760.0, 2200.0, 0.3, 0.03, 0.022)
_PARQUET = _material(710.0, 3850.0, 0.3, 0.03, 0.014)  # as birch plywood
_LAMINATE = _material(760.0, 2560.0, 0.3, 0.05, 0.007)  # as MDF; it lies on a foam
_TILE = Layer(0.009, 2400.0, 60e9, 0.2, 0.005)  # porcelain stoneware, assumed
_SCREED = _material(2000.0, 3250.0, 0.2, 0.03, 0.07)  # with what its edge strip takes, assumed
_SLAB = _material(2200.0, 3800.0, 0.2, 0.005, 0.2)

_floors: dict[str, Floor] = {
    floor.name: floor
    for floor in (
        Floor(
            name="wood",  # boards on joists
            friction=0.8,  # chosen: as in training, amid the 0.7 to 0.9 above
            layers=(_CHIPBOARD,),
            colour=(0.72, 0.53, 0.34),
        ),
        Floor(
            name="parquet",  # of several layers, on battens
            friction=0.8,
            layers=(_PARQUET,),
            colour=(0.66, 0.44, 0.26),
        ),
        Floor(
            name="laminate",  # floating on a thin foam
            friction=0.75,  # chosen: smoother than wood
            layers=(_LAMINATE,),
            underlay=1e8,
            colour=(0.78, 0.62, 0.45),
        ),
        Floor(
            name="carpet",  # tufted, on a slab
            friction=0.9,  # chosen: above the 0.82, as pile interlocks with the rubber
            layers=(_SLAB,),
            edges=_CONCRETE_EDGES * _SLAB.surface_mass,
            covering=Covering(stiffness=1.4e9, restitution=0.3),
            colour=(0.42, 0.47, 0.60),
        ),
        Floor(
            name="tile",  # porcelain, bedded on a floating screed
            friction=0.7,  # chosen: a smooth glaze, at the low end of marble above
            layers=(_TILE, _SCREED),
            underlay=8e6,
            colour=(0.85, 0.85, 0.82),
        ),
        Floor(
            name="concrete",  # a bare trowelled slab
            friction=0.75,  # middle of the 0.7 to 0.8 above
            layers=(_SLAB,),
            edges=_CONCRETE_EDGES * _SLAB.surface_mass,
            colour=(0.60, 0.60, 0.60),
        ),
    )
}

FLOORS: Mapping[str, Floor] = MappingProxyType(_floors)
"""The floors by name."""


def register_floor(floor: Floor) -> None:
    """Make a floor known by its name.

    Raises:
        ValueError: If there is such a floor already, or a figure is out of its range.
    """
    if not isinstance(floor, Floor):
        raise ValueError(f"register_floor takes a Floor, got {floor!r}")
    if floor.name in FLOORS:
        raise ValueError(f"the floor {floor.name!r} is registered already; give it another name")
    _check(floor)
    _floors[floor.name] = floor


def _check(floor: Floor) -> None:
    """Refuse a floor that cannot be."""
    if not isinstance(floor.name, str) or not re.fullmatch(r"[a-z][a-z0-9_-]*", floor.name):
        raise ValueError(
            "a floor's name must be small letters, digits, '_' and '-', a letter first, "
            f"got {floor.name!r}"
        )
    place = f"floor {floor.name}"
    if not isinstance(floor.layers, tuple) or not floor.layers:
        raise ValueError(f"{place}: layers must hold at least one Layer, got {floor.layers!r}")
    for name, length in (("size", 2), ("colour", 3)):
        value = getattr(floor, name)
        if not isinstance(value, tuple) or len(value) != length:
            raise ValueError(f"{place}: {name} must be {length} numbers, got {value!r}")
    for name, allowed in _RANGES.items():
        value = getattr(floor, name)
        for number in value if isinstance(value, tuple) else (value,):
            check_number(f"{place}: {name}", number, allowed)
    for index, layer in enumerate(floor.layers):
        if not isinstance(layer, Layer):
            raise ValueError(f"{place}: layers[{index}] must be a Layer, got {layer!r}")
        for name, value in vars(layer).items():
            check_number(f"{place}: layers[{index}].{name}", value, _LAYER_RANGES[name])
    if floor.covering is not None:
        if not isinstance(floor.covering, Covering):
            raise ValueError(f"{place}: covering must be a Covering, got {floor.covering!r}")
        for name, value in vars(floor.covering).items():
            check_number(f"{place}: covering.{name}", value, _COVERING_RANGES[name])


_POSITIVE = Range(0.0, above=True)
_RANGES = {
    "friction": Range(0.0, 10.0, above=True),
    "size": Range(0.1, 1000.0),
    "edges": Range(0.0),
    "underlay": Range(0.0),
    "colour": Range(0.0, 1.0),
}
_LAYER_RANGES = {
    "thickness": _POSITIVE,
    "density": _POSITIVE,
    "modulus": _POSITIVE,
    "poisson": Range(0.0, 0.5),
    "loss": _POSITIVE,
}
_COVERING_RANGES = {"stiffness": _POSITIVE, "restitution": Range(0.0, 1.0, above=True)}


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
