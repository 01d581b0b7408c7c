"""Train as `train.py` does, and say how much memory of the GPU it took.

    python -m benchmarks.gpu_training OPTIONS OF train.py

Its last line is a JSON object.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from mute.command_lines import train
from mute.command_lines.arguments import command_line
from mute.support.errors import run_cli

from .gpu_memory import peak_of_this_process

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, or the training fails.
    """
    argv = command_line() if argv is None else list(argv)
    status = train.main(argv)
    device = argv[argv.index("--device") + 1] if "--device" in argv else "cpu"
    print(json.dumps({"peak_gpu_memory_mb": peak_of_this_process(device)}))
    return status


if __name__ == "__main__":
    run_cli(main)
