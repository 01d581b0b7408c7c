"""Make the files of a policy that ships: python -m mute.release --checkpoint PATH."""

from __future__ import annotations

from mute.command_lines.entry_points import release

if __name__ == "__main__":
    release()
