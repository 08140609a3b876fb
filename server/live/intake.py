"""State machine of a live trial's stream, independent of sockets, clocks and disks.

seq below the next one → a duplicate, ignored · the next one → stored · above → closed, the tablet resumes.
Batches are acknowledged only after `note_synced`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import (
    Finish,
    Header,
    Hello,
    Kind,
    LogRecord,
    SampleBatch,
    check_fits,
    encode_batch,
    finish_json,
    parse_finish,
    parse_hello,
    read_batch_header,
    view_samples,
)
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.server.live import protocol
from sagittal.server.live.protocol import MOST_UNACKED, CloseCode, ProtocolError

MISMATCH = "finish_mismatch"


@dataclass(frozen=True)
class TakeEnd:
    """End of a trial, after which batches are rejected.

    Parameters
    ----------
    count : batches in the log. sha256 : over their payloads in order of seq.
    problem : None, or finish_mismatch: the tablet's count or hash differs; the trial is stored nevertheless.
    """

    count: int
    sha256: str
    problem: str | None = None


@dataclass(frozen=True)
class IntakeAnswer:
    """Response to one message.

    Parameters
    ----------
    say : text message to send immediately, None = nothing. close : then close with this code and `reason`.
    keep : record for the log. battery : levels for display only.
    ended : the end requested by the tablet is already durable; reply with its recording.
    """

    say: str | None = None
    close: CloseCode | None = None
    reason: str = ""
    keep: tuple[Kind, bytes] | None = None
    battery: Mapping[str, float] | None = None
    ended: TakeEnd | None = None


NOTHING = IntakeAnswer()


def refuse(error: ProtocolError) -> IntakeAnswer:
    """Response that reports an error and closes the connection."""
    return IntakeAnswer(protocol.error(error.code, error.message), error.close, error.code)


@dataclass
class _Span:
    """Duration of a stream by its own clock."""

    began_us: int
    length_s: float = 0.0


class Intake:
    """State of one trial: hello, progress, and end.

    `hello` is None until it is replayed or greeted.
    """

    def __init__(self) -> None:
        self.hello: Hello | None = None
        self.next_seq = 0
        self.durable = 0
        self._hash = hashlib.sha256()
        self._said: Finish | None = None  # the end as declared by the tablet or this side
        self._base = 0  # batches in the log when it was opened
        self._end_durable = False
        self._spans: dict[int, _Span] = {}

    @property
    def ended(self) -> TakeEnd | None:
        """The end, once durable."""
        return self._ended() if self._end_durable else None

    @property
    def elapsed_s(self) -> float | None:
        """Duration of the longest stream by its own clock; None without samples."""
        return max((span.length_s for span in self._spans.values()), default=None)

    @property
    def heard(self) -> frozenset[int]:
        """Streams with at least one batch."""
        return frozenset(self._spans)

    @property
    def is_over(self) -> bool:
        """Whether the trial has been ended, durably or not."""
        return self._said is not None

    def replay(self, record: LogRecord) -> None:
        """Update from a record of the log, all of which is durable.

        Raises
        ------
        InputError `live_log_order` if it is not a log of ours.
        """
        if (self.hello is None) != (record.kind == "H") or self._said is not None:
            raise InputError(
                "live_log_order", Message("The log has a record '{kind}' out of its order.", kind=record.kind)
            )
        if record.kind == "H":
            self.hello = parse_hello(record.body)
        elif record.kind == "B":
            header = read_batch_header(record.body)
            if header.seq != self.next_seq:
                raise InputError(
                    "live_log_order",
                    Message("Batch {seq} follows {next_seq}.", seq=header.seq, next_seq=self.next_seq - 1),
                )
            self._take(record.body, header)
            self.durable = self._base = self.next_seq
        else:
            self._said = parse_finish(record.body)
            self._end_durable = True

    def greet(self, hello: Hello) -> IntakeAnswer:
        """Respond to a hello; a reconnecting tablet must describe the same sensors."""
        if self.hello is None:
            self.hello = hello
        if hello != self.hello:
            return refuse(
                ProtocolError(
                    "hello_changed",
                    "The hello differs from the one this take began with; end the take and begin a new one "
                    "to record with other sensors.",
                )
            )
        # not `next_seq`: a client that takes the welcome for an acknowledgement must still be correct;
        # batches sent twice for it are duplicates
        return IntakeAnswer(protocol.welcome(self.durable))

    def offer(self, message: bytes | str) -> IntakeAnswer:
        """Respond to one message of a greeted tablet; records to be stored are in the response."""
        try:
            if isinstance(message, bytes):
                protocol.check_size(message)
                return self._batch(message)
            match protocol.parse(message):
                case Hello() as hello:
                    return self.greet(hello)
                case SampleBatch() as batch:
                    return self._batch(encode_batch(batch))
                case Finish() as finish:
                    return self._finish(finish)
                case battery:
                    return IntakeAnswer(battery=battery.percent)
        except ProtocolError as error:
            return refuse(error)
        except InputError as error:
            return refuse(ProtocolError(error.code, error.message))

    def end(self) -> IntakeAnswer:
        """End the trial on the server side with the received batches."""
        if self._said is not None:
            return IntakeAnswer(ended=self.ended)
        return self._keep_end(Finish(self.next_seq, self._hash.hexdigest()))

    def note_synced(self, records: int) -> None:
        """Mark the first `records` records since opening as durable."""
        self.durable = min(self._base + records, self.next_seq)
        self._end_durable = self._end_durable or self._base + records > self.next_seq

    def _batch(self, frame: bytes) -> IntakeAnswer:
        header = read_batch_header(frame)
        if self.hello is None:
            raise ProtocolError("hello_missing", "A batch came before the hello.")
        check_fits(header, self.hello)
        if header.seq < self.next_seq:
            return IntakeAnswer(protocol.ack(self.durable))
        if self._said is not None:
            raise ProtocolError(
                "take_ended", "The take has ended; it takes no more batches.", CloseCode.ENDED
            )
        if header.seq > self.next_seq:
            raise ProtocolError(
                "gap", f"Batch {header.seq} came, {self.next_seq} is next; connect again.", CloseCode.GAP
            )
        if self.next_seq - self.durable >= MOST_UNACKED:
            raise ProtocolError(
                "too_many_unacked",
                f"{MOST_UNACKED} batches are not acknowledged yet; wait at {protocol.MAX_UNACKED}.",
                CloseCode.TOO_MANY,
            )
        self._take(frame, header)
        return IntakeAnswer(keep=("B", frame))

    def _take(self, frame: bytes, header: Header) -> None:
        self._hash.update(view_samples(frame, header))
        self.next_seq += 1
        if self.hello is not None:
            span = self._spans.setdefault(header.stream, _Span(header.t0_us))
            lasted = (header.n_samples - 1) / self.hello.stream(header.stream).rate_hz
            span.length_s = max(span.length_s, 1e-6 * (header.t0_us - span.began_us) + lasted)

    def _finish(self, finish: Finish) -> IntakeAnswer:
        if self._said is not None:
            return IntakeAnswer(ended=self.ended)
        if finish.count > self.next_seq:
            return IntakeAnswer(
                protocol.error(
                    MISMATCH,
                    Message(
                        f"The tablet counts {{count}} {plural(finish.count, 'batch', 'batches')}, "
                        "{next_seq} have come; send the rest and finish again.",
                        count=finish.count,
                        next_seq=self.next_seq,
                    ),
                    next_seq=self.next_seq,
                )
            )
        return self._keep_end(finish)

    def _keep_end(self, finish: Finish) -> IntakeAnswer:
        self._said = finish
        return IntakeAnswer(keep=("F", finish_json(finish)))

    def _ended(self) -> TakeEnd:
        own = Finish(self.next_seq, self._hash.hexdigest())
        return TakeEnd(own.count, own.sha256, None if self._said == own else MISMATCH)
