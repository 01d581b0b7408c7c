"""Hear what beta does: one sound in which beta 0 and beta 1 take turns, and its spectrogram.

One robot keeps walking while its beta changes. It is one of those that all figures are of, a little
different from the exact model and seeing with noise, so no step is like another. Levels are
modelled, and measured from the very samples that are written. Full scale is 10 Pa, as in all sound
that is kept here; where that would clip it is more, and told. The sound in the docs is made by

    python examples/listen.py --out docs/noise
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import soundfile
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.audible_env import make_listening_env
from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.acoustics.metering.levels import P_REF, settling_time
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.origin import sound_origin
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.command_lines.arguments import (
    check_option,
    check_seed,
    command_line,
    make_directory,
    parse,
)
from mute.command_lines.sound_options import (
    Sources,
    check_sources,
    load_audible_policy,
    progress_bar,
    tell,
)
from mute.controllers import LearnedController
from mute.controllers.command import Command
from mute.controllers.learned import Policy
from mute.evaluation.plotting import STYLE, check_matplotlib
from mute.evaluation.session import Session
from mute.evaluation.tables import write_json
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import MuteError, run_cli
from mute.support.files import write_file
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.support.threads import use_collection_threads
from mute.tasks import DEFAULT_TASK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "ListenArgs",
    "Sound",
    "Turn",
    "faded",
    "full_scale_for",
    "main",
    "spectrogram",
    "turn_levels",
]

_BETAS = (0.0, 1.0)
_WARM_UP = 1.0
"""Time walked before the sound begins, s."""
_FADE = 0.1
"""Time over which the sound comes and goes, s."""
_UNSETTLED = settling_time("fast")
"""Time after each change of beta that is in no level, s: the meter forgets, the gait changes."""
_SEEDS = 5
"""How many robots may fall before that is an error."""

_LOWEST, _HIGHEST = 50.0, 20000.0
"""Ends of the spectrogram, Hz."""
_BANDS_PER_OCTAVE = 24
_WINDOW = 4096
"""Samples that a column of the spectrogram is made of, at least: 85 ms, for 23 Hz."""
_COLUMNS = 1200
"""Columns of the spectrogram, about."""
_DEPTH = 60.0
"""What is drawn below the loudest, dB."""


@dataclass
class ListenArgs:
    """Arguments of the program."""

    policy: Path = shipped_file(DEFAULT_TASK)
    """Who walks: a checkpoint."""
    surface: str = "wood"
    """Floor: wood, parquet, laminate, carpet, tile or concrete."""
    speed: float = 0.5
    """Commanded forward speed, m/s."""
    seconds_each: float = 3.0
    """Length of a turn, s."""
    turns: int = 6
    """How often beta 0 or beta 1 has its turn; beta 0 begins."""
    seed: int = 1
    """Seed of the robot, of its initial state and of the noise; if it falls, the next ones."""
    sources: Sources = SOURCES
    out: Path = Path("evaluation")
    """Directory of the files that are written."""

    def check(self) -> None:
        """Check the arguments but the policy.

        Raises:
            MuteError: If one is not allowed.
        """
        if self.surface not in FLOORS:
            allowed = ", ".join(FLOORS)
            raise MuteError(f"--surface must be one of {allowed}, got {self.surface!r}")
        check_option("speed", self.speed, Range(0.0, 2.0, above=True))
        # Shorter, the last turn would be over before there is a level that is not faded.
        check_option("seconds-each", self.seconds_each, Range(_UNSETTLED + _FADE, 20.0))
        check_option("turns", self.turns, Range(2, 12, whole=True))
        check_seed(self.seed)
        check_sources(self.sources)


@dataclass(frozen=True)
class Turn:
    """A part of the sound with one beta."""

    beta: float
    """Quiet factor."""
    begin: float
    """Time at which it begins, s."""
    end: float
    """Time at which it ends, s."""
    speed: float
    """Mean forward speed of the robot, m/s."""


@dataclass(frozen=True)
class Sound:
    """What is written, and what was walked for it."""

    samples: NDArray[np.int16]
    """Shape: (samples,)."""
    full_scale: float
    """Sound pressure of the largest sample that there can be, Pa."""
    turns: tuple[Turn, ...]
    seed: int
    """Of the robot that walked."""

    @property
    def pressure(self) -> NDArray[np.float64]:
        """What the samples stand for, Pa. Shape: (samples,)."""
        return self.samples.astype(np.float64) * (self.full_scale / 32767.0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, the policy cannot be used or falls, or a file not be
            written.
    """
    args = parse(ListenArgs, command_line() if argv is None else argv, __doc__ or "")
    args.check()
    check_matplotlib()
    policy, origin = load_audible_policy(args.policy), sound_origin(args.policy)
    make_directory(args.out)
    use_collection_threads()
    sound = _standing_robot(args, policy)
    about: dict[str, Any] = _about(args, sound, turn_levels(sound)) | origin
    files = _write(args, sound, about)
    for name, figures in about["levels"].items():
        heard = f"MNL {figures['mnl']:.1f}, PNL {figures['pnl']:.1f} dBA (modelled)"
        print(f"{name}: {heard}, {figures['speed']:.2f} m/s")
    sizes = ", ".join(f"{path.name} ({path.stat().st_size / 1e6:.2f} MB)" for path in files)
    print(f"written to {args.out}: {sizes}")
    return 0


