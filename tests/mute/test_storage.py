"""The networks that rsl_rl's PPO learns are rsl_rl's, whatever they save on the way."""

from __future__ import annotations

import pytest
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from mute.storage import PreparedModel


@pytest.mark.parametrize("activation", ["elu", "relu", "selu", "tanh"])
def test_activations_in_place_change_neither_outputs_nor_gradients(activation):
    generator = torch.Generator().manual_seed(0)
    obs = TensorDict(
        {name: torch.randn(64, 5, generator=generator) for name in ("policy", "estimate")}, 64
    )
    groups = {"actor": ["policy", "estimate"]}
    sizes = {"output_dim": 3, "hidden_dims": (16, 8), "activation": activation}
    plain = MLPModel(obs, groups, "actor", **sizes)
    ours = PreparedModel(obs, groups, "actor", **sizes)
    ours.load_state_dict(plain.state_dict())
    # PPO hands over inputs ready made, and the same ones in every pass.
    obs[ours.prepared_group] = torch.cat((obs["policy"], obs["estimate"]), dim=-1)
    before = obs.clone()
    outputs = [model(obs) for model in (plain, ours)]
    assert torch.equal(*outputs)
    for output in outputs:
        output.square().sum().backward()
    for expected, parameter in zip(plain.parameters(), ours.parameters(), strict=True):
        assert parameter.grad is not None and expected.grad is not None
        assert torch.allclose(parameter.grad, expected.grad, rtol=1e-5, atol=1e-6)
    assert (obs == before).all()


def test_no_activation_keeps_its_input():
    obs = TensorDict({"policy": torch.randn(4, 10)}, batch_size=4)
    model = PreparedModel(obs, {"actor": ["policy"]}, "actor", 3, (16, 8), "elu")
    activations = [layer for layer in model.mlp if isinstance(layer, torch.nn.ELU)]
    assert len(activations) == 2
    assert all(layer.inplace for layer in activations)


def test_an_update_draws_no_actions_and_sees_the_same_distribution():
    obs = TensorDict({"policy": torch.randn(4, 10)}, batch_size=4)
    gaussian = {"class_name": "mute.distribution:SharedGaussian", "init_std": 0.5}
    model = PreparedModel(
        obs, {"actor": ["policy"]}, "actor", 3, (16, 8), distribution_cfg=gaussian
    )
    drawn = model(obs, stochastic_output=True)
    expected = [part.clone() for part in model.output_distribution_params]
    assert not torch.equal(drawn, model.output_mean)
    before = torch.get_rng_state()
    prepared = TensorDict({model.prepared_group: obs["policy"]}, batch_size=4)
    output = model(prepared, stochastic_output=True)
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.equal(output, expected[0])
    for one, other in zip(model.output_distribution_params, expected, strict=True):
        assert torch.equal(one, other)


def test_a_single_raw_group_is_not_taken_for_an_input_ready_made():
    obs = TensorDict({"policy": 5.0 + torch.randn(100, 10)}, batch_size=100)
    model = PreparedModel(obs, {"actor": ["policy"]}, "actor", 3, (16, 8), obs_normalization=True)
    model.update_normalization(obs)
    assert model.get_latent(obs).mean().abs() < 0.1
