"""Torch modules of the method; they know nothing of environments."""

from .encoders import State
from .estimator import Estimate, Estimator, EstimatorCfg

__all__ = ["Estimate", "Estimator", "EstimatorCfg", "State"]
