"""One live trial in an estimator process: read its log, estimate, give feedback and report.

Apart from the timing of pictures, results depend only on the log and the commands, batch by batch in
order: a process that replaces a crashed one reproduces the same strides and cues with the same numbers.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

import msgspec

from sagittal.core.errors import InputError, Notice, SagittalError
from sagittal.core.events.result import GaitEvent
from sagittal.core.feedback import Baseline, Prescription
from sagittal.core.feedback.engine import COMMANDS, FeedbackEngine
from sagittal.core.formats.live_log import (
    Hello,
    LogRecord,
    SampleBatch,
    decode_batch,
    parse_hello,
    scan,
    scan_records,
)
from sagittal.core.frames import SIDES, Protocol, Side
from sagittal.core.functional_tests.result import GuidedTestView
from sagittal.core.online import OnlineSession
from sagittal.core.online.frame import AngleTrail, CalibrationView, LiveFrame
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.signals.recording import Subject
from sagittal.server.live import wire
from sagittal.server.live.messages import (
    STALE_S,
    Command,
    FeedbackStatus,
    FeedItem,
    FollowTake,
    Kind,
    LogProcessed,
    Picture,
    Report,
    encode_json,
)
from sagittal.server.report.words.guided_words import tell_person

CHUNK_BYTES: Final = 1 << 14
"""Bytes processed at a time, half a second of seven sensors, so that catching up does not block
other trials.
"""
EVERY_S: Final = 1 / 30
"""Minimum interval of pictures (docs/reference/architecture.md, "The 3D figure")."""
SLOW_S: Final = 0.2
"""Minimum interval of updating text parts (sensors, calibration)."""
DRIFT: Final = 1e-4
"""Maximum clock drift (100 ppm), by which the fastest transmission may become slower."""
PICTURE_TRAILS: Final = 400
"""Angle samples buffered for the next picture while a trial catches up; charts show no older ones."""


class Follower:
    """One live trial.

    Parameters
    ----------
    say : sends one report. clock : monotonic seconds, same clock as in the web process.
    """

    def __init__(
        self, begin: FollowTake, say: Callable[[Report], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.take = begin.take
        self._begin = begin
        self._say = say
        self._clock = clock
        self._file: BinaryIO | None = None
        self._read = 0
        self._size = begin.size
        self._arrived: deque[tuple[int, float]] = deque()
        self._commands: deque[Command] = deque(begin.commands)
        self._online: OnlineSession | None = None
        self._hello: Hello | None = None
        self._engine = _engine(begin)
        self._battery: Mapping[str, float] = {}
        self._said: Counter[Kind] = Counter()
        self._next_seq = 0
        self._stage = "waiting"
        self._guard = "unknown"
        self._standing = b""
        self._phase = _Phase()
        self._delays = _Delays()
        self._late = False
        self._last: LiveFrame | None = None
        self._guided: GuidedTestView | None = None
        self._trail: deque[AngleTrail] = deque(maxlen=PICTURE_TRAILS)
        self._sent_at = self._slow_at = -1.0
        self._slow: Mapping[str, Any] = {}
        self._slow_stage = ""
        self._described: tuple[CalibrationView | None, msgspec.Raw] | None = None

    @property
    def has_work(self) -> bool:
        """Whether the log has unread data."""
        return self._read < self._size

    @property
    def due_at(self) -> float | None:
        """Time of the next picture; None = nothing new to show."""
        return None if self._last is None else self._sent_at + EVERY_S

    def grow(self, size: int, time: float) -> None:
        """Register a log size of `size` bytes at `time`."""
        self._size = size
        self._arrived.append((size, time))

    def command(self, command: Command) -> None:
        """Schedule a command before the batch it refers to."""
        self._commands.append(command)
        self._obey()

    def charge(self, percent: Mapping[str, float]) -> None:
        """Update the battery levels of some sensors."""
        self._battery = {**self._battery, **percent}

    def step(self) -> None:
        """Read and process the next part of the log; raises InputError live_log_gone."""
        if self._file is None:
            self._file = _open_log(self._begin.path)
        self._file.seek(self._read)
        data = self._file.read(min(CHUNK_BYTES, self._size - self._read))
        records, used = scan(data) if self._read == 0 else scan_records(data)
        if not used and len(data) >= CHUNK_BYTES:  # a record longer than a chunk
            data += self._file.read(self._size - self._read - len(data))
            records, used = scan(data) if self._read == 0 else scan_records(data)
        if not used:
            raise ValueError(f"the log cannot be read from byte {self._read} on")
        start = self._read
        for record in records:
            self._use(record, start + record.end)
        self._read = start + used

    def show(self) -> None:
        """Send a picture of the latest frame if due."""
        due, now = self.due_at, self._clock()
        if due is None or now < due or self._last is None:
            return
        frame = self._last
        if now >= self._slow_at + SLOW_S or frame.stage != self._slow_stage:
            self._slow, self._slow_at, self._slow_stage = (
                wire.slow_part(frame, self._battery, self._guided, self._describe(frame.calibration)),
                now,
                frame.stage,
            )
        body = wire.frame(frame, self._trail, self._slow, self._phase.at(frame.t_s))
        delay = None if self._late else self._delays.now(now)
        guided = self._guided
        say = None if guided is None else tell_person(guided.protocol, guided.phase)
        pose, read_bytes = wire.pose(frame), self._read
        self._say(Picture(self.take, frame.t_s, frame.seq, frame.stage, body, delay, read_bytes, pose, say))
        self._last = None
        self._trail.clear()
        self._sent_at = now

    def _describe(self, view: CalibrationView | None) -> msgspec.Raw:
        """Calibration state as JSON, cached while unchanged."""
        if self._described is None or self._described[0] is not view:
            self._described = view, wire.describe_calibration(view)
        return self._described[1]

    def close(self) -> None:
        """Close the log file."""
        if self._file is not None:
            self._file.close()

    def _use(self, record: LogRecord, end: int) -> None:
        if record.kind == "H":
            self._hello = parse_hello(record.body)
            self._online = OnlineSession(
                self._hello,
                Subject(height_m=self._begin.height_m),
                _protocol(self._begin.protocol),
            )
            self._obey()
        elif record.kind == "B" and self._online is not None and self._hello is not None:
            batch = decode_batch(record.body)
            self._note_arrival(batch, end)
            self._obey()
            frame = self._online.push(batch)
            self._next_seq = batch.seq + 1
            if frame is not None:
                self._tell(frame)
                # takes milliseconds once a second, after the cue has been sent
                for notice in self._online.compare_sensors():
                    self._item("notice", notice.t_s, wire.notice(notice))
                self._guided = self._online.guide_test()
            self._obey()
        elif record.kind == "F":
            self._say(LogProcessed(self.take))

    def _obey(self) -> None:
        """Carry out the commands that precede the next batch."""
        while self._online is not None and self._commands and self._commands[0].before <= self._next_seq:
            command = self._commands.popleft()
            if command.name == "redo_calibration":
                self._online.command("redo_calibration")
                self._stage = "waiting"
            elif command.name == "test":
                self._online.command("test", command.value)
            elif command.name in COMMANDS and self._engine is not None:
                self._engine.command(command.name, command.value)
                self._tell_standing()

    def _tell(self, frame: LiveFrame) -> None:
        for event in frame.events:
            self._phase.see(event)
        for stride in frame.strides:
            self._phase.measure(stride)
            self._item("stride", stride.detected_s, wire.stride(stride))
        self._coach(frame)
        for notice in frame.notices:
            self._item("notice", notice.t_s, wire.notice(notice))
        if frame.stage == "running" and self._stage != "running":
            self._item("calibration", frame.t_s, wire.announce_calibration(frame))
        self._stage = frame.stage
        self._last = frame
        self._trail.append(frame.trail)

    def _coach(self, frame: LiveFrame) -> None:
        if self._engine is None:
            return
        for stride in frame.strides:
            cue = self._engine.push(stride, frame.t_s)
            if cue is not None:
                self._item("cue", cue.t_s, wire.cue(cue))
        if frame.strides or not self._standing:
            self._tell_standing()

    def _tell_standing(self) -> None:
        if self._engine is None:
            return
        state = self._engine.state
        if state.guard.state != self._guard:
            self._guard = state.guard.state
            self._item("guard", None if self._last is None else self._last.t_s, wire.feedback(state))
        body = encode_json(wire.feedback(state))
        if body != self._standing:
            self._standing = body
            self._say(FeedbackStatus(self.take, body))

    def _item(self, kind: Kind, t_s: float | None, content: dict[str, Any]) -> None:
        if self._late:
            content["late"] = True
        self._say(FeedItem(self.take, kind, self._said[kind], t_s, encode_json(content), self._late))
        self._said[kind] += 1

    def _note_arrival(self, batch: SampleBatch, end: int) -> None:
        """Determine whether this batch is up to date; data logged before the process started are not."""
        if end <= self._begin.size:
            self._late = True
            return
        while len(self._arrived) > 1 and self._arrived[0][0] < end:
            self._arrived.popleft()
        if self._arrived and self._hello is not None:
            rate = self._hello.stream(batch.stream).rate_hz
            self._delays.arrived(batch, rate, self._arrived[0][1])
        self._late = (self._delays.now(self._clock()) or 0.0) > STALE_S


class _Delays:
    """Delay of the latest sample, relative to the fastest transmission observed, per device clock."""

    def __init__(self) -> None:
        self._fastest: dict[int, tuple[float, float]] = {}
        self._due: float | None = None

    def arrived(self, batch: SampleBatch, rate_hz: float, time: float) -> None:
        n = len(batch.samples)
        last = (n - 1) / rate_hz if batch.offsets_us is None else float(batch.offsets_us[-1]) * 1e-6
        sampled = batch.t0_us * 1e-6 + last
        way = time - sampled
        previous, when = self._fastest.get(batch.stream, (way, time))
        fastest = min(way, previous + DRIFT * (time - when))
        self._fastest[batch.stream] = (fastest, time)
        self._due = sampled + fastest

    def now(self, now: float) -> float | None:
        return None if self._due is None else max(0.0, now - self._due)


class _Phase:
    """Phase of each foot in its cycle, from its last contact and stride duration."""

    def __init__(self) -> None:
        self._contact: dict[Side, float] = {}
        self._length: dict[Side, float] = {}

    def see(self, event: GaitEvent) -> None:
        if event.kind == "ic":
            self._contact[event.side] = event.time_s

    def measure(self, stride: LiveStride) -> None:
        self._length[stride.side] = stride.end_s - stride.start_s

    def at(self, t_s: float) -> dict[Side, float | None]:
        phases: dict[Side, float | None] = {}
        for side in SIDES:
            contact, length = self._contact.get(side), self._length.get(side)
            share = None if contact is None or not length else 100.0 * (t_s - contact) / length
            # half a cycle overdue: the subject has stopped
            phases[side] = None if share is None or not 0.0 <= share <= 150.0 else min(share, 100.0)
        return phases


def _open_log(path: str) -> BinaryIO:
    try:
        return Path(path).open("rb")
    except FileNotFoundError:
        raise InputError(
            "live_log_gone",
            "The log of this take is not in the data folder any more, so nothing of it can be estimated.",
        ) from None


def _engine(begin: FollowTake) -> FeedbackEngine | None:
    if begin.prescription is None:
        return None
    baseline = None if begin.baseline is None else Baseline.from_json(begin.baseline)
    return FeedbackEngine(Prescription.from_json(begin.prescription), baseline)


def _protocol(name: str) -> Protocol:
    return cast("Protocol", name)  # the database contains only known ones


def describe_failure(error: Exception) -> Notice:
    """Notice for a failed estimate; errors raised by core include their reason."""
    if isinstance(error, SagittalError):
        return Notice(error.code, error.message, severity="error")
    return Notice(
        "live_estimate_failed",
        "The live estimate of this trial stopped due to a program error; the trial is still being "
        "recorded and will be analysed afterwards. Details are in the server log; please report them.",
        severity="error",
    )
