"""A plate that is struck: how it gives way, what it radiates at once, and what rings on.

Two parts, both of the mean square force F^2 in a band:

- **at once**: the near field of bending waves around the blow. Below the critical frequency a
  point force on an endless plate sounds like a monopole of the pressure
  p(t) = rho F(t - r / c) / (2 pi m'' r), with the power rho F^2 / (2 pi c m''^2) on each side
  (Cremer, Heckl and Petersson, Structure-Borne Sound, 2005; Vigran, Building Acoustics, 2008, eq.
  6.62). Stiffness and loss do not matter;
- **ringing**: the power F^2 Re(Y) that goes into bending waves, Y = 1 / (8 sqrt(B m'')) of an
  endless plate (the same), of which the share eta_rad / eta_tot is radiated on each side,
  eta_rad = rho c sigma / (omega m'').

A plate that floats on a soft underlay of the dynamic stiffness s' moves freely above
f0 = sqrt(s' / m'') / (2 pi) alone (ISO 12354-2, annex C). The underlay takes from the plate's mass,
which becomes m'' z with z = 1 - (f0 / f)^2 (1 + i eta_u): what is radiated at once is 1 / z of that
of a free plate, and Re(Y / sqrt(z)) is given to bending waves, which lose eta_u (f0 / f)^2 to the
underlay as well.

Layers that are bonded bend about one neutral plane. Radiation factors sigma are those of ISO
12354-1, annex B, for a plate in a wide wall; losses at the edges of heavy plates are its formula
C.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mute.acoustics.air import AIR_DENSITY, AIR_IMPEDANCE, SPEED_OF_SOUND

__all__ = ["UNDERLAY_LOSS", "Layer", "Plate", "bonded"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Of the integral over a plate."""
_ALL_LOST = 15.0
"""Exponent at which nothing is left of a wave's energy."""
UNDERLAY_LOSS = 0.2
"""Loss factor of what a plate floats on (assumed: foams and fibres have 0.1 to 0.3)."""


@dataclass(frozen=True)
class Layer:
    """A sheet of one material."""

    thickness: float
    """m."""
    density: float
    """kg / m^3."""
    modulus: float
    """Young's, Pa."""
    poisson: float
    """Poisson's ratio."""
    loss: float
    """Internal loss factor."""

    @property
    def surface_mass(self) -> float:
        """Kg / m^2."""
        return self.thickness * self.density

    @property
    def stretching_stiffness(self) -> float:
        """Against being stretched, by the plate's modulus E / (1 - nu^2), N / m."""
        return self.thickness * self.modulus / (1.0 - self.poisson**2)


