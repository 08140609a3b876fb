"""Two web servers appear to users as one clinic."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx
import pytest
import viser
import websockets
from websockets.asyncio.client import ClientConnection

from sagittal.core.formats.live_log import PROTOCOL, Hello, hello_json
from sagittal.server.live.pairing import pair as pair_tablet
from sagittal.server.live_takes import live
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.high_water import read_mark
from tests.data import ROOT
from tests.helpers.live_takes import HELLO, frame, kept_in
from tests.helpers.service import new_session
from tests.server.nodes.pair import PASSWORD, NodePair, RunningNode, describe, find_ports, start_process

pytestmark = [pytest.mark.postgres, pytest.mark.sweep, pytest.mark.anyio]

PATIENCE_S = 30.0


async def until(holds: Callable[[], bool], patience_s: float = PATIENCE_S) -> None:
    limit = time.monotonic() + patience_s
    while not await asyncio.to_thread(holds):
        assert time.monotonic() < limit
        await asyncio.sleep(0.1)


@dataclass
class TakeThere:
    """A take that a tablet streams, and which of the two has it."""

    session: str
    token: str
    hello: Hello
    owner: RunningNode
    other: RunningNode

    @property
    def api(self) -> str:
        return f"/api/v1/sessions/{self.session}/live"

    @contextlib.asynccontextmanager
    async def tablet(self, node: RunningNode) -> AsyncIterator[ClientConnection]:
        url = f"{node.socket}/api/v1/live"
        async with websockets.connect(url, subprotocols=[PROTOCOL], compression=None) as ws:  # type: ignore[list-item]
            await ws.send(hello_json(self.hello, self.token).decode())
            yield ws


def row_of(pair: NodePair, take_id: str) -> live.LiveTakeRecord:
    with closing(Database(pair.a.settings.database_source)) as db, db.read() as c:
        return live.get(c, take_id)


def open_take(pair: NodePair, code: str) -> TakeThere:
    """A take, asked for at B and paired at A, wherever it is then."""
    session = new_session(pair.a.client, code)
    opened = pair.b.client.post(f"/api/v1/sessions/{session}/live").raise_for_status().json()
    paired = pair_tablet(pair.a.address, opened["code"])
    owner, alternative = pair.both if row_of(pair, paired.take).node == "a" else reversed(pair.both)
    return TakeThere(session, paired.token, replace(HELLO, take=paired.take), owner, alternative)


def open_take_at(pair: NodePair, node: RunningNode, code: str) -> TakeThere:
    """A take that one of the two has: where a session's take is opened goes by the session's id."""
    return next(take for number in range(50) if (take := open_take(pair, f"{code}-{number}")).owner is node)


async def heard(ws: ClientConnection, expected: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    async with asyncio.timeout(PATIENCE_S):
        async for text in ws:
            message: dict[str, Any] = json.loads(text)
            if expected(message):
                return message
    pytest.fail(f"the line ended with {ws.close_code}")


async def acknowledge(ws: ClientConnection, seqs: range) -> None:
    """Send batches and wait until all are on the disk."""
    for seq in seqs:
        await ws.send(frame(seq))
    await heard(ws, lambda said: said.get("type") == "ack" and said["ack"] >= seqs.stop)


async def drain(ws: ClientConnection) -> None:
    """Read until the line ends, which raises."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            await ws.recv()


def feed(pair: NodePair, node: RunningNode, session: str) -> Any:
    cookie = {"Cookie": f"sid={pair.cookie}"}
    return websockets.connect(f"{node.socket}/sessions/{session}/live/feed", additional_headers=cookie)


async def test_a_take_of_one_is_seen_steered_and_closed_through_the_other(pair: NodePair) -> None:
    take = await asyncio.to_thread(open_take, pair, "L-1")
    # the tablet, too, speaks to the one that does not have the take
    async with take.tablet(take.other) as tablet, feed(pair, take.other, take.session) as screen:
        await acknowledge(tablet, range(12))
        observations = await heard(
            screen, lambda said: said.get("state") == "streaming" and said.get("count") == 12
        )
        assert observations["tablet"] == "connected"
        ask = take.other.client
        marked = await asyncio.to_thread(
            ask.post, f"{take.api}/commands", json={"command": "mark", "value": "turn"}
        )
        assert [mark["value"] for mark in marked.raise_for_status().json()["marks"]] == ["turn"]
        closed = (await asyncio.to_thread(ask.post, f"{take.api}/close")).raise_for_status().json()
        assert (closed["state"], closed["problem"]) == ("closed", None)
        over = await heard(screen, lambda said: said.get("state") == "closed")
        assert over["recording"] == closed["recording_id"] is not None
        folder = take.owner.settings.live
        await until(lambda: not list(folder.glob("*.log")))


