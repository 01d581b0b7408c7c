"""Interpreters that stand in for those of peers, and answer what a test needs."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

FACTS = {
    **{"version": "1.0", "engine": "an engine 2.0", "robot": "a robot", "task": "a task"},
    **{"num_envs": 8, "physics_step": 0.005, "decimation": 4, "note": "a note"},
}


def peer_python(folder: Path, name: str, answers: str, facts: object = FACTS) -> Path:
    """Write an interpreter that answers as a peer does, and notes what it is asked.

    Args:
        folder: Where it and `asked`, common to all there, are written.
        name: Its name.
        answers: Expression of the answer, of `part` and `number`, the requests until then.
        facts: What it says first.
    """
    program = f"""\
        #!{sys.executable}
        import json, sys
        print(json.dumps({facts!r}), flush=True)
        counts = dict()
        for line in sys.stdin:
            part = line.split()[0]
            number = counts[part] = counts.get(part, 0) + 1
            with open({str(folder / "asked")!r}, "a") as asked:
                asked.write({name!r} + " " + line)
            print(json.dumps({answers}), flush=True)
    """
    path = folder / name
    path.write_text(textwrap.dedent(program))
    path.chmod(0o755)
    return path
