"""What the page's sound is held to: recorded walks, and what Python makes of them.

The policy walks on each floor at beta 0 and 1. What it does is kept in whole steps, so that files
are small, and what is heard is that of the very numbers that were kept.
"""

from __future__ import annotations

import dataclasses
import gzip
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.audible_env import TIMESTEP, make_listening_env
from mute.acoustics.contacts import ContactBlock, Impacts
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.metering.third_octaves import third_octaves
from mute.acoustics.microphone import Microphone
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.acoustics.sources.landings import place_struck
from mute.controllers import LearnedController
from mute.controllers.command import Command
from mute.controllers.learned import Policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import FOOT_RADIUS, LEGS
from mute.envs.sensors import sensor_slice
from mute.evaluation.session import Session
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import MuteError
from mute.support.files import write_file
from mute.support.plain_data import laid_out
from mute.support.provenance import file_sha256
from mute.web.sound_tables import SAMPLE_RATE

__all__ = ["STEPS", "heard_figures", "read_walk", "write_sound_references"]

STEPS = {
    "landing_speed": 1e-4,
    "landing_mass": 1e-4,
    "friction_power": 1e-3,
    "foot_position": 1e-3,
    "joint_position": 1e-6,
    "joint_velocity": 2e-4,
    "joint_torque": 1e-3,
    "trunk_position": 1e-3,
    "trunk_quaternion": 1e-3,
}
"""In which each quantity is kept; in the order of the page's `ContactReadings`."""

_WIDTHS = {"foot_position": 12, "trunk_position": 3, "trunk_quaternion": 4} | dict.fromkeys(
    ("joint_position", "joint_velocity", "joint_torque"), 12
)
"""Numbers of each quantity in a step, 4 unless told."""

_SURFACES = ("wood", "carpet", "tile", "concrete")
_BETAS = (0.0, 1.0)
_MORE = (("parquet", 0.0), ("laminate", 0.0))
"""Floors that are held to at one beta alone."""
_SEED = 1
"""Of the robots, each a little different from the exact model, and of their first states."""
_SPEED = 0.5
"""Commanded forward speed, m/s."""
_WARM_UP = 1.0
"""Time walked before, s."""
_SECONDS = 2.5
_BESIDE = (0.2, 1.0, 1.2)
"""Where a listener walks along who hears the walks at beta 0 as well, m."""
_NOISE_SEEDS = 8
"""Draws of the noise whose mean is taken: what is drawn differs, its mean does not."""
_SENSED = 400
"""Physics steps whose sensors are kept."""


