"""`play.py`: watch a policy walk, hear it, steer it, film it, or have its figures."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.files.writing import has_samples
from mute.acoustics.floors import FLOORS
from mute.acoustics.live_listener import LiveListener
from mute.acoustics.soundscape import SOURCES
from mute.command_lines.arguments import (
    LONGEST_WALK,
    MANY_ROBOTS,
    check_option,
    check_seed,
    check_video,
    check_wav,
    command_line,
    parse,
)
from mute.command_lines.play_choices import with_all_sensors
from mute.command_lines.play_figures import live_captions, report, stretch, summary
from mute.command_lines.play_page import (
    DEFAULT_HOST,
    DEFAULT_PORT,
    check_page,
    check_place,
    walk_in_page,
)
from mute.command_lines.play_sound import check_sound, played_aloud
from mute.command_lines.policy_options import DriverArgs
from mute.command_lines.sound_options import (
    MicrophonePlace,
    Sources,
    check_sources,
    find_microphone,
    progress_bar,
    tell,
)
from mute.controllers.command import COMMAND_LIMITS, Command
from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import Look
from mute.envs.terrain import GROUNDS, TerrainCfg
from mute.envs.terrain.figures import LEVELS
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.live.gamepad import GAMEPAD_HELP, Gamepad
from mute.live.gamepad_process import gamepad_process
from mute.live.keys import KEYS_HELP
from mute.rendering.backend import has_display, why_no_window
from mute.rendering.height_dots import HeightDots
from mute.rendering.sound_track import temporary_sound
from mute.rendering.video import Video
from mute.support.errors import MuteError
from mute.support.ranges import Range
from mute.support.signals import exit_status
from mute.support.streams import patient_output
from mute.support.threads import use_collection_threads

__all__ = ["PlayArgs", "main"]

_DEFAULT_SECONDS = 20.0
_STAND_TIME = 0.5
"""Time that robots stand before they get the command, s; a quarter of a shorter walk."""
_SETTLE_TIME = 1.0
"""Time with the command that the figures leave out at first, s; half of a shorter walk."""
_SURFACE = "wood"
"""Floor that is heard, and walked on where sound is kept, unless one is named."""

_DESCRIPTION = f"""\
Watch a policy walk, hear it, steer it, film it, or have its figures.

Where there is a display, a window opens; else figures are printed as it walks.

{KEYS_HELP}

