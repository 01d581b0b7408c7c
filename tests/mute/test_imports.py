"""Tests that MUTE is a library as others are: an import changes nothing but what is imported."""

from __future__ import annotations

import subprocess
import sys

from places import REPOSITORY

# Other packages do change the process: Gymnasium hides pygame's greeting. So all is imported once,
# put back as it was, and imported again, when nothing but MUTE's own modules is new.
_PROGRAM = """
import importlib, logging, multiprocessing, os, pkgutil, signal, sys, warnings

import mute
import torch

def state():
    return {
        "environment": dict(os.environ),
        "threads": torch.get_num_threads(),
        "precision": torch.get_float32_matmul_precision(),
        "default type": torch.get_default_dtype(),
        "gradients": torch.is_grad_enabled(),
        "signals": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "warnings": list(warnings.filters),
        "logging": (logging.root.level, list(logging.root.handlers), logging.root.disabled),
        "processes": multiprocessing.get_start_method(allow_none=True),
        "path": list(sys.path),
        "directory": os.getcwd(),
    }

def import_all():
    names = [module.name for module in pkgutil.walk_packages(mute.__path__, "mute.")]
    assert "mute.envs.quadruped_env" in names and "mute.command_lines.train" in names
    for name in names:
        importlib.import_module(name)

environment = dict(os.environ)
import_all()
for name in [name for name in sys.modules if name.startswith("mute.")]:
    del sys.modules[name]
os.environ.clear()
os.environ.update(environment)
torch.set_num_threads(3)
before = state()
import_all()
after = state()
print([name for name in before if before[name] != after[name]])
"""


def test_no_module_changes_the_process_that_imports_it():
    result = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout == "[]\n"
