"""Scene servers reachable only by this user."""

from __future__ import annotations

import stat
import tempfile
from pathlib import Path

import pytest
from viser._messages import ShareUrlRequest

from sagittal.core.errors import EstimationError
from sagittal.server.viewer.scene_server import (
    LONGEST_PATH_BYTES,
    socket_of,
    start_scene_server,
    stop_scene_server,
)


def test_it_listens_on_a_socket_in_a_folder_of_its_own_and_leaves_nothing() -> None:
    server = start_scene_server()
    try:
        path = socket_of(server)
        assert path.parent.name.startswith("sagittal-view-")
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
        assert path.is_socket()
        assert ShareUrlRequest not in server._websock_server._incoming_handlers
    finally:
        stop_scene_server(server)
    assert not path.parent.exists()


def test_a_folder_that_was_cleaned_away_is_no_error() -> None:
    server = start_scene_server()
    path = socket_of(server)
    for one in path.parent.iterdir():
        one.unlink()
    path.parent.rmdir()
    stop_scene_server(server)
    assert not path.parent.exists()


@pytest.mark.parametrize("where", ["missing", "x" * LONGEST_PATH_BYTES])
def test_without_a_place_it_says_what_an_administrator_can_do(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / where
    if where != "missing":
        folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with pytest.raises(EstimationError, match="TMPDIR") as refused:
        start_scene_server()
    assert refused.value.code == "no_place_for_views"
    assert not folder.exists() or not list(folder.iterdir())
