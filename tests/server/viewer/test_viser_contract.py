"""What we rely on inside viser beyond its public API (a new version must keep it or we must adapt)."""

from __future__ import annotations

from pathlib import Path

import pytest
import viser
from viser import _messages

from server.viewer import pipe
from server.viewer.motion import Motion
from server.viewer.proxy import client_page
from server.viewer.views import Views


def test_client_page_is_one_file_without_anything_from_elsewhere() -> None:
    path = Path(viser.__file__).parent / "client" / "build" / "index.html"
    page = path.read_text(encoding="utf-8")
    head = page[: page.index("</head>")]
    assert 'src="http' not in head
    assert 'href="http' not in head


def test_panel_is_hidden_before_the_head_ends() -> None:
    page = client_page()
    assert page.index(".mantine-Paper-root") < page.index("</head>")


def test_message_types_keep_their_names() -> None:
    for name in pipe.ALLOWED | {"ShareUrlRequest"}:
        assert isinstance(getattr(_messages, name), type)


@pytest.mark.anyio
async def test_a_view_has_no_handler_for_requests_to_share(motion: Motion) -> None:
    async with Views().running() as views:
        view = await views.open("login", "tab", "analysis", lambda: motion)
        assert _messages.ShareUrlRequest not in view.server._websock_server._incoming_handlers
