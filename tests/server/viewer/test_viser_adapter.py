"""Private parts of viser that we rely on; a new version must keep them or our code must change."""

from __future__ import annotations

import asyncio
import inspect
import re
from contextlib import aclosing
from operator import attrgetter
from pathlib import Path
from queue import Queue
from typing import Any

import numpy as np
import pytest
import viser
from viser import _messages
from viser._messages import SceneNodeUpdateMessage
from viser.infra import _infra

from sagittal.server.viewer import viser_adapter
from sagittal.server.viewer.batches import DrawnBatch
from sagittal.server.viewer.client import client_page, unpack_page
from sagittal.server.viewer.motion import ReplayMotion, prepare_motion
from sagittal.server.viewer.views import FigureViews
from sagittal.server.viewer.viser_adapter import (
    WINDOW_S,
    ArraysChanged,
    draw_lines,
    gather_longer,
    move_copies,
    show_at_once,
)
from tests.server import walk


def test_client_page_is_one_file_without_anything_from_elsewhere() -> None:
    path = Path(viser.__file__).parent / "client" / "build" / "index.html"
    page = path.read_text(encoding="utf-8")
    head = page[: page.index("</head>")]
    assert 'src="http' not in head
    assert 'href="http' not in head


def test_panel_is_hidden_before_the_head_ends() -> None:
    page = client_page()
    assert page.index(".mantine-Paper-root") < page.index("</head>")


def test_the_client_can_be_unpacked() -> None:
    page = client_page()
    plain = unpack_page(page)
    assert plain is not None, "viser packs its client in another way: server/viewer/client.py must follow"
    style = re.search(r'data-ss="(\d+)" data-cs="(\d+)"', page)
    assert style is not None
    visible_match = re.search(
        r'<style>(.*?)</style><script type="text/plain" id="client">(.*?)</script>', plain, re.DOTALL
    )
    assert visible_match is not None
    assert [len(part.encode()) for part in visible_match.groups()] == [int(n) for n in style.groups()]
    assert "data-p=" not in plain
    assert unpack_page("<head><script>another()</script></head>") is None


def test_message_types_keep_their_names() -> None:
    for name in viser_adapter.ALLOWED | {"ShareUrlRequest"}:
        assert isinstance(getattr(_messages, name), type)


@pytest.mark.anyio
async def test_a_view_has_no_handler_for_requests_to_share(motion: ReplayMotion) -> None:
    async with FigureViews().run() as views:
        view = await views.open("login", "tab", "session", "analysis", lambda: motion)
        assert _messages.ShareUrlRequest not in view.server._websock_server._incoming_handlers


def test_viser_asks_websockets_for_nothing_but_what_we_hand_it() -> None:
    names = set(re.findall(r"\bwebsockets\.([a-z_.]*[a-z])", inspect.getsource(_infra.WebsockServer)))
    handed = _infra.websockets
    # the type of a connection is named in annotations only, which are not evaluated
    for name in names - {"asyncio.server"}:
        assert attrgetter(name)(handed) is not None, name
    assert "asyncio.server.serve" in names


def test_one_message_turns_and_places_a_batch_as_the_public_setters_would() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        drawn = prepare_motion(walk.poses(1.0)).batches["thighs"]
        handle = DrawnBatch(server.scene, "thighs", drawn, None).handle
        stored_message_from_id = server._websock_server._broadcast_buffer.message_from_id
        initial_names = set(stored_message_from_id)
        move_copies(handle, drawn.wxyz[5], drawn.position[5])
        (sent,) = [stored_message_from_id[k] for k in set(stored_message_from_id) - initial_names]
        plain = SceneNodeUpdateMessage(sent.name, sent.updates, sent.owner)
        ours: list[memoryview] = []
        theirs: list[memoryview] = []
        assert sent.as_serializable_dict() == plain.as_serializable_dict()
        assert sent.as_serializable_dict(ours) == plain.as_serializable_dict(theirs)
        assert ours == theirs
        assert sent.entity_state_key() == plain.entity_state_key()
        assert isinstance(sent, SceneNodeUpdateMessage)
        assert (sent.name, set(sent.updates)) == ("/room/thighs", {"batched_wxyzs", "batched_positions"})
        np.testing.assert_array_equal(handle.batched_positions, drawn.position[5])
        # who comes later gets the newest message of a kind only, and these two always come together
        move_copies(handle, drawn.wxyz[6], drawn.position[6])
        later = [
            m
            for m in stored_message_from_id.values()
            if isinstance(m, SceneNodeUpdateMessage) and m.name == "/room/thighs"
        ]
        assert len(later) == 1
        np.testing.assert_array_equal(later[0].updates["batched_wxyzs"], drawn.wxyz[6])
    finally:
        server.stop()


