"""Sound that has been worked out and is yet to be heard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Pending"]


class Pending:
    """A line of coming samples for each robot, which grows as it must."""

    def __init__(self, num_robots: int) -> None:
        """Start in silence."""
        self._samples = np.zeros((num_robots, 0))

    def add(self, robots: NDArray | slice | int, offset: int, sound: NDArray) -> None:
        """Add sound.

        Args:
            robots: Whose.
            offset: Samples from the next one on, after which it begins.
            sound: Shape: (len(robots), samples), or (samples,) for one robot's index.
        """
        stop = offset + sound.shape[-1]
        self._reach(stop)
        self._samples[robots, offset:stop] += sound

    def add_all(self, robots: NDArray, offsets: NDArray, sounds: NDArray) -> None:
        """Add short sounds, of which one robot may have several.

        Args:
            robots: Whose each is. Shape: (n,).
            offsets: Samples from the next one on, after which each begins. Shape: (n,).
            sounds: Shape: (n, samples).
        """
        if not len(robots):
            return
        self._reach(int(offsets.max()) + sounds.shape[1])
        at = offsets[:, None] + np.arange(sounds.shape[1])
        np.add.at(self._samples, (robots[:, None], at), sounds)

    def take(self, samples: int) -> NDArray[np.float64]:
        """Return the next samples, and forget them. Shape: (robots, samples)."""
        self._reach(samples)
        heard = self._samples[:, :samples].copy()
        kept = self._samples.shape[1] - samples
        self._samples[:, :kept] = self._samples[:, samples:]
        self._samples[:, kept:] = 0.0
        return heard

    def _reach(self, samples: int) -> None:
        missing = samples - self._samples.shape[1]
        if missing > 0:
            self._samples = np.pad(self._samples, ((0, 0), (0, missing)))
