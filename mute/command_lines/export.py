"""Export a policy as one ONNX file: python -m mute.export --policy PATH --out policy.onnx."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mute.command_lines.arguments import command_line, parse
from mute.command_lines.policy_options import PolicyArgs
from mute.controllers import load_policy
from mute.controllers.onnx_export import export_policy

__all__ = ["ExportArgs", "main"]


@dataclass
class ExportArgs(PolicyArgs):
    """Arguments of the command line."""

    out: Path = Path("policy.onnx")
    """ONNX file to write or replace."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If the policy cannot be loaded or the file cannot be written.
    """
    argv = command_line() if argv is None else argv
    args = parse(ExportArgs, argv, "Export a policy as one ONNX file.")
    export_policy(load_policy(args.with_policy_found().policy), args.out)
    print(f"wrote {args.out}")
    return 0
