"""The meter as a program, run in this process."""

import json

from mute.command_lines import meter


def run(capsys, *arguments):
    """Return the JSON that the program prints, and its warnings."""
    assert meter.main([*map(str, arguments), "--json"]) == 0
    captured = capsys.readouterr()
    return json.loads(captured.out), captured.err
