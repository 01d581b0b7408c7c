"""A digital filter that runs over a signal block by block, as if it had been heard for ever."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["RunningFilter"]

_REST = 1e-150
"""A filter's state below this is nothing: its square is just above the slow denormal numbers."""


class RunningFilter:
    """Second-order sections for a stream of any number of channels.

    Before its first sample each channel is taken to have had that sample's value for ever, so that
    a recording with a constant offset does not begin with a bang.
    """

    def __init__(self, sections: NDArray[np.float64]) -> None:
        """Take the filter.

        Args:
            sections: As `scipy.signal.sosfilt` takes them. Shape: (sections, 6).
        """
        self._sections = sections
        self._state: NDArray[np.float64] | None = None

    def filter(self, block: NDArray) -> NDArray[np.float64]:
        """Return the next samples, filtered; any lengths of blocks give the same samples.

        Args:
            block: Shape: (channels, samples).

        Returns:
            Shape: (channels, samples).
        """
        block = np.asarray(block, dtype=np.float64)
        if block.shape[1] == 0:
            return block
        if self._state is None:
            settled = signal.sosfilt_zi(self._sections)[:, None, :]
            self._state = settled * block[None, :, :1]
        filtered, state = signal.sosfilt(self._sections, block, axis=-1, zi=self._state)
        state[np.abs(state) < _REST] = 0.0
        self._state = state
        return filtered
