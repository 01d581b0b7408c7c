"""A model-predictive controller, as legged robots ship with, to compare learned walks with."""

from .controller import MpcController
from .settings import MpcCfg

__all__ = ["MpcCfg", "MpcController"]
