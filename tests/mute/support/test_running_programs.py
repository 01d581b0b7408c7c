"""Programs are run to their end, and asked to end where nobody waits any more."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from mute.support.programs import run_program

_SAVES = """
import pathlib, signal, sys, time
def save(number, frame):
    time.sleep(0.3)
    pathlib.Path(sys.argv[1], "saved").touch()
    sys.exit(0)
signal.signal(signal.SIGTERM, save)
pathlib.Path(sys.argv[1], "begun").touch()
time.sleep(60)
"""


@pytest.mark.parametrize("status", [0, 3])
def test_the_status_is_the_programs(status):
    assert (
        run_program([sys.executable, "-c", f"print('said'); raise SystemExit({status})"]) == status
    )


def _interrupt_once_begun(folder: Path) -> None:
    while not (folder / "begun").exists():
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupt_lets_the_program_save_what_it_has(tmp_path):
    threading.Thread(target=_interrupt_once_begun, args=(tmp_path,), daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        run_program([sys.executable, "-c", _SAVES, str(tmp_path)])
    assert (tmp_path / "saved").exists()
