"""A server that is asked to stop in the middle of takes."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from core.formats.live_log import PROTOCOL, hello_json
from tests.live_takes import stored
from tests.live_walk import walk, walk_hello
from tests.service import new_session, served


def test_sigterm_in_the_middle_of_a_take_keeps_what_came_and_ends_within_ten_seconds(tmp_path: Path) -> None:
    frames = [due.frame for due in walk()[:300]]
    with served(tmp_path / "data") as service:
        client = service.client
        session = new_session(client, "P-1")
        code = client.post(f"/api/v1/sessions/{session}/live").raise_for_status().json()["code"]
        paired = client.post("/api/v1/live/pairings", json={"code": code}).raise_for_status().json()
        url = str(client.base_url).replace("http://", "ws://").rstrip("/") + paired["socket"]
        feed = f"{str(client.base_url).replace('http://', 'ws://').rstrip('/')}/sessions/{session}/live/feed"
        cookie = {"Cookie": f"sid={client.cookies['sid']}"}
        with (
            connect(url, subprotocols=[Subprotocol(PROTOCOL)], compression=None) as ws,
            connect(feed, additional_headers=cookie, compression=None) as page,
        ):
            ws.send(hello_json(walk_hello(paired["take"]), paired["token"]).decode())
            assert "welcome" in str(ws.recv())
            acknowledged = 0
            for one in frames[:60]:
                ws.send(one)
            while acknowledged < 60:
                message = str(ws.recv())
                if '"ack"' in message:
                    acknowledged = int(message.split(":")[-1].rstrip("}"))
            page.recv()
            began = time.monotonic()
            service.process.send_signal(signal.SIGTERM)
            service.process.wait(10)
            took = time.monotonic() - began
            with contextlib.suppress(ConnectionClosed):
                while True:
                    ws.recv(timeout=5)
    assert service.process.returncode == 0
    assert took < 10
    kept = stored(tmp_path / "data" / "live" / f"{paired['take']}.log")
    assert kept == frames[: len(kept)]
    assert len(kept) >= acknowledged
