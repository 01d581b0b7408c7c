"""The example that runs an exported policy without the project, as a module."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType

from places import REPOSITORY

__all__ = ["EXAMPLE", "load_example"]

EXAMPLE = REPOSITORY / "examples" / "run_onnx.py"


def load_example() -> ModuleType:
    """Return `examples/run_onnx.py`, which lies in no package."""
    spec = importlib.util.spec_from_file_location("run_onnx_example", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module
