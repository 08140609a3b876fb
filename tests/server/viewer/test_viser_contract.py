"""What we rely on inside viser beyond its public API (a new version must keep it or we must adapt)."""

from __future__ import annotations

import inspect
import re
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
import viser
from viser import _messages
from viser._messages import SceneNodeUpdateMessage
from viser.infra import _infra

from server.viewer import pipe
from server.viewer.batches import DrawnBatch, move_copies
from server.viewer.client import client_page, unpack_page
from server.viewer.motion import ReplayMotion, prepare_motion
from server.viewer.views import FigureViews
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
    shown = re.search(
        r'<style>(.*?)</style><script type="text/plain" id="client">(.*?)</script>', plain, re.DOTALL
    )
    assert shown is not None
    assert [len(part.encode()) for part in shown.groups()] == [int(n) for n in style.groups()]
    assert "data-p=" not in plain
    assert unpack_page("<head><script>another()</script></head>") is None


def test_message_types_keep_their_names() -> None:
    for name in pipe.ALLOWED | {"ShareUrlRequest"}:
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
        kept = server._websock_server._broadcast_buffer.message_from_id
        before = set(kept)
        move_copies(handle, drawn.wxyz[5], drawn.position[5])
        (sent,) = [kept[k] for k in set(kept) - before]
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
            m for m in kept.values() if isinstance(m, SceneNodeUpdateMessage) and m.name == "/room/thighs"
        ]
        assert len(later) == 1
        np.testing.assert_array_equal(later[0].updates["batched_wxyzs"], drawn.wxyz[6])
        handle.batched_positions = drawn.position[7]
        np.testing.assert_array_equal(
            drawn.position[6], prepare_motion(walk.poses(1.0)).batches["thighs"].position[6]
        )
    finally:
        server.stop()
