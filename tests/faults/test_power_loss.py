"""Power loss while publishing: the real code on a model of a disk, every state it may be found in."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.storage import fs
from tests.faults.model_disk import ModelDisk

CONTENT = b"0123456789"


def publish(disk: ModelDisk, monkeypatch: pytest.MonkeyPatch, *, order: str) -> list[list[dict[Path, bytes]]]:
    """Publish a file and its row; returns the possible states from the moment the row is committed."""
    monkeypatch.setattr(fs, "system", disk)
    target = Path("/blobs/p/sha")
    if order == "row first":
        begin = 0
        fs.write_file(target, CONTENT)
    else:
        fs.write_file(target, CONTENT)
        begin = len(disk.history) - 1
    return disk.history[begin:]


def broken(states: list[list[dict[Path, bytes]]]) -> int:
    """In how many states a committed row refers to a missing or damaged file."""
    return sum(state.get(Path("/blobs/p/sha")) != CONTENT for moment in states for state in moment)


@pytest.mark.death
def test_a_committed_row_always_has_its_whole_file(monkeypatch: pytest.MonkeyPatch) -> None:
    disk = ModelDisk()
    states = publish(disk, monkeypatch, order="file first")
    assert states
    assert broken(states) == 0
    assert sum(map(len, disk.history)) > 10


def test_a_name_never_shows_a_part_of_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    disk = ModelDisk()
    publish(disk, monkeypatch, order="file first")
    visible_responses = {state.get(Path("/blobs/p/sha")) for moment in disk.history for state in moment}
    assert visible_responses == {None, CONTENT}


@pytest.mark.death
def test_the_model_sees_the_mistakes_it_is_there_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert broken(publish(ModelDisk(), monkeypatch, order="row first")) > 0

    class NoFileSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if not isinstance(self._open[fd], int):
                super().fsync(fd)

    class NoFolderSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if isinstance(self._open[fd], int):
                super().fsync(fd)

    for careless in (NoFileSync(), NoFolderSync()):
        assert broken(publish(careless, monkeypatch, order="file first")) > 0