def _standing_robot(args: ListenArgs, policy: Policy) -> Sound:
    """Return the sound of the first robot, from the seed on, that does not fall.

    Raises:
        MuteError: If too many do.
    """
    for seed in range(args.seed, args.seed + _SEEDS):
        sound = _walk(args, policy, seed)
        if sound is not None:
            return sound
        tell(f"the robot of seed {seed} fell")
    raise MuteError(
        f"--policy {args.policy}: falls on {args.surface} at --speed {args.speed:g}, with each "
        f"seed from {args.seed} to {args.seed + _SEEDS - 1}"
    )


def _walk(args: ListenArgs, policy: Policy, seed: int) -> Sound | None:
    """Return the sound of a robot; None if it falls."""
    dt = policy.cfg.env.step_dt
    before, each = round(_WARM_UP / dt), round(args.seconds_each / dt)
    steps = before + args.turns * each
    env = make_listening_env(robots_cfg(policy, 1, steps * dt, seed), args.surface)
    session = Session(env, LearnedController(policy, 1), Command(args.speed, beta=_BETAS[0]))
    recorder = Recorder(env)
    soundscape = Soundscape(
        1, [args.surface], sample_rate=SAMPLE_RATE, seed=seed, sources=args.sources
    )
    turns: list[Turn] = []
    heard: list[NDArray[np.float32]] = []
    with progress_bar("walk", steps) as advance:
        if not _stays_up(session, before, advance):
            return None
        soundscape.render(recorder.take())  # unheard, but for what still rings
        session.recent_gait()
        for number in range(args.turns):
            beta = _BETAS[number % len(_BETAS)]
            session.set_command(Command(args.speed, beta=beta))
            if not _stays_up(session, each, advance):
                return None
            begin = sum(map(len, heard)) / SAMPLE_RATE
            heard.append(soundscape.render(recorder.take())[0])
            end = sum(map(len, heard)) / SAMPLE_RATE
            turns.append(Turn(beta, begin, end, session.recent_gait().speed))
    return _sound(np.concatenate(heard), tuple(turns), seed)


def _stays_up(session: Session, steps: int, advance: Callable[[float], None]) -> bool:
    """Walk a number of control steps, unless the robot falls, and tell whether it did not."""
    for _ in range(steps):
        session.step()
        if bool(session.env.episode_length_buf[0] == 0):  # it has begun anew
            return False
        advance(session.steps)
    return True