async def test_when_the_one_with_a_take_is_killed_the_other_goes_on_and_nothing_acknowledged_is_lost(
    pair: NodePair,
) -> None:
    take = await asyncio.to_thread(open_take, pair, "K-1")
    owner, alternative = take.owner, take.other
    given_up = await asyncio.to_thread(open_take_at, pair, owner, "E")
    async with take.tablet(alternative) as tablet, given_up.tablet(owner) as second:
        await acknowledge(tablet, range(20))
        await acknowledge(second, range(8))
        await asyncio.to_thread(owner.kill)
        with contextlib.suppress(websockets.ConnectionClosed):
            await drain(tablet)
    ask = alternative.client
    # at once: patients, another session's take, its views
    assert (await asyncio.to_thread(ask.get, "/api/v1/patients")).status_code == 200
    state = (await asyncio.to_thread(ask.get, take.api)).raise_for_status().json()
    assert (state["state"], state["problem"]) == ("streaming", "node_away")
    refused = await asyncio.to_thread(
        ask.post, f"{take.api}/commands", json={"command": "mark", "value": None}
    )
    assert (refused.status_code, refused.json()["code"]) == (503, "node_away")
    async with take.tablet(alternative) as tablet:
        with pytest.raises(websockets.ConnectionClosed, match="node_away"):
            await drain(tablet)
    session = await asyncio.to_thread(new_session, ask, "K-2")
    assert (await asyncio.to_thread(ask.post, f"/api/v1/sessions/{session}/live")).status_code == 201

    # a take may be ended meanwhile; what its server has of it is stored as soon as that is back
    ended = (await asyncio.to_thread(ask.post, f"{given_up.api}/close")).raise_for_status().json()
    assert (ended["state"], ended["problem"], ended["recording_id"]) == ("closed", "node_away", None)

    # a page that looks on meanwhile is told to come back, and is led there then
    async with feed(pair, alternative, take.session) as screen:
        await heard(screen, lambda said: said.get("problem") == "node_away")
        await asyncio.to_thread(owner.start_again)
        with pytest.raises(websockets.ConnectionClosed, match="moved"):
            await drain(screen)
    assert row_of(pair, given_up.hello.take).recording_id is not None
    # a tablet comes again and again; as soon as the other has heard of it, the line leads there
    await until(lambda: ask.get(take.api).json()["problem"] is None)
    async with take.tablet(alternative) as tablet:
        welcome = await heard(tablet, lambda said: said.get("type") == "welcome")
        assert welcome["next_seq"] == 20
        await acknowledge(tablet, range(20, 24))
    closed = (await asyncio.to_thread(ask.post, f"{take.api}/close")).raise_for_status().json()
    record = await asyncio.to_thread(ask.get, f"/api/v1/sessions/{take.session}/recording")
    [file] = record.raise_for_status().json()["files"]
    patient = row_of(pair, take.hello.take).patient_id
    log = (owner.settings.blobs / patient / file["sha256"]).read_bytes()
    assert kept_in(log) == [frame(seq) for seq in range(24)]
    assert closed["state"] == "closed"


async def test_wrong_passwords_are_counted_over_both(pair: NodePair) -> None:
    wrong = {"name": "nobody", "password": "another guess"}
    answers = []
    for turn in range(11):
        with httpx.Client(base_url=pair.both[turn % 2].address, timeout=30) as stranger:
            answers.append(
                (await asyncio.to_thread(stranger.post, "/api/v1/sign-in", json=wrong)).status_code
            )
    assert answers == [401] * 10 + [429]


async def test_an_upload_that_began_at_one_goes_on_at_the_other(pair: NodePair) -> None:
    content = b"0123456789" * 300_000
    session = await asyncio.to_thread(new_session, pair.a.client, "U-1")
    path = f"/api/v1/sessions/{session}/uploads"
    begun = (
        pair.a.client.post(path, json={"name": "walk.csv", "size": len(content)}).raise_for_status().json()
    )
    body, turn = 0, 0
    while body < len(content):
        node, turn = pair.both[turn % 2], turn + 1
        answer = node.client.patch(
            f"{path}/{begun['id']}",
            content=content[body : body + 1_000_000],
            headers={"Upload-Offset": str(body)},
        )
        body = answer.raise_for_status().json()["offset"]
    done = pair.b.client.post(
        f"{path}/{begun['id']}/finish", json={"sha256": hashlib.sha256(content).hexdigest()}
    )
    assert done.raise_for_status().json()["size"] == len(content)


