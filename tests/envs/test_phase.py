"""Tests of contacts and phase against constructed contact sequences."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mute.envs.phase import CausalContacts, debounce, hindsight_phase, hindsight_swing

SEGMENTS = st.lists(st.integers(2, 9), min_size=1, max_size=8)
SAMPLES = st.lists(st.booleans(), min_size=1, max_size=40)
MIN_STEPS = st.integers(1, 4)


def _column(samples):
    """Turn the samples of one foot, numbers or the characters of a string, into (T, 1, 1)."""
    return torch.tensor([int(sample) for sample in samples], dtype=torch.bool)[:, None, None]


def _starts(contacts, *at):
    starts = torch.zeros(contacts.shape[:2], dtype=torch.bool)
    for step in at:
        starts[step] = True
    return starts


def _from_segments(durations, first):
    """Build alternating segments, the first one in contact if `first`, as a list of samples."""
    return [first ^ (k % 2 == 1) for k, duration in enumerate(durations) for _ in range(duration)]


def _segments(samples):
    """Return [state, duration] of every run of equal samples."""
    runs = []
    for sample in samples:
        if runs and runs[-1][0] == sample:
            runs[-1][1] += 1
        else:
            runs.append([sample, 1])
    return runs


def _debounce_by_hand(samples, min_steps):
    """Walk through the samples of one foot and accept a change once it has held."""
    accepted = [samples[0]]
    for t in range(1, len(samples)):
        run = samples[t : t + min_steps]
        changes = len(run) == min_steps and all(x == samples[t] for x in run)
        accepted.append(samples[t] if changes else accepted[-1])
    return accepted


def _labels_by_hand(durations, first, max_steps=50):
    """Return phase and closedness of every sample of a list of segments; the outer two are open."""
    phase, closed = [], []
    for k, duration in enumerate(durations):
        contact = first ^ (k % 2 == 1)
        is_closed = 0 < k < len(durations) - 1 and duration <= max_steps
        for age in range(duration):
            progress = 1 - age / duration if contact else age / duration
            phase.append(progress if is_closed else 0.0)
            closed.append(is_closed)
    return phase, closed


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ("1101100", "1111100"),  # one sample of air is merged into the stance
        ("0010100", "0000000"),  # chatter that never holds keeps the old state
        ("00101100", "00001100"),  # a change is dated back to where its own run began
        ("0111", "0111"),  # the first sample is the initial state, however short
        ("0001", "0000"),  # the last sample cannot be confirmed
    ],
)
def test_debouncing_by_two_samples_gives_the_hand_computed_contacts(raw, expected):
    assert torch.equal(debounce(_column(raw), 2), _column(expected))


@given(samples=SAMPLES, min_steps=MIN_STEPS)
@settings(deadline=None)
def test_debouncing_accepts_a_change_exactly_when_it_has_held(samples, min_steps):
    expected = _debounce_by_hand(samples, min_steps)
    assert debounce(_column(samples), min_steps).flatten().tolist() == expected


@given(samples=SAMPLES, min_steps=MIN_STEPS)
@settings(deadline=None)
def test_no_short_interior_segment_survives_debouncing(samples, min_steps):
    debounced = debounce(_column(samples), min_steps).flatten().tolist()
    assert all(duration >= min_steps for _, duration in _segments(debounced)[1:])


@given(samples=SAMPLES, min_steps=MIN_STEPS)
@settings(deadline=None)
def test_debouncing_twice_is_debouncing_once(samples, min_steps):
    once = debounce(_column(samples), min_steps)
    assert torch.equal(debounce(once, min_steps), once)


@given(durations=SEGMENTS, first=st.booleans())
@settings(deadline=None)
def test_debouncing_leaves_long_segments_alone(durations, first):
    contacts = _column(_from_segments(durations, first))
    assert torch.equal(debounce(contacts, 2), contacts)


@given(before=SAMPLES, after=SAMPLES, min_steps=MIN_STEPS)
@settings(deadline=None)
def test_debouncing_treats_two_episodes_as_if_each_were_alone(before, after, min_steps):
    joined = _column(before + after)
    apart = torch.cat([debounce(_column(part), min_steps) for part in (before, after)])
    assert torch.equal(debounce(joined, min_steps, _starts(joined, len(before))), apart)


@given(durations=SEGMENTS, first=st.booleans())
@settings(deadline=None)
def test_hindsight_phase_is_the_truth_of_the_segments(durations, first):
    contacts = _column(_from_segments(durations, first))
    phase, closed = hindsight_phase(contacts, _starts(contacts))
    expected_phase, expected_closed = _labels_by_hand(durations, first)
    assert phase.flatten().tolist() == pytest.approx(expected_phase)
    assert closed.flatten().tolist() == expected_closed


def test_a_swing_of_four_samples_rises_in_quarters_and_a_stance_of_two_falls_in_halves():
    contacts = _column("110000110011")
    phase, closed = hindsight_phase(contacts, _starts(contacts))
    expected = [0, 0, 0, 0.25, 0.5, 0.75, 1, 0.5, 0, 0.5, 0, 0]
    assert phase.flatten().tolist() == expected
    assert closed.flatten().tolist() == [False] * 2 + [True] * 8 + [False] * 2


@given(samples=SAMPLES, min_steps=st.integers(2, 4), start=st.integers(0, 39))
@settings(deadline=None)
def test_phase_stays_in_range_and_moves_by_at_most_one_over_the_shortest_segment(
    samples, min_steps, start
):
    contacts = _column(samples)
    starts = _starts(contacts, min(start, len(samples) - 1))
    phase, closed = (x.flatten() for x in hindsight_phase(contacts, starts, min_steps))
    assert ((phase >= 0) & (phase <= 1)).all()
    both_closed = closed[1:] & closed[:-1]
    assert (phase.diff().abs()[both_closed] <= 1 / min_steps + 1e-6).all()


@given(durations=SEGMENTS, first=st.booleans())
@settings(deadline=None)
def test_closed_phase_is_one_at_touchdown_and_zero_at_foot_off(durations, first):
    contacts = _column(_from_segments(durations, first))
    phase, closed = (x.flatten() for x in hindsight_phase(contacts, _starts(contacts)))
    contact = contacts.flatten().float()
    change = torch.cat((torch.zeros(1), contact.diff()))
    assert (phase[(change > 0) & closed] == 1.0).all()
    assert (phase[(change < 0) & closed] == 0.0).all()


@given(before=SAMPLES, after=SAMPLES)
@settings(deadline=None)
def test_hindsight_phase_never_bridges_an_episode_start(before, after):
    joined = _column(before + after)
    labels = hindsight_phase(joined, _starts(joined, len(before)))
    alone = [hindsight_phase(_column(x), _starts(_column(x))) for x in (before, after)]
    for k in range(2):
        torch.testing.assert_close(labels[k], torch.cat([part[k] for part in alone]))


def test_an_episode_start_between_two_states_is_no_event():
    contacts = _column("0011" + "0000" + "1100")
    _, closed = hindsight_phase(contacts, _starts(contacts, 4))
    assert closed.flatten().tolist() == [False] * 8 + [True] * 2 + [False] * 2


def test_a_segment_longer_than_the_longest_is_masked_and_one_as_long_is_not():
    contacts = _column(_from_segments([2, 5, 4, 2], first=False))
    _, closed = hindsight_phase(contacts, _starts(contacts), max_steps=4)
    assert closed.flatten().tolist() == [False] * 7 + [True] * 4 + [False] * 2


def test_a_change_away_from_an_unconfirmed_first_sample_is_no_event():
    contacts = _column("0" + "1111" + "000" + "11")
    _, closed = hindsight_phase(contacts, _starts(contacts))
    assert closed.flatten().tolist() == [False] * 5 + [True] * 3 + [False] * 2


def test_every_foot_of_every_environment_is_labelled_on_its_own():
    generator = torch.Generator().manual_seed(3)
    contacts = torch.rand((30, 3, 2), generator=generator) < 0.5
    starts = torch.rand((30, 3), generator=generator) < 0.1
    phase, closed = hindsight_phase(contacts, starts)
    assert closed.any()
    for env in range(3):
        for foot in range(2):
            alone = contacts[:, env, foot, None, None].contiguous()
            labels = hindsight_phase(alone, starts[:, env, None])
            torch.testing.assert_close(labels[0].flatten(), phase[:, env, foot])
            assert torch.equal(labels[1].flatten(), closed[:, env, foot])


def test_contacts_that_are_not_boolean_are_refused():
    with pytest.raises(ValueError, match="bool"):
        debounce(torch.zeros(3, 1, 1), 2)


def test_starts_of_another_shape_are_refused():
    with pytest.raises(ValueError, match="starts"):
        hindsight_phase(_column("0011"), torch.zeros(3, 1, dtype=torch.bool))


def test_a_shortest_segment_of_zero_samples_is_refused():
    with pytest.raises(ValueError, match="min_steps"):
        debounce(_column("0011"), 0)


def _play(samples, attribute, **options):
    """Feed one foot its samples and return what the attribute was after each."""
    causal = CausalContacts(1, 1, **options)
    values = []
    for raw in _column(samples):
        causal.update(raw)
        values.append(getattr(causal, attribute).item())
    return values


@given(samples=SAMPLES, min_steps=MIN_STEPS)
@settings(deadline=None)
def test_causal_contact_is_the_debounced_contact_delayed(samples, min_steps):
    delay = min_steps - 1
    causal = _play(samples, "contact", min_steps=min_steps)
    debounced = debounce(_column(samples), min_steps).flatten().tolist()
    assert causal[:delay] == [samples[0]] * min(delay, len(samples))
    assert causal[delay:] == debounced[: max(len(samples) - delay, 0)]


#          sample:  0 1 2 3 4 5 6 7 8 9 10 11 12
EPISODE = "1100010111100"


@pytest.mark.parametrize(
    ("attribute", "expected"),
    [
        ("contact", [1, 1, 1, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0]),
        ("foot_off", [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1]),
        ("touchdown", [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0]),
        ("air_steps", [0, 0, 0, 1, 2, 3, 4, 5, 0, 0, 0, 0, 1]),
        ("stance_steps", [0, 1, 2, 0, 0, 0, 0, 0, 1, 2, 3, 4, 0]),
        ("last_air_steps", [10] * 8 + [5] * 5),
        ("last_stance_steps", [15] * 12 + [4]),
    ],
)
def test_causal_contacts_of_a_short_episode_are_the_hand_computed_ones(attribute, expected):
    assert _play(EPISODE, attribute) == expected


def test_causal_phase_is_age_over_the_last_duration_clipped():
    # Nominal durations 4 and 5; the swing from sample 2 lasts 6, the stance after it 8 or more.
    nominal = {"nominal_air_steps": 4, "nominal_stance_steps": 5}
    phase = _play("11" + "000000" + "11111111", "phase", **nominal)
    assert phase[3:8] == pytest.approx([0.25, 0.5, 0.75, 1.0, 1.0])
    assert phase[9:] == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0, 0.0, 0.0])


def test_hindsight_tells_how_long_a_swing_still_lasts():
    contacts = _column("1110000111110011")
    left, length, swings = (x.flatten() for x in hindsight_swing(contacts, _starts(contacts)))
    assert swings.tolist() == [c == "s" for c in "...ssss.....ss.."]
    assert left[swings].tolist() == [4, 3, 2, 1, 2, 1]
    assert length[swings].tolist() == [4, 4, 4, 4, 2, 2]


def test_causal_phase_of_a_steady_gait_is_the_hindsight_phase_once_events_are_confirmed():
    samples = _from_segments([6, 4, 6, 4, 6, 4, 6], first=True)
    contacts = _column(samples)
    phase, closed = (x.flatten() for x in hindsight_phase(contacts, _starts(contacts)))
    causal = torch.tensor(_play(samples, "phase"))
    # The second closed swing is the first whose duration is known; its first sample is unconfirmed.
    second_swing = slice(17, 20)
    assert closed[second_swing].all()
    assert causal[second_swing].tolist() == pytest.approx(phase[second_swing].tolist())


def test_resetting_one_environment_changes_no_other():
    generator = torch.Generator().manual_seed(5)
    raw = torch.rand((20, 2, 4), generator=generator) < 0.5
    touched, untouched = CausalContacts(2), CausalContacts(2)
    for step, sample in enumerate(raw):
        touched.update(sample)
        untouched.update(sample)
        if step == 9:
            touched.reset(torch.tensor([True, False]))
    for name, value in untouched.state_dict().items():
        assert torch.equal(touched.state_dict()[name][1], value[1]), name


@pytest.mark.parametrize("given_now", [True, False])
def test_a_reset_environment_goes_on_as_a_new_one(given_now):
    generator = torch.Generator().manual_seed(6)
    raw = torch.rand((20, 1, 4), generator=generator) < 0.5
    used, new = CausalContacts(1), CausalContacts(1)
    for sample in raw[:10]:
        used.update(sample)
    mask = torch.tensor([True])
    if given_now:
        used.reset(mask, raw[10])
    else:
        used.reset(mask)
        used.update(raw[10])
    new.update(raw[10])
    for sample in raw[11:]:
        used.update(sample)
        new.update(sample)
    for name, value in new.state_dict().items():
        assert torch.equal(used.state_dict()[name], value), name


def test_a_restored_state_goes_on_like_the_one_that_was_saved():
    generator = torch.Generator().manual_seed(7)
    raw = torch.rand((20, 2, 4), generator=generator) < 0.5
    original, restored = CausalContacts(2), CausalContacts(2)
    for sample in raw[:10]:
        original.update(sample)
    restored.load_state_dict(original.state_dict())
    for sample in raw[10:]:
        original.update(sample)
        restored.update(sample)
    for name, value in original.state_dict().items():
        assert torch.equal(restored.state_dict()[name], value), name


def test_a_tensor_read_earlier_does_not_change_with_an_update():
    causal = CausalContacts(1, 1)
    causal.update(torch.tensor([[True]]))
    before = {name: (value, value.clone()) for name, value in causal.state_dict().items()}
    for _ in range(3):
        causal.update(torch.tensor([[False]]))
    assert not causal.contact.item()
    assert all(torch.equal(value, copy) for value, copy in before.values())


def test_a_state_of_another_number_of_environments_is_refused_and_changes_nothing():
    causal = CausalContacts(2)
    causal.update(torch.ones(2, 4, dtype=torch.bool))
    with pytest.raises(ValueError, match="contact"):
        causal.load_state_dict(CausalContacts(3).state_dict())
    assert causal.contact.shape == (2, 4)
    assert causal.contact.all()


def test_raw_contacts_of_another_shape_are_refused():
    with pytest.raises(ValueError, match="raw"):
        CausalContacts(2).update(torch.ones(3, 4, dtype=torch.bool))
