"""Trainings of one recipe, over several seeds, on the page of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.command_lines.card_reliability import SeedFiles, read_seeds
from mute.command_lines.card_tables import markdown, times
from mute.support.errors import MuteError

__all__ = ["CARD", "Recipe", "ends", "policy_figures", "read_recipe", "trainings_table"]

_RANGE = {
    "beta": ("beta", "{:g}"),
    "fall_rate": ("falls", "{:.1%}"),
    "velocity_error_sq": ("velocity error (m/s)²", "{:.4f}"),
    "velocity_rmse": ("estimator: velocity RMSE (m/s)", "{:.3f}"),
    "height_rmse": ("height RMSE (m)", "{:.4f}"),
    "phase_mae": ("phase MAE", "{:.3f}"),
}
_AT_SPEED = {
    "beta": ("beta", "{:g}"),
    "landing_speed_mean": ("landing speed (m/s)", "{:.3f}"),
    "landing_speed_rms": ("its RMS", "{:.3f}"),
    "apex_cm": ("apex (cm)", "{:.1f}"),
    "duty_factor": ("duty factor", "{:.2f}"),
    "stride_frequency": ("strides/s a foot", "{:.2f}"),
    "power": ("power, control steps (W)", "{:.1f}"),
}
_TRAININGS = {
    "name": ("training", "{}"),
    "trials": ("trials", "{}"),
    "error": ("velocity error at beta 0, 1", "{}"),
    "landing": ("landing speed at beta 0 to 1 (m/s)", "{}"),
    "slower": ("beta 1 lands slower by", "{:.0%}"),
    "apex": ("apex at beta 0, 1 (cm)", "{}"),
}
CARD = (
    "seed",
    "figures",
    "command",
    "commit",
    "machine",
    "iterations",
    "steps",
    "wall_time_minutes",
)
"""What the page tells of the policy that ships."""


@dataclass(frozen=True)
class Recipe:
    """What the files of a task's trainings hold, as plain data."""

    task: str
    card: Mapping[str, Any]
    """Of its policy that ships, with that policy's figures."""
    seeds: Mapping[int, SeedFiles]
    """Of trainings by their seeds, that of the policy that ships among them."""

    @property
    def training(self) -> str:
        """How each seed is trained: by the command of the one that ships."""
        command = self.card["command"].replace(" --plain", "")
        return command.replace(f"--seed {self.card['seed']}", "--seed SEED")

    @property
    def folder(self) -> str:
        """Where the files of its seeds are kept, in the checkout."""
        return f"docs/reliability/{self.task}"

    @property
    def gaits(self) -> dict[int, Mapping[str, Any]]:
        """What `evaluate.py gait` wrote of every training, by its seed."""
        return {seed: run.gait for seed, run in self.seeds.items() if run.gait is not None}


def read_recipe(task: str, card: Mapping[str, Any], folder: Path) -> Recipe:
    """Read what was measured of a task's trainings.

    Args:
        task: Its name.
        card: Card of its policy that ships, which `mute.release` wrote, with all of `CARD`.
        folder: Directory of `seedN.json` and what lies beside them.

    Raises:
        MuteError: If a seed's file is not what the command wrote, or trainings are not alike.
    """
    seeds = read_seeds(folder)
    _check(folder, card, seeds)
    return Recipe(task, card, seeds)


def _check(folder: Path, card: Mapping[str, Any], seeds: Mapping[int, SeedFiles]) -> None:
    """Refuse trainings that what ships is not one of, or that are not alike.

    Raises:
        MuteError: If the files of one are missing, or tell of other iterations or betas.
    """
    if card["seed"] not in seeds:
        raise MuteError(f"no seed{card['seed']}.json, of what ships, in {folder}")
    betas = [row["beta"] for row in card["figures"]["range"]]
    for seed, run in seeds.items():
        path = folder / f"seed{seed}_gait.json"
        if run.gait is None:
            raise MuteError(f"no file at {path}; `evaluate.py gait` writes it")
        trained = run.gait.get("iteration")
        if trained != card["iterations"] - 1:
            raise MuteError(
                f"{path} is of iteration {trained}, what ships of {card['iterations'] - 1}"
            )
        for part in ("range", "at_speed"):
            told = [row["beta"] for row in run.gait[part]]
            if told != betas:
                raise MuteError(f"{path} has betas {told} in {part}, what ships has {betas}")


