"""Work in a process of its own, so that its memory is that of this work alone."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from mute.support.errors import MuteError

__all__ = ["call_apart", "peak_memory_mb"]


def call_apart(module: str, function: str, *arguments: str | float) -> Any:  # noqa: ANN401
    """Call a function in a new process and return what it returns, as plain data.

    Args:
        module: Name of its module.
        function: Its name there; it returns a dataclass.
        arguments: Numbers and words.

    Raises:
        MuteError: If the call fails; it ends with what the process said last.
    """
    code = (
        f"import dataclasses, json; from {module} import {function}; "
        f"print(json.dumps(dataclasses.asdict({function}(*{arguments!r}))))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    if result.returncode != 0:
        raise MuteError(f"the measurement failed: {result.stderr.strip()[-200:]}")
    return json.loads(result.stdout.splitlines()[-1])


def peak_memory_mb() -> float:
    """Return the largest memory that this process has held, MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # What `getrusage` tells begins with the memory of the process that started this one.
        (peak,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(peak.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # macOS: bytes
