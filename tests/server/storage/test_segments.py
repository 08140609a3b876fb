"""The log of a take: what any damage leaves, and what reading costs."""

from __future__ import annotations

import errno
import tracemalloc
from pathlib import Path

import pytest

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import FILE_MARK, LogRecord, hello_json, record
from sagittal.server.storage import fs, segments
from tests.helpers.live_takes import HELLO, frame, stored

FRAMES = [frame(i) for i in range(4)]
HEAD = FILE_MARK + record("H", hello_json(HELLO))
PIECES = [record("B", f) for f in FRAMES] + [record("F", b"{}")]
WHOLE = HEAD + b"".join(PIECES)


def ends() -> list[int]:
    result = [len(HEAD)]
    for piece in PIECES:
        result.append(result[-1] + len(piece))
    return result


def recovered(path: Path) -> tuple[segments.TakeLog | None, list[LogRecord]]:
    observations: list[LogRecord] = []
    log = segments.recover(path, observations.append)
    if log is not None:
        log.close()
    return log, observations


def test_a_log_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "live" / "t.log"
    log = segments.create(path, hello_json(HELLO))
    for piece in PIECES:
        log.append(piece)
    log.sync()
    log.close()
    assert path.read_bytes() == WHOLE
    assert log.size == len(WHOLE)
    assert stored(path) == FRAMES


