# MuJoCo ships no type information: its module is compiled, and its attributes cannot be seen.
from typing import Any

def __getattr__(name: str) -> Any: ...
