"""Film two robots side by side, one fast and one quiet, with the level of each: an animated WebP.

The robots get the same command on the same floor and differ in beta alone. Levels are modelled:
what a sound level meter with Fast time weighting would show at the trunk. The picture on the front
page is made by

    python examples/side_by_side.py --out docs/side_by_side.webp
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import io
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mute.rendering.backend import find_backend
from mute.support.errors import MuteError, run_cli
from mute.support.files import replace_file
from mute.support.resources import shipped_file
from mute.support.threads import configure_threads
from mute.tasks import DEFAULT_TASK

if TYPE_CHECKING:
    from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["Clip", "main", "panel", "walk"]

_BETAS = (0.0, 1.0)
_COLORS = ("#d95f30", "#12807c")
_FLOOR = "wood"
_WOOD = (1.45, 1.12, 0.78)
"""What red, green and blue of the floor's pattern are multiplied by."""
_SPEED = 0.5
"""Commanded forward speed, m/s."""
_LOOK_AT_HEIGHT = 0.165
"""Height of the point that the camera looks at, m: the trunk's bobbing stays to be seen."""
_RATE = 25
"""Pictures a second."""
_WARM_UP = 4.0
"""Time walked before the first picture, s: both robots are on their way, and the trace is full."""
_TRACE = 3.0
"""Time that the trace shows, s."""
_SHOWN = 5
"""Pictures for which a figure stays: at 25 a second nobody could read it."""
_LOWEST, _HIGHEST = 50.0, 80.0
"""Levels at the bottom and the top of the trace, dBA."""
_PICTURE = (416, 264)
_STRIP = (416, 122)
"""Sizes of a robot's picture and of its levels below, pixels."""
_GAP = 8
_FINER = 3
"""Pixels drawn for each pixel that is kept, each way: PIL's lines have steps."""
_QUALITY = 62


@dataclass
class Clip:
    """What was seen and heard of one robot."""

    beta: float
    """Its quiet factor."""
    pictures: list[np.ndarray] = field(default_factory=list)
    """Shapes: (height, width, 3), uint8."""
    levels: list[float] = field(default_factory=list)
    """Fast level at each picture and, before the first, back to the start of the trace, dBA."""
    mean_level: float = math.nan
    """Mean of the Fast levels of the whole walk but its first second, dBA."""
    speed: float = math.nan
    """Mean forward speed of the same time, m/s."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If nothing renders here, the policy cannot be used, or the file not be written.
    """
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("side_by_side.webp"), help="file to write")
    parser.add_argument("--seconds", type=float, default=4.5, help="length of the film, s")
    policy = shipped_file(DEFAULT_TASK)
    parser.add_argument("--policy", type=Path, default=policy, help="who walks")
    args = parser.parse_args(sys.argv[1:] if argv is None else argv)
    if args.out.suffix != ".webp" or not args.out.parent.is_dir():
        raise MuteError(f"--out must name a .webp file in a folder that is there, got {args.out}")
    if not 1.0 / _RATE <= args.seconds <= 60.0:
        raise MuteError(f"--seconds must be from {1.0 / _RATE:g} to 60, got {args.seconds:g}")
    configure_threads()  # before torch is imported
    if sys.platform == "linux":
        os.environ["MUJOCO_GL"] = find_backend(os.environ)  # before mujoco is
    clips = [walk(args.policy, beta, round(args.seconds * _RATE)) for beta in _BETAS]
    _write(args.out, clips)
    for clip in clips:
        heard = f"{clip.mean_level:.1f} dBA on average (modelled)"
        print(f"beta {clip.beta:g}: {heard}, {clip.speed:.2f} m/s")
    print(f"written: {args.out}, {args.out.stat().st_size / 1e6:.2f} MB")
    return 0


def walk(policy: Path, beta: float, num_pictures: int) -> Clip:
    """Return what is seen and heard of a robot.

    Args:
        policy: Checkpoint of who walks.
        beta: Its quiet factor.
        num_pictures: How many pictures to take, `_RATE` a second.

    Raises:
        MuteError: If the policy cannot be used.
    """
    from mute.acoustics.audible_env import audible_cfg
    from mute.acoustics.live_listener import LiveListener
    from mute.controllers import LearnedController, load_policy
    from mute.controllers.command import Command
    from mute.envs.quadruped_env import QuadrupedEnv
    from mute.evaluation.session import Session
    from mute.evaluation.trials import evaluation_cfg

    learned = load_policy(policy)
    seconds = _WARM_UP + num_pictures / _RATE
    cfg = evaluation_cfg(learned.cfg.env, num_envs=1, seconds=seconds, seed=0)
    cfg = dataclasses.replace(cfg, random_heading=False)  # along x, across the picture
    env = QuadrupedEnv(audible_cfg(cfg, _FLOOR))
    listener = LiveListener(env, _FLOOR)
    session = Session(
        env, LearnedController(learned, 1), Command(_SPEED, 0.0, 0.0, beta), listener=listener
    )
    steps = round(1.0 / (_RATE * env.step_dt))
    clip = Clip(beta)
    with listener, _Camera(env) as camera:
        for picture in range(-round(_WARM_UP * _RATE), num_pictures):
            for _ in range(steps):
                session.step()
            clip.levels.append(listener.level())
            if picture >= 0:
                clip.pictures.append(camera.picture())
    clip.mean_level, clip.speed = listener.levels()["mnl"], session.gait().speed
    return clip


