"""Signals that ask a program to end take the way of Ctrl-C, once, and can wait for work."""

from __future__ import annotations

import signal

import pytest

from mute.support.errors import run_cli
from mute.support.signals import STOP_SIGNALS, StopRequest


@pytest.mark.parametrize("number", STOP_SIGNALS, ids=lambda number: number.name)
def test_a_signal_ends_a_command_in_one_line_with_the_status_that_shells_report(number, capsys):
    before = [signal.getsignal(each) for each in STOP_SIGNALS]
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: signal.raise_signal(number))
    assert stop.value.code == 128 + number
    assert capsys.readouterr().err == "interrupted\n"
    assert [signal.getsignal(each) for each in STOP_SIGNALS] == before


def test_a_signal_that_comes_again_does_not_disturb_what_is_being_kept(capsys):
    kept = []

    def main() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGHUP)
            kept.append("all")

    with pytest.raises(SystemExit) as stop:
        run_cli(main)
    assert stop.value.code == 128 + signal.SIGTERM
    assert kept == ["all"]


@pytest.mark.parametrize("number", STOP_SIGNALS, ids=lambda number: number.name)
def test_a_signal_that_is_ignored_from_the_start_stays_so(number):
    previous = signal.signal(number, signal.SIG_IGN)
    try:
        with StopRequest() as stop:
            signal.raise_signal(number)
        assert stop.number is None
        with pytest.raises(SystemExit) as ended:
            run_cli(lambda: signal.raise_signal(number))
        assert ended.value.code == 0
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, previous)


def test_a_request_waits_and_names_the_first_signal():
    with StopRequest() as stop:
        assert stop.number is None
        for number in (signal.SIGXCPU, signal.SIGXCPU, signal.SIGTERM):
            signal.raise_signal(number)
        assert stop.number == signal.SIGXCPU
        assert stop.exit_status == 128 + signal.SIGXCPU


def test_a_second_ctrl_c_ends_at_once_but_not_while_work_is_being_kept():
    with pytest.raises(KeyboardInterrupt), StopRequest() as stop:
        signal.raise_signal(signal.SIGTERM)
        with stop.finishing():
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)


def test_a_lasting_request_takes_every_signal_to_the_end(monkeypatch):
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    try:
        with StopRequest(lasting=True) as stop:
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert stop.exit_status == 130
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
