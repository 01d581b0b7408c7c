"""The page `docs/benchmark.md`: how fast training and hearing are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mute.command_lines.benchmark_figures import CAPTIONS, PARTS, with_interval
from mute.command_lines.card_physics import physics_section
from mute.command_lines.card_tables import cut_short, markdown
from mute.command_lines.card_targets import targets_section

__all__ = ["BenchmarkFiles", "benchmark_page"]

_MEASURED = {
    "num_envs": ("environments", "{}"),
    "version": ("version", "{}"),
    "blocks": ("blocks", "{}"),
    "turns": ("turns", "{}"),
    **{name: (caption, "{}") for name, caption in CAPTIONS.items()},
    "peak_memory_mb": ("memory (MB)", "{}"),
}
_PEERS = {
    "name": ("peer", "{}"),
    "version": ("version", "{}"),
    "engine": ("engine", "{}"),
    "robot": ("robot", "{}"),
    "task": ("task", "{}"),
    "physics": ("a control step", "{}"),
    "num_envs": ("environments", "{}"),
    "environment": ("environment alone", "{}"),
    "loop": ("whole training loop", "{}"),
    "note": ("note", "{}"),
}
_PEER_WALKS = {
    "name": ("peer", "{}"),
    "task": ("task", "{}"),
    "num_envs": ("environments", "{}"),
    "minutes": ("trained for (min)", "{:.1f}"),
    "steps": ("control steps", "{:,}"),
    "velocity_error_sq": ("error ((m/s)²)", "{:.3f}"),
    "fall_rate": ("falls", "{:.0%}"),
    "walks": ("walks", "{}"),
}
_PARTS = {
    "name": ("part", "{}"),
    "robots": ("robots", "{}"),
    "wall": ("took (s)", "{:.2f}"),
    "real_time": ("times as fast as the robots walk", "{:.1f}"),
}
_PARTS_OF_SOUND = {
    "whole": "physics, policy, sound and meter",
    "recorder": "of that: finding landings and sliding",
    "sound": "of that: making and measuring sound",
    "lone recorder": "one robot: finding landings and sliding",
    "lone energies": "one robot: levels without sound",
    "lone walk": "one robot: everything",
    "lone live sound": "one robot: its sound as it walks",
}

_OF_A_WALK = {"minutes": ("minutes", "{:.2f}"), "iteration": ("iterations", "{}")}

_INTERVALS = (
    "Turns are taken in blocks of a few, each with fresh processes and a seed of its own. Each "
    "figure is the median over the blocks' medians, and in brackets stands its 95 % interval, from "
    "one of these to another (binomial, distribution-free). It is of block medians, as the turns "
    "of a block depend on each other; and blocks end as soon as it is narrow, which makes it "
    "slightly optimistic."
)
_OF_TURNS = (
    "Each figure is the median over turns of one pair of processes, and in brackets stands the "
    "interval that would hold the true one at 95 % if turns were independent. They depend on each "
    "other, and other processes may run at another speed, so it is too narrow. Each version's "
    "engine does its own training's rollout again, the new one without recording what the old one "
    "records."
)
"""What is said of a file from before there were blocks."""


@dataclass(frozen=True)
class BenchmarkFiles:
    """What the files hold, as plain data."""

    training: Mapping[str, Any]
    """Rates of training, and peers on the same machine."""
    peers: Mapping[str, Any]
    """Peers on another machine."""
    sound: Mapping[str, Any]
    """What it takes to hear robots."""
    physics: Mapping[str, Any]
    """What parts of the physics cost."""
    walking: Mapping[str, Any]
    """How soon trainings walk."""
    peer_walks: Mapping[str, Any]
    """How far peers' own trainings come."""


def benchmark_page(files: BenchmarkFiles) -> str:
    """Return the whole page."""
    physics = physics_section(files.physics)
    training = _training(files.training), _walking(files.walking)
    if "old" in files.training["versions"]:
        training = *training, targets_section(files.training, files.walking)
    parts = (_head(), *training, physics, _peers(files), _sound(files))
    return "\n\n".join(parts) + "\n"


def _head() -> str:
    return (
        "<!-- Made by `python -m mute.card --out docs`; do not edit. -->\n\n"
        "# Speed\n\n"
        "Control steps a second: environments times steps, each of 20 ms. All of it was timed on "
        "CPUs. This page is made by `python -m mute.card --out docs`; the figures are those of the "
        "commits that wrote the files."
    )


