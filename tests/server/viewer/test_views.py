from __future__ import annotations

import asyncio
import os
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import pytest

from sagittal.core.errors import EstimationError, InputError
from sagittal.server.auth.roles import Role
from sagittal.server.viewer.motion import ReplayMotion
from sagittal.server.viewer.views import MOST_NAMES, FigureViews

pytestmark = pytest.mark.anyio


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


async def test_same_tab_shares_and_other_sign_in_does_not(motion: ReplayMotion) -> None:
    loads: list[int] = []

    def load() -> ReplayMotion:
        loads.append(1)
        return motion

    async with FigureViews().run() as views:
        mine = await views.open("login-1", "tab", "session", "analysis", load)
        assert await views.open("login-1", "tab", "session", "analysis", load) is mine
        theirs = await views.open("login-2", "tab", "session", "analysis", load)
        assert theirs.server is not mine.server
        assert views.find(mine.id, "login-1", Role.VIEWER) is mine
        assert views.find(mine.id, "login-2", Role.ADMIN) is None
        assert views.find("unknown", "login-1", Role.ADMIN) is None
        assert loads == [1]


async def test_a_view_is_found_by_the_names_of_its_last_few_loads(motion: ReplayMotion) -> None:
    async with FigureViews().run() as views:
        for k in range(MOST_NAMES + 2):
            view = await views.open("login", "tab", "session", "analysis", lambda: motion, name=f"{k:032x}")
        matches = [views.find(f"{k:032x}", "login", Role.VIEWER) for k in range(MOST_NAMES + 2)]
        assert matches == [None, None, *[view] * MOST_NAMES]
        assert views.find(view.id, "login", Role.VIEWER) is view
        assert len(views) == 1


async def test_a_views_socket_is_for_this_user_alone_and_goes_with_it(motion: ReplayMotion) -> None:
    async with FigureViews(idle_s=0.0).run() as views:
        view = await views.open("login", "tab", "session", "analysis", lambda: motion)
        assert view.socket.is_socket()
        folder = view.socket.parent.stat()
        assert (folder.st_mode & 0o777, folder.st_uid) == (0o700, os.getuid())
        await views.sweep()
        assert not view.socket.parent.exists()


@pytest.fixture
def short_path() -> Iterator[Path]:
    """An empty folder whose path leaves room for a socket's, which pytest's own may not."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


async def test_a_figure_that_cannot_be_drawn_leaves_nothing_behind(
    motion: ReplayMotion, short_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(_server: object) -> NoReturn:
        raise InputError("body_bad", "There is no body.")

    monkeypatch.setattr(tempfile, "tempdir", str(short_path))
    async with FigureViews().run() as views:
        threads = threading.active_count()
        with pytest.raises(InputError):
            await views.open_live("session", "light", draw, lambda _view: None)
        assert list(short_path.iterdir()) == []
        assert threading.active_count() <= threads + 1  # the one that to_thread keeps


@pytest.mark.parametrize(("folder", "why"), [("a" * 100, "too long"), ("missing/folder", "No such file")])
async def test_a_folder_that_takes_no_sockets_is_told_and_not_waited_for(
    motion: ReplayMotion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, why: str
) -> None:
    (tmp_path / ("a" * 100)).mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / folder))
    async with FigureViews().run() as views:
        with pytest.raises(EstimationError, match=f"{why}.*set TMPDIR") as error:
            await views.open("login", "tab", "session", "analysis", lambda: motion)
    assert error.value.code == "no_place_for_views"
    assert list(tmp_path.rglob("sagittal-view-*")) == []


async def test_unwatched_views_stop_and_watched_ones_stay(motion: ReplayMotion) -> None:
    async with FigureViews(idle_s=0.0).run() as views:
        view = await views.open("login", "tab", "session", "analysis", lambda: motion)
        with view.keep_open():
            await views.sweep()
            assert len(views) == 1
        await views.sweep()
        assert len(views) == 0


async def test_at_the_limit_the_longest_unwatched_view_gives_way(motion: ReplayMotion) -> None:
    async with FigureViews(limit=2).run() as views:
        first = await views.open("login", "1", "session", "analysis", lambda: motion)
        second = await views.open("login", "2", "session", "analysis", lambda: motion)
        third = await views.open("login", "3", "session", "analysis", lambda: motion)
        assert views.find(first.id, "login", Role.ADMIN) is None
        with second.keep_open(), third.keep_open(), pytest.raises(EstimationError) as refused:
            await views.open("login", "4", "session", "analysis", lambda: motion)
        assert refused.value.code == "too_many_views"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts open files in /proc")
async def test_views_leave_no_threads_and_no_files_behind(motion: ReplayMotion) -> None:
    async def one(views: FigureViews) -> None:
        await views.open("login", "tab", "session", "analysis", lambda: motion)
        await views.close()

    async with FigureViews().run() as views:
        await one(views)
        threads, files = threading.active_count(), open_files()
        for _ in range(15):
            await one(views)
        # the event loop's own thread pool may still grow by a few; a leak would leave one per view
        async with asyncio.timeout(20):
            while threading.active_count() >= threads + 8 or open_files() > files + 2:
                await asyncio.sleep(0.05)


async def test_no_banner_is_printed(motion: ReplayMotion, capfd: pytest.CaptureFixture[str]) -> None:
    async with FigureViews().run() as views:
        await views.open("login", "tab", "session", "analysis", lambda: motion)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