{GAMEPAD_HELP}"""


@dataclass
class PlayArgs(DriverArgs):
    """Arguments of `play.py`."""

    beta: float = 0.5
    """Quiet factor: 0 for speed, 1 for silence."""
    vx: float = 0.5
    """Forward velocity, m/s; from -2 to 2."""
    vy: float = 0.0
    """Velocity to the left, m/s; from -1 to 1."""
    wz: float = 0.0
    """Yaw rate, rad/s; from -2 to 2."""
    seconds: float | None = None
    """Time to walk, s; 20 unless given, or until the window is closed."""
    seed: int = 0
    """Seed of the first states and of the noise in the sound."""
    num_envs: int = 1
    """Number of robots; the first is shown and heard, all other figures are of all."""
    begin: Literal["standing", "moving"] = "standing"
    """How robots begin: standing, at rest in the exact stance (several robots each a little beside
    it), with the command half a second later; moving, near the stance with a little speed in any
    direction, as in training."""
    terrain: str = "flat"
    """Ground to walk on: flat, slopes, uneven, blocks, stairs, stairs_down or rooms; indoor or
    rough, for several robots, is a mix of these. Except on flat ground, pictures have dots: green
    where it is, orange where the policy takes it to be."""
    level: int = 2
    """How difficult it is, 0 to 4."""
    surface: str | None = None
    """Floor to walk on and to hear, with physics at 1 ms: wood, parquet, laminate, carpet,
    tile or concrete. Unless given, training's floor in steps of 5 ms at most, with a level
    (modelled, sounding as wood); with --sound, --wav or --video, wood."""
    sources: Sources = SOURCES
    microphone: MicrophonePlace = "trunk"
    sound: bool = False
    """Play the modelled sound of the first robot through this machine's loudspeakers while it walks
    in a window or a page; needs sounddevice: pip install 'mute[sound]'."""
    wav: Path | None = None
    """Keep the modelled sound of the first robot in this .wav file."""
    video: Path | None = None
    """Film to this .mp4 file, with sound, without a window."""
    viewer: Literal["auto", "native", "web", "none"] = "auto"
    """native opens a window, auto does where there is a display; web serves a page to watch and
    steer in from any browser, until Ctrl-C or for --seconds; none does neither."""
    host: str = DEFAULT_HOST
    """Address that the page of --viewer web listens at; 0.0.0.0 is seen from other machines."""
    port: int = DEFAULT_PORT
    """Port of that page; where it is taken, the next free one."""
    policies: tuple[Path, ...] = ()
    """Further policies that can be chosen in the page while it walks: checkpoints, .onnx files, or
    'latest'."""
    look: Look = "primitives"
    """The robot's look; menagerie needs the package mujoco_menagerie."""
    json: bool = False
    """Print one JSON object with the figures on standard output, and nothing else there."""

    def check(self) -> None:
        """Check the ranges.

        Raises:
            MuteError: If a value is out of its range.
        """
        for name, (low, high) in COMMAND_LIMITS.items():
            check_option(name, getattr(self, name), Range(low, high))
        if self.seconds is not None:
            check_option("seconds", self.seconds, Range(0.0, LONGEST_WALK, above=True))
        check_option("num-envs", self.num_envs, MANY_ROBOTS)
        check_seed(self.seed)
        check_option("level", self.level, Range(0, LEVELS - 1, whole=True))
        if self.terrain not in GROUNDS:
            raise MuteError(f"--terrain must be one of {', '.join(GROUNDS)}, got {self.terrain!r}")
        kinds = GROUNDS[self.terrain]
        if len(kinds) > self.num_envs:
            raise MuteError(
                f"--terrain {self.terrain} is {', '.join(kinds)}, so it takes as many robots at "
                f"least: --num-envs {len(kinds)}, got {self.num_envs}"
            )
        if self.surface is not None and self.surface not in FLOORS:
            allowed = ", ".join(FLOORS)
            raise MuteError(f"--surface must be one of {allowed}, got {self.surface!r}")
        check_wav(self.wav)
        check_video(self.video)
        check_sources(self.sources)
        find_microphone(self.microphone)
        if self.video and self.viewer == "native":
            raise MuteError("--video films without a window, so not with --viewer native")
        if self.video and self.viewer == "web":
            raise MuteError("--video films as fast as it can, so not with --viewer web")
        check_place(self.viewer == "web", self.host, self.port, self.policies)
        if self.sound and (self.video or self.viewer == "none"):
            raise MuteError(
                "--sound plays a walk that is watched, so not with --video or --viewer none"
            )

    @property
    def command(self) -> Command:
        """What the robots are asked to do at first."""
        return Command(self.vx, self.vy, self.wz, self.beta)

    @property
    def floor(self) -> str | None:
        """Name of the floor to walk on; None for training's."""
        return self.surface or (_SURFACE if self.sound or self.sound_file else None)

    @property
    def sound_file(self) -> Path | None:
        """File for the sound; that of a video alone is beside it, until it is put in."""
        if self.wav or not self.video:
            return self.wav
        return temporary_sound(self.video)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, a policy cannot be used, or a picture cannot be made.
    """
    args = parse(PlayArgs, command_line() if argv is None else argv, _DESCRIPTION)
    args.check()
    # The reader of our lines, `head` say, may have had enough: that must not cost a film.
    with patient_output() if args.video or args.wav else contextlib.nullcontext():
        if not args.json:
            return _play(args)[1]
        # Whatever a library may print must not get between the reader and the object.
        with contextlib.redirect_stdout(sys.stderr):
            session, status = _play(args)
        print(json.dumps(report(session), allow_nan=False))
        return status


def _play(args: PlayArgs) -> tuple[Session, int]:
    """Walk as asked and return the walk and the exit status."""
    use_collection_threads()
    in_page, in_window = args.viewer == "web", _wants_window(args)
    if in_page:
        check_page()
    if args.sound:
        check_sound(in_page or in_window)
    args = args.with_driver_found()
    endless = (in_page or in_window) and args.seconds is None
    session = _make_session(args, endless)
    status = 0
    try:
        if in_page:
            num_steps = None if args.seconds is None else _num_steps(args, session)
            place, dots = (args.host, args.port), _height_dots(args, session)
            with _aloud(args, session):
                walk_in_page(args, args.policies, place, session, num_steps, dots)
        elif in_window:
            _walk_in_window(args, session)
        elif args.video:
            _walk_on_video(args, session, args.video)
        else:
            _walk_in_text(args, session)
    except KeyboardInterrupt as stop:
        print(f"interrupted after {session.seconds:.1f} s", file=sys.stderr)
        status = exit_status(stop)
    if args.wav:
        _tell_sound(args.wav, session)
    if not args.json:
        _print_summary(session, args.floor)
    return session, status


def _tell_sound(path: Path, session: Session) -> None:
    """Say what became of the file of the sound; one that never began is removed."""
    if not (path.exists() and has_samples(path)):
        path.unlink(missing_ok=True)
        print(f"{path} is not written: the walk ended before its sound began", file=sys.stderr)
        return
    clipped = session.listener.clipped if session.listener else 0
    note = f" ({clipped} samples are clipped)" if clipped else ""
    print(f"sound: {path}{note}", file=sys.stderr)


def _wants_window(args: PlayArgs) -> bool:
    """Tell whether to open a window.

    Raises:
        MuteError: If one is asked for and none can open.
    """
    if args.viewer in ("none", "web") or args.video:
        return False
    reason = why_no_window(os.environ, sys.platform)
    if reason is None:
        return True
    if args.viewer == "native":
        raise MuteError(f"--viewer native: {reason}")
    if has_display(os.environ, sys.platform):
        print(f"figures in place of a window: {reason}", file=sys.stderr)
    return False


def _make_session(args: PlayArgs, endless: bool) -> Session:
    policy = args.driver()
    seconds = LONGEST_WALK if endless else args.seconds or _DEFAULT_SECONDS
    stand_time = min(_STAND_TIME, 0.25 * seconds) if args.begin == "standing" else 0.0
    settle_time = min(stand_time + _SETTLE_TIME, 0.5 * seconds)
    env = _make_env(args, policy, seconds)
    listener = _make_listener(args, env, settle_time)
    _print_header(args, policy)
    controller = policy.controller(env.cfg)
    return Session(env, controller, args.command, settle_time, listener, stand_time)


def _make_env(args: PlayArgs, policy: Driver, seconds: float) -> QuadrupedEnv:
    """Return the robots, on a floor and with physics that can be heard if that is wanted.

    Raises:
        MuteError: If the policy's rate goes with no floor.
    """
    levels = (args.level, args.level)
    terrain = TerrainCfg(kind=args.terrain, first_levels=levels, curriculum=False)
    cfg = evaluation_cfg(policy.cfg.env, args.num_envs, seconds, args.seed, terrain=terrain)
    if args.begin == "standing":
        # Of several, each stands a little differently.
        joint_noise = cfg.initial_joint_noise if args.num_envs > 1 else 0.0
        cfg = dataclasses.replace(from_the_stance(cfg), initial_joint_noise=joint_noise)
    # All walk along x, so that the camera has the same view of every walk.
    scene = dataclasses.replace(cfg.scene, look=args.look)
    cfg = dataclasses.replace(cfg, random_heading=False, scene=scene)
    if args.viewer == "web":
        cfg = with_all_sensors(cfg)
    if args.floor or args.viewer == "web" or not args.json:
        try:
            cfg = audible_cfg(cfg, args.floor)
        except ValueError as error:
            raise MuteError(f"--surface {args.floor}: {error}") from error
    return QuadrupedEnv(cfg)


def _make_listener(args: PlayArgs, env: QuadrupedEnv, settle_time: float) -> LiveListener | None:
    if not env.cfg.scene.foot_forces:
        return None
    surface = args.floor or _SURFACE
    return LiveListener(
        env,
        surface,
        settle_time,
        args.seed,
        args.sound_file,
        find_microphone(args.microphone),
        args.sources,
    )


def _num_steps(args: PlayArgs, session: Session) -> int:
    return max(1, round((args.seconds or _DEFAULT_SECONDS) / session.env.step_dt))


def _walk_in_window(args: PlayArgs, session: Session) -> None:
    from mute.live.window import watch  # loads GLFW, which only a window needs

    def shown() -> dict[str, str]:
        command = session.command
        return {
            "beta": f"{command.beta:.2f}",
            "command": f"{command.vx:.2f} {command.vy:.2f} m/s {command.wz:.2f} rad/s",
            **live_captions(session),
        }

    print(KEYS_HELP, GAMEPAD_HELP, sep="\n", flush=True)
    num_steps = None if args.seconds is None else _num_steps(args, session)
    heard = session.listener or contextlib.nullcontext()
    with heard, _aloud(args, session), gamepad_process() as pad:
        watch(session, num_steps, shown, _height_dots(args, session), Gamepad(pad, tell))


def _aloud(args: PlayArgs, session: Session) -> contextlib.AbstractContextManager[None]:
    """Return what plays the walk through the loudspeakers, where that is asked for."""
    if not args.sound:
        return contextlib.nullcontext()
    microphone = find_microphone(args.microphone)
    return played_aloud(session, args.floor or _SURFACE, args.seed, microphone, args.sources)


def _height_dots(args: PlayArgs, session: Session) -> HeightDots | None:
    """Return the heights to draw, where they differ."""
    return None if args.terrain == "flat" else HeightDots(session.env, session.controller)


def _walk_on_video(args: PlayArgs, session: Session, path: Path) -> None:
    video = Video(path, session.env, args.sound_file, dots=_height_dots(args, session))
    try:
        with video:
            _walk_in_text(args, session, video.record)
    except KeyboardInterrupt:
        print(f"{path} holds what was filmed so far", file=sys.stderr)
        raise
    finally:
        if video.silent_because:
            print(f"{path} is without sound: {video.silent_because}", file=sys.stderr)
        if args.sound_file and not args.wav:
            args.sound_file.unlink(missing_ok=True)
    print(f"video: {path} ({video.frame_rate:.0f} pictures a second)", file=sys.stderr)


def _walk_in_text(
    args: PlayArgs, session: Session, on_step: Callable[[], None] | None = None
) -> None:
    """Walk as fast as it goes and print the figures of each second, or a bar while filming."""
    num_steps = _num_steps(args, session)
    per_second = round(1.0 / session.env.step_dt)
    show_bar = on_step is not None and not args.json and sys.stderr.isatty()
    heard = session.listener or contextlib.nullcontext()
    bar = progress_bar("filming", num_steps) if show_bar else contextlib.nullcontext()
    with heard, bar as advance:
        for step in range(num_steps):
            session.step()
            if on_step is not None:
                on_step()
            if advance is not None:
                advance(step + 1)
            if session.steps % per_second == 0 and not (show_bar or args.json):
                figures = [f"{k} {v}" for k, v in live_captions(session).items()]
                print(f"{session.seconds:5.1f} s", *figures, sep=" | ", flush=True)


def _print_header(args: PlayArgs, policy: Driver) -> None:
    command = args.command
    beta = f"beta {command.beta:g}" if policy.quiet_factor else "beta changes nothing"
    print(
        f"{policy.task}, iteration {policy.iteration}: {beta}, asked for "
        f"{command.vx:g} m/s forward, {command.vy:g} m/s left, {command.wz:g} rad/s"
        + (f", on {args.floor}" if args.floor else ""),
        flush=True,
    )


def _print_summary(session: Session, floor: str | None) -> None:
    robots = session.env.num_envs
    print(f"\n{stretch(session)}, {robots} robot{'s' * (robots > 1)}:")
    for name, text in summary(session, floor).items():
        print(f"  {name:20}{text}")
