"""Modules of a user's own, which register tasks, reward terms and floors as they are imported.

Only the user names them, in the environment or on the command line; no file that is read does.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback

from mute.support.errors import MuteError

__all__ = ["PLUGINS", "load_plugin", "load_plugins"]

PLUGINS = "MUTE_PLUGINS"
"""Environment variable with the names of modules to import before a command starts, by commas."""


def load_plugins() -> None:
    """Import the modules that the environment names.

    Raises:
        MuteError: If one cannot be imported.
    """
    for name in os.environ.get(PLUGINS, "").replace(",", " ").split():
        load_plugin(name, PLUGINS)


def load_plugin(name: str, asked_by: str) -> None:
    """Import a module that is installed, or lies in the working directory.

    Args:
        name: Its name, with dots inside packages.
        asked_by: What names it, for the error.

    Raises:
        MuteError: If there is no such module, or it fails; one line that says where.
    """
    if not all(part.isidentifier() for part in name.split(".")):
        raise MuteError(f"{asked_by} must name modules such as my_tasks, got {name!r}")
    # At the end: a file that is called `json.py` there hides nothing.
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        importlib.import_module(name)
    except MuteError:
        raise
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            raise MuteError(
                f"{asked_by}: there is no module {name!r}, neither installed nor in this folder"
            ) from error
        last = traceback.extract_tb(error.__traceback__)[-1]
        reason = str(error) or type(error).__name__
        raise MuteError(
            f"{asked_by}: the module {name!r} cannot be imported: {reason} "
            f"({last.filename}:{last.lineno})"
        ) from error
