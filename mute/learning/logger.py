"""What a training leaves behind: TensorBoard curves and a JSON Lines file.

Built on rsl_rl's own hooks: a `LogWriter` for the curves and a subclass of its `Logger`, whose
console page gives way to a callback; what that shows is left to the displays.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import logging
import statistics
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rsl_rl.utils import LogWriter
from rsl_rl.utils.logger import Logger
from torch.utils.tensorboard import SummaryWriter

from mute.learning.distributed import Ranks
from mute.support.files import DiskError, told_of_file, write_file

__all__ = ["CurveWriter", "MeanCurves", "TrainingLogger", "quiet_writer_thread"]

_LOG = logging.getLogger(__name__)

_CLOCK_TICK = 0.05
"""What a file's time may be behind the clock, s."""

_LAST_WORD = 1.0
"""Longest wait for a thread that has failed to say so, s."""


class CurveWriter(LogWriter):
    """Writes every scalar to TensorBoard and, an iteration a line, to `curves.jsonl`."""

    def __init__(self, log_dir: str, first_iteration: int = 0) -> None:
        """Open the files; those of an interrupted run are continued.

        Args:
            log_dir: Directory of the run.
            first_iteration: Iteration that logging goes on with; what the files hold from it on was
                logged by a run that ended without saving it, and is dropped.

        Raises:
            DiskError: If a file cannot be written, or the old curves not be read.
        """
        self._log_dir = Path(log_dir)
        self._path = self._log_dir / "curves.jsonl"
        with told_of_file(self._path):
            _outlast_second_of(self._path)
        with self._tensorboards():
            self._tensorboard = SummaryWriter(log_dir=log_dir, purge_step=first_iteration or None)
        _drop_from(self._path, first_iteration)
        self.latest: dict[str, float] = {}
        """The current iteration's scalars by tag."""

    def add_scalar(self, tag: str, scalar_value: float, global_step: int) -> None:
        """Log a scalar."""
        # rsl_rl logs some curves a second time over seconds; TensorBoard can show that by itself.
        if tag.endswith("/time"):
            return
        self.latest[tag] = float(scalar_value)
        with self._tensorboards():
            self._tensorboard.add_scalar(tag, scalar_value, global_step)

    def end_iteration(self, iteration: int) -> dict[str, float]:
        """Write the iteration's scalars out to both files and return them.

        Raises:
            DiskError: If a file cannot be written.
        """
        scalars, self.latest = self.latest, {}
        with told_of_file(self._path), self._path.open("a") as file:
            file.write(json.dumps({"iteration": iteration, **scalars}) + "\n")
        with self._tensorboards():
            # Its thread says of what it could not write when it is next asked; closing does not.
            self._tensorboard.flush()
        return scalars

    def stop(self) -> None:
        """Close the files."""
        with self._tensorboards():
            self._tensorboard.close()

    def _tensorboards(self) -> contextlib.AbstractContextManager[None]:
        return told_of_file(self._log_dir, "write TensorBoard's curves in")


class MeanCurves(LogWriter):
    """Takes every rank's scalars; the first writes each one's mean over the ranks that have it."""

    def __init__(self, ranks: Ranks, curves: CurveWriter | None) -> None:
        """Take what the first rank writes to; the others have nothing."""
        self._ranks, self._curves = ranks, curves
        self._own: dict[str, float] = {}

    def add_scalar(self, tag: str, scalar_value: float, global_step: int) -> None:
        """Keep a scalar until the end of the iteration."""
        self._own[tag] = float(scalar_value)

    def end_iteration(self, iteration: int) -> dict[str, float]:
        """Write the means and return them; the other ranks return nothing."""
        own, self._own = self._own, {}
        of_ranks = self._ranks.gather(own)
        if self._curves is None:
            return {}
        for tag in dict.fromkeys(tag for scalars in of_ranks for tag in scalars):
            values = [scalars[tag] for scalars in of_ranks if tag in scalars]
            self._curves.add_scalar(tag, statistics.fmean(values), iteration)
        return self._curves.end_iteration(iteration)

    def stop(self) -> None:
        """Close the files."""
        if self._curves is not None:
            self._curves.stop()


