"""GitPython, imported so that a machine without a git program is as good as any other."""

from __future__ import annotations

import os
import sys
from types import ModuleType

__all__ = ["import_git"]

_REFRESH = "GIT_PYTHON_REFRESH"
"""Environment variable that says what importing GitPython does where it finds no git."""


def import_git() -> ModuleType:
    """Import GitPython and return it; by default it is an ImportError where there is no git.

    GitPython reads the variable once, so it is set for the import alone, and only if the user has
    not set it.
    """
    if "git" in sys.modules or _REFRESH in os.environ:
        import git

        return git
    os.environ[_REFRESH] = "quiet"
    try:
        import git
    finally:
        del os.environ[_REFRESH]
    return git
