"""The networks that rsl_rl's PPO learns are rsl_rl's, whatever they save on the way."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from quick_products import use_bfloat16
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from mute.learning.model import PreparedModel
from mute.networks.reflection import Reflection


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
    torch.testing.assert_close(*outputs, rtol=0.0, atol=1e-6)
    for output in outputs:
        output.square().sum().backward()
    for expected, parameter in zip(plain.parameters(), ours.parameters(), strict=True):
        assert parameter.grad is not None and expected.grad is not None
        assert torch.allclose(parameter.grad, expected.grad, rtol=1e-5, atol=1e-6)
    assert (obs == before).all()


@pytest.mark.parametrize("activation", ["elu", "relu", "selu"])
def test_activations_work_in_place(activation):
    obs = TensorDict({"policy": torch.randn(4, 10)}, batch_size=4)
    model = PreparedModel(obs, {"actor": ["policy"]}, "actor", 3, (16, 8), activation)
    activations = [layer for layer in model.mlp if not isinstance(layer, torch.nn.Linear)]
    assert len(activations) == 2
    assert all(layer.inplace for layer in activations)


def _make_actor(obs):
    torch.manual_seed(0)
    gaussian = {"class_name": "mute.learning.distribution:SharedGaussian", "init_std": 0.5}
    settings = {"obs_normalization": True, "distribution_cfg": gaussian}
    model = PreparedModel(obs, {"actor": ["policy"]}, "actor", 4, (16, 8), **settings)
    model.update_normalization(obs)
    return model


def _make_obs():
    torch.manual_seed(1)
    return TensorDict({"policy": 5.0 + torch.randn(100, 10)}, batch_size=100)


@pytest.mark.parametrize("tied", [False, True])
def test_an_update_draws_no_actions_and_sees_the_same_distribution(tied):
    obs = _make_obs()
    model = _make_actor(obs)
    if tied:
        model.tie(Reflection.swapped(10), Reflection.swapped(4))
    drawn = model(obs, stochastic_output=True)
    assert not torch.equal(drawn, model.output_mean)
    prepared = TensorDict({model.prepared_group: model.get_latent(obs)}, batch_size=100)
    before, results = torch.get_rng_state(), []
    for observations in (obs, prepared):
        torch.set_rng_state(before)
        model(observations, stochastic_output=True)
        log_prob = model.get_output_log_prob(drawn.detach())
        gradients = torch.autograd.grad(log_prob.square().mean(), [*model.parameters()])
        results.append((*model.output_distribution_params, log_prob, gradients))
    assert torch.equal(torch.get_rng_state(), before)
    torch.testing.assert_close(*results)


def test_a_critic_without_a_distribution_gives_its_output():
    obs = _make_obs()
    model = PreparedModel(obs, {"critic": ["policy"]}, "critic", 1, (16, 8))
    model.tie(Reflection.swapped(10), Reflection.unchanged(1))
    prepared = TensorDict({model.prepared_group: model.get_latent(obs)}, batch_size=100)
    torch.testing.assert_close(model(prepared), model(obs))


def test_a_single_raw_group_is_not_taken_for_an_input_ready_made():
    obs = _make_obs()
    assert _make_actor(obs).get_latent(obs).mean().abs() < 0.1


def test_two_models_of_the_same_groups_prepare_inputs_of_their_own():
    obs = _make_obs()
    models = [PreparedModel(obs, {name: ["policy"]}, name, 3, (8,)) for name in ("actor", "critic")]
    assert models[0].prepared_group != models[1].prepared_group


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TorchScript, by torch
def test_what_rsl_rl_exports_says_what_the_model_does():
    obs = _make_obs()
    model = _make_actor(obs).eval()
    scripted: Any = torch.jit.script(model.as_jit())
    for exported in (scripted, model.as_onnx(verbose=False)):
        torch.testing.assert_close(exported(obs["policy"]), model(obs))


def _make_critic():
    torch.manual_seed(0)
    obs = TensorDict({"policy": torch.randn(200, 10)}, batch_size=200)
    sizes = {"output_dim": 2, "hidden_dims": (32, 16), "obs_normalization": True}
    return obs, PreparedModel(obs, {"critic": ["policy"]}, "critic", **sizes)


def test_hidden_layers_compute_in_bfloat16_and_the_last_one_in_float32(monkeypatch):
    obs, critic = _make_critic()
    use_bfloat16(monkeypatch)
    seen = []
    for layer in (layer for layer in critic.mlp if isinstance(layer, torch.nn.Linear)):
        layer.register_forward_hook(lambda _layer, _inputs, output: seen.append(output.dtype))
    assert critic(obs).dtype == torch.float32
    assert seen == [torch.bfloat16, torch.bfloat16, torch.float32]


def test_in_bfloat16_outputs_and_gradients_are_those_of_float32_within_its_rounding(monkeypatch):
    obs, critic = _make_critic()
    outputs, gradients = [], []
    for prepare in (lambda _: None, use_bfloat16):
        prepare(monkeypatch)
        output = critic(obs)
        loss = (output - 1.0).square().mean()
        outputs.append(output.detach())
        gradients.append(torch.autograd.grad(loss, list(critic.parameters())))
    # bfloat16 keeps 8 bits, so that a value is off by 2^-9 at most; three layers add up.
    assert 0.0 < (outputs[0] - outputs[1]).abs().max() < 0.02 * outputs[0].abs().max()
    for exact, rounded in zip(*gradients, strict=True):
        assert rounded.dtype == torch.float32
        assert (exact - rounded).norm() < 0.02 * exact.norm()


def test_an_input_ready_made_gives_what_the_observations_give_in_bfloat16(monkeypatch):
    obs, critic = _make_critic()
    use_bfloat16(monkeypatch)
    ready = TensorDict({critic.prepared_group: critic.prepared(obs)}, batch_size=200)
    assert ready[critic.prepared_group].dtype == torch.bfloat16
    torch.testing.assert_close(critic(ready), critic(obs), rtol=0.0, atol=1e-6)
