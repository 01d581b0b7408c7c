"""Join pictures to a film: python build/encode_film.py FOLDER OUT.webp MILLISECONDS."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

WIDTH = 800
"""Of the film, pixels."""


def main() -> int:
    """Read the pictures of a folder in the order of their names, and write the film."""
    folder, out, period = sys.argv[1:]
    pictures = [_scaled(path) for path in sorted(Path(folder).glob("*.png"))]
    pictures[0].save(
        out,
        save_all=True,
        append_images=pictures[1:],
        duration=int(period),
        loop=0,
        quality=60,
        method=4,
    )
    print(f"wrote {out}, {Path(out).stat().st_size / 1e6:.2f} MB")
    return 0


def _scaled(path: Path) -> Image.Image:
    with Image.open(path) as picture:
        height = round(picture.height * WIDTH / picture.width)
        return picture.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    sys.exit(main())
