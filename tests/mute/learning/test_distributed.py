"""Two ranks on CPUs, really run: they stay equal, stop as one, go on, and miss one that is gone."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from learning_helpers import before_each_update, clone_tree, differences, make_cfg
from places import REPOSITORY
from ranks_at_work import (
    SPLIT_ENVS,
    learn_from,
    record_rollout,
    use_latent_means,
    whole_batch_cfg,
)

import mute.networks.estimator
from mute.checkpoint import load_checkpoint
from mute.command_lines.train import main
from mute.learning import distributed
from mute.learning.distributed import Ranks, joined_ranks
from mute.learning.logger import CurveWriter, MeanCurves
from mute.learning.runner import MuteRunner
from mute.support.errors import MuteError

TINY = ["--plain", "--num-envs", "4", "--agent.num-steps-per-env", "6"]
TINY += ["--agent.actor-hidden", "8", "--agent.critic-hidden", "8", "--agent.noise-interval", "0"]
_PATIENCE = 240.0
"""Seconds that processes get on a busy machine; they take a few."""
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(REPOSITORY)}


def _start(command: list[str], **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=REPOSITORY,
        env=ENVIRONMENT | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _start_ranks(*commands: list[str]) -> list[subprocess.Popen[str]]:
    """Start a rank for each command, as torchrun would."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free.getsockname()[1])}
    size = str(len(commands))
    sizes = address | {"WORLD_SIZE": size, "LOCAL_WORLD_SIZE": size}
    return [
        _start(command, **sizes, RANK=str(rank), LOCAL_RANK=str(rank))
        for rank, command in enumerate(commands)
    ]


def _finish(processes: list[subprocess.Popen[str]]) -> list[str]:
    """Wait for ranks to end; return what each wrote to its standard error."""
    try:
        return [process.communicate(timeout=_PATIENCE)[1] for process in processes]
    finally:
        for process in processes:
            process.kill()


@contextlib.contextmanager
def _torchrun(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    with _start([*launcher, "train.py", *TINY, *arguments]) as process:
        try:
            yield process
        finally:
            process.terminate()  # ends the ranks with it, where the test has failed before


def _read_lines(process: subprocess.Popen[str], count: int) -> list[str]:
    assert process.stdout is not None
    return [process.stdout.readline() for _ in range(count)]


def _child(process: subprocess.Popen[str], rank: int) -> int:
    """Return the process id of a rank that torchrun has started."""
    listed = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True)
    return sorted(map(int, listed.stdout.split()))[rank]


def _curves(run: Path) -> list[dict[str, float]]:
    return [json.loads(line) for line in (run / "curves.jsonl").read_text().splitlines()]


def _iterations(run: Path) -> list[float]:
    return [line["iteration"] for line in _curves(run)]


def _names_our_code(errors: str) -> bool:
    """Tell whether a traceback goes through the project's files; torchrun prints its own.

    Those of packages do not count, wherever their environment lies: it may be in the project.
    """
    files = [line for line in errors.splitlines() if f'File "{REPOSITORY}' in line]
    return any("site-packages" not in line for line in files)


# -- learning together -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def one_process() -> dict:
    """Gradients and normalisers of one process that learns from all robots of two rollouts."""
    sample = mute.networks.estimator._sample
    use_latent_means()
    runner = MuteRunner("go1_mute", whole_batch_cfg(SPLIT_ENVS), None)
    rollouts = []
    before_each_update(runner, lambda: rollouts.append(record_rollout(runner)))
    runner.train()
    start = MuteRunner("go1_mute", whole_batch_cfg(SPLIT_ENVS), None)
    recorded = {"start": clone_tree(start.alg.save()), "rollouts": rollouts}
    learnt = [learn_from(start, rollout, slice(None)) for rollout in rollouts]
    mute.networks.estimator._sample = sample
    return {"recorded": recorded, "learnt": learnt}


