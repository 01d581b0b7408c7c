"""What a training leaves behind: TensorBoard curves and a JSON Lines file.

Built on rsl_rl's own hooks: a `LogWriter` for the curves and a subclass of its `Logger`, whose
console page gives way to a callback; what that shows is left to the displays.
"""

from __future__ import annotations

import contextlib
import io
import json
import statistics
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rsl_rl.utils import LogWriter
from rsl_rl.utils.logger import Logger
from torch.utils.tensorboard import SummaryWriter

from mute.learning.distributed import Ranks
from mute.support.files import replace_file

__all__ = ["CurveWriter", "MeanCurves", "TrainingLogger"]


class CurveWriter(LogWriter):
    """Writes every scalar to TensorBoard and, an iteration a line, to `curves.jsonl`."""

    def __init__(self, log_dir: str, first_iteration: int = 0) -> None:
        """Open the files; those of an interrupted run are continued.

        Args:
            log_dir: Directory of the run.
            first_iteration: Iteration that logging goes on with; what the files hold from it on was
                logged by a run that ended without saving it, and is dropped.
        """
        _outlast_second_of_newest(Path(log_dir))
        self._tensorboard = SummaryWriter(
            log_dir=log_dir, purge_step=first_iteration or None, flush_secs=10
        )
        self._path = Path(log_dir) / "curves.jsonl"
        _drop_from(self._path, first_iteration)
        self.latest: dict[str, float] = {}
        """The current iteration's scalars by tag."""

    def add_scalar(self, tag: str, scalar_value: float, global_step: int) -> None:
        """Log a scalar."""
        # rsl_rl logs some curves a second time over seconds; TensorBoard can show that by itself.
        if tag.endswith("/time"):
            return
        self.latest[tag] = float(scalar_value)
        self._tensorboard.add_scalar(tag, scalar_value, global_step)

    def end_iteration(self, iteration: int) -> dict[str, float]:
        """Append the iteration's scalars to the file and return them."""
        scalars, self.latest = self.latest, {}
        with self._path.open("a") as file:
            file.write(json.dumps({"iteration": iteration, **scalars}) + "\n")
        return scalars

    def stop(self) -> None:
        """Close the files."""
        self._tensorboard.close()


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
        on_iteration: Callable[[int, int, dict[str, float]], None],
        ranks: Ranks,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Prepare to log.

        Args:
            *args: What `Logger` takes.
            measure: Called with an iteration; returns further scalars for its curves.
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
        self._measure = measure
        self._on_iteration = on_iteration
        self._ranks = ranks

    def init_logging_writer(self) -> None:
        """Open the curves, quietly."""
        with contextlib.redirect_stdout(io.StringIO()):
            super().init_logging_writer()
        if self._ranks.several and self.log_dir is not None:
            curves = self.writer if isinstance(self.writer, CurveWriter) else None
            self.writer = MeanCurves(self._ranks, curves)

    def log(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401
        """Log an iteration, see `Logger.log`; show it on the display instead of the console."""
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(*args, **kwargs)
        # rsl_rl's runner names every argument.
        iteration, total = kwargs["it"], kwargs["total_it"]
        scalars: dict[str, float] = {}
        if isinstance(self.writer, CurveWriter | MeanCurves):
            for tag, value in self._measure(iteration).items():
                self.writer.add_scalar(tag, value, iteration)
            scalars = self.writer.end_iteration(iteration)
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


def _outlast_second_of_newest(log_dir: Path) -> None:
    """Wait, a second at most, until a new event file's name comes after all that are there.

    TensorBoard reads a run's files in the order of their names, which begin with the second of
    their making and go on with the process. A run that is resumed within that second could be read
    before what it continues, and what it drops would show again.
    """
    made = {path.name.split(".")[3] for path in log_dir.glob("events.out.tfevents.*")}
    while f"{int(time.time()):010d}" in made:
        time.sleep(0.01)


def _drop_from(path: Path, first_iteration: int) -> None:
    """Keep the lines before an iteration; a line that a killed process cut short goes as well.

    The new file takes the place of the old one whole, so that a full disk costs no curves.
    """
    if not path.exists():
        return
    kept = []
    for line in path.read_text().splitlines(keepends=True):
        with contextlib.suppress(ValueError):
            if json.loads(line)["iteration"] < first_iteration:
                kept.append(line)
    replace_file(path, "".join(kept).encode())
