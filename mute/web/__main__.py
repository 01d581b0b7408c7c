"""Write the assets of the page: python -m mute.web --out web/assets."""

from __future__ import annotations

from mute.command_lines.entry_points import web

if __name__ == "__main__":
    web()