@dataclass(frozen=True)
class Plate:
    """A thin plate, in bending."""

    surface_mass: float
    """m'', kg / m^2."""
    bending_stiffness: float
    """B, N m."""
    loss: float
    """Internal loss factor."""
    edges: float = 0.0
    """Loss at the edges, at 1 Hz: it falls with the root of the frequency."""
    size: tuple[float, float] = (4.0, 3.0)
    """Length and width, m."""
    underlay: float = 0.0
    """Dynamic stiffness by area of what it floats on, N / m^3; 0 if it does not."""

    @property
    def floating_frequency(self) -> float:
        """f0 of the plate on its underlay, Hz."""
        return sqrt(self.underlay / self.surface_mass) / (2.0 * pi)

    @property
    def first_mode(self) -> float:
        """Lowest frequency of bending waves that fit in, of a plate that rests on its edges, Hz."""
        long, wide = self.size
        speed = sqrt(self.bending_stiffness / self.surface_mass)
        return 0.5 * pi * speed * (long**-2 + wide**-2)

    def freedom(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the velocity over that without an underlay. Any shape.

        Args:
            frequency: Hz.
        """
        return 1.0 / self._mass_left(frequency)

    def _mass_left(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return z, the share of the plate's mass that its underlay leaves it. Any shape."""
        ratio = np.square(self.floating_frequency / np.asarray(frequency, dtype=np.float64))
        return 1.0 - ratio * (1.0 + 1j * UNDERLAY_LOSS)

    @property
    def area(self) -> float:
        """m^2."""
        return self.size[0] * self.size[1]

    @property
    def mobility(self) -> float:
        """Y of a point far from the edges, real at all frequencies, m / (N s)."""
        return 1.0 / (8.0 * sqrt(self.bending_stiffness * self.surface_mass))

    @property
    def critical_frequency(self) -> float:
        """At which bending waves are as fast as sound, Hz."""
        return SPEED_OF_SOUND**2 / (2.0 * pi) * sqrt(self.surface_mass / self.bending_stiffness)

    @property
    def mode_density(self) -> float:
        """Modes per hertz, the same at all frequencies."""
        return 0.5 * self.area * sqrt(self.surface_mass / self.bending_stiffness)

    def total_loss(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return eta_tot, with the edges, the underlay and the sound of both sides. Any shape.

        Args:
            frequency: Hz.
        """
        frequency = np.asarray(frequency, dtype=np.float64)
        edges = self.edges / np.sqrt(frequency)
        underlay = UNDERLAY_LOSS * np.square(self.floating_frequency / frequency)
        return self.loss + edges + underlay + 2.0 * self.radiation_loss(frequency)

    def radiation_loss(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return eta_rad of one side. Any shape.

        Args:
            frequency: Hz.
        """
        frequency = np.asarray(frequency, dtype=np.float64)
        factor = self.radiation_factor(frequency)
        return AIR_DENSITY * SPEED_OF_SOUND * factor / (2.0 * pi * frequency * self.surface_mass)

    def radiation_factor(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return sigma of bending waves that fill the plate. Any shape.

        Args:
            frequency: Hz.
        """
        frequency = np.asarray(frequency, dtype=np.float64)
        critical = self.critical_frequency
        long, wide = self.size
        first_mode = SPEED_OF_SOUND**2 / (4.0 * critical) * (long**-2 + wide**-2)
        above = 1.0 / np.sqrt(1.0 - np.minimum(critical / frequency, 1.0 - 1e-9))
        small = 4.0 * self.area * (frequency / SPEED_OF_SOUND) ** 2
        at = np.sqrt(2.0 * pi * frequency * (long + wide) / (16.0 * SPEED_OF_SOUND))
        if first_mode <= critical / 2.0:
            below = self._edges_and_corners(frequency)
            below = np.where((frequency < first_mode) & (below > small), small, below)
            factor = np.where(frequency >= critical, above, below)
        else:
            low = (frequency < critical) & (small < at)
            high = (frequency > critical) & (above < at)
            factor = np.where(low, small, np.where(high, above, at))
        return np.minimum(factor, 2.0)

    def _edges_and_corners(self, frequency: NDArray) -> NDArray:
        """Return sigma below the critical frequency, where only edges and corners radiate."""
        critical = self.critical_frequency
        # Near 1 the formula has no end; the cap of sigma is reached before.
        share = np.sqrt(np.minimum(frequency / critical, 1.0 - 1e-6))
        rest = 1.0 - share**2
        edges = (rest * np.log((1.0 + share) / (1.0 - share)) + 2.0 * share) / (
            4.0 * pi**2 * rest**1.5
        )
        corners = (
            8.0 * SPEED_OF_SOUND**2 * (1.0 - 2.0 * share**2)
            / (critical**2 * pi**4 * self.area * share * np.sqrt(rest))
        )  # fmt: skip
        corners = np.where(frequency < critical / 2.0, corners, 0.0)
        around = 2.0 * sum(self.size) / self.area * SPEED_OF_SOUND / critical
        return around * edges + corners

    def direct_pressure(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the pressure radiated at once, times distance, over the force, Pa m / N.

        rho / (2 pi m'') up to the critical frequency. Above, the near field radiates no more than
        the bending waves do; it is let go by a filter of Butterworth's of the second order.

        Args:
            frequency: Hz. Any shape.
        """
        ratio = 1j * np.asarray(frequency, dtype=np.float64) / self.critical_frequency
        low = AIR_DENSITY / (2.0 * pi * self.surface_mass) * self.freedom(frequency)
        return low / (1.0 + sqrt(2.0) * ratio + ratio**2)

    def direct_power(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the power radiated at once on one side over F^2, W / N^2. Any shape.

        Args:
            frequency: Hz.
        """
        pressure = np.abs(self.direct_pressure(frequency))
        return 2.0 * pi * np.square(pressure) / AIR_IMPEDANCE

    def ringing_power(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the power that bending waves radiate on one side over F^2, W / N^2. Any shape.

        Args:
            frequency: Hz.
        """
        # Of the two roots numpy returns that with a real part above 0: power goes in.
        given = self.mobility * (1.0 / np.sqrt(self._mass_left(frequency))).real
        return given * self.radiation_loss(frequency) / self.total_loss(frequency)

    def spread(self, frequency: ArrayLike, distance: ArrayLike) -> NDArray[np.float64]:
        """Return p^2 / (rho c) over the ringing power, above the blow at a distance, 1 / m^2.

        The energy of bending waves runs outwards at the group speed 2 omega / k and loses a = eta k
        / 2 of itself by length, so that a exp(-a s) / (2 pi s) of the power leaves the plate by
        area at s from the blow; what comes to the edges goes round the plate and leaves anywhere.
        Each spot is heard with 1 / (2 pi r^2) of its power. Far off both parts add up to that.

        Args:
            frequency: Hz.
            distance: From the blow, m. Shapes broadcast.
        """
        frequency = np.asarray(frequency, dtype=np.float64)
        distance = np.asarray(distance, dtype=np.float64)
        lost = 0.5 * self.total_loss(frequency) * self.wave_number(frequency)
        reach = sqrt(self.area / pi)
        # Of a disc, by the angle from its axis at which a ring of it is seen, as far as there is
        # anything left.
        edge = np.arctan(np.minimum(reach, _ALL_LOST / lost) / distance)
        angle = 0.5 * (1.0 + _NODES) * edge[..., None]
        along = distance[..., None] * np.tan(angle)
        near = 0.5 * edge * (_WEIGHTS * np.exp(-lost[..., None] * along)).sum(axis=-1)
        everywhere = np.log1p(np.square(reach / distance)) / (2.0 * self.area)
        return lost / (2.0 * pi * distance) * near + np.exp(-lost * reach) * everywhere

    def wave_number(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return k of bending waves, (omega^2 m'' / B)^(1/4), 1 / m. Any shape.

        Args:
            frequency: Hz.
        """
        omega = 2.0 * pi * np.asarray(frequency, dtype=np.float64)
        return np.sqrt(omega) * (self.surface_mass / self.bending_stiffness) ** 0.25

    def decay_time(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the time in which ringing falls by 60 dB, ln(10^6) / (2 pi f eta), s. Any shape.

        Args:
            frequency: Hz.
        """
        frequency = np.asarray(frequency, dtype=np.float64)
        return np.log(1e6) / (2.0 * pi * frequency * self.total_loss(frequency))


def bonded(
    layers: Sequence[Layer],
    edges: float = 0.0,
    size: tuple[float, float] = (4.0, 3.0),
    underlay: float = 0.0,
) -> Plate:
    """Return the plate that bonded layers are, from the top down.

    They bend about the plane in which nothing is stretched. Each layer's loss counts by its share
    of the stiffness.

    Args:
        layers: One at least.
        edges: See `Plate.edges`.
        size: Length and width, m.
        underlay: See `Plate.underlay`.

    Raises:
        ValueError: If there is none.
    """
    if not layers:
        raise ValueError("a plate must have one layer at least")
    stretching = np.array([layer.stretching_stiffness for layer in layers])
    thickness = np.array([layer.thickness for layer in layers])
    middle = np.cumsum(thickness) - 0.5 * thickness
    neutral = (stretching * middle).sum() / stretching.sum()
    bending = stretching * (thickness**2 / 12.0 + (middle - neutral) ** 2)
    loss = (bending * [layer.loss for layer in layers]).sum() / bending.sum()
    mass = sum(layer.surface_mass for layer in layers)
    return Plate(mass, float(bending.sum()), float(loss), edges, size, underlay)
