"""The directory of a run: its name, whose it is, its parameters, and the command that goes on."""

from __future__ import annotations

import contextlib
import itertools
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from mute.checkpoint import first_line, newest_checkpoint
from mute.config import TaskCfg, to_plain
from mute.learning.distributed import Ranks
from mute.support.errors import MuteError
from mute.support.files import told_of_file, write_file
from mute.support.provenance import current_commit, machine_kind

__all__ = [
    "claim_run",
    "give_up_run",
    "last_saved",
    "plan_run",
    "program_name",
    "read_parameters",
    "resume_hint",
    "started_command",
    "write_parameters",
]

_PARAMETERS = "config.yaml"
_SCRIPT = "train.py"


def plan_run(of_task: Path, run_name: str, start: str) -> Path:
    """Return the directory of a new run, which `claim_run` makes once all else has gone well.

    Args:
        of_task: Directory of the task's runs.
        run_name: Name that the user gave, or nothing.
        start: Date and time, which names a run without one.

    Raises:
        MuteError: If the name is none, or a run has it.
    """
    name = run_name or start
    if Path(name).name != name or name == ".." or not name.isprintable():
        raise MuteError(f"--run-name must be a plain name on one line without '/', got {name!r}")
    run_dir = of_task / name
    if run_name and ((run_dir / _PARAMETERS).exists() or list(run_dir.glob("model_*.pt"))):
        raise _is_taken(run_dir)
    return run_dir


def claim_run(run_dir: Path, named: bool) -> Path:
    """Make the directory of a new run, which no other process takes for its own; return it.

    Args:
        run_dir: The directory that is planned.
        named: Whether the user gave the name. If not, and another run has begun in the same second,
            a number is added to it.

    Raises:
        MuteError: If a run has the name by now, or the directory cannot be made.
    """
    try:
        run_dir.parent.mkdir(parents=True, exist_ok=True)
        if not named:
            return _make_first_free(run_dir)
        run_dir.mkdir(exist_ok=True)
        (run_dir / _PARAMETERS).touch(exist_ok=False)
    except FileExistsError as error:
        if (run_dir / _PARAMETERS).exists():
            raise _is_taken(run_dir) from None
        raise MuteError(f"--log-dir: cannot make {run_dir}: {error.strerror}") from error
    except OSError as error:
        raise MuteError(f"--log-dir: cannot make {run_dir}: {error.strerror}") from error
    return run_dir


def give_up_run(run_dir: Path) -> None:
    """Remove the directory of a run that has not begun; what others have put into it stays."""
    with contextlib.suppress(OSError):
        (run_dir / _PARAMETERS).unlink(missing_ok=True)
        run_dir.rmdir()


def _make_first_free(run_dir: Path) -> Path:
    numbered = (run_dir.with_name(f"{run_dir.name}-{number}") for number in itertools.count(1))
    for directory in itertools.chain([run_dir], numbered):
        with contextlib.suppress(FileExistsError):
            directory.mkdir()
            return directory
    raise AssertionError("numbers do not end")


def _is_taken(run_dir: Path) -> MuteError:
    return MuteError(
        f"{run_dir} holds a run already: choose another --run-name, or go on with "
        f"--resume {shlex.quote(f'{run_dir}/model_N.pt')}"
    )


def write_parameters(
    run_dir: Path,
    task: str,
    cfg: TaskCfg,
    command: Sequence[str],
    before: Mapping[str, Any] | None = None,
) -> None:
    """Write what the run is re-made from, as it starts or goes on.

    The command that started it stays; those that went on are listed under `resumed`.

    Args:
        run_dir: Directory of the run.
        task: Name of the task.
        cfg: Its configuration.
        command: Words of the command that was given.
        before: What `read_parameters` returned, where the run goes on.

    Raises:
        DiskError: If the file cannot be written.
    """
    origin: dict[str, Any] = {
        "command": shlex.join(command),
        "commit": current_commit(),
        "machine": machine_kind(),
    }
    if before is not None:
        entries = [*before.get("resumed", []), origin]
        origin = {name: before.get(name) for name in origin} | {"resumed": entries}
    content = {"task": task, **origin, **to_plain(cfg)}
    write_file(run_dir / _PARAMETERS, yaml.safe_dump(content, sort_keys=False).encode())


def read_parameters(run_dir: Path) -> dict[str, Any] | None:
    """Return what a run was started with, as plain data; None where nothing tells of it.

    What tells which commands made the run has the form that `write_parameters` gives it.

    Raises:
        MuteError: If the file cannot be read, or is damaged.
    """
    path = run_dir / _PARAMETERS
    if not path.exists():
        return None
    try:
        with told_of_file(path, "read"):
            content = yaml.safe_load(path.read_bytes())
        _check_parameters(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise MuteError(
            f"{path} is damaged: {first_line(error)}; mend it, or move it away to go on without "
            "the commands that it tells of"
        ) from error
    return content


def _check_parameters(content: object) -> None:
    """Raise ValueError unless it is in words what began a run, and each time that it went on."""
    if not isinstance(content, dict):
        raise ValueError("it holds no fields")
    resumed = content.get("resumed", [])
    if not isinstance(resumed, list):
        raise ValueError("resumed must be a list")
    for index, origin in enumerate([content, *resumed]):
        place = f"resumed[{index - 1}]" if index else "it"
        for name in ("command", "commit", "machine"):
            told = origin.get(name) if isinstance(origin, dict) else origin
            if not isinstance(told, str | None):  # earlier versions told less
                raise ValueError(f"{place} must tell its {name} in words")


def started_command(ranks: Ranks, program: str) -> list[str]:
    """Return the words that start a training as this one was started, without its options.

    Args:
        ranks: Those that torchrun has started, or this process alone.
        program: What was run: the script, or the installed command.
    """
    launcher = shlex.split(ranks.launcher)
    if program.endswith(".py"):
        return [*launcher, program]
    found = shutil.which(Path(program).name)
    known = found is not None and Path(found).resolve() == Path(program).resolve()
    command = Path(program).name if known else program
    return [*launcher, "--no-python", command] if ranks.several else [command]


def program_name(argv: Sequence[str] | None) -> str:
    """Return what was run where the arguments are those of the process, else the script."""
    if argv is None and sys.argv[0] not in ("", "-c", "-m"):
        return sys.argv[0]
    return _SCRIPT


def resume_hint(command: Sequence[str], task: str, checkpoint: Path) -> str:
    """Return the command line that goes on from a checkpoint, quoted for a shell."""
    return shlex.join([*command, "--task", task, "--resume", str(checkpoint)])


def last_saved(run_dir: Path, command: Sequence[str], task: str) -> str:
    """Return in words which checkpoint of a run is the newest whole one, and how to go on."""
    newest = newest_checkpoint(run_dir)
    if newest is None:
        return "no checkpoint has been saved yet"
    return f"the last checkpoint is whole, go on with: {resume_hint(command, task, newest)}"