def _training(measured: Mapping[str, Any]) -> str:
    rows = [line for row in measured["rates"] for line in _lines(row)]
    against = _against(measured["versions"])
    parts = "\n".join(
        f"- {CAPTIONS[name]}: {sentence};" for name, sentence in measured["parts"].items()
    )
    return (
        "## Training\n\n"
        f"`python -m mute.benchmark{measured['options']}{against} --out docs/benchmark.json` on "
        f"{measured['machine']}, with a load average of {measured['load_before']:.1f} from other "
        f"work as it began. {_versions(measured['versions'])}\n\n"
        f"{markdown(rows, _MEASURED)}\n\n"
        f"{_precision(measured)}What is measured:\n\n"
        f"{parts}\n"
        "- memory: the most that a process has held after three iterations of training, without "
        "what the other parts need.\n\n"
        f"{_INTERVALS if all('blocks' in row for row in measured['rates']) else _OF_TURNS} A turn "
        "does every part once, of both versions where there are two, which wait for each other in "
        "processes of their own; the loop is first, and the order of the rest is drawn anew for "
        "every second turn and then gone backwards. A ratio is taken within a turn, so it is not "
        "quite the quotient of two medians. A training goes on from turn to turn; its first "
        "actions have a standard deviation of 0.4."
    )


def _walking(measured: Mapping[str, Any]) -> str:
    """Return how soon trainings walk, and how many times as soon as those of the old version."""
    versions = measured["commits"]
    rows = {
        seed: {"seed": seed} for seed in dict.fromkeys(row["seed"] for row in measured["walking"])
    }
    for row in measured["walking"]:
        for name, (_, form) in _OF_A_WALK.items():
            value = "never" if row[name] is None else form.format(row[name])
            rows[row["seed"]][f"{row['version']} {name}"] = value
    columns = {"seed": ("seed", "{}")}
    for version in versions:
        for name, (caption, _) in _OF_A_WALK.items():
            columns[f"{version} {name}"] = (f"{version}: {caption}", "{}")
    commits = " ".join(f"{_commit(name, commit)}." for name, commit in versions.items())
    return (
        "## From nothing to a walk\n\n"
        f"`python -m mute.benchmark --until-walking{measured['options']}{_against(versions)} --out "
        f"docs/walking.json` on {measured['machine']}, with a load average of "
        f"{measured['load_before']:.1f} from other work as it began: {measured['definition']}. "
        f"{commits}{cut_short(measured['stopped'])}\n\n"
        f"{markdown(list(rows.values()), columns)}{''.join(_compared(measured))}"
    )