@pytest.fixture(scope="module")
def two_ranks(one_process, tmp_path_factory) -> tuple[Path, list[dict]]:
    directory = tmp_path_factory.mktemp("ranks")
    torch.save(one_process["recorded"], directory / "recorded.pt")
    command = ["tests/helpers/ranks_at_work.py", str(directory)]
    processes = _start_ranks(command, command)
    errors = _finish(processes)
    assert [process.returncode for process in processes] == [0, 0], errors
    return directory, [torch.load(directory / f"rank_{rank}.pt") for rank in (0, 1)]


def test_what_is_learnt_stays_bit_equal_between_ranks_whose_robots_differ(two_ranks):
    first, second = (clone_tree(seen["whole"]) for seen in two_ranks[1])
    own = [seen["learner"]["estimator_trainer"].pop("past") for seen in (first, second)]
    assert differences(first["learner"], second["learner"]) == []
    assert first["learning_rate"] == second["learning_rate"]
    assert first["iteration"] == second["iteration"] == 3
    count = first["learner"]["actor_state_dict"]["obs_normalizer.count"]
    assert int(count) == 2 * 4 * 8 * 8  # ranks, iterations, steps, robots
    # Own robots, own physics, own noise and own exploration; the same place in the curricula.
    world, other = first["world"]["env"], second["world"]["env"]
    assert world["step_count"] == other["step_count"] == 32
    for name in ("physics", "command", "action"):
        assert not torch.equal(world[name], other[name])
    assert not torch.equal(own[0]["obs"], own[1]["obs"])
    assert not torch.equal(first["random"], second["random"])


def test_a_run_of_two_ranks_resumed_with_two_equals_an_uninterrupted_one_bit_for_bit(two_ranks):
    for seen in two_ranks[1]:
        assert differences(seen["resumed"], seen["whole"]) == []


def test_two_ranks_learn_from_halves_what_one_process_learns_from_the_whole(one_process, two_ranks):
    for seen in two_ranks[1]:
        for expected, actual in zip(one_process["learnt"], seen["shared"], strict=True):
            assert expected.keys() == actual.keys()
            for name, value in expected.items():
                # What began at 0 has moved by some steps of Adam, 1e-3 each, or by less.
                scale = max(float(value.abs().max()), 1e-3)
                error = float((actual[name] - value).abs().max())
                assert error <= 1e-3 * scale, name
    assert any(name.startswith("estimator.") for name in one_process["learnt"][1])


def test_a_run_begins_with_the_estimates_of_the_first_ranks_networks(two_ranks):
    assert [seen["current"] for seen in two_ranks[1]] == [True, True]


def test_one_rank_logs_the_means_and_saves(two_ranks):
    directory, seen = two_ranks
    run = directory / "whole"
    assert len(list(run.glob("events.*"))) == 1
    assert _iterations(run) == [0, 1, 2, 3]
    saved = load_checkpoint(run / "model_3.pt")
    assert len(saved["other_ranks"]) == 1
    last, averages = _curves(run)[-1], [rank["whole"]["averages"] for rank in seen]
    rewards = [statistics.fmean(own["rewards"]) for own in averages]
    assert last["Train/mean_reward"] == pytest.approx(sum(rewards) / 2, rel=1e-6)
    assert rewards[0] != rewards[1]
    assert averages[0]["total_steps"] == 2 * 4 * 8 * 8


# -- the command -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory) -> tuple[Path, int, str]:
    """A run of two ranks that torchrun stops; its directory, its last iteration, what it said."""
    log_dir = tmp_path_factory.mktemp("interrupted")
    with _torchrun("--iterations", "100000", "--log-dir", str(log_dir)) as process:
        head = _read_lines(process, 3)
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=_PATIENCE)
    lines = [*head, *out.splitlines()]
    iterations = [int(line.split("/")[0]) for line in lines]
    assert iterations == list(range(1, len(lines) + 1)), "one rank shows each iteration once"
    (run,) = (log_dir / "go1_mute").iterdir()
    return run, len(lines) - 1, errors