def _sound(pressure: NDArray, turns: tuple[Turn, ...], seed: int) -> Sound:
    """Return what is written of a sound pressure, Pa. Shape: (samples,)."""
    pressure = faded(pressure)
    full_scale = full_scale_for(pressure)
    if full_scale > WAV_FULL_SCALE:
        tell(f"full scale is {full_scale:g} Pa: at the usual {WAV_FULL_SCALE:g} Pa it would clip")
    samples = np.rint(pressure * (32767.0 / full_scale)).astype(np.int16)
    return Sound(samples, full_scale, turns, seed)


def faded(pressure: NDArray, seconds: float = _FADE) -> NDArray[np.float64]:
    """Return a sound that comes and goes with half a period of a cosine, from and to nothing.

    Args:
        pressure: Shape: (samples,).
        seconds: How long each of the two takes.
    """
    length = round(seconds * SAMPLE_RATE)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(length) / length)
    result = pressure.astype(np.float64)
    result[:length] *= ramp
    result[-length:] *= ramp[::-1]
    return result


def full_scale_for(pressure: NDArray) -> float:
    """Return the full scale that a sound is written with: the usual, or as many Pa as it needs."""
    return max(WAV_FULL_SCALE, float(math.ceil(np.abs(pressure).max())))


def turn_levels(sound: Sound) -> list[NDArray[np.float64]]:
    """Return the readings of the meter in each turn, dBA.

    They are without `_UNSETTLED` after its begin, and without where the whole fades away.
    """
    meter = SoundLevelMeter(SAMPLE_RATE)
    meter.update(sound.pressure)
    times, readings = meter.detector.reading_times, meter.detector.readings[0]
    last = sound.turns[-1].end - _FADE
    margin = 0.5 / SAMPLE_RATE
    return [
        readings[
            (times > turn.begin + _UNSETTLED - margin) & (times < min(turn.end, last) + margin)
        ]
        for turn in sound.turns
    ]


def _about(args: ListenArgs, sound: Sound, levels: Sequence[NDArray[np.float64]]) -> dict[str, Any]:
    """Return what a sound is, as plain data."""
    rows = [
        {"beta": turn.beta, "begin": turn.begin, "end": turn.end, **_figures([turn], [readings])}
        for turn, readings in zip(sound.turns, levels, strict=True)
    ]
    both = {}
    for beta in _BETAS:
        own = [at for at, turn in enumerate(sound.turns) if turn.beta == beta]
        figures = _figures([sound.turns[at] for at in own], [levels[at] for at in own])
        both[f"beta {beta:g}"] = figures
    return {
        "surface": args.surface,
        "commanded_speed": args.speed,
        "sources": args.sources,
        "seed": sound.seed,
        "sample_rate": SAMPLE_RATE,
        "seconds": len(sound.samples) / SAMPLE_RATE,
        "full_scale_pa": sound.full_scale,
        "levels": both,
        "turns": rows,
    }


def _figures(turns: Sequence[Turn], levels: Sequence[NDArray[np.float64]]) -> dict[str, float]:
    """Return what the readings in some turns, and the robot's speeds, come to."""
    readings = np.concatenate(levels)
    speed = float(np.mean([turn.speed for turn in turns]))
    return {"mnl": float(readings.mean()), "pnl": float(readings.max()), "speed": speed}


def _write(args: ListenArgs, sound: Sound, about: dict[str, Any]) -> list[Path]:
    """Write the files, and return them; of a call that fails, none stays.

    Raises:
        DiskError: If one cannot be written.
    """
    stem = args.out / f"listen-{args.surface}"
    flac, png, told = (stem.with_name(f"{stem.name}.{kind}") for kind in ("flac", "png", "json"))
    coded = io.BytesIO()
    soundfile.write(coded, sound.samples, SAMPLE_RATE, format="FLAC", subtype="PCM_16")
    picture = _picture(args, sound, about)
    files: list[Path] = []
    try:
        write_file(flac, coded.getvalue())
        files.append(flac)
        write_file(png, picture)
        files.append(png)
        write_json(told, about)
        files.append(told)
    except BaseException:
        for path in files:
            path.unlink(missing_ok=True)
        raise
    return files


