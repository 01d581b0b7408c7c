"""How loud a policy walks: the paper's protocol, with all trials side by side.

The robots are as robots are: each a little different, seeing with noise (`usual_robots`). Every
level here is modelled (`mute.acoustics`), not measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch

from mute.acoustics.audible_env import make_listening_env
from mute.acoustics.listener import Listener
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, Room
from mute.acoustics.soundscape import SOURCES
from mute.acoustics.tally import HeardLevels
from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.gait import Gait
from mute.evaluation.intervals import mean_with_interval
from mute.evaluation.trials import run_trial
from mute.evaluation.usual_robots import robots_cfg
from mute.rendering.kept_walks import KeptWalks, filming

__all__ = [
    "SETTLE_TIME",
    "NoiseRow",
    "NoiseSetting",
    "measure_noise",
    "robot_weight",
]

SETTLE_TIME = 1.0
"""Time at the start of a trial that is walked but not measured, s."""


@dataclass(frozen=True)
class NoiseSetting:
    """What the robots of some trials are asked for."""

    beta: float
    """Quiet factor."""
    command_speed: float
    """Commanded forward speed, m/s."""


@dataclass
class NoiseRow:
    """Figures of the trials of one setting on one floor. Levels in dBA re 20 uPa, modelled."""

    method: str
    """What walks: the task of the policy."""
    beta: float
    """Quiet factor."""
    surface: str
    """Name of the floor."""
    robots: str
    """`different`: robots as they are, each with its own physics, that see with noise; `nominal`:
    the exact model, without noise."""
    command_speed: float
    """Commanded forward speed, m/s."""
    trials: int
    """Number of robots."""
    trials_heard: int
    """Those with a level: not the ones that kept falling. MNL, PNL and LAeq are over these."""
    mnl_mean: float
    """Mean over trials of the mean noise level, dBA; NaN if there is none."""
    mnl_std: float
    """Standard deviation of it, dBA; NaN for one trial."""
    mnl_ci95: float
    """Half width of its 95 % confidence interval (Student's t), dBA; NaN for one trial."""
    pnl_mean: float
    """Mean over trials of the peak noise level, dBA."""
    pnl_std: float
    """Standard deviation of it, dBA."""
    pnl_ci95: float
    """Half width of its 95 % confidence interval, dBA."""
    laeq_mean: float
    """Mean over trials of the equivalent continuous level, dBA."""
    laeq_impacts: float
    """Level of the mean energy over trials of the struck floor; -inf if it is silent, NaN if not
    heard."""
    laeq_body: float
    """The same of the robot's shell, which landings shake."""
    laeq_scuffing: float
    """The same of scuffing."""
    laeq_drive: float
    """The same of motors and gears."""
    laeq_fan: float
    """The same of the fan."""
    speed_mean: float
    """Mean actual forward speed, m/s."""
    velocity_error_sq: float
    """Mean of |v_xy^cmd - v_xy|^2, (m/s)^2."""
    landing_speed_mean: float
    """Mean over landings of the landing speed, m/s."""
    landing_speed_rms: float
    """Root mean square of it, m/s."""
    apex_mean: float
    """Mean over swings of the highest clearance, m."""
    duty_factor: float
    """Share of the time that a foot is on the ground."""
    stride_frequency: float
    """Landings of a foot per second, Hz."""
    power: float
    """Mean over all physics steps of the sum over joints of |torque times velocity|, W."""
    cost_of_transport: float
    """Power over weight times actual speed."""
    fall_rate: float
    """Share of the robots that fell."""


def measure_noise(
    policy: Driver,
    surface: str,
    settings: Sequence[NoiseSetting],
    trials: int,
    seconds: float,
    seed: int,
    keep: KeptWalks | None = None,
    microphone: Microphone | None = None,
    sources: Sequence[str] = SOURCES,
    from_energies: bool = False,
    on_step: Callable[[], None] | None = None,
    nominal: bool = False,
    room: Room = OPEN,
) -> list[NoiseRow]:
    """Walk straight ahead on a floor and return each setting's figures.

    A robot that falls starts again; its figures leave out the fall and `SETTLE_TIME` after it.

    Args:
        policy: What walks.
        surface: Name of the floor.
        settings: What is asked for; their trials walk side by side, in one batch.
        trials: Robots for each setting, which differ in their physics, their initial state and
            their noise.
        seconds: Measured length of a trial, after `SETTLE_TIME`, s.
        seed: Seed of initial states and of the noise.
        keep: What to keep of each setting's first trial, by the setting's index, from
            `SETTLE_TIME` on.
        microphone: Where to listen. Default: on the trunk.
        sources: What to hear, of `soundscape.SOURCES`.
        from_energies: Take the levels from energies, without sound that no file wants: quicker, see
            `mute.acoustics.energy`.
        on_step: Called after each control step, of which there are `(seconds + SETTLE_TIME) /
            step_dt`.
        nominal: Let all be the exact model, which sees without noise; they differ in their initial
            state alone.
        room: Where it is heard. Sound of one with walls needs pyroomacoustics.

    Raises:
        MuteError: If a file cannot be written, nothing renders, or what a room needs is missing.
        ValueError: If the floor or a source is not known.
    """
    robots = len(settings) * trials
    cfg = robots_cfg(policy, robots, seconds + SETTLE_TIME, seed, nominal)
    env = make_listening_env(cfg, surface)
    commands = torch.zeros(robots, 4)
    for index, setting in enumerate(settings):
        chosen = slice(index * trials, (index + 1) * trials)
        commands[chosen, 0], commands[chosen, 3] = setting.command_speed, setting.beta
    kept = (keep or KeptWalks()).spaced(trials)
    steps = round((seconds + SETTLE_TIME) / env.step_dt)
    with (
        filming(env, kept, SETTLE_TIME) as films,
        Listener(
            env,
            [surface],
            microphone=microphone,
            sources=sources,
            settle_time=SETTLE_TIME,
            seed=seed,
            wav=films.sounds,
            from_energies=from_energies,
            room=room,
        ) as listener,
    ):

        def hear(_: object, dones: torch.Tensor) -> None:
            listener.listen(dones)
            films.record()
            if on_step is not None:
                on_step()

        meter = run_trial(env, policy.controller(env.cfg), commands, steps, hear)
    kept.note_clipped(listener.clipped)
    levels = listener.levels()
    weight = robot_weight(env)
    who = "nominal" if nominal else "different"
    rows = []
    for index, setting in enumerate(settings):
        chosen = torch.zeros(robots, dtype=torch.bool)
        chosen[index * trials : (index + 1) * trials] = True
        own = levels[index * trials : (index + 1) * trials]
        rows.append(_row((policy.task, surface, who), setting, meter.gait(chosen), own, weight))
    return rows


def robot_weight(env: QuadrupedEnv) -> float:
    """Return the robot's weight, N."""
    return float(env.model.body_mass.sum()) * float(np.linalg.norm(env.model.opt.gravity))


def _row(
    case: tuple[str, str, str],
    setting: NoiseSetting,
    gait: Gait,
    levels: Sequence[HeardLevels],
    weight: float,
) -> NoiseRow:
    heard = [trial for trial in levels if math.isfinite(trial.mnl)]
    mnl, mnl_std, mnl_ci95 = mean_with_interval([trial.mnl for trial in heard])
    pnl, pnl_std, pnl_ci95 = mean_with_interval([trial.pnl for trial in heard])
    power = _mean_power(levels)
    own = asdict(gait) | {"power": power}
    shared = {name: own[name] for name in NoiseRow.__dataclass_fields__ if name in own}
    return NoiseRow(
        method=case[0],
        beta=setting.beta,
        surface=case[1],
        robots=case[2],
        command_speed=setting.command_speed,
        trials=len(levels),
        trials_heard=len(heard),
        mnl_mean=mnl,
        mnl_std=mnl_std,
        mnl_ci95=mnl_ci95,
        pnl_mean=pnl,
        pnl_std=pnl_std,
        pnl_ci95=pnl_ci95,
        laeq_mean=mean_with_interval([trial.laeq for trial in heard])[0],
        **{
            f"laeq_{name}": _mean_energy([trial.sources.get(name, math.nan) for trial in levels])
            for name in SOURCES
        },
        speed_mean=gait.speed,
        cost_of_transport=power / (weight * gait.speed) if gait.speed > 0.0 else math.nan,
        **shared,
    )


def _mean_power(levels: Sequence[HeardLevels]) -> float:
    """Return the power over the time of all trials together, W; NaN where none counts."""
    counted = [trial for trial in levels if trial.seconds > 0.0]
    seconds = sum(trial.seconds for trial in counted)
    work = sum(trial.power * trial.seconds for trial in counted)
    return work / seconds if counted else math.nan


def _mean_energy(values: Sequence[float]) -> float:
    """Return the level of the mean energy, dB, without values that are NaN; NaN if all are."""
    known = [10.0 ** (0.1 * value) for value in values if not math.isnan(value)]
    if not known:
        return math.nan
    mean = sum(known) / len(known)
    return 10.0 * math.log10(mean) if mean > 0.0 else -math.inf
