"""A policy with random weights, for the tests of what judges one."""

from __future__ import annotations

from mute.config import AgentCfg, EstimationCfg, TaskCfg, to_plain
from mute.controllers.learned import Policy, make_policy
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.runner import MuteRunner, policy_part
from mute.networks.estimator import EstimatorCfg


def saved_random_policy() -> dict:
    """Return what the file of a small policy holds."""
    estimation = EstimationCfg(network=EstimatorCfg(lstm_hidden=8, latent_dim=4, phase_hidden=(8,)))
    agent = AgentCfg(actor_hidden=(8,), critic_hidden=(8,), estimation=estimation)
    cfg = TaskCfg(QuadrupedEnvCfg(num_envs=4, num_threads=1), agent)
    runner = MuteRunner("go1_mute", cfg, None)
    payload = {"task": "go1_mute", "config": to_plain(cfg), "iter": 0}
    return policy_part(runner.alg.save() | payload)


def make_random_policy() -> Policy:
    """Return that policy."""
    return make_policy(saved_random_policy())