def write_sound_references(policy: Policy, policy_file: Path, out: Path) -> list[Path]:
    """Walk, and write what was done and heard into a directory, which is made if need be.

    - `FLOOR-BETA.bin.gz`: a walk of some seconds, its readings in whole steps of `STEPS`;
    - `references.json`: what Python's soundscape makes of those very readings, in levels and third
      octaves, by source and in all; the places that blows hit; what a meter reads of a known sound;
    - `sensors.bin.gz`: a part of a walk as the sensors have it, for who makes readings of them.

    Args:
        policy: What walks.
        policy_file: The file that it is from, whose digest is kept.
        out: Where to.

    Raises:
        MuteError: If a robot falls, or a file cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    walks: dict[str, Any] = {}
    beside: dict[str, Any] = {}
    recorded: dict[str, Any] = {}
    files: dict[str, bytes] = {}
    settings = [(surface, beta) for surface in _SURFACES for beta in _BETAS]
    for surface, beta in [*settings, *_MORE]:
        name = f"{surface}-{beta:g}"
        block, sensed = _walk(policy, surface, beta)
        kept = _quantised(block)
        files[f"{name}.bin.gz"] = gzip.compress(_coded(kept), 9, mtime=0)
        own = _decoded(kept)
        walks[name] = heard_figures(own, surface)
        if beta == _BETAS[0]:
            beside[name] = _figures([_beside(own, surface, seed) for seed in range(_NOISE_SEEDS)])
        if not recorded:
            files["sensors.bin.gz"] = gzip.compress(sensed.coded(), 9, mtime=0)
            recorded = _recorded(block, sensed)
    content = {
        "policy_sha256": file_sha256(policy_file),
        "timestep": TIMESTEP,
        "steps": STEPS,
        "noise_seeds": _NOISE_SEEDS,
        "bands": [[band.low, band.high] for band in third_octaves(SAMPLE_RATE)],
        "beside": {"offset": _BESIDE, "walks": beside},
        "microphones": _microphones(),
        "recorded": recorded,
        "places": _places(),
        "meter": _metered(),
        "walks": walks,
    }
    files["references.json"] = (laid_out(content) + "\n").encode()
    for name, data in files.items():
        write_file(out / name, data)
    return [out / name for name in files]


@dataclass
class _Sensed:
    """The first physics steps of a walk, as the sensors at the feet have them."""

    rows: list[NDArray]
    """Blocks of sensor data. Shape of each: (steps, sensors)."""
    columns: NDArray[np.int64]
    """Those of contact, place, velocity, angular velocity and force, foot by foot."""
    friction: float
    """Friction coefficient of the robot on its floor."""

    def coded(self) -> bytes:
        """Return them step by step."""
        rows = np.concatenate(self.rows)[:_SENSED, self.columns]
        return np.ascontiguousarray(rows, dtype="<f4").tobytes()


def _sense(env: QuadrupedEnv) -> _Sensed:
    """Begin to keep what the sensors of the first robot say."""
    columns = [
        np.arange(env.model.nsensordata)[
            sensor_slice(env.model, f"{LEGS[0]}_foot_{name}", len(LEGS))
        ]
        for name in ("contact", "pos", "vel", "angvel", "force")
    ]
    friction = env.simulation.read_field("geom_friction")[0, env.model.geom("floor").id, 0]
    sensed = _Sensed([], np.concatenate(columns), float(friction))

    def keep() -> None:
        sensed.rows.append(env.simulation.substeps["sensordata"][0].numpy().copy())

    env.physics_listeners.append(keep)
    return sensed


def _walk(policy: Policy, surface: str, beta: float) -> tuple[ContactBlock, _Sensed]:
    """Return what one robot does on a floor, and what its sensors say.

    Raises:
        MuteError: If it falls.
    """
    dt = policy.cfg.env.step_dt
    steps = round((_WARM_UP + _SECONDS) / dt)
    cfg = robots_cfg(policy, 1, (steps + 1) * dt, _SEED)
    env = make_listening_env(cfg, surface)
    session = Session(env, LearnedController(policy, 1), Command(_SPEED, beta=beta))
    recorder = Recorder(env)
    before = round(_WARM_UP / dt)
    for _ in range(before):
        session.step()
    recorder.take()
    sensed = _sense(env)
    for _ in range(steps - before):
        session.step()
    if int(env.episode_length_buf[0]) != steps:
        raise MuteError(f"the robot of seed {_SEED} fell on {surface} at beta {beta:g}")
    return recorder.take(), sensed


def _recorded(block: ContactBlock, sensed: _Sensed) -> dict[str, Any]:
    """Return what the recorder made of what was sensed: sliding, and landings with their speed."""
    power = block.friction_power[:_SENSED, 0]
    step, foot = np.nonzero(power)
    part = block.part(0, _SENSED)
    landings = zip(part.impact_steps(), part.impacts.foot, part.impacts.speed, strict=True)
    return {
        "friction": sensed.friction,
        "sliding": [
            [int(s), int(f), float(p)]
            for s, f, p in zip(step, foot, power[step, foot], strict=True)
        ],
        "landings": [[int(s), int(f), float(v)] for s, f, v in landings],
    }


def _quantised(block: ContactBlock) -> dict[str, NDArray[np.int64]]:
    """Return a block's readings in whole steps of `STEPS`. Shape of each: (steps, numbers)."""
    speed, mass = np.zeros((2, block.steps, len(LEGS)))
    at = (block.impact_steps(), block.impacts.foot)
    speed[at], mass[at] = block.impacts.speed, block.impacts.mass
    values = {
        "landing_speed": speed,
        "landing_mass": mass,
        "friction_power": block.friction_power[:, 0],
        "foot_position": block.foot_pos[:, 0].reshape(block.steps, -1),
        "joint_position": block.joint_pos[:, 0],
        "joint_velocity": block.joint_vel[:, 0],
        "joint_torque": block.joint_torque[:, 0],
        "trunk_position": block.trunk_pos[:, 0],
        "trunk_quaternion": block.trunk_quat[:, 0],
    }
    return {
        name: np.rint(values[name].astype(np.float64) / step).astype(np.int64)
        for name, step in STEPS.items()
    }


