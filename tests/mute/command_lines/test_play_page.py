"""`play.py --viewer web` really serves its page, tells its address, and ends cleanly."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest
from places import REPOSITORY

from mute.command_lines import play, play_page
from mute.support.errors import MuteError

COMMAND = [sys.executable, "play.py", "--viewer", "web"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--policies", "a.pt"], "--policies goes with --viewer web alone"),
        (["--host", "0.0.0.0"], "--host goes with --viewer web alone"),
        (["--port", "8081", "--viewer", "none"], "--port goes with --viewer web alone"),
        (["--viewer", "web", "--port", "0"], "--port must be an integer >= 1 and <= 65535, got 0"),
        (["--viewer", "web", "--port", "65536"], "--port must be an integer >= 1 and <= 65535"),
        (["--viewer", "web", "--host", ""], "--host must be a name or an address"),
        (["--viewer", "web", "--video", "a.mp4"], "not with --viewer web"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(MuteError, match=message):
        play.main(options)


def test_without_what_serves_it_the_page_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(play_page.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(MuteError, match=r"--viewer web needs viser and mjviser: pip install"):
        play_page.check_page()


def _run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *words], cwd=REPOSITORY, capture_output=True, text=True, timeout=200, check=False
    )


def test_a_place_where_it_cannot_listen_ends_it_in_one_line():
    pytest.importorskip("viser", reason="needs mute[web]")
    done = _run("--host", "192.0.2.1", "--seconds", "1")
    assert done.returncode == 2
    why = os.strerror(errno.EADDRNOTAVAIL)
    reason = f"no page at --host '192.0.2.1' --port 8080: {why}"
    assert reason in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_it_goes_on_for_the_time_it_is_given_beside_a_port_that_is_taken():
    pytest.importorskip("viser", reason="needs mute[web]")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        done = _run("--port", str(port), "--seconds", "1.5")
    assert done.returncode == 0, done.stderr
    assert "watch and steer at http://127.0.0.1:" in done.stdout
    assert f":{port}\n" not in done.stdout
    assert "over 1.5 s, 1 robot:" in done.stdout


def test_an_interrupt_ends_it_with_its_one_object_and_the_status_of_a_signal(tmp_path: Path):
    pytest.importorskip("viser", reason="needs mute[web]")
    with (tmp_path / "errors").open("w+") as errors:
        running = subprocess.Popen(
            [*COMMAND, "--port", "18200", "--json"],
            cwd=REPOSITORY,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        try:
            address = _address(tmp_path / "errors", running)
            with urllib.request.urlopen(address, timeout=60.0) as answer:
                assert answer.status == 200
            running.send_signal(signal.SIGINT)
            printed, _ = running.communicate(timeout=60.0)
        finally:
            running.kill()
            running.wait()
    assert running.returncode == 128 + signal.SIGINT
    report = json.loads(printed)
    assert report["seconds"] >= 0.0
    assert report["surface"] == "wood"  # the page is heard
    told = (tmp_path / "errors").read_text()
    assert "interrupted after" in told
    assert "Traceback" not in told


def _address(path: Path, running: subprocess.Popen[str]) -> str:
    """Wait until the address is told, and return it; the time limit of tests bounds it."""
    while running.poll() is None:
        time.sleep(0.05)
        for line in path.read_text().splitlines():
            if line.startswith("watch and steer at "):
                return line.removeprefix("watch and steer at ")
    raise AssertionError(path.read_text())
