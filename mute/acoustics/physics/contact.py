"""A blow: how long two bodies touch, with what force, and what is left of the energy.

The bodies press on each other by a power law with the damping of Hunt and Crossley (Journal of
Applied Mechanics 42, 440, 1975), d deep and closing at d':

    F = k d^n (1 + u d' / v)

n = 3/2 is Hertz' contact of a sphere with a plane, k = 4/3 E* sqrt(R), with 1/E* the sum of
(1 - nu^2) / E of both (Johnson, Contact Mechanics, 1985, chapter 4). v is the speed of the blow:
with it in the damping the restitution is the material's, at every speed, as that of rubber nearly
is. In the phase plane d' dd'/dd the law integrates to

    ln((1 + u) / (1 - e u)) = u (1 + e),

which ties the damping u to the restitution e on a rigid ground. A ground that gives way does so as
a plate: its speed is the mobility Y times the force. In units of the depth
D = ((n + 1) m v^2 / 2 k)^(1 / (n + 1)), the time D / v and the momentum m v, nothing but u, n and
y = Y m v / D is left, so that one table over y holds all blows on a ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import gamma, log, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import root_scalar

__all__ = [
    "YIELDS",
    "Blow",
    "BlowTable",
    "ContactLaw",
    "blow_table",
    "hertz_duration",
    "hertz_stiffness",
    "series_modulus",
]

_STEPS = 3072
"""Steps of an integration, as many for each blow. Between them the force is constant: with a third
of them what a soft blow has left at high frequencies is 4 dB too much."""
_LONGEST = (8.0, 10.0)
"""Time that is integrated, in units of D / v: so much, and so much more times y. A rigid ground
holds a blow for 3 (e = 1) or less; one that gives way, for some times y."""
_FAINT = 1e-4
"""Share of its peak at which a force is over."""
_SHAPE_POINTS = 1025
"""Points at which the impulse that has passed is kept."""
YIELDS = np.concatenate(([0.0], np.geomspace(1e-2, 10.0, 31)))
"""Relative mobilities y of the table, from a rigid ground on; beyond its end, its end."""


def series_modulus(*bodies: tuple[float, float]) -> float:
    """Return E* of two bodies that press on each other, Pa.

    Args:
        bodies: Young's modulus, Pa, and Poisson's ratio of each.
    """
    return 1.0 / sum((1.0 - poisson**2) / modulus for modulus, poisson in bodies)


def hertz_stiffness(radius: float, modulus: float) -> float:
    """Return k of a sphere on a plane, N / m^1.5.

    Args:
        radius: Of the sphere, m.
        modulus: E*, Pa.
    """
    return 4.0 / 3.0 * modulus * sqrt(radius)


def hertz_duration(mass: float, speed: float, stiffness: float, exponent: float = 1.5) -> float:
    """Return how long a blow without loss on a rigid ground lasts, s.

    For n = 3/2 it is Hertz' 2.943 D / v.

    Args:
        mass: kg.
        speed: m/s.
        stiffness: k, N / m^n.
        exponent: n.
    """
    depth = ((exponent + 1.0) * mass * speed**2 / (2.0 * stiffness)) ** (1.0 / (exponent + 1.0))
    share = 1.0 / (exponent + 1.0)
    return 2.0 * depth / speed * sqrt(pi) * share * gamma(share) / gamma(share + 0.5)


@dataclass(frozen=True)
class ContactLaw:
    """How a body presses on a ground."""

    stiffness: float
    """k, N / m^n."""
    exponent: float
    """n."""
    restitution: float
    """e on a rigid ground, above 0 and at most 1."""
    mobility: float = 0.0
    """Y of the ground, m / (N s): how fast it gives way."""

    @cached_property
    def damping(self) -> float:
        """u, the damping that leaves the restitution."""
        return _damping(self.restitution)

    def depth(self, mass: ArrayLike, speed: ArrayLike) -> NDArray[np.float64]:
        """Return D, the depth of a blow without loss on a rigid ground, m. Shapes broadcast."""
        mass, speed = np.asarray(mass, dtype=np.float64), np.asarray(speed, dtype=np.float64)
        share = 1.0 / (self.exponent + 1.0)
        return ((self.exponent + 1.0) * mass * speed**2 / (2.0 * self.stiffness)) ** share

    def blow(self, mass: ArrayLike, speed: ArrayLike) -> Blow:
        """Return what blows are like.

        Args:
            mass: kg.
            speed: Above 0, m/s. Shapes broadcast.
        """
        mass, speed = np.broadcast_arrays(
            np.asarray(mass, dtype=np.float64), np.asarray(speed, dtype=np.float64)
        )
        depth = self.depth(mass, speed)
        give = self.mobility * mass * speed / depth
        table = blow_table(self.exponent, self.damping)
        return Blow(
            duration=np.interp(give, YIELDS, table.duration) * depth / speed,
            impulse=np.interp(give, YIELDS, table.impulse) * mass * speed,
            lost=np.interp(give, YIELDS, table.lost) * 0.5 * mass * speed**2,
            give=give,
        )

    def passed(self, give: NDArray, elapsed: NDArray) -> NDArray[np.float64]:
        """Return the share of the impulse that has passed.

        Args:
            give: `Blow.give` of blows. Shape: (n,).
            elapsed: Time since each began over its duration; below 0 it has not yet begun. Shape:
                (n, times).
        """
        shapes = self._shapes(give)
        position = np.clip(elapsed, 0.0, 1.0) * (_SHAPE_POINTS - 1)
        index = np.minimum(position.astype(np.int64), _SHAPE_POINTS - 2)
        share = position - index
        low = np.take_along_axis(shapes, index, axis=1)
        return low + share * (np.take_along_axis(shapes, index + 1, axis=1) - low)

    def spectrum(self, give: NDArray, cycles: NDArray) -> NDArray[np.complex128]:
        """Return the Fourier transform of pulses of unit impulse and duration, 1 at 0.

        Args:
            give: `Blow.give` of blows. Shape: (n,).
            cycles: Frequency times the duration of each. Shape: (n, frequencies).
        """
        count = _SHAPE_POINTS - 1
        middle = (np.arange(count) + 0.5) / count
        # The force is constant between points: each step adds its impulse, blurred by its width.
        steps = np.diff(self._shapes(give), axis=1)
        turns = np.exp(-2j * pi * cycles[:, :, None] * middle)
        return np.einsum("nfc,nc->nf", turns, steps) * np.sinc(cycles / count)

    def _shapes(self, give: NDArray) -> NDArray[np.float64]:
        """Return the impulse that has passed at equal steps of each blow. Shape: (n, points)."""
        table = blow_table(self.exponent, self.damping)
        index = np.clip(np.searchsorted(YIELDS, give, side="right") - 1, 0, len(YIELDS) - 2)
        share = (give - YIELDS[index]) / (YIELDS[index + 1] - YIELDS[index])
        share = np.clip(share, 0.0, 1.0)[:, None]
        return (1.0 - share) * table.passed[index] + share * table.passed[index + 1]


@dataclass(frozen=True)
class Blow:
    """What blows are like. Each array has one value a blow."""

    duration: NDArray[np.float64]
    """Time of contact, s."""
    impulse: NDArray[np.float64]
    """Integral of the force, N s."""
    lost: NDArray[np.float64]
    """Energy that the body has lost, to heat and to the ground, J."""
    give: NDArray[np.float64]
    """y, by how much the ground gave way; it sets the shape of the force."""


@dataclass(frozen=True)
class BlowTable:
    """Blows of one law on all grounds of `YIELDS`, in units of D, v and m. Shape: (yields, ...)."""

    duration: NDArray[np.float64]
    """Time of contact, D / v."""
    impulse: NDArray[np.float64]
    """Integral of the force, m v."""
    lost: NDArray[np.float64]
    """Energy that is lost, m v^2 / 2."""
    passed: NDArray[np.float64]
    """Share of the impulse that has passed at equal steps of the contact."""


def _damping(restitution: float) -> float:
    """Return u of a restitution e."""
    if restitution > 0.999:  # the third order of u, where the logarithm cancels itself out
        return 1.5 * (1.0 - restitution**2) / (1.0 + restitution**3)

    def gap(u: float) -> float:
        return log((1.0 + u) / (1.0 - restitution * u)) - u * (1.0 + restitution)

    # Both sides agree at u = 0, too: it is left out. At 1 / e the logarithm has no end.
    bracket = (0.5 * (1.0 - restitution), (1.0 - 1e-12) / restitution)
    return float(root_scalar(gap, bracket=bracket, method="brentq").root)


@lru_cache(maxsize=64)
def blow_table(exponent: float, damping: float) -> BlowTable:
    """Integrate blows on all grounds of `YIELDS` side by side, by Runge and Kutta's rule.

    Time steps are each blow's own. Where the ground gives way like a dashpot, a body sinks into it
    for ever; a blow is over once its force has fallen to `_FAINT` of its peak.
    """
    give = YIELDS
    step = (_LONGEST[0] + _LONGEST[1] * give) / _STEPS

    def force(speed: NDArray, depth: NDArray) -> NDArray:
        spring = (exponent + 1.0) / 2.0 * np.maximum(depth, 0.0) ** exponent
        closing = (1.0 + damping * speed) / (1.0 + damping * give * spring)
        return np.maximum(spring * closing, 0.0)

    def rates(state: NDArray) -> NDArray:
        pressed = force(*state)
        return np.stack((-pressed, state[0] - give * pressed))

    course = np.zeros((_STEPS + 1, 2, len(give)))
    course[0, 0] = 1.0
    for index in range(_STEPS):
        state = course[index]
        first = rates(state)
        second = rates(state + 0.5 * step * first)
        third = rates(state + 0.5 * step * second)
        fourth = rates(state + step * third)
        course[index + 1] = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    forces = force(course[:, 0], course[:, 1])
    return _summed_up(forces, course, step)


def _over(pressed: NDArray, depth: NDArray) -> float:
    """Return at which step, and how far on to the next, a blow is over: faint, or out again."""
    peak = int(pressed.argmax())
    ends = []
    for left in (pressed / pressed[peak] - _FAINT, depth):
        gone = np.flatnonzero(left[peak:] <= 0.0)
        if len(gone):
            last = peak + int(gone[0]) - 1
            ends.append(last + float(left[last] / (left[last] - left[last + 1])))
    return min(ends)


def _summed_up(forces: NDArray, course: NDArray, step: NDArray) -> BlowTable:
    """Return what blows came to, from their forces and (speeds, depths) at each step."""
    duration, left = np.empty(len(step)), np.empty(len(step))
    passed = np.empty((len(step), _SHAPE_POINTS))
    for blow, (pressed, depth) in enumerate(zip(forces.T, course[:, 1].T, strict=True)):
        over = _over(pressed, depth)
        last = int(over)
        times = np.append(np.arange(last + 1), over) * step[blow]
        until = np.append(pressed[: last + 1], np.interp(over, np.arange(len(pressed)), pressed))
        so_far = cumulative_trapezoid(until, times, initial=0.0)
        duration[blow], left[blow] = times[-1], course[last + 1, 0, blow]
        points = np.linspace(0.0, times[-1], _SHAPE_POINTS)
        passed[blow] = np.interp(points, times, so_far / so_far[-1])
    return BlowTable(duration, 1.0 - left, 1.0 - left**2, passed)
