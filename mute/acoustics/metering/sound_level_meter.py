"""A sound level meter for arrays: A-weighting, Fast or Slow detector, statistics.

It is the same for a robot in simulation and for a real recording, and knows nothing of either;
files are those of `wav_levels`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.metering.levels import P_REF, LevelDetector, Levels, TimeWeighting
from mute.acoustics.metering.weighting import AWeighting

__all__ = ["SAMPLES_AT_ONCE", "SoundLevelMeter", "measure"]

SAMPLES_AT_ONCE = 1 << 18
"""Samples of all channels that are worked on at a time: bounds the memory."""


class SoundLevelMeter:
    """A-weighting, detector and statistics for any number of channels, streamed."""

    def __init__(
        self,
        sample_rate: int,
        channels: int = 1,
        time_weighting: TimeWeighting = "fast",
        reference: float = P_REF,
    ) -> None:
        """Start from silence.

        Args:
            sample_rate: Hz, >= `weighting.MIN_SAMPLE_RATE`.
            channels: Number of channels, >= 1.
            time_weighting: "fast" or "slow".
            reference: Root mean square of 0 dB, in the unit of the samples, > 0. The default is
                for samples in Pa; 1 gives dB re full scale.

        Raises:
            ValueError: If an argument is out of its range.
        """
        self.detector = LevelDetector(sample_rate, channels, time_weighting, reference)
        """Where the figures are made; has the readings and the level of now."""
        self._weighting = AWeighting(sample_rate)

    def update(self, block: NDArray) -> None:
        """Take the next samples; any lengths of blocks give the same figures.

        Args:
            block: Shape: (channels, samples), or (samples,) for one channel.

        Raises:
            ValueError: If the shape is wrong or a sample is not finite.
        """
        if block.ndim == 1 and self.detector.channels == 1:
            block = block[None]
        if block.ndim != 2 or len(block) != self.detector.channels:
            raise ValueError(
                f"block must be ({self.detector.channels}, samples), got {block.shape}"
            )
        if not np.isfinite(block).all():
            raise ValueError("block must be finite, got NaN or infinity")
        length = max(SAMPLES_AT_ONCE // len(block), 1)
        for begin in range(0, block.shape[1], length):
            weighted = self._weighting.filter(block[:, begin : begin + length])
            self.detector.update(np.square(weighted, out=weighted))

    def result(self) -> list[Levels]:
        """Return the figures of what came so far, one for each channel.

        Raises:
            ValueError: If nothing came.
        """
        return self.detector.result()


def measure(
    samples: NDArray,
    sample_rate: int,
    time_weighting: TimeWeighting = "fast",
    reference: float = P_REF,
) -> list[Levels]:
    """Return the figures of a whole signal, one for each channel.

    Args:
        samples: Shape: (samples,) or (channels, samples).
        sample_rate: Hz.
        time_weighting: "fast" or "slow".
        reference: Root mean square of 0 dB, in the unit of the samples.

    Raises:
        ValueError: If an argument is out of its range, or a sample is not finite.
    """
    samples = np.atleast_2d(samples)
    meter = SoundLevelMeter(sample_rate, len(samples), time_weighting, reference)
    meter.update(samples)
    return meter.result()