def spectrogram(pressure: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return how much sound there is when and where.

    Args:
        pressure: Pa. Shape: (samples,).

    Returns:
        The edges of the columns, s; the edges of the bands, Hz; and the level in each, dB re 20
        uPa. Shapes: (columns + 1,), (bands + 1,), (bands, columns).
    """
    hop = max(_WINDOW // 8, len(pressure) // _COLUMNS)
    length = max(_WINDOW, 2 * hop)
    transform = signal.ShortTimeFFT(
        np.hanning(length + 1)[:-1],
        hop,
        SAMPLE_RATE,
        fft_mode="onesided2X",
        scale_to="psd",
    )
    columns = len(pressure) // hop
    density = transform.spectrogram(pressure, p0=0, p1=columns)
    # The energy up to each edge between two lines, and of it what lies within a band.
    below = np.concatenate((np.zeros((1, columns)), np.cumsum(density, axis=0))) * transform.delta_f
    bands = math.ceil(_BANDS_PER_OCTAVE * math.log2(_HIGHEST / _LOWEST))
    edges = _LOWEST * 2.0 ** (np.arange(bands + 1) / _BANDS_PER_OCTAVE)
    place = edges / transform.delta_f + 0.5
    line = place.astype(int)
    share = (place - line)[:, None]
    energy = np.diff((1.0 - share) * below[line] + share * below[line + 1], axis=0)
    times = (np.arange(columns + 1) - 0.5) * (hop / SAMPLE_RATE)
    levels = 10.0 * np.log10(np.maximum(energy, 1e-12 * P_REF**2) / P_REF**2)
    return times, edges, levels


def _picture(args: ListenArgs, sound: Sound, about: dict[str, Any]) -> bytes:
    """Return the spectrogram as a PNG, with marks where beta changes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    times, edges, levels = spectrogram(sound.pressure)
    top = 5.0 * math.ceil(levels.max() / 5.0)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(8.4, 4.2), layout="constrained")
        axes = figure.subplots()
        mesh = axes.pcolormesh(times, edges, levels, cmap="magma", vmin=top - _DEPTH, vmax=top)
        bar = figure.colorbar(mesh, ax=axes, pad=0.01)
        bar.set_label(f"dB re 20 µPa in 1/{_BANDS_PER_OCTAVE} octave")
        axes.set_yscale("log")
        axes.set_yticks([50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000])
        axes.set_yticklabels(["50", "100", "200", "500", "1k", "2k", "5k", "10k", "20k"])
        axes.minorticks_off()
        axes.set_xlim(0.0, sound.turns[-1].end)
        axes.set_ylim(_LOWEST, _HIGHEST)
        axes.set_xlabel("time (s)")
        axes.set_ylabel("frequency (Hz)")
        _mark_turns(axes, sound.turns)
        told = [f"{name} MNL {own['mnl']:.1f} dBA" for name, own in about["levels"].items()]
        asked = f"{args.surface}, {args.speed:g} m/s asked (modelled)"
        figure.suptitle(f"{asked}: {', '.join(told)}", fontsize=9)
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=130)
    return picture.getvalue()


def _mark_turns(axes: Axes, turns: Sequence[Turn]) -> None:
    """Say above an axis of time whose turn it is, with a line at each change."""
    for turn in turns:
        if turn is not turns[0]:
            axes.axvline(turn.begin, color="white", linewidth=1.0, linestyle="--")
        axes.text(
            0.5 * (turn.begin + turn.end),
            1.01,
            f"beta {turn.beta:g}",
            transform=axes.get_xaxis_transform(),
            horizontalalignment="center",
            verticalalignment="bottom",
            fontsize=8,
        )


if __name__ == "__main__":
    run_cli(main)
