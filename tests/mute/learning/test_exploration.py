"""The entropy bonus falls as it is told to, in the update as well, and after a resumption."""

from __future__ import annotations

import dataclasses

import pytest
from learning_helpers import differences, everything, make_cfg

from mute.config import AgentCfg, TaskCfg
from mute.learning.exploration import Exploration
from mute.learning.runner import MuteRunner


def _cfg(iterations: int) -> TaskCfg:
    cfg = make_cfg(iterations)
    ppo = dataclasses.replace(cfg.agent.ppo, entropy_coef=0.01)
    fading = {"late_entropy_share": 0.2, "entropy_iterations": (1, 2)}
    return dataclasses.replace(cfg, agent=dataclasses.replace(cfg.agent, ppo=ppo, **fading))


@pytest.mark.parametrize(
    ("ramp", "weights"),
    [
        ((2, 2), [1.0, 1.0, 0.2, 0.2]),
        ((1, 2), [1.0, 0.6, 0.2, 0.2]),
        ((0, 3), [0.8, 0.6, 0.4, 0.2]),
    ],
)
def test_it_falls_in_a_straight_line_from_the_first_to_the_last_iteration(ramp, weights):
    exploration = Exploration(entropy_coef=1.0, late_share=0.2, iterations=ramp)
    assert [exploration.weight(iteration) for iteration in range(4)] == pytest.approx(weights)


def test_it_stays_unless_told_otherwise():
    agent = AgentCfg()
    weights = {Exploration.of(agent).weight(iteration) for iteration in (0, 10, 10**6)}
    assert weights == {agent.ppo.entropy_coef}


def test_each_update_has_the_weight_of_its_iteration_and_a_resumed_one_as_well(tmp_path):
    seen: list[float] = []

    def runner(iterations: int, log_dir=None) -> MuteRunner:
        made = MuteRunner("go1_mute", _cfg(iterations), log_dir)
        update = made.alg.update

        def noted() -> dict[str, float]:
            losses = update()
            seen.append(made.alg.entropy_coef)
            return losses

        made.alg.update = noted
        return made

    whole = runner(4, tmp_path)
    assert whole.train()
    assert seen == pytest.approx([0.01, 0.006, 0.002, 0.002])
    resumed = runner(4, tmp_path / "resumed")
    resumed.load(str(tmp_path / "model_1.pt"))
    assert resumed.train()
    assert seen[4:] == pytest.approx([0.002, 0.002])
    assert differences(everything(resumed), everything(whole)) == []


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"entropy_iterations": (5, 2)}, r"agent\.entropy_iterations must be \(low, high\)"),
        ({"entropy_iterations": (2, 5)}, r"go together, got \(2, 5\) and 1"),
        ({"late_entropy_share": 0.5}, r"go together, got \(0, 0\) and 0\.5"),
        ({"late_entropy_share": 1.5}, r"agent\.late_entropy_share must be"),
    ],
)
def test_bad_figures_are_refused_by_name(changed, told):
    with pytest.raises(ValueError, match=told):
        AgentCfg(**changed)