def test_ctrl_c_stops_all_ranks_at_one_iteration_and_saves_it(interrupted):
    run, last, errors = interrupted
    path = run / f"model_{last}.pt"
    assert load_checkpoint(path)["iter"] == last
    assert errors.count(f"interrupted, saved: {path}") == 1
    goes_on = f"torchrun --nproc-per-node=2 train.py --task go1_mute --resume {path}"
    assert errors.count(goes_on) == 1
    assert not _names_our_code(errors)


@pytest.fixture(scope="module")
def continued(interrupted) -> tuple[Path, int]:
    """The same run, two iterations longer by one process; its directory and last iteration."""
    run, last, _ = interrupted
    arguments = ["--resume", "latest", "--log-dir", str(run.parents[1])]
    assert main([*TINY, *arguments, "--iterations", str(last + 3)]) == 0
    return run, last + 2


def test_one_rank_goes_on_with_what_two_have_learnt(interrupted, continued):
    run, last = continued
    before = load_checkpoint(run / f"model_{interrupted[1]}.pt")
    after = load_checkpoint(run / f"model_{last}.pt")
    assert "other_ranks" not in after
    assert _iterations(run) == list(range(last + 1))
    assert after["env"]["env"]["step_count"] == before["env"]["env"]["step_count"] + 2 * 6
    counts = [c["actor_state_dict"]["obs_normalizer.count"] for c in (before, after)]
    assert int(counts[1] - counts[0]) == 2 * 6 * 4
    steps = [c["logger"]["total_steps"] for c in (before, after)]
    assert steps[1] - steps[0] == 2 * 6 * 4
    optimiser = after["optimizer_state_dict"]["state"][0]["step"]
    ppo = after["config"]["agent"]["ppo"]
    updates = ppo["num_learning_epochs"] * ppo["num_mini_batches"]
    assert int(optimiser) == updates * (last + 1)


def test_two_ranks_go_on_with_one_and_miss_one_that_is_killed(continued):
    run, last = continued
    arguments = ["--resume", str(run / f"model_{last}.pt"), "--agent.save-interval", "1"]
    with _torchrun(*arguments, "--iterations", "100000") as process:
        _read_lines(process, 3)
        os.kill(_child(process, rank=1), signal.SIGKILL)
        _, errors = process.communicate(timeout=_PATIENCE)
    assert process.returncode != 0
    assert errors.count("robots begin anew") == 1
    said = [line for line in errors.splitlines() if line.startswith("error: ")]
    assert len(said) == 1, errors
    assert "rank 1 is gone" in said[0]
    path = Path(said[0].split()[-1])
    assert load_checkpoint(path)["iter"] >= last + 2
    assert len(load_checkpoint(path)["other_ranks"]) == 1
    assert not _names_our_code(errors)


def test_ranks_that_were_given_different_commands_end_with_one_line(tmp_path):
    commands = [
        ["train.py", *TINY, "--seed", seed, "--log-dir", str(tmp_path / "runs")] for seed in "01"
    ]
    processes = _start_ranks(*commands)
    errors = _finish(processes)
    assert [process.returncode for process in processes] == [2, 2], errors
    assert errors[0].startswith("error: rank 1 has another configuration")
    assert errors[0].count("\n") == 1
    assert errors[1] == ""
    assert not (tmp_path / "runs").exists()


SPOILT_ON_RANK_1 = """
import os, sys
from mute.command_lines.train import main
from mute.learning.estimator_trainer import EstimatorTrainer
from mute.support.errors import run_cli

update = EstimatorTrainer.update

def spoilt(trainer, *args):
    losses = update(trainer, *args)
    if losses and os.environ["RANK"] == "1":
        losses["estimator_total"] = float("nan")
    return losses

EstimatorTrainer.update = spoilt
run_cli(lambda: main(sys.argv[1:]))
"""