class _Camera(contextlib.AbstractContextManager["_Camera"]):
    """Looks at the only robot of an environment from its right side and walks along."""

    def __init__(self, env: QuadrupedEnv) -> None:
        import mujoco

        from mute.envs.picture import Picture

        self._picture = Picture(env)
        pixels = self._picture.model.texture("floor").data.reshape(-1, 3)
        pixels[:] = np.clip(pixels * _WOOD, 0, 255)
        self._env = env
        self._view = mujoco.MjvCamera()
        self._view.azimuth, self._view.elevation, self._view.distance = 74.0, -10.0, 1.05
        width, height = _PICTURE
        self._renderer = mujoco.Renderer(self._picture.model, height, width)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False

    def picture(self) -> np.ndarray:
        """Return the robot as it stands now. Shape: (height, width, 3), uint8."""
        self._picture.show(0)
        data = self._picture.data
        self._view.lookat[:] = (*data.qpos[:2], _LOOK_AT_HEIGHT)
        self._renderer.update_scene(data, self._view)
        return self._renderer.render().copy()

    def __exit__(self, *error: object) -> None:
        self._renderer.close()


def panel(clip: Clip, index: int, color: str) -> Image.Image:
    """Return one picture of a clip: the robot, and below it its level as a figure and a trace.

    Args:
        clip: What was seen and heard.
        index: Of the picture.
        color: Of the trace and of the label.
    """
    heard = clip.levels[: len(clip.levels) - len(clip.pictures) + index + 1]
    shown = heard[: len(heard) - index % _SHOWN]
    image = Image.new("RGB", (_PICTURE[0], _PICTURE[1] + _STRIP[1]), "white")
    image.paste(Image.fromarray(clip.pictures[index]), (0, 0))
    pace = f"{clip.speed:.2f} of {_SPEED:.2f} m/s asked"
    image.paste(_strip(heard[-round(_TRACE * _RATE) :], shown[-1], pace, color), (0, _PICTURE[1]))
    draw = ImageDraw.Draw(image)
    label = f"beta = {clip.beta:g}"
    draw.rounded_rectangle((10, 10, 10 + 106, 10 + 32), radius=7, fill=color)
    draw.text((10 + 53, 10 + 16), label, font=_font(20, bold=True), fill="white", anchor="mm")
    return image


def _strip(trace: Sequence[float], level: float, pace: str, color: str) -> Image.Image:
    """Return a level as a figure with what it is of, and its trace."""
    width, height = _STRIP
    image = Image.new("RGB", (width * _FINER, height * _FINER), "#f6f7f8")
    draw = ImageDraw.Draw(image)
    middle = 88.0
    draw.text(_fine(middle, 46), f"{level:.0f}", color, _font(64 * _FINER, True), anchor="mm")
    draw.text(_fine(middle, 91), "dBA, modelled", "#444444", _font(13 * _FINER), anchor="mm")
    draw.text(_fine(middle, 108), pace, "#777777", _font(11 * _FINER), anchor="mm")
    _draw_trace(image, trace, color)
    return image.resize(_STRIP, Image.Resampling.LANCZOS)


def _draw_trace(image: Image.Image, trace: Sequence[float], color: str) -> None:
    """Draw levels over time, the newest at the right end, and the scale that they stand on."""
    draw = ImageDraw.Draw(image)
    left, right, top, bottom = 206.0, _STRIP[0] - 12.0, 12.0, _STRIP[1] - 14.0

    def y_of(dba: float) -> float:
        share = (min(max(dba, _LOWEST), _HIGHEST) - _LOWEST) / (_HIGHEST - _LOWEST)
        return bottom - share * (bottom - top)

    for dba in (50, 60, 70, 80):
        draw.line([_fine(left, y_of(dba)), _fine(right, y_of(dba))], "#dcdfe3", _FINER)
        caption = _fine(left - 6.0, y_of(dba))
        draw.text(caption, str(dba), "#777777", _font(11 * _FINER), anchor="rm")
    step = (right - left) / (_TRACE * _RATE - 1)
    first = right - step * (len(trace) - 1)
    points = [_fine(first + step * i, y_of(dba)) for i, dba in enumerate(trace)]
    veil = Image.new("L", image.size, 0)
    ImageDraw.Draw(veil).polygon([*points, _fine(right, bottom), _fine(first, bottom)], fill=60)
    image.paste(Image.new("RGB", image.size, color), mask=veil)
    draw.line(points, color, round(2.2 * _FINER), joint="curve")


def _fine(x: float, y: float) -> tuple[float, float]:
    """Return where a place in a strip is in its finer drawing, pixels."""
    return _FINER * x, _FINER * y


def _write(path: Path, clips: Sequence[Clip]) -> None:
    """Write the clips side by side as an endless film."""
    frames = []
    for index in range(len(clips[0].pictures)):
        width = len(clips) * (_PICTURE[0] + _GAP) - _GAP
        frame = Image.new("RGB", (width, _PICTURE[1] + _STRIP[1]), "white")
        for place, (clip, color) in enumerate(zip(clips, _COLORS, strict=True)):
            frame.paste(panel(clip, index, color), (place * (_PICTURE[0] + _GAP), 0))
        frames.append(frame)
    film = io.BytesIO()
    frames[0].save(
        film,
        "WEBP",
        save_all=True,
        append_images=frames[1:],
        duration=1000 // _RATE,
        loop=0,
        quality=_QUALITY,
        method=4,
    )
    try:
        replace_file(path, film.getbuffer())
    except OSError as error:
        raise MuteError(f"--out: cannot write {path}: {error.strerror}") from error


@functools.cache
def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return a font that comes with matplotlib, so that letters look alike everywhere."""
    from matplotlib import font_manager

    weight = "bold" if bold else "normal"
    name = font_manager.FontProperties(family="DejaVu Sans", weight=weight)
    return ImageFont.truetype(font_manager.findfont(name), size)


if __name__ == "__main__":
    run_cli(main)
