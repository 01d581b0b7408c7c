"""Run the export: python -m mute.export --policy PATH --out policy.onnx."""

from __future__ import annotations

from mute.command_lines.entry_points import export

if __name__ == "__main__":
    export()
