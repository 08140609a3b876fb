"""One open live trial in the web process: recorder, tablet, therapist's commands and browser updates.

Runs on the event loop; disk and database access is left to the hub.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final, Protocol

import msgspec

from sagittal.server.live import protocol
from sagittal.server.live.intake import IntakeAnswer, TakeEnd
from sagittal.server.live.journal import Journal
from sagittal.server.live.messages import STALE_S, Charge, Command, FeedItem, FollowTake, Picture
from sagittal.server.live.pool import EstimatorPool
from sagittal.server.live.protocol import ProtocolError
from sagittal.server.live.recorder import Recorder
from sagittal.server.live.room import Room
from sagittal.server.live.sensors import sensor_rows
from sagittal.server.live_takes.live import LiveTakeRecord
from sagittal.server.live_takes.live_events import LiveEvent, is_own_notice
from sagittal.server.live_takes.live_training import LiveTraining

STEERING: Final = frozenset({"feedback", "level", "pause", "stale", "redo_calibration", "test"})
"""Commands that affect the estimator, effective from a given batch."""
TOLD: Final = frozenset({"cue", "calibration", "guard", "notice"})
"""Kinds of items stored as events."""


class TabletLink(Protocol):
    """Connection to a tablet (server/live/tablet.py)."""

    def say(self, text: str) -> None:
        """Send a message."""

    def ack(self, seq: int) -> None:
        """Acknowledge all batches below this one."""

    def shut(self, code: int, reason: str) -> None:
        """Close."""


class TakeRegistry(Protocol):
    """Interface of the registry to its trials (server/live/hub.py)."""

    @property
    def pool(self) -> EstimatorPool:
        """The estimator processes."""

    @property
    def journal(self) -> Journal:
        """Storage of events."""

    def note_started(self, take: ActiveTake) -> None:
        """The first batch of this trial has been received."""

    def note_ended(self, take: ActiveTake, end: TakeEnd) -> None:
        """The end of this trial is durable."""

    def tell_state(self, take: ActiveTake) -> None:
        """Send the state of this trial to browsers."""


@dataclass(frozen=True)
class TherapistMark:
    """A time marked by the therapist."""

    t_s: float | None
    value: str | None


@dataclass
class TakeSteering:
    """Commands and interruptions of a trial so far, from its events."""

    commands: list[Command] = field(default_factory=list)
    marks: list[TherapistMark] = field(default_factory=list)
    ghost: Any = None
    stale: bool = False
    stopping: bool = False

    def note_event(self, take_id: str, kind: str, t_s: float | None, content: Mapping[str, Any]) -> None:
        """Update from one event."""
        value = content.get("value")
        if kind in STEERING:
            self.commands.append(Command(take_id, int(content["before"]), kind, value))
        if kind == "stale":
            self.stale = bool(value)
        elif kind == "stop":
            self.stopping = True
        elif kind == "ghost":
            self.ghost = value
        elif kind == "mark":
            self.marks.append(TherapistMark(t_s, value))
        elif kind == "undo_mark" and self.marks:
            self.marks.pop()


class ActiveTake:
    """A live trial with a recorder.

    Parameters
    ----------
    house : its registry. row : as stored when it was opened.
    earlier : its events so far, after a restart of the server.
    """

    recorder: Recorder

    def __init__(
        self,
        house: TakeRegistry,
        row: LiveTakeRecord,
        room: Room,
        training: LiveTraining,
        earlier: Iterable[LiveEvent],
    ) -> None:
        self.id = row.id
        self.session_id = row.session_id
        self.state = row.state
        self.source = row.source
        self.room = room
        self.training = training
        self.tablet: TabletLink | None = None
        self.over = asyncio.Event()
        self.told = asyncio.Event()
        self.recording_id: str | None = None
        self.problem: str | None = None
        self.estimate = "preparing"
        self.t_s: float | None = None
        self.stage: str | None = None
        self.say: str | None = None
        self._house = house
        self._seen: Counter[str] = Counter()
        self.steered = TakeSteering()
        for event in earlier:
            self.steered.note_event(self.id, event.kind, event.t_s, event.content)
            # these do not come from the estimator
            if event.kind in TOLD and not is_own_notice(event.content):
                self._seen[event.kind] += 1
        self.grown_at = time.monotonic()
        self._size = 0
        self._battery: dict[str, float] = {}
        self._verdict: Mapping[str, Any] | None = None

    # the socket

    def offer(self, message: bytes | str) -> IntakeAnswer:
        """Pass a message to the recorder; never blocks."""
        answer = self.recorder.offer(message)
        if answer.keep is not None and self.state != "streaming" and answer.keep[0] == "B":
            self.state = "streaming"
            self._house.note_started(self)
        if answer.keep is not None and answer.keep[0] == "F":
            self.steered.stopping = True
            self._house.tell_state(self)
        return answer

    def charge(self, percent: Mapping[str, float]) -> None:
        """Show battery levels."""
        self._battery |= percent
        self._house.pool.send(Charge(self.id, dict(percent)))

    # the recorder's listener

    def note_growth(self, size: int) -> None:
        """The log is readable up to `size`; if it was longer before, it is processed again from the start."""
        self.grown_at = time.monotonic()
        previous, self._size = self._size, size
        if size < previous:
            self._house.pool.follow(self.id)
        else:
            self._house.pool.grow(self.id, size)
        if self.steered.stale and not self._house.pool.follows(self.id):
            self.mind_silence(False)

    def note_acknowledged(self, seq: int) -> None:
        """Batches are durable."""
        if self.tablet is not None:
            self.tablet.ack(seq)

    def note_end(self, end: TakeEnd) -> None:
        """The end is durable."""
        self._house.note_ended(self, end)

    def note_failure(self, error: ProtocolError) -> None:
        """A disk error occurred."""
        if self.tablet is not None:
            self.tablet.shut(error.close, error.code)

    # the estimator

    def begin(self) -> FollowTake:
        """Order to process this trial from its start."""
        t = self.training
        return FollowTake(
            self.id,
            str(self.recorder.path),
            self.recorder.size,
            t.height_m,
            t.protocol,
            None if t.prescription is None else dict(t.prescription),
            None if t.baseline is None else dict(t.baseline),
            list(self.steered.commands),
        )

    def steer(self, name: str, value: Any, t_s: float | None) -> dict[str, Any]:
        """Issue a command from the next batch on; return the content of its event, which is at `t_s`."""
        content: dict[str, Any] = {"value": value}
        if name in STEERING:
            content["before"] = self.recorder.next_seq
        self.steered.note_event(self.id, name, t_s, content)
        if name in STEERING:
            self._house.pool.send(self.steered.commands[-1])
        return content

    def show(self, picture: Picture) -> None:
        """Forward a picture."""
        self.t_s = picture.t_s
        if self.stage == "running" and picture.stage != "running":
            self.room.forget_strides()
        if (picture.stage, picture.say) != (self.stage, self.say):
            self.stage, self.say = picture.stage, picture.say
            self.tell_stage()
        stale = picture.delay_s is None or picture.delay_s > STALE_S
        delay = b"null" if picture.delay_s is None else b"%d" % round(1000.0 * picture.delay_s)
        tail = b',"delay_ms":%s,"stale":%s}' % (delay, b"true" if stale else b"false")
        self.room.say("frame", picture.body + tail)
        self.room.show(picture)
        if not stale:
            self.mind_silence(False)

    def tell_stage(self) -> None:
        """Send the stage of the estimation to the tablet."""
        if self.tablet is not None and self.stage is not None:
            self.tablet.say(protocol.state(self.stage, self.say))
            if self.stage == "running" and self._verdict is not None:
                self.tablet.say(protocol.judge_calibration(self._verdict))

    def tell(self, item: FeedItem) -> None:
        """Forward a one-time event, unless a restarted process repeats it."""
        if item.kind == "stride":
            self.room.keep_stride(item.body)
        elif item.kind == "cue":
            self.room.keep_cue(item.k, item.body)
        elif item.kind == "calibration":
            self._judge(msgspec.json.decode(item.body)["calibration"]["verdict"])
        if item.k < self._seen[item.kind]:
            return
        self._seen[item.kind] = item.k + 1
        if item.kind in ("stride", "cue", "notice"):
            self.room.say(item.kind, item.body)
        if item.kind in TOLD:
            content = msgspec.json.decode(item.body)
            for name in ("type", "late"):
                content.pop(name, None)
            self._house.journal.add(self.id, item.kind, item.t_s, content)

    def _judge(self, verdict: Mapping[str, Any] | None) -> None:
        """Store the outcome of a calibration and send it to the tablet."""
        self._verdict = verdict
        if verdict is not None and self.tablet is not None:
            self.tablet.say(protocol.judge_calibration(verdict))

    def look(self, now: float) -> None:
        """Detect that the tablet has stopped sending."""
        if self.state == "streaming" and now - self.grown_at > STALE_S:
            self.mind_silence(True)

    def mind_silence(self, stale: bool) -> None:
        """Pause feedback while data are stale; pauses are stored, so that a replay reproduces them."""
        if stale != self.steered.stale:
            content = self.steer("stale", stale, self.t_s)
            if self.training.prescription is not None:
                self._house.journal.add(self.id, "stale", self.t_s, content)

    def standing(self) -> dict[str, Any]:
        """State for browsers; time and sensors come from the recorder, independent of the estimator."""
        elapsed = self.recorder.elapsed_s
        silent = time.monotonic() - self.grown_at > STALE_S
        return {
            "type": "state",
            "take": self.id,
            "state": self.state,
            "tablet": "connected" if self.tablet is not None else "lost",
            "source": self.source,
            "count": self.recorder.next_seq,
            "elapsed_s": None if elapsed is None else round(elapsed, 1),
            "sensors": sensor_rows(self.recorder.hello, self.recorder.heard, self._battery, silent=silent),
            "marks": [asdict(mark) for mark in self.steered.marks],
            "ghost": self.steered.ghost,
            "stale": self.steered.stale,
            "stopping": self.steered.stopping,
            "estimate": self.estimate if self._house.pool.follows(self.id) else "none",
            "recording": self.recording_id,
            "problem": self.problem,
        }


def describe_unjoined(row: LiveTakeRecord | None) -> dict[str, Any]:
    """State of a trial that has no tablet yet or has ended; None = there was none."""
    return {
        "type": "state",
        "take": None if row is None else row.id,
        "state": "none" if row is None else row.state,
        "tablet": "none",
        "source": None if row is None else row.source,
        "count": None if row is None else row.count,
        "elapsed_s": None,
        "sensors": [],
        "marks": [],
        "ghost": None,
        "stale": False,
        "stopping": False,
        "estimate": "none",
        "recording": None if row is None else row.recording_id,
        "problem": None if row is None else row.problem,
    }