def _coded(kept: dict[str, NDArray[np.int64]]) -> bytes:
    """Return readings as bytes: differences of differences in time, of few digits each.

    A difference is stored in groups of seven bits, the lowest first, of which all but the last have
    the eighth bit set, and its sign in the lowest bit.
    """
    coded = bytearray()
    for name, whole in kept.items():
        order = 1 if name in _STEADY else 2
        for column in whole.T:
            for value in np.diff(column, order, prepend=np.zeros(order, np.int64)).tolist():
                left = 2 * value if value >= 0 else -2 * value - 1
                while left >= 128:
                    coded.append(128 | left & 127)
                    left >>= 7
                coded.append(left)
    return bytes(coded)


def _uncoded(coded: bytes) -> dict[str, NDArray[np.int64]]:
    """Return the readings that `_coded` made bytes of."""
    digits = np.frombuffer(coded, np.uint8).astype(np.int64)
    ends = np.flatnonzero(digits < 128)
    begins = np.concatenate(([0], ends[:-1] + 1))
    place = np.arange(len(digits)) - np.repeat(begins, ends - begins + 1)
    whole = np.add.reduceat((digits & 127) << (7 * place), begins)
    values = np.where(whole % 2 == 0, whole // 2, -(whole + 1) // 2)
    widths = [_WIDTHS.get(name, len(LEGS)) for name in STEPS]
    columns = values.reshape(sum(widths), -1)
    kept = {}
    for name, part in zip(STEPS, np.split(columns, np.cumsum(widths)[:-1]), strict=True):
        summed = part.cumsum(axis=1)
        kept[name] = (summed if name in _STEADY else summed.cumsum(axis=1)).T
    return kept


def read_walk(path: Path) -> ContactBlock:
    """Return a walk that was kept, as it is heard."""
    return _decoded(_uncoded(gzip.decompress(path.read_bytes())))


_STEADY = (
    "landing_speed",
    "landing_mass",
    "friction_power",
    "foot_position",
    "joint_velocity",
    "joint_torque",
    "trunk_position",
    "trunk_quaternion",
)
"""Quantities whose first differences are kept; of the others, the second."""


def _decoded(kept: dict[str, NDArray[np.int64]]) -> ContactBlock:
    """Return the block that quantised readings are, of float32 as the page has them."""
    value = {name: (whole * STEPS[name]).astype(np.float32) for name, whole in kept.items()}
    steps = len(kept["landing_speed"])
    step, foot = np.nonzero(kept["landing_speed"])
    feet = value["foot_position"].reshape(steps, 1, len(LEGS), 3)
    return ContactBlock(
        start=0.0,
        timestep=TIMESTEP,
        impacts=Impacts(
            time=step * TIMESTEP,
            robot=np.zeros(len(step), np.int64),
            foot=foot,
            speed=value["landing_speed"][step, foot].astype(np.float64),
            mass=value["landing_mass"][step, foot].astype(np.float64),
            floor=np.zeros(len(step), np.int64),
            position=feet[step, 0, foot] - (0.0, 0.0, FOOT_RADIUS),
        ),
        friction_power=value["friction_power"][:, None],
        foot_pos=feet,
        floor=np.zeros((steps, 1, len(LEGS)), np.int8),
        joint_pos=value["joint_position"][:, None],
        joint_vel=value["joint_velocity"][:, None],
        joint_torque=value["joint_torque"][:, None],
        trunk_pos=value["trunk_position"][:, None],
        trunk_quat=value["trunk_quaternion"][:, None],
    )


def heard_figures(block: ContactBlock, surface: str) -> dict[str, Any]:
    """Return levels and third octaves of a walk, in all and by source."""

    def render(source: str, own: int) -> NDArray[np.float64]:
        return Soundscape(1, [surface], seed=own, sources=(source,)).render(block)[0].astype(float)

    steady = {name: render(name, 0) for name in ("impacts", "body", "drive")}
    drawn = [
        {name: render(name, number) for name in ("scuffing", "fan")}
        for number in range(_NOISE_SEEDS)
    ]
    whole = [sum([*steady.values(), *own.values()]) for own in drawn]
    sources = {name: [sound] for name, sound in steady.items()}
    sources |= {name: [own[name] for own in drawn] for name in ("scuffing", "fan")}
    assert sources.keys() == set(SOURCES)
    landings = block.impacts
    return {
        **_figures([np.asarray(sound) for sound in whole]),
        "sources": {name: _figures(sounds) for name, sounds in sources.items()},
        "landings": [
            [round(float(time) / TIMESTEP), int(foot), float(speed), float(mass)]
            for time, foot, speed, mass in zip(
                landings.time, landings.foot, landings.speed, landings.mass, strict=True
            )
        ],
    }


def _beside(block: ContactBlock, surface: str, seed: int) -> NDArray[np.float64]:
    """Return the sound of a walk as a listener hears it who walks along."""
    microphone = Microphone(_BESIDE, "beside")
    return Soundscape(1, [surface], microphone, seed=seed).render(block)[0].astype(float)


def _microphones() -> list[dict[str, Any]]:
    """Return where microphones are that go with trunks of all poses."""
    generator = np.random.default_rng(1)
    block = Impacts.none()
    found = []
    for _ in range(12):
        offset, trunk = generator.uniform(-1.0, 1.0, (2, 3))
        quat = generator.normal(size=4)
        quat /= np.linalg.norm(quat)
        nothing = np.zeros((1, 1, 4))
        pose = ContactBlock(
            0.0, TIMESTEP, block, nothing, np.zeros((1, 1, 4, 3)), nothing, nothing, nothing,
            nothing, trunk[None, None], quat[None, None],
        )  # fmt: skip
        at = {
            mount: Microphone(tuple(offset), mount).position(pose)[0, 0].tolist()
            for mount in ("trunk", "beside", "world")
        }
        own = {"offset": offset.tolist(), "trunk": trunk.tolist(), "quaternion": quat.tolist()}
        found.append(own | {"at": at})
    return found


def _figures(sounds: list[NDArray[np.float64]]) -> dict[str, Any]:
    """Return figures of draws of a sound: mean levels, and third octaves of mean energies."""
    levels, bands = [], []
    for sound in sounds:
        meter = SoundLevelMeter(SAMPLE_RATE)
        meter.update(sound)
        levels.append(dataclasses.asdict(meter.result()[0]))
        bands.append(_bands(sound))
    silent = -100.0
    squares = np.maximum(np.mean(bands, axis=0), 10.0 ** (silent / 10.0) * P_REF**2)
    return {
        **{
            name: round(float(np.mean([max(own[name], silent) for own in levels])), 4)
            for name in ("mnl", "pnl", "laeq", "lafmax")
        },
        "bands": np.round(10.0 * np.log10(squares / P_REF**2), 4).tolist(),
    }


def _bands(sound: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean square in each third octave, Pa^2, by one transform under Hann's window.

    The whole sound lies in one window: so the page's tests, and whoever reads them, need no bank of
    filters to get the very same.
    """
    window = np.hanning(len(sound) + 1)[:-1]
    length = 1 << (len(sound) - 1).bit_length()
    power = np.square(np.abs(np.fft.rfft(sound * window, length)))
    frequency = np.fft.rfftfreq(length, 1.0 / SAMPLE_RATE)
    scale = 2.0 / (length * np.square(window).sum())
    return np.array(
        [
            scale * power[(frequency >= band.low) & (frequency < band.high)].sum()
            for band in third_octaves(SAMPLE_RATE)
        ]
    )


def _places() -> list[list[float]]:
    """Return points of a floor and which of its places they are: x, y, place."""
    points = np.random.default_rng(0).uniform(-300.0, 300.0, (40, 3)).astype(np.float32)
    return [
        [float(x), float(y), int(place)]
        for (x, y, _), place in zip(points, place_struck(points.astype(float)), strict=True)
    ]


def _metered() -> dict[str, float]:
    """Return what a meter reads of a tone that is swept from 50 Hz to 10 kHz in 3 s, of 1 Pa.

    It swells and fades four times, and lies on an offset that a meter does not hear.
    """
    time = np.arange(3 * SAMPLE_RATE) / SAMPLE_RATE
    swell = 0.5 - 0.5 * np.cos(2.0 * np.pi * time / 0.75)
    sweep = swell * signal.chirp(time, 50.0, 3.0, 10000.0, "logarithmic", phi=-90)
    meter = SoundLevelMeter(SAMPLE_RATE)
    meter.update((sweep + 0.1).astype(np.float32))
    return dataclasses.asdict(meter.result()[0])
