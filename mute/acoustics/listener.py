"""Robots that are heard as they walk: recorder, soundscape and meter in one.

A `Listener` follows an environment step by step. It works in stretches, so that its memory does
not grow with the walk but for the readings of the level, and the sound of robots can be kept as
WAV files on the way. What a robot does between a fall and the time at which it walks again is
heard, but is in no figure.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import TracebackType

import numpy as np
import torch
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.energy import EnergyMeter
from mute.acoustics.files.writing import WavWriter
from mute.acoustics.metering.levels import settling_time
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, Room
from mute.acoustics.recorder import FloorAt, Recorder
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.acoustics.tally import HeardLevels, Tally
from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["SAMPLE_RATE", "SILENT_STRETCH", "STRETCH", "WAV_FULL_SCALE", "Listener"]

SAMPLE_RATE = 48000
"""Of all sound that is made here, Hz."""

WAV_FULL_SCALE = 10.0
"""Sound pressure of a full-scale sample in a WAV file, Pa. Always the same, so that a quiet walk
sounds quiet beside a loud one; 10 Pa is a peak of 114 dB, as a boarded floor has under a foot."""

STRETCH = 0.5
"""Time that is worked on at once, s; it bounds the memory."""

SILENT_STRETCH = 2.0
"""The same where no sound is made of few robots: each stretch costs some milliseconds."""
_FEW = 16
"""Robots up to which that is worth its memory."""


class Listener:
    """Hears robots of an environment at a microphone of each one's own, and measures the level.

    A context manager: the files of the sound are whole however the walk ends.

    The figures leave out `settle_time` from the start, and for each robot the step of a fall (or of
    a simulation that blew up) and `settle_time` after it. The detector remembers what was before;
    so readings count only once it has settled too, as at the start of any recording.
    """

    def __init__(
        self,
        env: QuadrupedEnv,
        floors: Sequence[str],
        floor_at: FloorAt | int = 0,
        microphone: Microphone | None = None,
        sources: Sequence[str] = SOURCES,
        settle_time: float = 1.0,
        seed: int = 0,
        wav: Path | Mapping[int, Path] | None = None,
        stretch: float | None = None,
        robots: slice | None = None,
        from_energies: bool = False,
        wav_start: float | None = None,
        room: Room = OPEN,
    ) -> None:
        """Begin to listen.

        Args:
            env: The environment, with `scene.foot_forces`; call `listen` after each of its steps.
            floors: Names of the floors, in the order of their indices.
            floor_at: Index of the floor under world positions, see `Recorder`.
            microphone: Where to listen. Default: on the trunk.
            sources: What to hear, of `soundscape.SOURCES`.
            settle_time: Time that the figures leave out, at the start and after each fall, s.
            seed: Of all noise.
            wav: File for the sound of the first robot, or files by robot; they begin on entering.
            stretch: Time that is worked on at once, s. Default: `STRETCH`, or where no sound is
                made, of few robots, `SILENT_STRETCH`.
            robots: Which robots to hear, counted from the first of them; None for all.
            from_energies: Take the levels from `EnergyMeter`, without making sound that no file
                wants. Files change no figure then.
            wav_start: Time at which the sound in the files begins, s. Default: `settle_time`.
            room: Where it is heard. Sound of one with walls needs pyroomacoustics.

        Raises:
            MuteError: If there is no calibration, or what the sound of a room needs is not
                installed.
            ValueError: If a floor or a source is not allowed, or the environment does not measure
                what is needed.
        """
        self.clipped: dict[int, int] = {}
        """Samples beyond full scale in each robot's file, once it is complete."""
        self._env = env
        self._robots = robots or slice(None)
        self._count = len(range(env.num_envs)[self._robots])
        self._recorder = Recorder(env, floor_at, robots)
        self._make_energy_meter = lambda: EnergyMeter(
            self._count, floors, microphone, sources, room=room
        )
        self._from_energies = from_energies
        self._paths = {0: wav} if isinstance(wav, Path) else dict(wav or {})
        self._files: dict[int, WavWriter] = {}
        self._closing = contextlib.ExitStack()
        self._soundscape = None
        if self._paths or not from_energies:
            self._soundscape = Soundscape(
                self._count, floors, microphone, SAMPLE_RATE, seed, sources, room=room
            )
        self._settle_steps = round(settle_time / env.step_dt)
        self._read_steps = self._settle_steps + math.ceil(settling_time("fast") / env.step_dt)
        if stretch is None:
            silent = self._soundscape is None and self._count <= _FEW
            stretch = SILENT_STRETCH if silent else STRETCH
        self._steps_at_once = max(1, round(stretch / env.step_dt))
        start = self._settle_steps * env.step_dt if wav_start is None else wav_start
        self._skipped = round(start * SAMPLE_RATE)
        self._ages: list[NDArray[np.int64]] = []
        self.restart()

    def __enter__(self) -> Listener:
        """Begin the files, if there are to be any.

        Raises:
            MuteError: If one cannot be written.
        """
        with contextlib.ExitStack() as opened:
            for robot, path in self._paths.items():
                self._files[robot] = WavWriter(path, SAMPLE_RATE, WAV_FULL_SCALE)
                opened.callback(self._close_file, robot)
            self._closing = opened.pop_all()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Work off what is left and complete the files; the figures remain.

        Raises:
            MuteError: If one cannot be written.
        """
        with self._closing:
            self._recorder.close()
            # What was interrupted may have left a control step that nobody has listened to. Then
            # the rest, less than a stretch, is given up.
            if exc_type is None:
                self._work()

    def restart(self) -> None:
        """Measure anew, of robots that are about to be reset; sound that is kept goes on."""
        self._work()
        self._recorder.restart(np.ones(self._count, dtype=bool))
        self._energies = self._make_energy_meter()
        self._meter = (
            self._energies if self._from_energies else SoundLevelMeter(SAMPLE_RATE, self._count)
        )
        self._steps = 0
        self._chosen = 0
        self._seconds = 0.0
        self._joint_work = np.zeros(self._count)
        self._begin_figures()

    def begin_anew(self) -> None:
        """Begin the figures anew, of robots that go on: as after a fall, once they have settled."""
        self._work()
        self._begin_figures()

    def listen(self, dones: torch.Tensor) -> None:
        """Hear the control step that the environment has just made.

        Args:
            dones: Episodes that ended in it. Shape: (num_envs,).
        """
        ended = dones.numpy()[self._robots]
        self._age += 1
        self._age[ended] = 0
        self._ages.append(self._age.copy())
        if ended.any():
            self._recorder.restart(ended, self._env.unstable.numpy()[self._robots])
        if len(self._ages) >= self._steps_at_once:
            self._work()

    def level(self) -> float:
        """Return what the meter of the first robot shows now, dBA; NaN before a first step."""
        self._work()
        return float(self._meter.detector.level[0]) if self._steps else math.nan

    def levels(self) -> list[HeardLevels]:
        """Return the figures of each robot, without the last stretch until the listener is left."""
        self._add_up()
        readings = zip(self._all_readings(), self._kept(), strict=True)
        return self._tally.figures([own[kept] for own, kept in readings])

    def readings(self) -> NDArray[np.float64]:
        """Return the Fast levels at `reading_times`, dBA; NaN where they are in no figure.

        Shape: (robots, readings).
        """
        return np.where(self._kept(), self._all_readings(), math.nan)

    def reading_times(self) -> NDArray[np.float64]:
        """Return the times of the readings since listening began, s. Shape: (readings,)."""
        return self._meter.detector.reading_times if self._steps else np.zeros(0)

    def _all_readings(self) -> NDArray[np.float64]:
        return self._meter.detector.readings if self._steps else np.zeros((self._count, 0))

    def _kept(self) -> NDArray[np.bool_]:
        """Return which readings count. Shape: (robots, readings)."""
        # Put together once: whoever asks each second for hours is not to wait longer each time.
        self._kept_parts = [np.concatenate(self._kept_parts, axis=1)]
        return self._kept_parts[0]

    def _begin_figures(self) -> None:
        """Leave all that came so far out of the figures."""
        self._age = np.zeros(self._count, dtype=np.int64)
        self._kept_parts = [np.zeros((self._count, self._chosen), dtype=bool)]
        self._tally = Tally(self._count, list(self._energies.exposure))

    def _work(self) -> None:
        """Measure, and write, what has been recorded since the last time."""
        if not self._ages:
            return
        ages = np.array(self._ages)
        self._ages.clear()
        block = self._recorder.take()
        counts = ages > self._settle_steps
        changes = np.flatnonzero((counts[1:] != counts[:-1]).any(axis=1)) + 1
        length = block.steps // len(ages)
        for first, stop in pairwise([0, *changes.tolist(), len(ages)]):
            if not np.array_equal(counts[first], self._tally.counting):
                self._add_up()
                self._tally.counting = counts[first]
            self._hear(block.part(first * length, stop * length))
        self._choose_readings(ages)
        self._steps += len(ages)

    def _hear(self, block: ContactBlock) -> None:
        pressure = self._render(block)
        self._energies.update(block)
        self._seconds += block.steps * block.timestep
        self._joint_work += block.joint_power.sum(axis=(0, 2)) * block.timestep
        if isinstance(self._meter, SoundLevelMeter) and pressure is not None:
            self._meter.update(pressure)
        if pressure is not None and self._files:
            begin = min(self._skipped, pressure.shape[1])
            self._skipped -= begin
            for robot, file in self._files.items():
                file.write(pressure[robot, begin:])

    def _render(self, block: ContactBlock) -> NDArray[np.float32] | None:
        return None if self._soundscape is None else self._soundscape.render(block)

    def _add_up(self) -> None:
        """Add what came since the last time to the tally of the robots for which it counts."""
        if self._seconds > 0.0:
            exposure = self._meter.detector.exposure
            sources = self._energies.exposure
            self._tally.take(self._seconds, self._joint_work, exposure, sources)

    def _choose_readings(self, ages: NDArray[np.int64]) -> None:
        """Tell which of the new readings count: those in steps of robots that are old enough."""
        new = self._meter.detector.reading_times_from(self._chosen)
        # A reading at the end of a step is that step's.
        step = np.ceil(new / self._env.step_dt - 1e-6).astype(np.int64) - 1 - self._steps
        self._kept_parts.append((ages >= self._read_steps)[step].T)
        self._chosen += len(new)

    def _close_file(self, robot: int) -> None:
        file = self._files.pop(robot)
        file.close()
        self.clipped[robot] = file.clipped
