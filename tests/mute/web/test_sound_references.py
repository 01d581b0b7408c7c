"""The walks that the page's sound is held to: the policy of flat ground, as Python hears it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from places import FLAT_POLICY

from mute.support.provenance import file_sha256
from mute.web.sound_references import STEPS, heard_figures, read_walk

KEPT = Path(__file__).parents[3] / "web" / "test" / "sound" / "reference"


@pytest.fixture(scope="module")
def references():
    return json.loads((KEPT / "references.json").read_text())


def test_they_are_of_the_policy_of_flat_ground(references):
    assert references["policy_sha256"] == file_sha256(FLAT_POLICY)
    assert references["steps"] == STEPS


def test_there_is_a_file_of_each_walk_and_they_are_small(references):
    files = {path.name.removesuffix(".bin.gz") for path in KEPT.glob("*-*.bin.gz")}
    assert files == set(references["walks"])
    assert sum(path.stat().st_size for path in KEPT.iterdir()) < 1.5e6


def test_a_walk_is_kept_whole(references):
    block = read_walk(KEPT / "tile-1.bin.gz")
    assert (block.steps, block.num_robots) == (2500, 1)
    assert len(block.impacts) == len(references["walks"]["tile-1"]["landings"])
    # Angles are kept well enough to tell speeds of them.
    apart = np.diff(block.joint_pos[:, 0].astype(float), axis=0) / block.timestep
    np.testing.assert_allclose(apart, block.joint_vel[1:, 0], atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(block.trunk_quat, axis=2), 1.0, atol=2e-3)


@pytest.mark.parametrize("name", ["wood-1", "tile-0"])
def test_python_still_hears_what_the_page_is_held_to(references, name):
    heard = heard_figures(read_walk(KEPT / f"{name}.bin.gz"), name.split("-")[0])
    wanted = references["walks"][name]
    assert heard["mnl"] == pytest.approx(wanted["mnl"], abs=0.01)
    np.testing.assert_allclose(heard["landings"], wanted["landings"])
    for source, figures in wanted["sources"].items():
        assert heard["sources"][source]["laeq"] == pytest.approx(figures["laeq"], abs=0.01)
    loud = np.array(wanted["bands"]) > 20.0
    np.testing.assert_allclose(
        np.array(heard["bands"])[loud], np.array(wanted["bands"])[loud], atol=0.02
    )
