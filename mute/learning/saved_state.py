"""Whether what a checkpoint holds has the form of what would be saved here.

torch copies integers into weights, stretches what can be broadcast, and takes numbers from strings;
what is of another form than its own is refused before anything of it is taken over.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from mute.envs.randomization import PHYSICS_DIM
from mute.envs.scene import LEGS
from mute.learning.algorithm import EstimatorPPO
from mute.networks.estimator import Estimator

__all__ = [
    "check_form",
    "check_iteration",
    "check_known_physics",
    "check_learner",
    "check_own_state",
    "check_totals",
    "check_weights",
    "entry",
]

_TOTALS = {"total_steps": 0, "total_time": 0.0}
"""Form of what the logger counts."""

_LISTS = ("rewards", "lengths")
"""What the logger averages: as many numbers as there have been."""


def entry(saved: object, key: str, place: str = "") -> Any:  # noqa: ANN401
    """Return what a mapping has under a key.

    Args:
        saved: What should be a mapping.
        key: The key.
        place: Name of the mapping, for the error; the checkpoint itself has none.

    Raises:
        ValueError: If it is not there.
    """
    if not isinstance(saved, Mapping) or key not in saved:
        raise ValueError(f"{place}.{key} is missing".removeprefix("."))
    return saved[key]


def check_form(saved: object, own: object, place: str, whole: bool = True) -> None:
    """Check that a saved value has the form of the own one.

    That is: the same type; of tensors, the same shape and number type; of mappings, the same keys;
    of lists, the same length. An integer may stand for a float.

    Args:
        saved: What a checkpoint holds.
        own: What would be saved here.
        place: Name of the value, for the error.
        whole: Whether keys may not be missing or be more; else those that both have are compared.

    Raises:
        ValueError: If it has not.
    """
    if isinstance(own, Tensor):
        _check_tensor(saved, own, place)
    elif isinstance(own, Mapping):
        _check_mapping(saved, own, place, whole)
    elif isinstance(own, list | tuple):
        if not isinstance(saved, list | tuple) or len(saved) != len(own):
            raise ValueError(f"{place} must be a list of {len(own)}")
        for index, (one, other) in enumerate(zip(saved, own, strict=True)):
            check_form(one, other, f"{place}[{index}]", whole)
    else:
        kinds = (int, float) if type(own) is float else (type(own),)
        if type(saved) not in kinds:
            raise ValueError(f"{place} must be {type(own).__name__}, got {saved!r:.40}")


def check_iteration(checkpoint: object) -> int:
    """Return the last finished iteration of a checkpoint.

    Raises:
        ValueError: If there is none, or it is no number of an iteration.
    """
    iteration = entry(checkpoint, "iter")
    check_form(iteration, 0, "iter")
    if iteration < 0:
        raise ValueError(f"iter must be >= 0, got {iteration}")
    return iteration


def check_weights(saved: object, network: nn.Module, place: str) -> None:
    """Check that a saved `state_dict` is one of a network, and that all of it is finite.

    Raises:
        ValueError: If it is not.
    """
    check_form(saved, network.state_dict(), place)
    _check_finite(saved, place)


def check_learner(checkpoint: Mapping[str, Any], alg: EstimatorPPO) -> None:
    """Check what all ranks take over: networks, optimisers, and what is told of the training.

    Raises:
        ValueError: If something is missing, or is not what would be saved here.
    """
    check_iteration(checkpoint)
    if not isinstance(entry(checkpoint, "infos"), dict | None):
        raise ValueError("infos must be a mapping or nothing")
    networks = {"actor": alg.actor, "critic": alg.critic, "estimator": alg.trainer.estimator}
    for name, network in networks.items():
        place = f"{name}_state_dict"
        check_weights(entry(checkpoint, place), network, place)
    trainer, place = entry(checkpoint, "estimator_trainer"), "estimator_trainer"
    own = alg.trainer.optimizer
    _check_optimizer(entry(trainer, "optimizer", place), own, f"{place}.optimizer")
    place = "optimizer_state_dict"
    _check_optimizer(entry(checkpoint, place), alg.optimizer, place)


def check_known_physics(checkpoint: Mapping[str, Any]) -> None:
    """Check that the critic of a training was told as much of each robot as it is here.

    What is not there is left to the other checks.

    Raises:
        ValueError: If it was told less, by an earlier version, or more.
    """
    part: object = checkpoint
    for key in ("env", "env", "physics"):
        part = part.get(key) if isinstance(part, Mapping) else None
    if isinstance(part, Tensor) and part.ndim == 2 and part.shape[1] != PHYSICS_DIM:
        raise ValueError(
            f"its critic knows {part.shape[1]} figures of a robot's physics, and here it would"
            f" {PHYSICS_DIM}; a training of that version can be played and exported alone"
        )


def check_own_state(saved: Mapping[str, Any], own: Mapping[str, Any], alg: EstimatorPPO) -> None:
    """Check what a rank saved of its own; the loaders say what of it they miss.

    Args:
        saved: What a checkpoint holds.
        own: What would be saved here.
        alg: Whose estimator is to learn from the rollout that waits for its labels.

    Raises:
        ValueError: If something has another form.
    """
    past, num_envs = entry(saved, "estimator_past"), alg.env.num_envs
    _check_past(past, alg.trainer.estimator, num_envs, "estimator_trainer.past")
    averages = {key: value for key, value in own["logger"].items() if key not in _LISTS}
    world = dict(own["env"]["env"])
    simulation = entry(entry(entry(saved, "env"), "env", "env"), "simulation", "env.env")
    if not isinstance(simulation, Mapping) or simulation.keys() != world["simulation"].keys():
        del world["simulation"]  # of another engine, which says so itself, or of none
    form = {**own, "env": own["env"] | {"env": world}, "logger": averages | _TOTALS}
    for name in _LISTS:
        numbers = entry(entry(saved, "logger"), name, "logger")
        if not isinstance(numbers, list) or any(type(n) not in (int, float) for n in numbers):
            raise ValueError(f"logger.{name} must be a list of numbers")
    # A run may move to a GPU, or from one.
    if form["cuda_random_state"] is None or entry(saved, "cuda_random_state") is None:
        del form["cuda_random_state"]
    check_form({name: entry(saved, name) for name in form}, form, "", whole=False)


def check_totals(checkpoint: Mapping[str, Any]) -> None:
    """Check what goes on where the robots begin anew.

    Raises:
        ValueError: If something is missing or has another form.
    """
    world = entry(entry(checkpoint, "env"), "env", "env")
    check_form(entry(world, "step_count", "env.env"), 0, "env.env.step_count")
    totals = entry(checkpoint, "logger")
    check_form({key: entry(totals, key, "logger") for key in _TOTALS}, _TOTALS, "logger")


def _check_optimizer(saved: object, optimizer: Optimizer, place: str) -> None:
    """Check that a saved `state_dict` is one of an optimiser (Adam) of the same parameters.

    Raises:
        ValueError: If it is not.
    """
    own = optimizer.state_dict()
    (own_group,) = own["param_groups"]
    groups, states = entry(saved, "param_groups", place), entry(saved, "state", place)
    if not isinstance(groups, list) or len(groups) != 1:
        raise ValueError(f"{place}.param_groups must be a list of 1")
    group = f"{place}.param_groups[0]"
    check_form(entry(groups[0], "params", group), own_group["params"], f"{group}.params")
    rate = entry(groups[0], "lr", group)
    if type(rate) not in (int, float) or not 0.0 < rate < math.inf:
        raise ValueError(f"{group}.lr must be > 0 and finite, got {rate!r:.40}")
    if not isinstance(states, Mapping):
        raise ValueError(f"{place}.state must be a mapping")
    parameters = dict(enumerate(optimizer.param_groups[0]["params"]))
    for index, state in states.items():
        if index not in parameters:
            raise ValueError(f"{place}.state[{index!r}] is of no parameter")
        parameter = parameters[index].detach()
        moments = {"step": torch.zeros(()), "exp_avg": parameter, "exp_avg_sq": parameter}
        check_form(state, moments, f"{place}.state[{index}]")
        _check_finite(state, f"{place}.state[{index}]")


def _check_past(past: object, estimator: Estimator, num_envs: int, place: str) -> None:
    """Check the rollout that waits for its labels, see `EstimatorTrainer`; it may be empty.

    Args:
        past: What a checkpoint holds.
        estimator: The estimator that is to learn from it.
        num_envs: Number of robots.
        place: Name of it, for the error.

    Raises:
        ValueError: If it has another form.
    """
    if past == {}:
        return
    steps, before = (_length(past, name, place) for name in ("obs", "contact_before"))
    robots = (num_envs,)
    shapes: dict[str, tuple[tuple[int, ...], torch.dtype]] = {
        "obs": ((steps, *robots, estimator.obs_dim), torch.float32),
        "base_lin_vel": ((steps, *robots, 3), torch.float32),
        "heights": ((steps, *robots, estimator.num_heights), torch.float32),
        "contact": ((steps, *robots, len(LEGS)), torch.bool),
        "dones": ((steps, *robots), torch.bool),
        "starts": ((steps, *robots), torch.bool),
    }
    for name, size in estimator.encoder.state_sizes.items():
        shapes[name] = ((*robots, size), torch.float32)
    if before:
        shapes["contact_before"] = ((before, *robots, len(LEGS)), torch.bool)
        shapes["starts_before"] = ((before, *robots), torch.bool)
    own = {
        name: torch.empty(shape, dtype=dtype, device="meta")
        for name, (shape, dtype) in shapes.items()
    }
    check_form(past, own, place)
    _check_finite(past, place)


def _length(past: object, name: str, place: str) -> int:
    """Return how many steps an entry has; none where there is no such entry but `obs` is."""
    value = past.get(name) if isinstance(past, Mapping) else None
    if isinstance(value, Tensor) and value.ndim > 1 and len(value) > 0:
        return len(value)
    if name == "obs" or value is not None:
        raise ValueError(f"{place}.{name} must be a tensor of shape (steps, robots, width)")
    return 0


def _check_tensor(saved: object, own: Tensor, place: str) -> None:
    wanted = f"{place} must be a tensor of {own.dtype} and shape {tuple(own.shape)}"
    if not isinstance(saved, Tensor):
        raise ValueError(f"{wanted}, got a {type(saved).__name__}")
    if saved.dtype != own.dtype or saved.shape != own.shape or saved.layout != own.layout:
        raise ValueError(f"{wanted}, got {saved.dtype} and {tuple(saved.shape)}")


def _check_mapping(saved: object, own: Mapping[Any, Any], place: str, whole: bool) -> None:
    if not isinstance(saved, Mapping):
        raise ValueError(f"{place} must be a mapping, got a {type(saved).__name__}")
    if whole:
        for key in own:
            entry(saved, key, place=place)
        for key in saved:
            if key not in own:
                raise ValueError(f"{place}.{key} is not known")
    for key in own:
        if key in saved:
            check_form(saved[key], own[key], f"{place}.{key}".removeprefix("."), whole)


def _check_finite(saved: object, place: str) -> None:
    """Check the tensors of a mapping whose form is known to be right."""
    assert isinstance(saved, Mapping)
    for key, value in saved.items():
        if not bool(value.isfinite().all()):
            raise ValueError(f"{place}.{key} holds numbers that are not finite")
