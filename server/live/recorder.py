"""Non-blocking recorder of one live trial, used by the socket's route.

Runs on the event loop. `offer` validates a message, queues it for the committer's thread and returns; the
listener is called on the loop when it is readable, when it is durable, and on disk errors.

    committer = Committer(); committer.start()             # one per server
    recorder = await open_recorder(path, hello, committer, listener)
    answer = recorder.greet(hello)                         # per connection: welcome, or hello_changed
    answer = recorder.offer(message)                       # per message, str or bytes
    await recorder.close()                                 # at shutdown, or when the trial has ended
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Protocol

from sagittal.core.formats.live_log import Hello, hello_json, record
from sagittal.server.live.committer import Committer, LogLane, Post
from sagittal.server.live.intake import Intake, IntakeAnswer, TakeEnd, refuse
from sagittal.server.live.protocol import CloseCode, ProtocolError
from sagittal.server.storage import segments
from sagittal.server.storage.refusal import FULL


class RecorderListener(Protocol):
    """Callbacks for recording events, called on the event loop; must not block."""

    def note_growth(self, size: int) -> None:
        """The log now has `size` readable bytes of complete records.

        After a disk error the size may decrease, because unsynced data were dropped; readers beyond `size`
        must restart.
        """

    def note_acknowledged(self, seq: int) -> None:
        """All batches below this one are durable and can be acknowledged to the tablet (`protocol.ack`)."""

    def note_end(self, end: TakeEnd) -> None:
        """The end is durable and the log complete."""

    def note_failure(self, error: ProtocolError) -> None:
        """Disk error (storage_full, storage_failed): report it and close with `error.close`.

        The tablet retains unacknowledged batches and reconnects; call `reopen` before greeting it.
        """


class Recorder:
    """Log of one live trial with its protocol state.

    Created by `open_recorder` or `restore`.

    Parameters
    ----------
    intake : state restored from the log. log : open for appending. post : posts calls to the event loop.

    `damage` : unreadable part of the log found on opening, None = intact.
    """

    def __init__(
        self,
        intake: Intake,
        log: segments.TakeLog,
        committer: Committer,
        listener: RecorderListener,
        post: Post,
    ) -> None:
        if intake.hello is None:
            raise ValueError("A recorder needs a take that has been greeted.")
        self.path = log.path
        self.hello = intake.hello
        self._intake = intake
        self.damage = log.damage
        self._lane = LogLane(log, self, post, committer.disk)
        self._committer = committer
        self._listener = listener
        self._size = log.size
        self._failure: ProtocolError | None = None

    @property
    def next_seq(self) -> int:
        """Sequence number of the next batch."""
        return self._intake.next_seq

    @property
    def durable(self) -> int:
        """Number of durable batches."""
        return self._intake.durable

    @property
    def elapsed_s(self) -> float | None:
        """Seconds from the first to the last received sample; None before the first."""
        return self._intake.elapsed_s

    @property
    def heard(self) -> frozenset[int]:
        """Streams with at least one batch."""
        return self._intake.heard

    @property
    def size(self) -> int:
        """Readable bytes of the log."""
        return self._size

    @property
    def end(self) -> TakeEnd | None:
        """The end of the trial, once durable."""
        return self._intake.ended

    @property
    def failure(self) -> ProtocolError | None:
        """Error that blocks recording until `reopen`, None if none."""
        return self._failure

    def greet(self, hello: Hello) -> IntakeAnswer:
        """Respond to the hello of a connection, the first or a later one."""
        return refuse(self._failure) if self._failure else self._intake.greet(hello)

    def offer(self, message: bytes | str) -> IntakeAnswer:
        """Respond to one message; never blocks or raises, whatever the tablet sends."""
        if self._failure:
            return refuse(self._failure)
        return self._kept(self._intake.offer(message))

    def finish(self) -> IntakeAnswer:
        """End the trial on the server; `RecorderListener.note_end` follows if the response lacks the end."""
        if self._failure:
            return refuse(self._failure)
        return self._kept(self._intake.end())

    async def reopen(self) -> None:
        """Return to the durable state after a disk error.

        Raises
        ------
        ProtocolError storage_full, storage_failed: the disk still fails.
        """
        try:
            self._intake = await asyncio.to_thread(self._restart)
        except OSError as error:
            self._failure = _refused(error)
            raise self._failure from error
        self._failure = None
        self.note_written(self._lane.log.size)

    async def close(self) -> None:
        """Write and sync queued records and close the file."""
        await asyncio.to_thread(self._lane.close)

    def note_written(self, size: int) -> None:
        """Callback of the committer's lane: readable bytes of the log."""
        self._size = size
        self._listener.note_growth(size)

    def note_synced(self, records: int) -> None:
        """Callback of the committer's lane: number of synced records."""
        durable_before, was_over = self._intake.durable, self._intake.ended
        self._intake.note_synced(records)
        if self._intake.durable > durable_before:
            self._listener.note_acknowledged(self._intake.durable)
        if self._intake.ended and not was_over:
            self._listener.note_end(self._intake.ended)

    def note_failure(self, error: OSError) -> None:
        """Callback of the committer's lane: the log cannot be written."""
        self._failure = _refused(error)
        self._listener.note_failure(self._failure)

    def _kept(self, answer: IntakeAnswer) -> IntakeAnswer:
        if answer.keep is not None:
            kind, body = answer.keep
            self._lane.put(record(kind, body))
            self._committer.wake(self._lane)
        return answer

    def _restart(self) -> Intake:
        self._lane.mend()
        intake = Intake()
        for _, one in segments.read_records(self.path):
            intake.replay(one)
        return intake


async def open_recorder(
    path: Path, hello: Hello | None, committer: Committer, listener: RecorderListener
) -> Recorder:
    """Open the trial at `path`, or create it with this hello.

    Raises
    ------
    ProtocolError
        storage_full, storage_failed; take_empty: neither a log nor a hello exists.
    InputError
        live_log_order, live_log_damaged: the file is not a valid log; it is not modified.
    """
    post = committer.post_to(asyncio.get_running_loop())
    try:
        intake, log = await asyncio.to_thread(restore, path, hello)
    except OSError as error:
        raise _refused(error) from error
    return Recorder(intake, log, committer, listener, post)


def restore(path: Path, hello: Hello | None) -> tuple[Intake, segments.TakeLog]:
    """Read a log and open it for appending; blocks.

    Raises
    ------
    OSError, ProtocolError `take_empty`, InputError `live_log_order`, `live_log_damaged`.
    """
    intake = Intake()
    if path.exists():
        log = segments.recover(path, intake.replay)
        if log is not None:
            return intake, log
    if hello is None:
        raise ProtocolError("take_empty", "Nothing has been streamed into this take.", CloseCode.ENDED)
    intake.greet(hello)
    return intake, segments.create(path, hello_json(hello))


def _refused(error: OSError) -> ProtocolError:
    if error.errno in FULL:
        return ProtocolError(
            "storage_full",
            "The server's disk is full; nothing is acknowledged until there is room. The tablet keeps its "
            "batches and tries again.",
            CloseCode.STORAGE,
        )
    return ProtocolError(
        "storage_failed",
        f"The server's disk refuses ({error.strerror}); nothing is acknowledged until it works. The tablet "
        "keeps its batches and tries again.",
        CloseCode.STORAGE,
    )
