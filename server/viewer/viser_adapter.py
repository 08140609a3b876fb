"""Adapter to viser's internals: no other module uses its private names or its client's build.

Avatar updates use lower-level calls than viser's public setters: a node is moved with one message, and a
frame wakes viser once. It listens on Unix sockets. Verified by tests/server/viewer/test_viser_adapter.py, and
at startup `require_known_viser` reports a version of viser in which the required names have changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import viser
import websockets.asyncio.server

from sagittal.core.errors import SagittalError
from sagittal.server.viewer.steps import Single


class UnknownViserError(SagittalError):
    """The installed viser is unsupported; the message names the missing part."""

    def __init__(self, missing: str) -> None:
        super().__init__(
            "unknown_viser",
            f"viser {viser.__version__} is not supported: {missing}. Install the version that "
            "requirements.lock names.",
        )


try:
    from viser import _messages
    from viser._messages import (
        EntityLifecycle,
        SceneNodeUpdateMessage,
        SetPositionMessage,
        ShareUrlRequest,
    )
    from viser.infra import _infra
except ImportError as error:
    raise UnknownViserError(f"it has no {error.name or error}") from error

ALLOWED: Final = frozenset({"ViewerCameraMessage"})
"""Message types a browser may send to viser; everything else, such as a request to share, is dropped."""
_USED: Final = {
    _messages: sorted(ALLOWED),
    _infra: ["websockets"],
    _infra.WebsockServer: ["get_message_buffer", "unregister_handler"],
    viser.SceneApi: ["_queue_scene_message"],
    SceneNodeUpdateMessage: ["redundancy_key", "entity_state_key", "as_serializable_dict"],
}
"""Required names, by object."""

WINDOW_S: Final = 0.1
"""How long viser collects messages not sent immediately: longer than a frame, so that its thread sleeps from
one frame to the next. With its default of a sixtieth of a second it would wake up unnecessarily.
"""


class ArraysChanged(  # type: ignore[call-arg]  # viser's types are not looked at
    SceneNodeUpdateMessage,  # type: ignore[misc]
    entity=EntityLifecycle("scene", "update_dict", "name"),
    include_in_scene_serialization=True,
):
    """viser's property update, restricted to C-contiguous float32 arrays of fixed properties.

    viser inspects the type of every field of every message, which takes a third of the time of a frame.
    """

    def redundancy_key(self) -> str:
        """The latest message of a node replaces earlier ones."""
        return f"scene:{self.name}:arrays"

    def entity_state_key(self) -> tuple[str, str]:
        """The message is dropped with its node."""
        return "scene", self.name

    def as_serializable_dict(self, binary_buffers: list[memoryview] | None = None) -> dict[str, Any]:
        """Serialize like viser's own message."""
        updates: dict[str, Any] = {}
        for name, array in self.updates.items():
            if binary_buffers is None:
                updates[name] = array.data
            else:
                updates[name] = {"__binary_index": len(binary_buffers), "dtype": "<f4"}
                binary_buffers.append(array.data)
        return {"name": self.name, "updates": updates, "owner": self.owner, "type": "SceneNodeUpdateMessage"}


def move_copies(handle: viser.BatchedMeshHandle, wxyz: Single, position: Single) -> None:
    """Set orientations (k, 4) and positions (k, 3) of all instances with one message instead of two.

    The number of messages, not of bytes, determines the cost of a frame. The arrays must be C-contiguous and
    must not be modified afterwards.
    """
    inside = handle._impl  # noqa: SLF001
    props = inside.props
    props.batched_wxyzs, props.batched_positions = wxyz, position
    moved = {"batched_wxyzs": wxyz, "batched_positions": position}
    inside.api._queue_scene_message(ArraysChanged(inside.name, moved))  # noqa: SLF001


def draw_lines(handle: viser.LineSegmentsHandle, points: Single) -> None:
    """Replace lines (n, 2, 3) by an equal number of others, if different; like `move_copies`."""
    inside = handle._impl  # noqa: SLF001
    if np.array_equal(inside.props.points, points):
        return
    inside.props.points = points
    inside.api._queue_scene_message(ArraysChanged(inside.name, {"points": points}))  # noqa: SLF001


def gather_longer(server: viser.ViserServer) -> None:
    """Let the server's thread sleep between frames; urgent updates are sent by `show_at_once`."""
    server._websock_server.get_message_buffer().window_duration_sec = WINDOW_S  # noqa: SLF001


@contextmanager
def show_at_once(server: viser.ViserServer) -> Iterator[None]:
    """Send all changes made within the context together and immediately.

    viser's `atomic` and `flush` do the same but wake its thread twice. Both its events are set: it may have
    checked since the last change and then waits for the next one, not for a flush.
    """
    buffer = server._websock_server.get_message_buffer()  # noqa: SLF001
    buffer.atomic_start()
    try:
        yield
    finally:
        with buffer.buffer_lock:
            buffer.atomic_counter -= 1
        # RuntimeError: the server has stopped
        with suppress(RuntimeError):
            buffer.event_loop.call_soon_threadsafe(_wake, buffer)


def _wake(buffer: Any) -> None:
    buffer.message_event.set()
    buffer.flush_event.set()


def move_node(handle: viser.SceneNodeHandle, place: tuple[float, float, float]) -> None:
    """Move a node; the public setter's cast and comparison take longer than the move."""
    inside = handle._impl  # noqa: SLF001
    inside.position[:] = place
    inside.api._queue_scene_message(SetPositionMessage(inside.name, place))  # noqa: SLF001


def forbid_sharing(server: viser.ViserServer) -> None:
    """Prevent clients from requesting a public tunnel; the proxy also drops the request."""
    server._websock_server.unregister_handler(ShareUrlRequest)  # noqa: SLF001


def read_client() -> str:
    """Viser's client page from its wheel.

    Raises
    ------
    UnknownViserError
        it is missing, or has no head element to extend.
    """
    try:
        page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(encoding="utf-8")
    except OSError:
        raise UnknownViserError("its client page is not where it was") from None
    if not page.partition("<head>")[2].partition("</head>")[1]:
        raise UnknownViserError("its client page has no head")
    return page


def require_known_viser() -> None:
    """Raise UnknownViserError if the installed viser lacks required names."""
    for home, names in _USED.items():
        for name in names:
            if not hasattr(home, name):
                raise UnknownViserError(f"{home.__name__} has no {name}")
    read_client()


def _serve(handler: Any, host: str, port: int, **options: Any) -> Any:
    """Listen as requested by viser, or on a Unix socket if the host is a path."""
    if host.startswith("/"):
        return websockets.asyncio.server.unix_serve(handler, host, **options)
    return websockets.asyncio.server.serve(handler, host, port, **options)


# viser can only listen on host and port: we replace `serve` in its module with one that supports paths
_infra.websockets = SimpleNamespace(
    asyncio=SimpleNamespace(server=SimpleNamespace(serve=_serve)),
    datastructures=websockets.datastructures,
    exceptions=websockets.exceptions,
)
