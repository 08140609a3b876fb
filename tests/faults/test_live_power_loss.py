"""Power loss while a take is recorded: the real log on a model of a disk, every state it may be found in."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.core.formats.live_log import FILE_MARK, hello_json, record
from sagittal.server.storage import fs, segments
from tests.faults.model_disk import ModelDisk
from tests.helpers.live_takes import HELLO, frame

FRAMES = [frame(i, n=1) for i in range(8)]
PIECES = [record("B", one) for one in FRAMES]
HEAD = FILE_MARK + record("H", hello_json(HELLO))


class Promises:
    """Guarantees over time: (moment of the disk, acknowledged batches; -1 = the trial itself)."""

    def __init__(self, disk: ModelDisk) -> None:
        self._disk = disk
        self._made: list[tuple[int, int]] = []

    def make(self, batches: int) -> None:
        self._made.append((len(self._disk.history) - 1, batches))

    def at(self, moment: int) -> int:
        return max((n for when, n in self._made if when <= moment), default=-1)


def record_a_take(path: Path, disk: ModelDisk, promises: Promises) -> None:
    """Three groups, between them an append that fails in the middle and a sync that fails."""
    log = segments.create(path, hello_json(HELLO))
    promises.make(0)
    log.append(PIECES[0])
    log.append(PIECES[1] + PIECES[2])
    log.sync()
    promises.make(3)
    log.append(PIECES[3])
    log.drop_unsynced()
    log.append(PIECES[3])
    torn(log, PIECES[4])
    log.append(PIECES[4])
    log.sync()
    promises.make(5)
    log.append(PIECES[5])
    log.sync()
    promises.make(6)
    log.close()


def torn(log: segments.TakeLog, piece: bytes) -> None:
    """The disk is full in the middle of an append."""
    whole = fs.system.write
    calls = 0

    def half(fd: int, data: bytes | memoryview) -> int:
        nonlocal calls
        calls += 1
        if calls > 1:
            raise OSError(28, "full")
        return whole(fd, bytes(data[: len(data) // 2])) and len(data) // 2

    fs.system.write = half  # type: ignore[method-assign]
    with pytest.raises(OSError, match="full"):
        log.append(piece)
    fs.system.write = whole  # type: ignore[method-assign]


def lost(path: Path, disk: ModelDisk, promises: Promises, monkeypatch: pytest.MonkeyPatch) -> int:
    """Recover every state on a real disk; in how many something acknowledged is missing or changed."""
    monkeypatch.setattr(fs, "system", fs.System())
    bad = 0
    for moment, states in enumerate(disk.history):
        promised = promises.at(moment)
        for content in {state.get(path) for state in states}:
            path.unlink(missing_ok=True)
            if content is None:
                bad += promised >= 0
                continue
            path.write_bytes(content)
            stored_chunks: list[bytes] = []
            log = segments.recover(path, lambda one: stored_chunks.append(one.body))  # noqa: B023
            if log is None:
                bad += promised >= 0
                continue
            log.close()
            assert stored_chunks[1:] == FRAMES[: len(stored_chunks) - 1]
            assert path.read_bytes() == HEAD + b"".join(PIECES[: len(stored_chunks) - 1])
            bad += len(stored_chunks) - 1 < promised
    return bad


@pytest.mark.death
def test_every_acknowledged_batch_survives_a_power_cut_at_any_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk, path = ModelDisk(), tmp_path / "t.log"
    promises = Promises(disk)
    monkeypatch.setattr(fs, "system", disk)
    record_a_take(path, disk, promises)
    assert sum(map(len, disk.history)) > 40
    assert lost(path, disk, promises, monkeypatch) == 0


@pytest.mark.parametrize(
    "tail", [b"", PIECES[2][:50], bytes(70), PIECES[2][:-1] + b"?"], ids=["none", "torn", "zeros", "wrong"]
)
def test_a_power_cut_while_a_take_is_recovered_loses_nothing_either(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tail: bytes
) -> None:
    disk, path = ModelDisk(), tmp_path / "t.log"
    result = HEAD + PIECES[0] + PIECES[1] + tail
    disk.put(path, result)
    path.write_bytes(result)
    promises = Promises(disk)
    promises.make(2)
    monkeypatch.setattr(fs, "system", disk)
    log = segments.recover(path, lambda _: None)
    assert log is not None
    log.append(PIECES[2])
    log.append(PIECES[3])
    log.sync()
    promises.make(4)
    log.close()
    assert lost(path, disk, promises, monkeypatch) == 0


def test_the_model_sees_a_log_that_is_not_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class NoFileSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if not isinstance(self._open[fd], int):
                super().fsync(fd)

    class NoFolderSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if isinstance(self._open[fd], int):
                super().fsync(fd)

    for careless in (NoFileSync(), NoFolderSync()):
        path = tmp_path / "t.log"
        promises = Promises(careless)
        path.unlink(missing_ok=True)
        monkeypatch.setattr(fs, "system", careless)
        record_a_take(path, careless, promises)
        assert lost(path, careless, promises, monkeypatch) > 0


def test_the_model_sees_a_recovery_that_promises_what_is_only_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk, path = ModelDisk(), tmp_path / "t.log"
    promises = Promises(disk)
    monkeypatch.setattr(fs, "system", disk)
    log = segments.create(path, hello_json(HELLO))
    log.append(PIECES[0])  # the process is killed here: the file can be read, the disk may not have it
    promises.make(1)  # what a welcome without a sync would promise
    log.close()
    assert lost(path, disk, promises, monkeypatch) > 0
