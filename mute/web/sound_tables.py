"""What the page's sound needs of Python: all that does not depend on the walk, as tables.

The page (`web/src/sound/`) makes the same sound as `mute.acoustics` as it goes, sample by sample.
What is worked out here once are the laws that it looks up: how blows press, how plates ring, how
the drive's forces come through, and the filters of noise and meter.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FORMAT", "packed", "sound_tables"]

FORMAT = 1
"""Version of the tables' layout; the page refuses any other."""


def sound_tables() -> dict[str, Any]:
    """Return the tables as nested dicts and lists of numbers, strings and float arrays.

    `packed` makes of them what the page loads: `sound.json` and `sound.bin` beside each other.

    - `format`: `FORMAT`; `sample_rate`: Hz, the only one that they are for (48000);
    - `air`: `speed_of_sound`, `impedance`; `foot_radius`, m; `p_ref`, Pa;
    - `landing`: `longest_pulse` s, `faintest` m/s, `place_size` m, `places`;
    - `low`: of what is worked out at a fraction of the sample rate: `divisor`, `delay` in samples,
      `interpolator` (taps * divisor,);
    - `contact_laws`: list of `exponent`, `stiffness`-free tables over the relative mobility:
      `yields` (n,), `duration` (n,), `impulse` (n,), `passed` (n, points);
    - `floors`: by name, in the order of `FLOORS`: `law` (index into `contact_laws`), `stiffness`,
      `exponent`, `mobility`, `friction`, `solref` (2,), `colour` (3,) and `plate`;
    - `shell`: `transmissibility`, `sides` (4,), `high_pass` (6,), `delay` s, and `plate`;
    - a `plate`: `direct` (sections, 6), `direct_gain` Pa m / N, `octaves` (bands,), `low` (bands,)
      0 or 1, `counts` (bands,), `decay` (bands,) s, `frequency` (tones,), `phase` (tones,),
      `strength` (places, tones) Pa m / (N s), `distances` (d,) m, `spread` (d, octaves) 1/m;
    - `drive`: `inertia` (12,), `backlash`, `stiffness`, `lever`, `tone_periods` (tones, 12),
      `tone_shares` (tones,);
    - `fan`: `level` dBA, `reference` m, `weight`, `filter` (6,); `scuffing`: `efficiency`,
      `filter` (6,);
    - `microphone`: `offset` (3,), `min_distance` m;
    - `meter`: `a_weighting` (sections, 6), `time_constant` s, `readings_per_second`,
      `first_reading`.
    """
    raise NotImplementedError


def packed(tables: dict[str, Any]) -> tuple[str, bytes]:
    """Return tables as JSON and the binary file of their arrays.

    In the JSON an array is `{"shape": [...], "offset": first number in the binary file}`; that holds
    float32 numbers, least significant byte first.
    """
    chunks: list[bytes] = []
    numbers = 0

    def plain(value: object) -> object:
        nonlocal numbers
        if isinstance(value, dict):
            return {str(name): plain(own) for name, own in value.items()}
        if isinstance(value, list | tuple):
            return [plain(own) for own in value]
        if isinstance(value, np.ndarray):
            reference = {"shape": list(value.shape), "offset": numbers}
            chunks.append(_bytes(value))
            numbers += value.size
            return reference
        return value

    return json.dumps(plain(tables), allow_nan=False), b"".join(chunks)


def _bytes(array: NDArray) -> bytes:
    if not np.isfinite(array).all():
        raise ValueError("a table of sound must be finite")
    return np.ascontiguousarray(array, dtype="<f4").tobytes()
