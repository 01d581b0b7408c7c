"""Foot contacts and the phase of each foot, from contact samples at the control rate.

The phase of a foot is 0 at foot-off and 1 at contact, linear in between, then linearly back to 0
until the next foot-off. It needs the *next* event, so there are two forms: `hindsight_phase` labels
a recorded window exactly, and `CausalContacts` estimates it online from the durations of the foot's
previous segments. All times are counted in control steps; an event belongs to the first sample of
the segment that it opens. What is done with the labels, and how contact is sensed, is left to
others.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor


def debounce(contacts: Tensor, min_steps: int, starts: Tensor | None = None) -> Tensor:
    """Merge contact segments shorter than `min_steps` into their neighbours, in hindsight.

    A change is accepted only once the new state has held for `min_steps` consecutive samples, and
    is then dated back to where that run began; alternating chatter therefore keeps the old state.
    The first sample of an episode is its initial state, however short, and a run cut off by the end
    of an episode or of the window is not accepted.

    Args:
        contacts: Raw contact of each foot. Shape: (T, N, F), bool.
        min_steps: Shortest segment that is kept, in samples.
        starts: True where a new episode begins at that sample; nothing is merged across it. Shape:
            (T, N), bool.

    Returns:
        The debounced contacts. Shape: (T, N, F), bool.

    Raises:
        ValueError: If a shape, a type or `min_steps` is not as above.
    """
    _check_window(contacts, starts, min_steps)
    held = _held(contacts, starts, min_steps)
    return contacts.gather(0, _last_index(_or_first(held, starts)).long())


def hindsight_phase(
    contacts: Tensor, starts: Tensor, min_steps: int = 2, max_steps: int = 50
) -> tuple[Tensor, Tensor]:
    """Label every sample of a recorded window with the phase of each foot.

    With e0 <= t the last event and e1 > t the next one, the phase is (t - e0) / (e1 - e0) in swing
    and one minus that in stance. A sample is closed where both events are known. The start of an
    episode or of the window is no event, and neither is a change away from an initial state that
    was itself too short to be believed.

    Args:
        contacts: Raw contact of each foot, debounced here. Shape: (T, N, F), bool.
        starts: True where a new episode begins at that sample. Shape: (T, N), bool.
        min_steps: Shortest segment that is kept, in samples (40 ms at 50 Hz).
        max_steps: Longest segment that has a phase, in samples (1 s at 50 Hz); longer ones, such as
            standing, are open.

    Returns:
        The phase, 0 where it is not closed, and the mask of closed samples. Shapes: (T, N, F),
        float and bool.

    Raises:
        ValueError: If a shape, a type or `min_steps` is not as above.
    """
    contact, begin, end, closed = _segments(contacts, starts, min_steps, max_steps)
    progress = (_time_like(contacts) - begin) / (end - begin)
    phase = torch.where(contact, 1.0 - progress, progress)
    return phase.masked_fill_(~closed, 0.0), closed


def hindsight_swing(
    contacts: Tensor, starts: Tensor, min_steps: int = 2, max_steps: int = 50
) -> tuple[Tensor, Tensor, Tensor]:
    """Tell for every sample of a recorded window how long each foot still swings.

    Args:
        contacts: As for `hindsight_phase`.
        starts: As for `hindsight_phase`.
        min_steps: As for `hindsight_phase`.
        max_steps: As for `hindsight_phase`.

    Returns:
        Samples until the foot lands, and those of its whole swing, both of no meaning where it is
        not in a closed swing, and the mask of where it is. Shapes: (T, N, F), int32, int32, bool.

    Raises:
        ValueError: If a shape, a type or `min_steps` is not as above.
    """
    contact, begin, end, closed = _segments(contacts, starts, min_steps, max_steps)
    return end - _time_like(contacts), end - begin, closed & ~contact


def _segments(
    contacts: Tensor, starts: Tensor, min_steps: int, max_steps: int
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the debounced contacts, where each sample's segment begins and ends, and is closed."""
    _check_window(contacts, starts, min_steps)
    held = _held(contacts, starts, min_steps)
    source = _last_index(_or_first(held, starts)).long()
    contact = contacts.gather(0, source)
    confirmed = held.gather(0, source)

    # A boundary ends a segment; only a boundary that is an event can close one.
    boundary = torch.empty_like(contact)
    boundary[0] = True
    torch.logical_or(contact[1:] != contact[:-1], starts[1:, :, None], out=boundary[1:])
    event = torch.zeros_like(contact)
    event[1:] = boundary[1:] & confirmed[:-1] & ~starts[1:, :, None]

    begin, end = _last_index(boundary), _next_index(boundary)
    length = end - begin
    known = event.gather(0, begin.long()) & event.gather(0, end.long())
    return contact, begin, end, known & (length > 0) & (length <= max_steps)


