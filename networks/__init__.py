"""Torch modules of the method; they know nothing of environments."""

from .estimator import Estimate, Estimator, EstimatorCfg, State

__all__ = ["Estimate", "Estimator", "EstimatorCfg", "State"]