def _compared(measured: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is said of both versions' times."""
    median = measured["median_old_over_new"]
    if median in (0.0, "never"):
        yield f"\n\nThe {'new' if median == 0.0 else 'old'} one never walks with most seeds."
    elif median is not None:
        yield f"\n\nThe old one takes {median:.2f} times as long, by the median over seeds."
    if measured["neither_walks"]:
        yield f" Seeds with which neither walks, left out: {measured['neither_walks']}."


def _lines(row: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the lines of one number of environments: new, old, and new over old."""
    common = {name: row.get(name) for name in ("num_envs", "blocks", "turns")}
    yield common | {"version": "new"} | _cells(row, "{:,.0f}")
    if "old" in row:
        yield common | {"version": "old"} | _cells(row["old"], "{:,.0f}")
        yield common | {"version": "new / old"} | _cells(row["new_over_old"], "{:.2f}")


def _cells(figures: Mapping[str, Any], form: str) -> dict[str, str | None]:
    """Return figures with their intervals; None where a line has none."""
    cells: dict[str, str | None] = {"peak_memory_mb": form.format(figures["peak_memory_mb"])}
    for name in CAPTIONS:
        own = form if name in PARTS else "{:.0%}"
        cells[name] = with_interval(figures, name, own) if name in figures else None
    return cells


def _versions(versions: Mapping[str, Mapping[str, str]]) -> str:
    told = [
        f"{_commit(name, each['commit'])} with {each['engine']}, "
        f"torch {each['torch']}, Python {each['python']}."
        for name, each in versions.items()
    ]
    return " ".join(told)


def _commit(name: str, commit: str) -> str:
    """Return which commit a version is, in words."""
    changed = " (changed)" if commit.endswith("-dirty") else ""
    return f"{name.capitalize()} is commit {commit[:10]}{changed}"


def _against(versions: Mapping[str, Any]) -> str:
    return " --against PYTHON:CHECKOUT" if "old" in versions else ""


def _precision(measured: Mapping[str, Any]) -> str:
    """Return which intervals are wider than they should be, and whether it was cut short."""
    told = [
        f"At {row['num_envs']}, {row['not_precise']}."
        for row in measured["rates"]
        if row["not_precise"]
    ]
    text = f"{' '.join(told)}{cut_short(measured['stopped'])}".strip()
    return f"{text}\n\n" if text else ""


def _peers(files: BenchmarkFiles) -> str:
    tables = [
        f"On {where['machine']} (`docs/{name}`):\n\n{_peer_table(where['peers'])}"
        for name, where in (("benchmark.json", files.training), ("peers.json", files.peers))
        if where["peers"]
    ]
    return "\n\n".join(
        (
            "## Other simulations on the CPU",
            "`python -m benchmarks.make_peers --into DIR` makes their environments, and `python -m "
            f"mute.benchmark{files.peers['options']} --peers all --peers-from DIR` times them in "
            "turns with MUTE itself: "
            "the environment alone, and their own training loops, all of an iteration, without "
            "what is compiled before. Medians over rounds, in brackets the 95 % interval where "
            "there are six or more. mjlab, MuJoCo Playground and UniLab have robots and tasks of "
            "their own. The engines of mjlab and MuJoCo Playground, Warp and MJX, are meant for "
            "GPUs, and the batches and epochs of the peers' trainings for other numbers of robots.",
            *tables,
            _peer_walks(files.peer_walks),
        )
    )


def _peer_walks(measured: Mapping[str, Any]) -> str:
    """Return whether peers' own policies walk within the time that they were given."""
    names = ",".join(row["name"] for row in measured["peers"])
    limit, every = measured["limit_minutes"], measured["tried_every_minutes"]
    trials = [
        {"name": row["name"], "task": row["task"], "num_envs": row["num_envs"]} | trial
        for row in measured["peers"]
        for trial in row["trials"]
    ]
    for trial in trials:
        trial["walks"] = "yes" if trial["walks"] else "no"
    return (
        "Whether a peer's own policy walks, by the definition of the walks above, on its own robot "
        f"and commands: `python -m benchmarks.peer_walks --peers {names} --peers-from DIR "
        f"--minutes {limit:g} --every {every:g} --out docs/peer_walks.json`, on "
        f"{measured['machine']}. Who is not in it was given no training.\n\n"
        f"{markdown(trials, _PEER_WALKS)}"
    )


def _peer_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return peers with intervals and shares of MUTE's rate, as far as a file knows them."""
    return markdown([_peer_cells(row) for row in rows], _PEERS)


def _peer_cells(row: Mapping[str, Any]) -> dict[str, Any]:
    cells = {name: row.get(name) for name in _PEERS}
    if row.get("decimation") is not None:
        cells["physics"] = f"{row['decimation']} x {1000 * row['physics_step']:g} ms"
    return cells | {part: _peer_rate(row, part) for part in ("environment", "loop")}


def _peer_rate(row: Mapping[str, Any], part: str) -> str | None:
    """Return a rate as in "1,234 [1,200, 1,300], 12% of mute"."""
    if row.get(part) is None:
        return None
    told = f"{row[part]:,.0f}"
    low, high = row.get("intervals", {}).get(part, (None, None))
    if low is not None and high is not None:
        told += f" [{low:,.0f}, {high:,.0f}]"
    share = row.get("over_mute", {}).get(part)
    return told if share is None or row["name"] == "mute" else f"{told}, {share:.0%} of mute"


def _sound(files: BenchmarkFiles) -> str:
    sound = files.sound
    parts = [{**part, "name": _PARTS_OF_SOUND[part["name"]]} for part in sound["parts"]]
    return (
        "## Sound\n\n"
        f"`python -m benchmarks.sound --out docs/noise/benchmark.json`: {sound['trials']} trials "
        f"of {sound['seconds']:g} s on {sound['floor']}, physics at 1 ms, sound at 48 kHz, on "
        f"{sound['machine']}:\n\n"
        f"{markdown(parts, _PARTS)}\n\n"
        "Levels without sound come from a table for each floor, which takes "
        f"{sound['table']:.2g} s, once in a process. "
        f"The process takes {sound['memory_mb']:.0f} MB, and {sound['memory_growth_mb']:.0f} MB "
        "more for walks of twice the length."
    )