def test_all_ranks_stop_where_the_loss_of_one_is_no_number_and_the_first_says_so(tmp_path):
    options = ["--iterations", "9", "--log-dir", str(tmp_path), "--run-name", "r"]
    command = ["-c", SPOILT_ON_RANK_1, *TINY, *options, "--agent.save-interval", "1"]
    processes = _start_ranks(command, command)
    errors = _finish(processes)
    assert [process.returncode for process in processes] == [2, 2], errors
    error = errors[0].splitlines()[-1]
    assert error.startswith("error: iteration 1: NaN or infinity in the loss 'estimator_total'")
    run = tmp_path / "go1_mute" / "r"
    assert error.endswith(f"--resume {run / 'model_0.pt'}")
    assert errors[1] == ""
    assert [path.name for path in run.glob("model_*")] == ["model_0.pt"]
    assert _iterations(run) == [0]


# -- alone, or nearly ------------------------------------------------------------------------------


def test_alone_there_is_nothing_to_agree_on():
    with joined_ranks() as ranks:
        assert ranks == Ranks()
    value = torch.tensor([1.0, 2.0])
    assert ranks.mean(value) is value
    assert ranks.gather(3) == [3]
    assert ranks.broadcast(3) == 3
    assert ranks.seed(7) == 7
    assert (ranks.any(True), ranks.any(False)) == (True, False)
    assert ranks.launcher == "python"


def test_ranks_draw_from_seeds_of_their_own():
    seeds = {Ranks(rank, 4).seed(seed) for rank in range(4) for seed in range(4)}
    assert len(seeds) == 16
    assert Ranks(0, 4).seed(3) == 3
    assert all(0 <= seed < 2**63 for seed in seeds)


def test_several_machines_are_named_in_the_command_that_goes_on():
    ranks = Ranks(rank=9, world_size=16, local_rank=1, local_world_size=8)
    assert ranks.launcher == "torchrun --nnodes=2 --nproc-per-node=8"


def test_each_rank_has_a_gpu_of_its_own_or_is_told_that_there_are_too_few(monkeypatch):
    chosen = []
    monkeypatch.setattr(torch.cuda, "set_device", chosen.append)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert Ranks(3, 4, 1, 2).device("cuda") == "cuda:1"
    assert chosen == [1]
    assert Ranks(3, 4, 1, 2).device("cpu") == "cpu"
    assert Ranks().device("cuda") == "cuda"
    with pytest.raises(MuteError, match=r"--nproc-per-node=4 needs as many GPUs, torch sees 2"):
        Ranks(3, 4, 3, 4).device("cuda")


def test_an_environment_that_is_only_half_torchruns_is_refused_in_one_line(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.delenv("RANK", raising=False)
    with pytest.raises(MuteError, match="start several processes with torchrun"), joined_ranks():
        pass


def test_ranks_on_cpus_are_told_to_the_algorithm_and_not_to_the_runner_of_rsl_rl(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")  # rsl_rl would look for 'cuda:0'
    runner = MuteRunner("go1_mute", make_cfg(), None, ranks=Ranks(1, 2))
    assert (runner.is_distributed, os.environ["WORLD_SIZE"]) == (False, "2")
    algorithm = runner.alg
    assert (algorithm.is_multi_gpu, algorithm.gpu_world_size, algorithm.gpu_global_rank) == (
        True,
        2,
        1,
    )


def test_a_mistake_in_the_program_is_not_taken_for_a_lost_rank():
    with pytest.raises(RuntimeError, match="shapes"), Ranks(0, 2).watched(lambda: ""):
        raise RuntimeError("shapes do not match")


def test_a_curve_is_the_mean_over_the_ranks_that_have_it(tmp_path, monkeypatch):
    others = {"Gait/power": 3.0, "Gait/apex_high_beta": 0.05}
    monkeypatch.setattr(distributed.Ranks, "gather", lambda self, own: [own, others])
    curves = MeanCurves(Ranks(0, 2), CurveWriter(str(tmp_path)))
    curves.add_scalar("Gait/power", 1.0, 0)
    curves.add_scalar("Noise/level_beta_0", 60.0, 0)
    expected = {"Gait/power": 2.0, "Noise/level_beta_0": 60.0, "Gait/apex_high_beta": 0.05}
    assert curves.end_iteration(0) == expected
    curves.stop()
    assert json.loads((tmp_path / "curves.jsonl").read_text()) == {"iteration": 0, **expected}
