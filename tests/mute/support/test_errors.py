"""Command lines end with one clear line and the right exit status."""

from __future__ import annotations

import pytest

from mute.support.errors import MuteError, run_cli


def _raise(error: BaseException):
    def main() -> int:
        raise error

    return main


def test_a_users_mistake_is_one_line_on_standard_error_with_status_2(capsys):
    with pytest.raises(SystemExit) as exit_info:
        run_cli(_raise(MuteError("beta is 1.2, allowed is 0 to 1\nsecond line")))
    captured = capsys.readouterr()
    assert exit_info.value.code == 2
    assert captured.err == "error: beta is 1.2, allowed is 0 to 1 second line\n"
    assert captured.out == ""


def test_ctrl_c_is_one_line_with_status_130(capsys):
    with pytest.raises(SystemExit) as exit_info:
        run_cli(_raise(KeyboardInterrupt()))
    assert exit_info.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


@pytest.mark.parametrize(("returned", "status"), [(None, 0), (0, 0), (3, 3)])
def test_what_main_returns_is_the_exit_status(returned, status):
    with pytest.raises(SystemExit) as exit_info:
        run_cli(lambda: returned)
    assert exit_info.value.code == status


def test_a_mistake_in_the_program_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        run_cli(_raise(ZeroDivisionError()))
