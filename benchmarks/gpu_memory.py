"""Memory of the GPU: what a process has taken at most, and what is taken by all together.

Neither is read while something is timed: the first is counted by the allocators themselves, and the
driver's program runs only where nothing else does. Importing this loads the standard library alone.
"""

from __future__ import annotations

import shutil
import subprocess

__all__ = ["memory_in_use", "nvidia_smi", "peak_of_this_process"]

_BYTES_PER_MB = 2**20


def nvidia_smi(fields: str) -> list[str]:
    """Return what the driver tells of the first GPU; nothing without one.

    Args:
        fields: Names of what is asked, with commas between.
    """
    program = shutil.which("nvidia-smi")
    if program is None:
        return []
    command = [program, f"--query-gpu={fields}", "--format=csv,noheader,nounits"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=20.0)
    except (OSError, subprocess.TimeoutExpired):
        return []
    lines = result.stdout.splitlines()
    if result.returncode != 0 or not lines:
        return []
    return [word.strip() for word in lines[0].split(",")]


def memory_in_use() -> float | None:
    """Return how much memory of the first GPU all processes have, MB; None without one."""
    told = nvidia_smi("memory.used")
    try:
        return float(told[0]) if told else None
    except ValueError:
        return None


def peak_of_this_process(device: str) -> float | None:
    """Return what torch and Warp have had at most, MB, by their own counts; None on the CPU.

    What the driver itself takes for a process is not in it.
    """
    if device == "cpu":
        return None
    import torch
    import warp

    peak = torch.cuda.max_memory_reserved(device) + warp.get_mempool_used_mem_high(device)
    return peak / _BYTES_PER_MB
