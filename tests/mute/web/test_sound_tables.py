"""What the page's sound looks up: the laws of Python, in a form that can be played."""

from __future__ import annotations

import json
import re
from math import ceil
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from mute.acoustics.body import SHELL
from mute.acoustics.floors import FLOORS
from mute.acoustics.physics.ringing import OCTAVES, ringing_energy
from mute.acoustics.sources.response import PLACES, floor_response
from mute.web.sound_tables import FORMAT, SAMPLE_RATE, packed, sound_tables

PAGE = Path(__file__).parents[3] / "web" / "src" / "sound"


@pytest.fixture(scope="module")
def tables():
    return sound_tables()


@pytest.fixture(scope="module")
def loaded(tables):
    """Return the tables as the page loads them."""
    text, binary = packed(tables)
    numbers = np.frombuffer(binary, "<f4")

    def arrays(value):
        if isinstance(value, list):
            return [arrays(own) for own in value]
        if not isinstance(value, dict):
            return value
        if value.keys() == {"shape", "offset"}:
            size = int(np.prod(value["shape"]))
            return numbers[value["offset"] :][:size].reshape(value["shape"])
        return {name: arrays(own) for name, own in value.items()}

    return arrays(json.loads(text))


def test_packed_tables_come_back_as_they_were(tables, loaded):
    assert loaded["format"] == FORMAT
    assert loaded["meter"] == tables["meter"]
    for name, floor in tables["floors"].items():
        for array in ("frequencies", "strengths", "spread"):
            own, back = floor["plate"][array], loaded["floors"][name]["plate"][array]
            np.testing.assert_allclose(back, own, rtol=1e-6)
    assert loaded["contact_laws"][0]["passed"].shape == tables["contact_laws"][0]["passed"].shape


def test_a_table_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="finite"):
        packed({"spread": np.array([1.0, np.inf])})


def test_the_page_knows_the_format():
    assert f"const FORMAT = {FORMAT};" in (PAGE / "tables.ts").read_text()


def test_the_page_knows_every_table_by_its_name(tables):
    told = (PAGE / "tables.ts").read_text()

    def names(value):
        for name, own in value.items():
            yield name
            if isinstance(own, dict):
                yield from names(own)

    floors = tables["floors"]
    shared = {name: own for name, own in tables.items() if name != "floors"}
    for name in {*names(shared), *names(next(iter(floors.values())))}:
        assert re.search(rf"\b{name}\b", told), name


def test_there_is_a_table_for_each_floor_in_their_order(tables):
    assert list(tables["floors"]) == list(FLOORS)
    for floor in tables["floors"].values():
        law = tables["contact_laws"][floor["law"]]
        assert law["passed"].shape[0] == len(law["yields"])


def rings(plate, tables, place):
    """Return by third octave what a blow of 1 N s makes ring, as sampled tones, Pa m / (N s)."""
    first = 0
    for band, count in enumerate(plate["counts"]):
        own = slice(first, first + count)
        first += count
        decay = plate["decays"][band]
        time = np.arange(ceil(decay * SAMPLE_RATE)) / SAMPLE_RATE
        turn = 2.0 * np.pi * plate["frequencies"][own][:, None]
        phase = np.pi - np.arctan(turn * decay / np.log(1e3))
        strength = plate["strengths"][place, own]
        # What a tier loses of a tone has been given to it before.
        tier = tables["tiers"][plate["tiers"][band]]
        fall = np.sinc(plate["frequencies"][own] * tier["divisor"] / SAMPLE_RATE)
        _, between = signal.freqz(
            np.array(tier["interpolator"]) / tier["divisor"], 1, turn[:, 0] / SAMPLE_RATE
        )
        tones = (strength * fall * np.abs(between)) @ np.sin(turn * time + phase)
        tones[0] *= 0.5
        yield plate["octaves"][band], tones * np.exp(-np.log(1e3) * time / decay)


@pytest.mark.parametrize("name", ["wood", "tile", "concrete"])
def test_tones_hold_the_power_of_the_plate_in_the_mean_over_places(tables, name):
    plate = tables["floors"][name]["plate"]
    held = np.array(
        [
            [np.square(part).sum() / SAMPLE_RATE for _, part in rings(plate, tables, place)]
            for place in range(PLACES)
        ]
    ).mean(axis=0)
    wanted = [ringing_energy(FLOORS[name].plate, band) for band in range(len(held))]
    np.testing.assert_allclose(held, wanted, rtol=0.02)


def test_a_place_rings_as_python_has_it_sample_by_sample(tables):
    plate, place = tables["floors"]["wood"]["plate"], 3
    response = floor_response(FLOORS["wood"].plate, SAMPLE_RATE)
    # Octaves whose tones are over before Python lets them fade.
    for octave in (4, 5, 6):
        own = np.fft.irfft(response.ringing[place, octave], response.length) * SAMPLE_RATE
        ours = np.zeros(response.length)
        for index, part in rings(plate, tables, place):
            if index == octave:
                ours[: len(part)] += part
        assert np.square(ours - own).sum() < 1e-4 * np.square(own).sum()


def test_the_shell_has_a_place_for_each_foot_and_nothing_below_its_first_mode(tables):
    plate = tables["shell"]["plate"]
    assert plate["strengths"].shape == (4, sum(plate["counts"]))
    assert plate["frequencies"].min() > SHELL.first_mode * 10.0**-0.1
    np.testing.assert_allclose(plate["spread"], 1.0 / np.sqrt(2.0 * np.pi))


@pytest.mark.parametrize("name", FLOORS)
def test_what_is_radiated_at_once_is_that_of_the_plate(tables, name):
    plate = FLOORS[name].plate
    table = tables["floors"][name]["plate"]
    frequency = np.geomspace(20.0, 4000.0, 60)
    z = np.exp(2j * np.pi * frequency / SAMPLE_RATE)
    sections = [np.polyval(s[:3], z) / np.polyval(s[3:], z) for s in table["direct"]]
    ours = table["direct_gain"] * np.abs(np.prod(sections, axis=0))
    wanted = np.abs(plate.direct_pressure(frequency))
    # A dashpot in the place of a loss differs a little about the resonance of what floats.
    np.testing.assert_allclose(20.0 * np.log10(ours / wanted), 0.0, atol=0.5)


@pytest.mark.parametrize("name", FLOORS)
def test_spreading_is_read_from_few_distances(tables, name):
    table = tables["floors"][name]["plate"]
    distances = np.array([0.07, 0.34, 0.59, 2.3])
    wanted = np.sqrt(FLOORS[name].plate.spread(OCTAVES, distances[:, None]))
    for octave in range(len(OCTAVES)):
        read = np.interp(np.log(distances), np.log(table["distances"]), table["spread"][:, octave])
        np.testing.assert_allclose(read / distances, wanted[:, octave], rtol=0.01)