class TrainingLogger(Logger):
    """rsl_rl's logger with the console page replaced by a callback."""

    def __init__(
        self,
        *args: Any,  # noqa: ANN401
        measure: Callable[[int], dict[str, float]],
        on_begin: Callable[[], None],
        on_iteration: Callable[[int, int, dict[str, float]], None],
        ranks: Ranks,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Prepare to log.

        Args:
            *args: What `Logger` takes.
            measure: Called with an iteration; returns further scalars for its curves.
            on_begin: Called once the curves are open, before the first iteration.
            on_iteration: Called with (iteration, total, scalars) at the end of each.
            ranks: Processes whose mean figures are logged.
            **kwargs: What `Logger` takes.
        """
        super().__init__(
            *args,
            is_distributed=ranks.several,
            gpu_world_size=ranks.world_size,
            gpu_global_rank=ranks.rank,
            **kwargs,
        )
        # rsl_rl averages the last 100 episodes, which are those of all ranks together here as well.
        kept = max(1, 100 // ranks.world_size)
        self.rewbuffer, self.lenbuffer = deque(maxlen=kept), deque(maxlen=kept)
        self.disk_error: DiskError | None = None
        """Why curves could not be written, from the iteration on in which that was met."""
        self._measure = measure
        self._on_begin = on_begin
        self._on_iteration = on_iteration
        self._ranks = ranks

    def init_logging_writer(self) -> None:
        """Open the curves, quietly.

        Raises:
            DiskError: If a file cannot be written.
        """
        place = told_of_file(Path(self.log_dir or "."), "write in")
        with contextlib.redirect_stdout(io.StringIO()), place:
            super().init_logging_writer()
        if self._ranks.several and self.log_dir is not None:
            curves = self.writer if isinstance(self.writer, CurveWriter) else None
            self.writer = MeanCurves(self._ranks, curves)
        self._on_begin()

    def log(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401
        """Log an iteration, see `Logger.log`; show it on the display instead of the console.

        A disk that refuses is kept in `disk_error`: the iteration has been learnt, and what comes
        of it is to be saved before anything else.
        """
        # rsl_rl's runner names every argument.
        iteration, total = kwargs["it"], kwargs["total_it"]
        scalars: dict[str, float] = {}
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                super().log(*args, **kwargs)
            if isinstance(self.writer, CurveWriter | MeanCurves):
                for tag, value in self._measure(iteration).items():
                    self.writer.add_scalar(tag, value, iteration)
                scalars = self.writer.end_iteration(iteration)
        except DiskError as error:
            self.disk_error = error
        self._on_iteration(iteration, total, scalars)

    def state_dict(self) -> dict[str, Any]:
        """Return the running averages, so that curves go on where they stopped."""
        return {
            "rewards": list(self.rewbuffer),
            "lengths": list(self.lenbuffer),
            "reward_sum": self.cur_reward_sum.clone(),
            "episode_length": self.cur_episode_length.clone(),
            "total_steps": self.tot_timesteps,
            "total_time": self.tot_time,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`."""
        self.rewbuffer.extend(state["rewards"])
        self.lenbuffer.extend(state["lengths"])
        self.cur_reward_sum = state["reward_sum"].to(self.device)
        self.cur_episode_length = state["episode_length"].to(self.device)
        self.load_totals(state)

    def load_totals(self, state: dict[str, Any]) -> None:
        """Continue the counts of a `state_dict` alone."""
        self.tot_timesteps, self.tot_time = state["total_steps"], state["total_time"]


@contextlib.contextmanager
def quiet_writer_thread() -> Iterator[None]:
    """Keep the thread that writes for TensorBoard from printing what it meets on the disk.

    It hands that on to the next call of its writer, where it becomes one line.
    """
    report, others = threading.excepthook, set(threading.enumerate())

    def tell(args: threading.ExceptHookArgs) -> None:
        if not (isinstance(args.exc_value, OSError) and _passes_tensorboard(args.exc_value)):
            report(args)

    threading.excepthook = tell
    try:
        yield
    except DiskError:
        # Its own report may come after that call of its writer.
        for thread in set(threading.enumerate()) - others:
            thread.join(_LAST_WORD)
        raise
    finally:
        threading.excepthook = report


def _passes_tensorboard(error: BaseException) -> bool:
    frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    return any(str(frame.f_globals.get("__name__")).startswith("tensorboard.") for frame in frames)


def _outlast_second_of(curves: Path) -> None:
    """Wait, a second at most, until a new event file's name comes after all that are there.

    TensorBoard reads a run's files in the order of their names, which begin with the second of
    their making and go on with the machine and the process. A run that is resumed within that
    second could be read before what it continues, and what it drops would show again. The curves
    were last written after the newest event file was made.
    """
    if not curves.exists():
        return
    written = curves.stat().st_mtime + _CLOCK_TICK
    deadline = time.monotonic() + 1.0
    while int(time.time()) <= int(written) and time.monotonic() < deadline:
        time.sleep(0.01)


def _drop_from(path: Path, first_iteration: int) -> None:
    """Keep the lines before an iteration; a line that a killed process cut short goes as well.

    The new file takes the place of the old one whole, so that a full disk costs no curves. Where
    more is damaged than the last line, the old one is kept beside it, and that is told.

    Raises:
        DiskError: If the file cannot be read or written.
    """
    if not path.exists():
        return
    with told_of_file(path, "read"):
        content = path.read_bytes()
    *lines, cut_short = content.split(b"\n")
    lines += [cut_short] if _iteration_of(cut_short) is not None else []
    iterations = [_iteration_of(line) for line in lines]
    if None in iterations:
        old = _free_name(path.with_name("curves.damaged.jsonl"))
        write_file(old, content)
        count = iterations.count(None)
        _LOG.warning("%s: %d damaged lines are left out; %s has them all", path, count, old)
    pairs = zip(lines, iterations, strict=True)
    kept = [line + b"\n" for line, own in pairs if own is not None and own < first_iteration]
    write_file(path, b"".join(kept))


def _free_name(path: Path) -> Path:
    names = (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(1))
    return next(name for name in itertools.chain([path], names) if not name.exists())


def _iteration_of(line: bytes) -> int | None:
    """Return which iteration a line of the curves is of; None if it is damaged."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        return None
    iteration = content.get("iteration") if isinstance(content, dict) else None
    return iteration if type(iteration) is int and iteration >= 0 else None
