"""One take on its way to the disk: what the socket's route needs, and nothing that could make it wait.

Used on the event loop. `offer` checks a message, queues it for the committer's thread and returns; the
listener is called back on the loop when it can be read, when it is durable, and when the disk refuses.

    committer = Committer(); committer.start()             # one per server
    recorder = await open_recorder(path, hello, committer, listener)
    answer = recorder.greet(hello)                         # of every connection: welcome, or hello_changed
    answer = recorder.offer(message)                       # of every message, str or bytes
    await recorder.close()                                 # at shut-down, or when the take is over
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
    """Who is told what happens to a take; all calls come on the event loop and must not block it."""

    def note_growth(self, size: int) -> None:
        """The log has `size` bytes of whole records now; readers of the file may go so far.

        After a failure of the disk it can be less than before: what had not been synced was cut off, and
        whoever has read beyond `size` starts anew.
        """

    def note_acknowledged(self, below: int) -> None:
        """All batches below this one survive a power cut: tell the tablet (`protocol.ack`)."""

    def note_end(self, end: TakeEnd) -> None:
        """The end is durable and the log file complete."""

    def note_failure(self, error: ProtocolError) -> None:
        """The disk refuses (storage_full, storage_failed): say so and close with `error.close`.

        The tablet keeps what is not acknowledged and comes back; `reopen` before greeting it.
        """


class Recorder:
    """One take's log with its rules.

    Made by `open_recorder` or `restore`.

    Parameters
    ----------
    intake : what the log holds. log : open for appending. post : the way to the event loop.

    `damage` : what could not be read of the log when it was opened, None = all is well.
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
        """The batch that comes next: so many have been taken."""
        return self._intake.next_seq

    @property
    def durable(self) -> int:
        """So many batches survive a power cut."""
        return self._intake.durable

    @property
    def elapsed_s(self) -> float | None:
        """Seconds from the first to the last sample that has come; None before the first."""
        return self._intake.elapsed_s

    @property
    def heard(self) -> frozenset[int]:
        """Streams of which a batch has come."""
        return self._intake.heard

    @property
    def size(self) -> int:
        """Bytes of the log that can be read."""
        return self._size

    @property
    def end(self) -> TakeEnd | None:
        """How the take ended, once that is durable."""
        return self._intake.ended

    @property
    def failure(self) -> ProtocolError | None:
        """Why nothing is taken until `reopen`, None = all is well."""
        return self._failure

    def greet(self, hello: Hello) -> IntakeAnswer:
        """Answer the hello of a connection, the first or a later one."""
        return refuse(self._failure) if self._failure else self._intake.greet(hello)

    def offer(self, message: bytes | str) -> IntakeAnswer:
        """Answer one message; never waits, never raises for what a tablet can send."""
        if self._failure:
            return refuse(self._failure)
        return self._kept(self._intake.offer(message))

    def finish(self) -> IntakeAnswer:
        """End the take here; `RecorderListener.note_end` follows, or the answer says it is there already."""
        if self._failure:
            return refuse(self._failure)
        return self._kept(self._intake.end())

    async def reopen(self) -> None:
        """Go back to what is durable after a failure of the disk.

        Raises
        ------
        ProtocolError storage_full, storage_failed: the disk still refuses.
        """
        try:
            self._intake = await asyncio.to_thread(self._restart)
        except OSError as error:
            self._failure = _refused(error)
            raise self._failure from error
        self._failure = None
        self.note_written(self._lane.log.size)

    async def close(self) -> None:
        """Write and sync what has been taken and let go of the file."""
        await asyncio.to_thread(self._lane.close)

    def note_written(self, size: int) -> None:
        """Note that the log has so many bytes; the committer's lane says it."""
        self._size = size
        self._listener.note_growth(size)

    def note_synced(self, records: int) -> None:
        """Note that so many records are on the disk; the committer's lane says it."""
        before, was_over = self._intake.durable, self._intake.ended
        self._intake.note_synced(records)
        if self._intake.durable > before:
            self._listener.note_acknowledged(self._intake.durable)
        if self._intake.ended and not was_over:
            self._listener.note_end(self._intake.ended)

    def note_failure(self, error: OSError) -> None:
        """Note that the log cannot be written; the committer's lane says it."""
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
    """Open the take at `path`, or begin it with this hello.

    Raises
    ------
    ProtocolError
        storage_full, storage_failed; take_empty: there is no log and no hello to begin one with.
    InputError
        live_log_order, live_log_damaged: the file is no log of ours; it is left as it is.
    """
    post = committer.post_to(asyncio.get_running_loop())
    try:
        intake, log = await asyncio.to_thread(restore, path, hello)
    except OSError as error:
        raise _refused(error) from error
    return Recorder(intake, log, committer, listener, post)


def restore(path: Path, hello: Hello | None) -> tuple[Intake, segments.TakeLog]:
    """What a log holds, and the log open for appending; blocks.

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
