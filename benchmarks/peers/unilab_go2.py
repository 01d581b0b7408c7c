"""UniLab's own Go2 task on flat ground, and its own training.

Run with UniLab 1.5.2 and mjbatch-uni 0.2.5. Its settings are composed as its command `train --algo
ppo --task go2_joystick_flat --sim mujoco` composes them, which expects a checkout: so the scene's
file is named in full.
"""

from __future__ import annotations

import importlib
import itertools
from importlib import metadata
from pathlib import Path
from typing import Any

import torch

from peers.parts import ACTION_SETS, TARGET_NOISE, Facts, Parts
from peers.rsl_rl_walk import training_loop, walk

__all__ = ["make"]

_TASK = "go2_joystick_flat/mujoco"
_COMMAND = "twist"

_NOMINAL = ("~env.events.pd_gains",)
"""What makes robots of a trial nominal, as MUTE's; the task adds nothing to what they see."""


def make(num_envs: int, _task: str) -> Parts:
    """Return the task and its training."""
    rl: Any = importlib.import_module("unilab.rl")
    training: Any = importlib.import_module("unilab.training")
    runners: Any = importlib.import_module("rsl_rl.runners")
    training.ensure_registries()
    cfg = _settings(num_envs)
    training.seed.apply_configured_training_seed(cfg, torch_runtime=True, cuda=False)
    env = _environment(cfg, num_envs)
    wrapped = rl.RslRlVecEnvAdapter(env, device="cpu")
    agent = training.algo_config_dict(cfg) | {"logger": "none"}
    runner = runners.OnPolicyRunner(wrapped, agent, log_dir=None, device="cpu")
    shape = (ACTION_SETS, num_envs, wrapped.num_actions)
    actions = itertools.cycle(TARGET_NOISE / cfg.env.actions.joint_pos.scale * torch.randn(shape))

    @torch.inference_mode()
    def step() -> None:
        wrapped.step(next(actions))

    def walk_some(trials: int, seconds: float) -> tuple[float, float]:
        nominal = _settings(trials, *_NOMINAL)
        trial = rl.RslRlVecEnvAdapter(_environment(nominal, trials), device="cpu")
        figures = walk(runner, trial, round(seconds / env.cfg.ctrl_dt), env.cfg.ctrl_dt, _read)
        trial.close()
        return figures

    facts = Facts(
        engine=f"mjbatch-uni {metadata.version('mjbatch-uni')}",
        robot="Unitree Go2",
        task="go2_joystick_flat",
        num_envs=num_envs,
        physics_step=env.cfg.sim_dt,
        decimation=round(env.cfg.ctrl_dt / env.cfg.sim_dt),
        note=f"rsl_rl {metadata.version('rsl-rl-lib')}, no estimator; without visual meshes",
    )
    return Parts(facts, step, training_loop(runner, num_envs), walk_some)


def _settings(num_envs: int, *more: str) -> Any:  # noqa: ANN401 -- not installed here
    hydra: Any = importlib.import_module("hydra")
    root = Path(importlib.import_module("unilab").__file__ or "").parent
    with hydra.initialize_config_dir(str(root / "conf" / "ppo"), version_base="1.3"):
        return hydra.compose(
            "config",
            overrides=[
                f"task={_TASK}",
                f"algo.num_envs={num_envs}",
                f"env.scene.model_file={root / 'assets/robots/go2/scene_flat.xml'}",
                "training.device=cpu",
                "training.logger=none",
                *more,
            ],
        )


def _environment(cfg: Any, num_envs: int) -> Any:  # noqa: ANN401
    adapter: Any = importlib.import_module("unilab.base.config_adapter")
    train: Any = importlib.import_module("unilab.scripts.train_rsl_rl")
    override = train.build_ppo_env_cfg_override(cfg)
    return adapter.create_env(cfg, num_envs=num_envs, env_cfg_override=override)


def _read(wrapped: Any) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:  # noqa: ANN401
    env = wrapped.env
    state = env.state
    # The critic's observation ends with the velocity in the robot's frame, without noise.
    velocity = state.obs["critic"][:, -3:]
    return env.command_manager.get_command(_COMMAND), velocity, state.terminated
