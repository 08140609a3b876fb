"""Manual edits of events and strides: records, and the pure functions that apply them.

The detector's events are never modified; the edits, applied in the order in which they were made, give the
events and strides in use. Undo removes the last edit. A stride is identified by a moment inside it, so that a
decision about it remains valid when its contacts are shifted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from typing import Any, Final, Literal, cast, get_args

from sagittal.core.errors import ParameterError
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents, Stride, Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.message import Message

EditKind = Literal["move_event", "add_event", "delete_event", "exclude_stride", "include_stride"]
KINDS: Final[tuple[EditKind, ...]] = get_args(EditKind)

APART_S: Final = 0.05
"""Two events of one foot closer than this are one (our choice: stance and swing last four times longer)."""

SAME_S: Final = 0.001
"""An event is meant when it lies this close to the time named (our choice: a tenth of a sample at 100 Hz)."""

REASON_LENGTH: Final = 200
"""Longest reason, characters (our choice)."""

SOURCE: Final = "manual"
"""Source of an event that a person placed."""


@dataclass(frozen=True)
class Edit:
    """One edit.

    Parameters
    ----------
    time_s : of the event to move or delete, of the new event, or a moment inside the stride, s.
    event : kind of the event; None for strides. to_s : new time of a moved event; else None.
    reason : why a stride is excluded, a line of text; else None.

    Raises
    ------
    ParameterError `bad_edit`: a field is missing, not finite, or not applicable to this kind of edit.
    """

    kind: EditKind
    side: Side
    time_s: float
    event: EventKind | None = None
    to_s: float | None = None
    reason: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS or self.side not in SIDES:
            raise _bad(
                f"expected kind {', '.join(KINDS)} and side left or right, got {self.kind} {self.side}"
            )
        about_event = self.kind.endswith("event")
        if self.event not in (get_args(EventKind) if about_event else (None,)):
            raise _bad(f"{self.kind} got event {self.event}; events are ic or tc, strides have none")
        if (self.to_s is not None) != (self.kind == "move_event"):
            raise _bad(f"{self.kind} got to_s {self.to_s}; a move, and only a move, says where to")
        if not all(isfinite(t) for t in (self.time_s, self.to_s) if t is not None):
            raise _bad("times are finite seconds from the start of the recording")
        reason_text = (self.reason or "").strip()
        if bool(reason_text) != (self.kind == "exclude_stride") or len(reason_text) > REASON_LENGTH:
            raise _bad(
                f"{self.kind} got a reason of {len(reason_text)} characters; leaving a stride out, "
                f"and only that, needs one of 1 to {REASON_LENGTH}"
            )

    def to_json(self) -> dict[str, Any]:
        """Plain values without empty fields."""
        return {k: v for k, v in asdict(self).items() if v is not None}


def read_edit(values: dict[str, Any]) -> Edit:
    """Parse an edit written by `to_json`; raises ParameterError bad_edit."""
    try:
        return Edit(**values)
    except TypeError as error:
        raise _bad(str(error)) from None


def apply_event_edits(events: GaitEvents, edits: Iterable[Edit], duration_s: float) -> GaitEvents:
    """The events after all event edits, in chronological order.

    Raises
    ------
    ParameterError `no_such_event`; `event_outside` the recording; `event_order`: it would pass another event
        of its foot, or come within `APART_S` of it.
    """
    contacts = list(events.events)
    for edit in edits:
        if not edit.kind.endswith("event"):
            continue
        to_s = edit.time_s if edit.to_s is None else edit.to_s
        _refuse_outside(to_s, duration_s)
        if edit.kind != "add_event":
            old = contacts.pop(_place(contacts, edit))
            _refuse_passing(contacts, edit, old.time_s, to_s)
        if edit.kind != "delete_event":
            _put(contacts, edit, to_s)
    contacts.sort(key=lambda e: e.time_s)
    return replace(events, events=tuple(contacts))


def apply_stride_edits(strides: Strides, edits: Iterable[Edit]) -> Strides:
    """The stride list with manual decisions: the last decision about a stride overrides any rule.

    Decisions about a moment that is no longer inside a stride have no effect.
    """
    listed = list(strides.strides)
    for edit in edits:
        if edit.kind.endswith("stride"):
            i = find_stride(listed, edit.side, edit.time_s)
            if i is not None:
                exclusion = None if edit.reason is None else f"{SOURCE}:{edit.reason.strip()}"
                listed[i] = replace(listed[i], excluded_reason=exclusion)
    return replace(strides, strides=tuple(listed))


def find_stride(strides: Sequence[Stride], side: Side, time_s: float) -> int | None:
    """Index of the stride of a foot that contains a moment, None without one."""
    return next((i for i, s in enumerate(strides) if s.side == side and s.start_s <= time_s < s.end_s), None)


def _place(contacts: Sequence[GaitEvent], edit: Edit) -> int:
    for i, e in enumerate(contacts):
        if e.side == edit.side and e.kind == edit.event and abs(e.time_s - edit.time_s) <= SAME_S:
            return i
    raise ParameterError(
        "no_such_event",
        Message(
            "There is no {edit} at {time_s:.3f} s; it may have been changed meanwhile. Load again.",
            edit=_name(edit),
            time_s=edit.time_s,
        ),
        t_s=edit.time_s,
    )


def _refuse_outside(time_s: float, duration_s: float) -> None:
    if not 0.0 <= time_s <= duration_s:
        raise ParameterError(
            "event_outside",
            Message(
                "{time_s:.3f} s is outside the recording; expected 0 to {duration_s:.3f} s.",
                time_s=time_s,
                duration_s=duration_s,
            ),
            t_s=time_s,
        )


def _put(contacts: list[GaitEvent], edit: Edit, time_s: float) -> None:
    near = next((e for e in contacts if e.side == edit.side and abs(e.time_s - time_s) < APART_S), None)
    if near is not None:
        raise ParameterError(
            "event_order",
            Message(
                "The {edit} at {time_s:.3f} s would be less than {APART_S:.0f} ms from another event "
                "of that foot at {time_s2:.3f} s; delete that one first.",
                edit=_name(edit),
                time_s=time_s,
                APART_S=1000 * APART_S,
                time_s2=near.time_s,
            ),
            t_s=time_s,
        )
    contacts.append(GaitEvent(time_s, edit.side, cast("EventKind", edit.event), SOURCE, time_s))


def _refuse_passing(contacts: Iterable[GaitEvent], edit: Edit, from_s: float, to_s: float) -> None:
    low, high = sorted((from_s, to_s))
    passed = next((e for e in contacts if e.side == edit.side and low <= e.time_s <= high), None)
    if passed is not None:
        raise ParameterError(
            "event_order",
            Message(
                "The {edit} cannot pass another event of that foot at {time_s:.3f} s; delete that one first.",
                edit=_name(edit),
                time_s=passed.time_s,
            ),
            t_s=to_s,
        )


def _name(edit: Edit) -> str:
    return f"{edit.side} {'initial contact' if edit.event == 'ic' else 'foot-off'}"


def _bad(problem: str) -> ParameterError:
    return ParameterError("bad_edit", Message("This edit is not as expected: {what}.", what=problem))
