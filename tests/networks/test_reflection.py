"""Networks that treat left and right alike: reflections, and layers that commute with them."""

from __future__ import annotations

import copy

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from mute.networks.reflection import Reflection, tie_layer, tie_mlp, tie_vector

SOURCE = Reflection((1, 0, 2, 3), (1.0, 1.0, -1.0, 1.0))
TARGET = Reflection((0, 2, 1), (-1.0, -1.0, -1.0))


def _make_mlp(leading_side: bool = False) -> nn.Sequential:
    torch.manual_seed(0)
    mlp = nn.Sequential(nn.Linear(4, 8), nn.ELU(), nn.Linear(8, 6), nn.ELU(), nn.Linear(6, 3))
    tie_mlp(mlp, SOURCE, TARGET, leading_side)
    return mlp


def _assert_commutes(mlp: nn.Module) -> None:
    x = torch.randn(50, 4)
    torch.testing.assert_close(mlp(SOURCE(x)), TARGET(mlp(x)))
    assert mlp(x).std() > 0.01  # a network that says 0 commutes with anything


@st.composite
def _reflections(draw) -> Reflection:
    parts = [
        draw(st.sampled_from((Reflection.unchanged(2), Reflection.swapped(4), SOURCE, TARGET)))
        for _ in range(draw(st.integers(1, 4)))
    ]
    return Reflection.joined(parts)


@given(_reflections())
def test_a_mirror_image_of_a_mirror_image_is_the_original(reflection):
    x = torch.randn(3, len(reflection.index))
    assert torch.equal(reflection(reflection(x)), x)


def test_a_reflection_permutes_and_then_signs():
    assert TARGET(torch.tensor([1.0, 2.0, 3.0])).tolist() == [-1.0, -3.0, -2.0]
    assert TARGET.unsigned(torch.tensor([1.0, 2.0, 3.0])).tolist() == [1.0, 3.0, 2.0]
    assert Reflection.swapped(4)(torch.arange(4.0)).tolist() == [2.0, 3.0, 0.0, 1.0]
    joined = Reflection.joined([TARGET, Reflection.swapped(2)])
    assert joined(torch.arange(5.0)).tolist() == [-0.0, -2.0, -1.0, 4.0, 3.0]


@pytest.mark.parametrize(
    ("index", "sign"),
    [((1, 2, 0), (1.0,) * 3), ((1, 0), (1.0, -1.0)), ((0, 1), (1.0, 2.0)), ((0, 1), (1.0,))],
)
def test_what_is_no_reflection_is_refused(index, sign):
    with pytest.raises(ValueError, match="not a reflection"):
        Reflection(index, sign)


def test_halves_of_an_odd_width_are_refused():
    with pytest.raises(ValueError, match="even width, got 5"):
        Reflection.swapped(5)


def test_a_tied_perceptron_commutes_with_the_reflections():
    _assert_commutes(_make_mlp())


def test_it_goes_on_commuting_as_it_learns_what_does_not():
    mlp = _make_mlp()
    optimizer = torch.optim.Adam(mlp.parameters(), lr=0.01, fused=True)
    x, y = torch.randn(200, 4), torch.randn(200, 3)
    losses = []
    for _ in range(100):
        loss = (mlp(x) - y).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0]
    _assert_commutes(mlp)


def _step_out(mlp: nn.Module) -> torch.Tensor:
    """Return what it says of what is its own mirror image, less the mirror image of that."""
    alike = 0.5 * (torch.ones(4) + SOURCE(torch.ones(4)))
    return mlp(alike) - TARGET(mlp(alike))


def test_a_leading_side_gives_an_answer_that_is_not_its_own_mirror_image():
    assert _step_out(_make_mlp()).abs().max() < 1e-6
    assert _step_out(_make_mlp(leading_side=True)).abs().max() > 1e-3


def test_with_a_leading_side_it_commutes_once_the_side_is_mirrored_too():
    mlp = _make_mlp(leading_side=True)
    optimizer = torch.optim.Adam(mlp.parameters(), lr=0.01, fused=True)
    x, y = torch.randn(200, 4), torch.randn(200, 3)
    for _ in range(50):
        optimizer.zero_grad()
        (mlp(x) - y).square().mean().backward()
        optimizer.step()
    image = copy.deepcopy(mlp)
    first = image[0]
    assert isinstance(first, nn.Linear)
    with torch.no_grad():
        first.bias.copy_(Reflection.swapped(8)(first.bias))
    torch.testing.assert_close(image(SOURCE(x)), TARGET(mlp(x)))


def test_the_tied_gradient_is_that_of_the_data_and_its_mirror_image():
    tied, free = _make_mlp(), copy.deepcopy(_make_mlp())  # a copy has no hooks
    x, y = torch.randn(20, 4), torch.randn(20, 3)
    (tied(x) - y).square().mean().backward()
    both = (torch.cat((x, SOURCE(x))), torch.cat((y, TARGET(y))))
    (free(both[0]) - both[1]).square().mean().backward()
    for one, other in zip(tied.parameters(), free.parameters(), strict=True):
        torch.testing.assert_close(one.grad, other.grad)


def test_tied_weights_start_as_large_as_free_ones():
    torch.manual_seed(0)
    weight = nn.Parameter(torch.randn(64, 128))
    tie_layer(weight, Reflection.swapped(128), Reflection.swapped(64))
    assert weight.std().item() == pytest.approx(1.0, rel=0.05)


def test_a_tied_vector_is_its_own_mirror_image():
    vector = nn.Parameter(torch.tensor([1.0, 2.0, 4.0]))
    tie_vector(vector, TARGET)
    assert vector.tolist() == [0.0, -1.0, 1.0]
    (vector * torch.tensor([1.0, 1.0, 0.0])).sum().backward()
    assert vector.grad is not None
    assert vector.grad.tolist() == [0.0, 0.5, -0.5]