async def test_signing_out_at_one_ends_open_lines_at_the_other(pair: NodePair) -> None:
    session = await asyncio.to_thread(new_session, pair.a.client, "S-1")
    with httpx.Client(base_url=pair.a.address, timeout=30) as person:
        person.post("/api/v1/sign-in", json={"name": "grace", "password": PASSWORD}).raise_for_status()
        cookie = {"Cookie": f"sid={person.cookies['sid']}"}
        url = f"{pair.b.socket}/sessions/{session}/live/feed"
        async with websockets.connect(url, additional_headers=cookie) as line:
            await heard(line, lambda said: said.get("type") == "state")
            person.post("/api/v1/sign-out").raise_for_status()
            with pytest.raises(websockets.ConnectionClosed, match="not_signed_in"):
                await drain(line)


async def test_an_erased_session_ends_its_take_wherever_that_is(pair: NodePair) -> None:
    take = await asyncio.to_thread(open_take, pair, "D-1")
    async with take.tablet(take.owner) as tablet:
        await acknowledge(tablet, range(4))
        gone = await asyncio.to_thread(take.other.client.delete, f"/api/v1/sessions/{take.session}")
        assert gone.status_code == 204
        with pytest.raises(websockets.ConnectionClosed, match="take_ended"):
            await drain(tablet)
    # whose sweep is at the erasure's note already does it; that is some moments later
    await until(lambda: not list(take.owner.settings.live.glob(f"{take.hello.take}.*")))


async def test_a_3d_view_is_found_from_both(pair: NodePair) -> None:
    session = await asyncio.to_thread(new_session, pair.a.client, "V-1")
    for node in pair.both:
        body = node.client.get(f"/sessions/{session}/live/figure").raise_for_status().json()["src"]
        for door in pair.both:
            assert door.client.get(body, follow_redirects=False).status_code == 307
            async with websockets.connect(
                f"{door.socket}{body.rstrip('/')}",
                additional_headers={"Cookie": f"sid={pair.cookie}"},
                subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
                max_size=None,
            ) as line:
                async with asyncio.timeout(PATIENCE_S):
                    assert isinstance(await line.recv(), bytes)


async def test_nobody_but_a_node_says_for_whom_it_asks(pair: NodePair) -> None:
    forged = {"X-Sagittal-Node": f"b;a;{int(time.time())};10.0.0.1;http;{'0' * 64}"}
    answer = pair.a.client.get("/api/v1/account", headers=forged)
    assert (answer.status_code, answer.json()["code"]) == (403, "not_a_node")


async def test_each_is_listed_and_none_of_the_same_name_or_of_no_name_starts(
    pair: NodePair, tmp_path: Path
) -> None:
    page = pair.b.client.get("/system").raise_for_status().text
    assert pair.a.address in page
    assert pair.b.address in page
    url, ports = pair.a.settings.database_url, find_ports(2)
    same = start_process(describe(pair.a.settings.data_dir, url, "a", ports[0]))
    single_process = start_process(
        Settings(data_dir=tmp_path, database_url=url, port=ports[1], workers=0, live_workers=0)
    )
    for process, reason in ((same, "is running on"), (single_process, "give every server a SAGITTAL_NODE")):
        text = (await asyncio.to_thread(process.communicate))[1]
        assert process.returncode == 1
        assert reason in text


async def test_a_backup_that_is_due_is_made_by_one(pair: NodePair, tmp_path: Path) -> None:
    folder = tmp_path / "backups"
    folder.mkdir()
    programs = [
        subprocess.Popen(
            [sys.executable, "-m", "sagittal.server.worker.backing_up"],
            cwd=ROOT, stdin=subprocess.PIPE,
            env={**os.environ, **replace(node.settings, backup_dir=str(folder)).environment()},
        )
        for node in pair.both
    ]  # fmt: skip
    codes = [await asyncio.to_thread(program.wait, 60) for program in programs]
    for program in programs:
        program.communicate()
    assert codes == [0, 0]
    assert len(list(folder.glob("*.tar"))) == 1


async def test_the_mark_follows_what_is_written_at_either(pair: NodePair) -> None:
    for number, node in enumerate(pair.both):
        response = node.client.post("/api/v1/patients", json={"code": f"M-{number}"})
        assert response.status_code == 201
    head = pair.a.client.get("/api/v1/audit/head").raise_for_status().json()["seq"]

    def has_followed() -> bool:
        mark = read_mark(pair.a.settings.mark)
        return mark is not None and mark.seq >= head

    await until(has_followed)
