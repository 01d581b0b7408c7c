"""Record a walk as an H.264 video: off-screen pictures with the camera on the robot.

What renders is chosen by `backend`, before mujoco is imported. Walking is left to the caller, and
so is the sound: a WAV file that `sound_track` puts in at the end.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

import imageio
import imageio_ffmpeg
import mujoco
import numpy as np

from mute.envs.picture import Picture
from mute.envs.quadruped_env import QuadrupedEnv
from mute.rendering.encoder import ffmpeg_program
from mute.rendering.height_dots import HeightDots
from mute.rendering.sound_track import add_sound
from mute.support.errors import MuteError
from mute.support.threads import core_share

__all__ = ["Video"]

_WIDTH, _HEIGHT = 1280, 720
_SOFTWARE_RATE = 25.0
"""Most pictures a second where the processor renders; each costs it over 0.1 s."""
_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "software")
_BROKE_OFF = "the encoder broke off; is the disk full?"
_AZIMUTH = 125.0
"""Of the camera from the way that the robot faces at first, degrees."""
_LOOK_AT_HEIGHT = 0.2
"""Height of the point that the camera looks at, m: the trunk's bobbing stays to be seen."""


class Video:
    """A video file of one robot of an environment; a context manager.

    The file gets its name when it is complete. Leaving by Ctrl-C completes it with what there is;
    leaving by another exception removes it.
    """

    def __init__(
        self,
        path: Path,
        env: QuadrupedEnv,
        sound: Path | None = None,
        robot: int = 0,
        start: float = 0.0,
        dots: HeightDots | None = None,
    ) -> None:
        """Prepare to render and make the file's directory; the file itself begins on entering.

        Args:
            path: The file, its name ending in .mp4; an old one is replaced at the end.
            env: The environment to look at.
            sound: WAV file of the same walk, complete before the video is.
            robot: Index of the robot to follow.
            start: Time after which the film begins, s.
            dots: Heights to draw as dots.

        Raises:
            MuteError: If the path cannot be a video, or nothing renders or encodes.
        """
        self.path = path
        self.silent_because = ""
        """Why the sound is not in the complete file, in one line."""
        self.never_began = False
        """Whether the walk ended before the first picture, so that there is no file."""
        self._env = env
        self._sound = sound
        self._robot = robot
        self._dots = dots
        ffmpeg_program()
        self._temporary = _temporary_name(path)
        self._steps = -round(start / env.step_dt)
        self._pictures = 0
        self._robot_picture = Picture(env)
        self._renderer, software = _make_renderer(self._robot_picture.model)
        rate = min(_SOFTWARE_RATE, 1.0 / env.step_dt) if software else 1.0 / env.step_dt
        self._stride = max(1, round(1.0 / (rate * env.step_dt)))
        self.frame_rate = 1.0 / (self._stride * env.step_dt)
        """Pictures a second: one a control step, fewer where the processor has to render."""
        self._camera = mujoco.MjvCamera()
        self._camera.elevation, self._camera.distance = -14.0, 1.5

    def __enter__(self) -> Video:
        """Open the file; without a later start, it begins with a picture of the present."""
        self._writer: Any = imageio.get_writer(
            self._temporary,
            fps=self.frame_rate,
            codec="libx264",
            quality=8,
            pixelformat="yuv420p",  # what every player can show
            # The encoder would start threads for all processors of the machine.
            output_params=["-preset", "veryfast", "-threads", str(core_share())],
            ffmpeg_log_level="fatal",  # what it meets on the disk is told by us, in one line
        )
        try:
            if self._steps == 0:
                self._append()
        except BaseException as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the file, or remove it where nothing was filmed or after an error.

        Raises:
            MuteError: If the file cannot be completed.
        """
        self._renderer.close()
        wanted = exc_type is None or issubclass(exc_type, KeyboardInterrupt)
        self.never_began = wanted and self._pictures == 0
        if wanted and self._pictures:
            try:
                self._complete()
            except OSError as error:
                self._discard()
                raise _cannot_write(self.path, error) from error
        else:
            self._discard()

    def record(self) -> None:
        """Take in the control step that the environment has just made.

        Raises:
            MuteError: If the file cannot be written.
        """
        self._steps += 1
        if self._steps >= 0 and self._steps % self._stride == 0:
            self._append()

    def _complete(self) -> None:
        """Close the file, put the sound in, and give it its name even if that fails."""
        self._writer.close()
        self._check_whole()
        try:
            if self._sound is not None:
                add_sound(self._temporary, self._sound)
        except MuteError as error:
            self.silent_because = str(error)
        finally:
            os.replace(self._temporary, self.path)

    def _check_whole(self) -> None:
        """Raise OSError unless every picture is in the file: closing it says nothing of that."""
        try:
            pictures, _ = imageio_ffmpeg.count_frames_and_secs(self._temporary)
        except RuntimeError as error:
            raise OSError(_BROKE_OFF) from error
        if pictures != self._pictures:
            raise OSError(_BROKE_OFF)

    def _append(self) -> None:
        try:
            self._writer.append_data(self._picture())
        except OSError as error:
            raise _cannot_write(self.path, error) from error
        self._pictures += 1

    def _picture(self) -> np.ndarray:
        """Return the robot as it stands now. Shape: (height, width, 3), uint8."""
        self._robot_picture.show(self._robot)
        data = self._robot_picture.data
        if not self._pictures:  # the view of a walk is the same whatever way it begins
            forward = self._env.heading[self._robot]
            self._camera.azimuth = _AZIMUTH + math.degrees(math.atan2(forward[1], forward[0]))
        height = _LOOK_AT_HEIGHT + self._ground_height()
        self._camera.lookat[:] = (*data.qpos[:2], height)
        self._renderer.update_scene(data, self._camera)
        if self._dots is not None:
            self._dots.add_to(self._renderer.scene)
        return self._renderer.render()

    def _ground_height(self) -> float:
        """Return the mean height of the ground below the robot's map, m."""
        env = self._env
        above = env.ground.height_map(env.grid, env.base_pos, env.heading)[self._robot].mean()
        return float(env.base_pos[self._robot, 2] - above)

    def _discard(self) -> None:
        with contextlib.suppress(OSError):
            self._writer.close()
        self._temporary.unlink(missing_ok=True)


