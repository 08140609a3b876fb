"""Takes of a whole server with its workers: analysed at their end, kept when it is asked to stop."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from sagittal.core.formats.live_log import PROTOCOL, hello_json
from sagittal.server.live.client import stream
from tests.helpers.live_takes import stored
from tests.helpers.live_walk import walk, walk_hello
from tests.helpers.service import new_session, served, wait_for


def opened(client: httpx.Client, session: str) -> tuple[dict[str, Any], str]:
    """Pairing response of a tablet with its socket address."""
    code = client.post(f"/api/v1/sessions/{session}/live").raise_for_status().json()["code"]
    paired = client.post("/api/v1/live/pairings", json={"code": code}).raise_for_status().json()
    return paired, str(client.base_url).replace("http://", "ws://").rstrip("/") + paired["socket"]


@pytest.mark.slow
def test_a_finished_take_is_analysed_like_an_upload(tmp_path: Path) -> None:
    async def frames() -> AsyncIterator[bytes]:
        for due in walk():
            yield due.frame

    with served(tmp_path / "data") as service:
        client = service.client
        session = new_session(client, "P-1")
        paired, url = opened(client, session)
        report = asyncio.run(stream(url, paired["token"], walk_hello(paired["take"]), frames()))
        recording = client.get(f"/api/v1/sessions/{session}/recording").raise_for_status().json()
        assert recording["id"] == report.recording
        assert [f["name"].rpartition(".")[2] for f in recording["files"]] == ["sagittal-live"]
        jobs = client.get("/api/v1/jobs").raise_for_status().json()
        assert {j["kind"] for j in jobs} == {"inspect", "analyse"}
        for one in jobs:
            assert wait_for(client, one["id"])["state"] == "done"
        body = client.get(f"/api/v1/sessions/{session}/report").raise_for_status().json()
        (analysis,) = client.get(f"/api/v1/sessions/{session}/analyses").raise_for_status().json()
        content = client.get(f"/api/v1/sessions/{session}/files/{recording['files'][0]['name']}").content
    assert content.startswith(b"SAGLIVE1\n")
    assert analysis["recording_id"] == report.recording
    strides = next(p for p in body["parameters"] if p["name"] == "stride_time_s")
    assert 0.9 < strides["left"]["value"] < 1.2


@pytest.mark.slow
def test_sigterm_in_a_take_keeps_what_came_and_ends_within_ten_seconds_nothing_was_computed_there(
    tmp_path: Path,
) -> None:
    frames = [due.frame for due in walk()[:300]]
    with served(tmp_path / "data") as service:
        client = service.client
        session = new_session(client, "P-1")
        paired, url = opened(client, session)
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
            loaded = Path(f"/proc/{service.process.pid}/maps").read_text()
            assert [x for x in ("llvmlite", "scipy", "numba") if f"/{x}/" in loaded] == []
            service.process.send_signal(signal.SIGTERM)
            service.process.wait(timeout=10)
            with contextlib.suppress(ConnectionClosed):
                while True:
                    ws.recv(timeout=5)
    assert service.process.returncode == 0
    retained = stored(tmp_path / "data" / "live" / f"{paired['take']}.log")
    assert retained == frames[: len(retained)]
    assert len(retained) >= acknowledged