def trainings_table(recipe: Recipe) -> str:
    """Return the table of the trainings, a row each, and what they are."""
    rows = []
    for seed, run in recipe.gaits.items():
        landing = [row["landing_speed_mean"] for row in run["at_speed"]]
        rows.append(
            {
                "name": f"seed {seed}{' (ships)' if seed == recipe.card['seed'] else ''}",
                "trials": f"{run['trials']} of {run['seconds']:g} s",
                "error": ends(run["range"], "velocity_error_sq", "{:.3f}"),
                "landing": ", ".join(f"{value:.3f}" for value in landing),
                "slower": 1.0 - landing[-1] / landing[0],
                "apex": ends(run["at_speed"], "apex_mean", "{:.1f}", 100.0),
            }
        )
    slower = [row["slower"] for row in rows]
    return (
        f"{markdown(rows, _TRAININGS)}\n\n"
        f"Each is `{recipe.training}` to its end, then `python evaluate.py gait --policy FILE` "
        f"(`{recipe.folder}/`). Landing speeds "
        f"are at an actual 0.5 m/s. Beta 1 lands slower than beta 0 by {min(slower):.0%} to "
        f"{max(slower):.0%}. How a run goes differs with the seed, and with the commit and the "
        "kind of processor, since rounding does. Other recipes are in [recipes.md](recipes.md)."
    )


def policy_figures(recipe: Recipe) -> str:
    """Return what made the policy that ships, and how it walks."""
    card, figures = recipe.card, recipe.card["figures"]
    in_cm = [row | {"apex_cm": times(row["apex_mean"], 100.0)} for row in figures["at_speed"]]
    return (
        f"`{card['command']}`{_then_called(card)}, seed {card['seed']}, commit "
        f"{card['commit'][:10]}: "
        f"{card['iterations']} iterations, {card['steps'] / 1e6:.1f} M steps, "
        f"{card['wall_time_minutes']:.0f} min on {card['machine']}. Its files and the figures of "
        "this section are made by `python -m mute.release --checkpoint "
        f"runs/{recipe.task}/RUN/model_{card['iterations'] - 1}.pt`.{_gone_on(card)}\n\n"
        f"{_first_walk(recipe)}\n\n"
        f"Over the command range, {figures['trials']} trials of {figures['seconds']:g} s:\n\n"
        f"{markdown(figures['range'], _RANGE)}\n\n"
        f"At an actual forward speed of {figures['speed']:g} m/s:\n\n"
        f"{markdown(in_cm, _AT_SPEED)}"
    )


def _gone_on(card: Mapping[str, Any]) -> str:
    """Tell whether the training had been stopped, and where it is told how it went on."""
    if not card.get("resumed"):
        return ""
    times = len(card["resumed"])
    return (
        f" It was stopped {times} time{'s' if times > 1 else ''} on the way: by which commands it "
        f"went on is in its card, `resources/go1/{card['task']}.json`."
    )


def _then_called(card: Mapping[str, Any]) -> str:
    """Tell what the task was called when the policy was trained, if that was another name."""
    then = card.get("task_then")
    return "" if then is None else f" (the task was called `{then}` then)"


def _first_walk(recipe: Recipe) -> str:
    """Tell when the training that made the policy walked for the first time."""
    seed = recipe.card["seed"]
    run = recipe.seeds[seed]
    progress, first = run.progress, run.first_walk
    if progress is None:
        return "When it walked for the first time was not measured."
    when = (
        f"for the first time after {first['iteration']} iterations, {first['minutes']:.1f} min"
        if first
        else "at no checkpoint"
    )
    randomized = progress.get("randomized")
    robots = "robots that differ and see with noise" if randomized else "the exact robot"
    return (
        f"Its training walked (error below 0.05, falls below 1 %, {progress['trials']} trials of "
        f"{robots}) {when}: "
        f"`python evaluate.py progress{' --randomized' if randomized else ''} "
        f"--run runs/{recipe.task}/RUN` (`{recipe.folder}/seed{seed}_progress.json`)."
    )


def ends(rows: Sequence[Mapping[str, Any]], name: str, form: str, factor: float = 1.0) -> str:
    """Return a figure at the first and at the last beta."""
    return ", ".join(form.format(factor * row[name]) for row in (rows[0], rows[-1]))