@pytest.mark.sweep
def test_a_log_cut_at_any_byte_recovers_its_longest_valid_prefix(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    whole_at = ends()
    for cut in range(len(WHOLE) + 1):
        path.write_bytes(WHOLE[:cut])
        log, observations = recovered(path)
        stored_largest = max((e for e in whole_at if e <= cut), default=None)
        if stored_largest is None:
            assert (log, observations, path.read_bytes()) == (None, [], WHOLE[:cut])
        else:
            assert log is not None
            assert (log.size, path.read_bytes()) == (stored_largest, WHOLE[:stored_largest])
            assert len(observations) == whole_at.index(stored_largest) + 1


@pytest.mark.sweep
def test_a_log_with_any_byte_changed_recovers_what_is_before_it(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    whole_at = ends()
    for index in range(len(HEAD), len(WHOLE)):
        path.write_bytes(WHOLE[:index] + bytes([WHOLE[index] ^ 0x10]) + WHOLE[index + 1 :])
        recovered(path)
        assert path.read_bytes() == WHOLE[: max(e for e in whole_at if e <= index)]


def test_zeros_behind_the_last_record_are_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(WHOLE + bytes(5000))
    recovered(path)
    assert path.read_bytes() == WHOLE


def test_a_recovered_log_goes_on_where_it_ended(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(HEAD + PIECES[0] + PIECES[1][:-1])
    log = segments.recover(path, lambda _: None)
    assert log is not None
    log.append(PIECES[1])
    log.sync()
    log.close()
    assert path.read_bytes() == HEAD + PIECES[0] + PIECES[1]


def test_going_back_cuts_off_what_was_not_synced(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    log = segments.create(path, hello_json(HELLO))
    log.append(PIECES[0])
    log.sync()
    log.append(PIECES[1])
    log.drop_unsynced()
    assert (log.size, path.read_bytes()) == (len(HEAD) + len(PIECES[0]), HEAD + PIECES[0])
    log.append(PIECES[1])
    log.close()
    assert path.read_bytes() == HEAD + PIECES[0] + PIECES[1]


def test_an_append_that_was_torn_is_cut_off_before_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Torn(fs.System):
        def write(self, fd: int, data: bytes | memoryview) -> int:
            if len(data) < len(PIECES[0]):
                raise OSError(errno.ENOSPC, "full")
            return super().write(fd, data[: len(data) // 2])

    path = tmp_path / "t.log"
    log = segments.create(path, hello_json(HELLO))
    monkeypatch.setattr(fs, "system", Torn())
    with pytest.raises(OSError, match="full"):
        log.append(PIECES[0])
    assert log.size == len(HEAD) < path.stat().st_size
    monkeypatch.setattr(fs, "system", fs.System())
    log.append(PIECES[1])
    log.close()
    assert path.read_bytes() == HEAD + PIECES[1]


@pytest.mark.parametrize("there", [b"", WHOLE[:4], HEAD[:-1]])
def test_a_torn_beginning_is_begun_again(tmp_path: Path, there: bytes) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(there)
    segments.create(path, hello_json(HELLO)).close()
    assert path.read_bytes() == HEAD


@pytest.mark.parametrize("there", [b"something else", HEAD[:30] + b"?" + HEAD[31:] + PIECES[0], WHOLE])
def test_a_file_that_is_there_is_never_written_over(tmp_path: Path, there: bytes) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(there)
    with pytest.raises(InputError) as refused:
        segments.create(path, hello_json(HELLO))
    assert refused.value.code == "live_log_damaged"
    assert path.read_bytes() == there


def test_reading_can_go_on_where_it_stopped_while_the_log_grows(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(HEAD + PIECES[0] + PIECES[1][:7])
    first = list(segments.read_records(path))
    assert [one.kind for _, one in first] == ["H", "B"]
    path.write_bytes(WHOLE)
    assert [one.body for _, one in segments.read_records(path, first[-1][0])] == [*FRAMES[1:], b"{}"]


def test_a_big_log_is_read_in_little_memory(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    piece = record("B", bytes(900_000))
    with path.open("wb") as file:
        file.write(HEAD)
        for _ in range(60):
            file.write(piece)
        file.write(piece[:-1])
    tracemalloc.start()
    try:
        number = sum(1 for _ in segments.read_records(path))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert number == 61
    assert peak < 6 * segments.CHUNK < path.stat().st_size / 2


def test_a_log_damaged_early_is_not_read_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    path.write_bytes(HEAD + b"\xff" * 20_000_000)
    tracemalloc.start()
    try:
        assert len(list(segments.read_records(path))) == 1
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3 * segments.CHUNK


def damage_of(path: Path, content: bytes) -> segments.Damage | None:
    path.write_bytes(content)
    log, _ = recovered(path)
    assert log is not None
    return log.damage


def test_an_end_torn_by_a_crash_is_no_damage_and_leaves_no_copy(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    for cut in range(len(HEAD), len(WHOLE)):
        assert damage_of(path, WHOLE[:cut]) is None
    assert damage_of(path, WHOLE) is None
    assert damage_of(path, WHOLE + bytes(5000)) is None
    assert damage_of(path, HEAD + PIECES[0] + PIECES[1][:30] + bytes(len(PIECES[1]) - 30)) is None
    assert [p.name for p in tmp_path.iterdir()] == ["t.log"]


def test_one_flipped_bit_in_a_log_keeps_the_whole_original(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    last = ends()[-3]  # of the last batch only a changed content can be told from a torn end
    for index in range(len(HEAD), last):
        for stored_path in tmp_path.glob("*.damaged"):
            stored_path.unlink()
        hurt = WHOLE[:index] + bytes([WHOLE[index] ^ 0x10]) + WHOLE[index + 1 :]
        damage = damage_of(path, hurt)
        start = max(e for e in ends() if e <= index)
        assert damage is not None
        assert (damage.start, damage.lost) == (start, len(WHOLE) - start)
        assert damage.original == tmp_path / "t.1.damaged"
        assert damage.original.read_bytes() == hurt
        assert path.read_bytes() == WHOLE[:start]


def test_a_second_damage_does_not_overwrite_the_first_original(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    for index in (len(HEAD) + 60, len(HEAD) + 70):
        damage_of(path, WHOLE[:index] + b"?" + WHOLE[index + 1 :])
    assert sorted(p.name for p in tmp_path.glob("*.damaged")) == ["t.1.damaged", "t.2.damaged"]


def test_a_damaged_log_whose_original_cannot_be_kept_is_not_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(fs.System):
        def write(self, fd: int, data: bytes | memoryview) -> int:
            raise OSError(errno.ENOSPC, "full")

    path = tmp_path / "t.log"
    hurt = WHOLE[: len(HEAD) + 60] + b"?" + WHOLE[len(HEAD) + 61 :]
    path.write_bytes(hurt)
    monkeypatch.setattr(fs, "system", Full())
    with pytest.raises(OSError, match="full"):
        segments.recover(path, lambda _: None)
    assert path.read_bytes() == hurt
    assert [p.name for p in tmp_path.iterdir()] == ["t.log"]


def test_damage_is_looked_for_in_a_long_log_without_reading_it_into_memory(tmp_path: Path) -> None:
    path = tmp_path / "t.log"
    with path.open("wb") as file:
        file.write(HEAD + PIECES[0][:-1] + b"?")
        for _ in range(20):
            file.write(b"BSGL1 " * 500_000)
        file.write(PIECES[1])
    tracemalloc.start()
    damage = segments.find_damage(path, len(HEAD))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert damage is not None
    assert most < 20e6