class CausalContacts:
    """Debounced contacts, segment ages and causal phase of each foot, one step at a time.

    A change of contact is confirmed once `min_steps` consecutive samples agree, so it is known
    `min_steps - 1` samples late, but ages and durations are dated back to where the run began:
    `contact` is `debounce` of the same samples, delayed. Where the next event is unknown, the phase
    takes the foot's last duration of that kind instead.

    Every update binds fresh tensors to the attributes and writes none in place: a tensor that was
    read from here never changes afterwards.
    """

    contact: Tensor
    """Confirmed contact of each foot. Shape: (N, F), bool."""

    touchdown: Tensor
    """Touchdowns confirmed at this update. Shape: (N, F), bool."""

    foot_off: Tensor
    """Foot-offs confirmed at this update. Shape: (N, F), bool."""

    last_air_steps: Tensor
    """Duration of the last swing, in samples. Shape: (N, F), int32.

    Only swings that began and ended with an event count; the nominal duration until the first of an
    episode.
    """

    last_stance_steps: Tensor
    """Duration of the last stance, in samples, as for the swing. Shape: (N, F), int32."""

    def __init__(
        self,
        num_envs: int,
        num_feet: int = 4,
        min_steps: int = 2,
        nominal_air_steps: int = 10,
        nominal_stance_steps: int = 15,
        device: torch.device | str = "cpu",
    ) -> None:
        """Start every foot anew: the first sample is its initial state.

        Args:
            num_envs: Number of environments, N.
            num_feet: Number of feet, F.
            min_steps: Number of agreeing samples that confirm a change (40 ms at 50 Hz).
            nominal_air_steps: Duration of a swing before the first is known, in samples.
            nominal_stance_steps: Duration of a stance before the first is known, in samples.
            device: Where the state lives.

        Raises:
            ValueError: If `min_steps` or a nominal duration is below 1.
        """
        for name, value in (
            ("min_steps", min_steps),
            ("nominal_air_steps", nominal_air_steps),
            ("nominal_stance_steps", nominal_stance_steps),
        ):
            if value < 1:
                raise ValueError(f"{name} must be at least 1, got {value}")
        self.min_steps = min_steps
        self.nominal_air_steps = nominal_air_steps
        self.nominal_stance_steps = nominal_stance_steps
        shape = (num_envs, num_feet)
        self.contact = torch.zeros(shape, dtype=torch.bool, device=device)
        self.touchdown = torch.zeros_like(self.contact)
        self.foot_off = torch.zeros_like(self.contact)
        self.last_air_steps = torch.full(shape, nominal_air_steps, dtype=torch.int32, device=device)
        self.last_stance_steps = torch.full_like(self.last_air_steps, nominal_stance_steps)
        # Age of the current segment, whether it began with an event, and for how many samples the
        # raw contact has contradicted it.
        self._age = torch.zeros_like(self.last_air_steps)
        self._began_with_event = torch.zeros_like(self.contact)
        self._contradicted = torch.zeros_like(self.last_air_steps)
        self._awaits_first = torch.ones((num_envs, 1), dtype=torch.bool, device=device)

    @property
    def air_steps(self) -> Tensor:
        """Samples since foot-off or the episode's start; 0 in stance. Shape: (N, F), int32."""
        return self._age * ~self.contact

    @property
    def stance_steps(self) -> Tensor:
        """Samples since touchdown or the episode's start; 0 in swing. Shape: (N, F), int32."""
        return self._age * self.contact

    @property
    def phase(self) -> Tensor:
        """Phase with the last duration in place of the unknown one. Shape: (N, F), float.

        In swing the age over the last duration, clipped to 1; in stance one minus that.
        """
        progress = self._age / torch.where(
            self.contact, self.last_stance_steps, self.last_air_steps
        )
        progress = progress.clamp(max=1.0)
        return torch.where(self.contact, 1.0 - progress, progress)

    def update(self, raw: Tensor) -> None:
        """Consume one sample of raw contacts.

        Args:
            raw: Raw contact of each foot. Shape: (N, F), bool.

        Raises:
            ValueError: If `raw` is not a bool tensor of that shape.
        """
        self._check_raw(raw)
        contact = torch.where(self._awaits_first, raw, self.contact)
        contradicted = (self._contradicted + 1) * (raw != contact)
        changed = contradicted >= self.min_steps
        self.touchdown = changed & ~contact
        self.foot_off = changed & contact
        age = self._age + ~self._awaits_first
        late = self.min_steps - 1
        completed = age - late
        known = self._began_with_event
        self.last_air_steps = torch.where(self.touchdown & known, completed, self.last_air_steps)
        self.last_stance_steps = torch.where(
            self.foot_off & known, completed, self.last_stance_steps
        )
        self.contact = contact ^ changed
        self._age = torch.where(changed, late, age)
        self._began_with_event = known | changed
        self._contradicted = contradicted * ~changed
        self._awaits_first = torch.zeros_like(self._awaits_first)

    def reset(self, mask: Tensor, raw: Tensor | None = None) -> None:
        """Begin a new episode in some environments; no other changes.

        Args:
            mask: True where an episode begins. Shape: (N,), bool.
            raw: Raw contacts of the first sample, shape (N, F), bool, read where `mask` is true.
                Left out, the next update brings the first sample; until then those feet count as in
                the air.

        Raises:
            ValueError: If `mask` or `raw` is not a bool tensor of its shape.
        """
        if mask.shape != self.contact.shape[:1] or mask.dtype != torch.bool:
            raise ValueError(
                f"mask must be a bool tensor of shape {tuple(self.contact.shape[:1])}, "
                f"got {mask.dtype} of shape {tuple(mask.shape)}"
            )
        if raw is not None:
            self._check_raw(raw)
        rows = mask[:, None]
        first = torch.zeros_like(self.contact) if raw is None else raw
        self.contact = torch.where(rows, first, self.contact)
        self.last_air_steps = self.last_air_steps.masked_fill(rows, self.nominal_air_steps)
        self.last_stance_steps = self.last_stance_steps.masked_fill(rows, self.nominal_stance_steps)
        for name in ("touchdown", "foot_off", "_age", "_began_with_event", "_contradicted"):
            setattr(self, name, getattr(self, name).masked_fill(rows, 0))
        self._awaits_first = self._awaits_first.masked_fill(rows, raw is None)

    def state_dict(self) -> dict[str, Tensor]:
        """Return the whole state as plain tensors; later updates do not change them."""
        return {name: getattr(self, attribute) for name, attribute in _STATE.items()}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Take over a state that `state_dict` returned.

        Raises:
            ValueError: If an entry is missing, unknown, or of another shape or type; nothing is
                changed then.
        """
        if state.keys() != _STATE.keys():
            raise ValueError(f"state must hold exactly {sorted(_STATE)}, got {sorted(state)}")
        for name, attribute in _STATE.items():
            own = getattr(self, attribute)
            if state[name].shape != own.shape or state[name].dtype != own.dtype:
                raise ValueError(
                    f"{name} must be {own.dtype} of shape {tuple(own.shape)}, "
                    f"got {state[name].dtype} of shape {tuple(state[name].shape)}"
                )
        for name, attribute in _STATE.items():
            setattr(self, attribute, state[name].to(self.contact.device, copy=True))

    def _check_raw(self, raw: Tensor) -> None:
        if raw.shape != self.contact.shape or raw.dtype != torch.bool:
            raise ValueError(
                f"raw must be a bool tensor of shape {tuple(self.contact.shape)}, "
                f"got {raw.dtype} of shape {tuple(raw.shape)}"
            )


_STATE = {
    name.lstrip("_"): name
    for name in (
        "contact",
        "touchdown",
        "foot_off",
        "last_air_steps",
        "last_stance_steps",
        "_age",
        "_began_with_event",
        "_contradicted",
        "_awaits_first",
    )
}


def _check_window(contacts: Tensor, starts: Tensor | None, min_steps: int) -> None:
    """Raise ValueError unless a window is as `debounce` and `hindsight_phase` ask for it."""
    if contacts.ndim != 3 or contacts.shape[0] == 0 or contacts.dtype != torch.bool:
        raise ValueError(
            "contacts must be a bool tensor of shape (T, N, F) with T >= 1, "
            f"got {contacts.dtype} of shape {tuple(contacts.shape)}"
        )
    if starts is not None and (starts.shape != contacts.shape[:2] or starts.dtype != torch.bool):
        raise ValueError(
            f"starts must be a bool tensor of shape {tuple(contacts.shape[:2])}, "
            f"got {starts.dtype} of shape {tuple(starts.shape)}"
        )
    if min_steps < 1:
        raise ValueError(f"min_steps must be at least 1, got {min_steps}")


def _held(contacts: Tensor, starts: Tensor | None, min_steps: int) -> Tensor:
    """Return where the next `min_steps - 1` samples of the episode agree with the sample."""
    num_steps = contacts.shape[0]
    same = contacts[1:] == contacts[:-1]
    if starts is not None:
        same &= ~starts[1:, :, None]
    held = torch.ones_like(contacts)
    for ahead in range(min_steps - 1):
        kept = max(num_steps - 1 - ahead, 0)
        held[:kept] &= same[ahead:]
        held[kept:] = False
    return held


def _or_first(held: Tensor, starts: Tensor | None) -> Tensor:
    """Add the first sample of every episode, taken as it is, to the held samples."""
    accepted = held.clone() if starts is None else held | starts[:, :, None]
    accepted[0] = True
    return accepted


def _time_like(contacts: Tensor) -> Tensor:
    """Return the index of every step. Shape: (T, 1, 1), int32."""
    return torch.arange(contacts.shape[0], dtype=torch.int32, device=contacts.device)[:, None, None]


def _last_index(marked: Tensor) -> Tensor:
    """Return the index of the last marked sample at or before each one, else 0: int32."""
    index = marked * _time_like(marked)
    # The running maximum, step by step: on a CPU several times faster than cummax.
    for before, here in itertools.pairwise(index.unbind(0)):
        torch.maximum(before, here, out=here)
    return index


def _next_index(marked: Tensor) -> Tensor:
    """Return the index of the next marked sample after each one, else that of the last: int32."""
    last = marked.shape[0] - 1
    following = torch.full(marked.shape, last, dtype=torch.int32, device=marked.device)
    following[:-1] -= _last_index(marked.flip(0)).flip(0)[1:]
    return following