def _temporary_name(path: Path) -> Path:
    """Return where the file grows until it is complete, beside its place; it can be written.

    Raises:
        MuteError: If it cannot.
    """
    if path.is_dir():
        raise MuteError(f"--video: {path} is a directory")
    temporary = path.with_name(f"{path.stem}.{os.getpid()}.tmp.mp4")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch()
    except OSError as error:
        raise _cannot_write(path, error) from error
    temporary.unlink()
    return temporary


def _cannot_write(path: Path, error: OSError) -> MuteError:
    # An encoder that has ended leaves a broken pipe; imageio's error has no number then.
    reason = error.strerror or _BROKE_OFF
    return MuteError(f"--video: cannot write {path}: {reason}")


def _make_renderer(model: mujoco.MjModel) -> tuple[mujoco.Renderer, bool]:
    """Return a renderer, and whether the processor does its work."""
    try:
        software = _renders_in_software()
        if software:
            # Four times as fast; the edges' steps drown in the compression.
            model.vis.quality.offsamples = 0
            model.vis.quality.shadowsize = 2048
        renderer = mujoco.Renderer(model, _HEIGHT, _WIDTH)
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = not software
    except Exception as error:  # each platform's context raises its own
        raise MuteError(f"--video: cannot render here: {error}") from error
    return renderer, software


def _renders_in_software() -> bool:
    if sys.platform != "linux":
        return False
    from OpenGL import GL  # looks at what MuJoCo has chosen, so not before it

    context = mujoco.GLContext(16, 16)
    context.make_current()
    name = GL.glGetString(GL.GL_RENDERER) or b""
    context.free()
    return any(word in name.decode().lower() for word in _SOFTWARE_RENDERERS)