def test_lines_are_sent_as_the_public_setter_would_and_only_when_they_are_others() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        initial, final = (np.full((4, 2, 3), x, np.float32) for x in (1.0, 2.0))
        handle = server.scene.add_line_segments("/lines", initial, (0, 0, 0))
        stored_message_from_id = server._websock_server._broadcast_buffer.message_from_id
        known_names = set(stored_message_from_id)
        draw_lines(handle, initial.copy())
        assert set(stored_message_from_id) == known_names
        draw_lines(handle, final)
        (sent,) = [stored_message_from_id[k] for k in set(stored_message_from_id) - known_names]
        plain = SceneNodeUpdateMessage("/lines", {"points": final}, sent.owner)
        assert sent.as_serializable_dict() == plain.as_serializable_dict()
        np.testing.assert_array_equal(handle.points, final)
    finally:
        server.stop()


def test_a_picture_is_sent_whole_and_at_once_however_long_viser_would_gather() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        gather_longer(server)
        buffer = server._websock_server._broadcast_buffer
        assert buffer.window_duration_sec == WINDOW_S
        buffer.window_duration_sec = 60.0
        visible_rows = dict.fromkeys(("thighs", "shanks"), prepare_motion(walk.poses(1.0)).batches["thighs"])
        drawn = {name: DrawnBatch(server.scene, name, batch, None) for name, batch in visible_rows.items()}
        selection: Queue[list[str]] = Queue()

        async def take() -> None:
            try:
                async with aclosing(buffer.window_generator(1)) as windows:
                    async for window in windows:
                        selection.put([m.name for m in window if isinstance(m, ArraysChanged)])
            finally:
                selection.put(["nothing more"])

        taking = asyncio.run_coroutine_threadsafe(take(), buffer.event_loop)
        assert selection.get(timeout=30) == []  # what was there before
        for frame in range(1, 4):
            with show_at_once(server):
                for part in drawn.values():
                    part.move(part.batch.wxyz[frame], part.batch.position[frame])
            assert selection.get(timeout=30) == ["/room/thighs", "/room/shanks"]
        taking.cancel()
        assert selection.get(timeout=30) == ["nothing more"]
    finally:
        server.stop()


def test_a_picture_that_took_longer_than_viser_gathers_is_sent_when_it_ends() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        buffer = server._websock_server._broadcast_buffer
        buffer.window_duration_sec = 0.01
        batch = prepare_motion(walk.poses(1.0)).batches["thighs"]
        part = DrawnBatch(server.scene, "thighs", batch, None)
        selection: Queue[list[str]] = Queue()

        async def take() -> None:
            async with aclosing(buffer.window_generator(1)) as windows:
                async for window in windows:
                    selection.put([m.name for m in window if isinstance(m, ArraysChanged)])

        taking = asyncio.run_coroutine_threadsafe(take(), buffer.event_loop)
        assert selection.get(timeout=30) == []  # what was there before
        with show_at_once(server):
            part.move(batch.wxyz[1], batch.position[1])
            # viser's thread is woken by something else, looks, and finds that it may not send yet
            for _ in range(100):
                looked = asyncio.run_coroutine_threadsafe(asyncio.sleep(0.002), buffer.event_loop)
                looked.result(timeout=30)
            assert not buffer.message_event.is_set()
        assert selection.get(timeout=30) == ["/room/thighs"]
        taking.cancel()
    finally:
        server.stop()


@pytest.mark.parametrize(("home", "name"), [(_messages, "ViewerCameraMessage"), (_infra, "websockets")])
def test_only_a_version_that_lacks_what_is_used_is_refused_and_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, home: Any, name: str
) -> None:
    viser_adapter.require_known_viser()  # as it is installed
    monkeypatch.delattr(home, name)
    with pytest.raises(
        viser_adapter.UnknownViserError, match=f"is not supported: .* has no {name}"
    ) as refused:
        viser_adapter.require_known_viser()
    assert viser.__version__ in refused.value.message


@pytest.mark.parametrize("page", [None, "<html><body>another client</body></html>"])
def test_a_client_page_that_is_not_known_is_refused_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, page: str | None
) -> None:
    build = tmp_path / "client" / "build"
    build.mkdir(parents=True)
    if page is not None:
        (build / "index.html").write_text(page)
    monkeypatch.setattr(viser, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(viser_adapter.UnknownViserError, match="is not supported: its client page"):
        viser_adapter.require_known_viser()


def test_no_other_module_reads_what_is_private_to_viser() -> None:
    private = re.compile(
        r"viser\._|viser\.infra|\._impl\b|\._websock_server|\._queue_scene_message|client/build"
    )
    folder = Path(viser_adapter.__file__).parents[1]
    readers = {path.name for path in folder.rglob("*.py") if private.search(path.read_text("utf-8"))}
    assert readers == {"viser_adapter.py"}
