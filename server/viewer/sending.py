"""How pictures of a figure go through viser: a node is moved by one message, a picture wakes it once.

All that we know of viser's insides to send less than its public setters do; tests/server/viewer/
test_viser_contract.py holds it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

import numpy as np
import viser
from viser._messages import EntityLifecycle, SceneNodeUpdateMessage

from sagittal.server.viewer.steps import Single

WINDOW_S: Final = 0.1
"""How long viser gathers what nobody asked to be sent at once: longer than a picture is shown, so that its
thread sleeps from one picture to the next. At its own sixtieth of a second it wakes between for nothing."""


class ArraysChanged(  # type: ignore[call-arg]  # viser's types are not looked at
    SceneNodeUpdateMessage,  # type: ignore[misc]
    entity=EntityLifecycle("scene", "update_dict", "name"),
    include_in_scene_serialization=True,
):
    """viser's message of new properties, of which it is known that they are arrays of float32, C-contiguous,
    and always the same ones of a node.

    viser asks of every field of every message what it is: a third of the time a frame takes.
    """

    def redundancy_key(self) -> str:
        """The newest of a node replaces the one before."""
        return f"scene:{self.name}:arrays"

    def entity_state_key(self) -> tuple[str, str]:
        """It goes when its node does."""
        return "scene", self.name

    def as_serializable_dict(self, binary_buffers: list[memoryview] | None = None) -> dict[str, Any]:
        """Say the same as viser's own message."""
        updates: dict[str, Any] = {}
        for name, array in self.updates.items():
            if binary_buffers is None:
                updates[name] = array.data
            else:
                updates[name] = {"__binary_index": len(binary_buffers), "dtype": "<f4"}
                binary_buffers.append(array.data)
        return {"name": self.name, "updates": updates, "owner": self.owner, "type": "SceneNodeUpdateMessage"}


def move_copies(handle: viser.BatchedMeshHandle, wxyz: Single, position: Single) -> None:
    """Turn (k, 4) and place (k, 3) all copies by one message; the public setters take one each.

    A message is what a frame costs, not its bytes. The arrays must be C-contiguous and are kept: nobody may
    write into them any more.
    """
    inside = handle._impl  # noqa: SLF001
    props = inside.props
    props.batched_wxyzs, props.batched_positions = wxyz, position
    moved = {"batched_wxyzs": wxyz, "batched_positions": position}
    inside.api._queue_scene_message(ArraysChanged(inside.name, moved))  # noqa: SLF001


def draw_lines(handle: viser.LineSegmentsHandle, points: Single) -> None:
    """Draw other lines (n, 2, 3) of as many pieces, if they are others; as `move_copies`."""
    inside = handle._impl  # noqa: SLF001
    if np.array_equal(inside.props.points, points):
        return
    inside.props.points = points
    inside.api._queue_scene_message(ArraysChanged(inside.name, {"points": points}))  # noqa: SLF001


def gather_longer(server: viser.ViserServer) -> None:
    """Let the server's thread sleep between pictures; what is to be seen sooner is sent by `show_at_once`."""
    server._websock_server.get_message_buffer().window_duration_sec = WINDOW_S  # noqa: SLF001


@contextmanager
def show_at_once(server: viser.ViserServer) -> Iterator[None]:
    """Send all that is changed inside together and at once.

    viser's `atomic` and `flush` do the same and wake its thread twice. Both its events are set: it may have
    looked in vain since the last change, and then waits for the next one, not for a flush.
    """
    buffer = server._websock_server.get_message_buffer()  # noqa: SLF001
    buffer.atomic_start()
    try:
        yield
    finally:
        with buffer.buffer_lock:
            buffer.atomic_counter -= 1
        # RuntimeError: the server has stopped, and nobody is to be woken
        with suppress(RuntimeError):
            buffer.event_loop.call_soon_threadsafe(_wake, buffer)


def _wake(buffer: Any) -> None:
    buffer.message_event.set()
    buffer.flush_event.set()
