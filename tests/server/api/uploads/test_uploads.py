"""Large files in parts: cut, sent twice, out of order, wrong, given up."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
from pathlib import Path

import httpx
import numpy as np
import pytest

from sagittal.server.safekeeping import erasure, sweep
from sagittal.server.uploads import uploads
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.engines import on_both_engines
from tests.server.api.uploads.test_files import API, blobs, new_session, stored_names
from tests.server.serving import serve

pytestmark = [pytest.mark.anyio, on_both_engines]


async def begin(client: httpx.AsyncClient, session: str, size: int, name: str = "walk.csv") -> str:
    answer = await client.post(f"{API}/sessions/{session}/uploads", json={"name": name, "size": size})
    assert answer.status_code == 201, answer.text
    return f"{API}/sessions/{session}/uploads/{answer.json()['id']}"


async def send(client: httpx.AsyncClient, path: str, offset: int, part: bytes) -> httpx.Response:
    return await client.patch(path, content=part, headers={"Upload-Offset": str(offset)})


async def finish(client: httpx.AsyncClient, path: str, content: bytes) -> httpx.Response:
    return await client.post(f"{path}/finish", json={"sha256": hashlib.sha256(content).hexdigest()})


@pytest.mark.slow
async def test_parts_in_any_order_and_twice_become_the_file_once(clinic: Clinic) -> None:
    """A sender that loses responses, repeats or skips parts is only told where to resume."""
    session = await new_session(clinic, "parts")
    chance = np.random.default_rng(17)
    content = chance.bytes(50_000)
    async with clinic.client("assistant") as client:
        path = await begin(client, session, len(content))
        target = 0
        while target < len(content):
            offset = int(chance.choice([target, target, max(0, target - 900), target + 1]))
            part = content[offset : offset + int(chance.integers(1, 9000))]
            answer = await send(client, path, offset, part)
            if offset == target:
                assert answer.status_code == 200
                target += len(part)
            else:
                assert (answer.status_code, answer.json()["code"]) == (409, "upload_gap")
                assert str(target) in answer.json()["detail"]
            notices = await client.head(path)
            assert notices.headers["Upload-Offset"] == str(target)
            if target < len(content):
                early = await finish(client, path, content)
                assert (early.status_code, early.json()["code"]) == (409, "upload_incomplete")
        assert notices.headers["Upload-Length"] == str(len(content))
        first, second = [await finish(client, path, content) for _ in range(2)]
        assert first.json() == second.json()
        assert first.json()["sha256"] == hashlib.sha256(content).hexdigest()
        # the same bytes sent at once are the same file
        await client.put(f"{API}/sessions/{session}/files/again.csv", content=content)
        assert (await client.get(f"{API}/sessions/{session}/uploads")).json() == []
    async with clinic.client("clinician") as client:
        assert (await client.get(f"{API}/sessions/{session}/files/walk.csv")).content == content
    assert await stored_names(clinic, session) == ["again.csv", "walk.csv"]


async def test_wrong_bytes_are_never_a_file_and_begin_again(clinic: Clinic) -> None:
    session = await new_session(clinic, "wrong")
    async with clinic.client("assistant") as client:
        path = await begin(client, session, 5)
        await send(client, path, 0, b"wrong")
        damaged = await finish(client, path, b"right")
        assert (damaged.status_code, damaged.json()["code"]) == (409, "upload_damaged")
        assert await stored_names(clinic, session) == []
        assert (await client.head(path)).headers["Upload-Offset"] == "0"
        assert (await send(client, path, 0, b"right")).json()["offset"] == 5
        beyond = await send(client, path, 5, b"!")
        assert (beyond.status_code, beyond.json()["code"]) == (413, "file_too_large")
        assert (await finish(client, path, b"right")).status_code == 200
        # a finished upload is over: the next file of this name and size is another one
        assert await begin(client, session, 5) != path


async def test_a_cut_connection_leaves_what_came_and_it_is_found_again(clinic: Clinic) -> None:
    session = await new_session(clinic, "cut part")
    content = os.urandom(3_500_000)
    async with serve(clinic.app) as port, clinic.client("clinician") as client:
        path = await begin(client, session, len(content))
        head = f"PATCH {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: sid={clinic.token('clinician')}\r\n"
        head += f"Upload-Offset: 0\r\nContent-Length: {len(content)}\r\n\r\n"
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(head.encode() + content[:2_600_000])
        await writer.drain()
        part = clinic.app.state.blobs.part(path.rpartition("/")[2])
        for _ in range(500):
            if part.exists() and part.stat().st_size >= 2_000_000:
                break
            await asyncio.sleep(0.02)
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
        # as after a reload: announced again, it is the same upload
        second_response = await client.post(
            f"{API}/sessions/{session}/uploads", json={"name": "walk.csv", "size": len(content)}
        )
        assert path.endswith(second_response.json()["id"])
        body = second_response.json()["offset"]
        assert 2_000_000 <= body < len(content)
        page = await client.get(f"/sessions/{session}/upload")
        assert "Choose the file again to continue" in page.text
        assert (await send(client, path, body, content[body:])).json()["offset"] == len(content)
        assert (await finish(client, path, content)).status_code == 200
    assert not part.exists()


async def test_limits_hold_for_what_is_announced(tmp_path: Path) -> None:
    limits = {"max_file_bytes": 3_000_000, "max_set_bytes": 4_000_000, "max_files": 2}
    async with open_clinic(tmp_path, **limits) as clinic:
        session = await new_session(clinic, "announced")

        async def refused(name: str, size: int) -> str:
            answer = await client.post(f"{API}/sessions/{session}/uploads", json={"name": name, "size": size})
            return str(answer.json()["code"])

        async with clinic.client("clinician") as client:
            assert await refused("a", 3_000_001) == "file_too_large"
            assert await refused("../a", 1) == "bad_file_name"
            await begin(client, session, 3_000_000, "a")
            assert await refused("b", 1_000_001) == "set_too_large"
            await begin(client, session, 1, "b")
            assert await refused("c", 1) == "too_many_files"
    async with open_clinic(tmp_path / "full", min_free_bytes=10**18) as clinic:
        session = await new_session(clinic, "no room")
        async with clinic.client("clinician") as client:
            assert await refused("a", 1) == "disk_full"


async def test_what_is_given_up_abandoned_or_erased_goes(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, sweep_grace_s=0) as clinic:
        session, alternative = await new_session(clinic, "gone"), await new_session(clinic, "other")
        store = clinic.app.state.blobs
        async with clinic.client("clinician") as client:
            path = await begin(client, session, 9, "given up")
            await send(client, path, 0, b"begun")
            foreign = path.replace(session, alternative)
            assert (await client.head(foreign)).status_code == 404
            assert (await send(client, foreign, 5, b"more")).status_code == 404
            assert (await client.delete(foreign)).status_code == 404
            sweep.sweep(clinic.db, store, clinic.settings)
            assert len(blobs(clinic)) == 1, "an upload that is coming stays"
            assert (await client.delete(path)).status_code == 204
            assert blobs(clinic) == []

            path = await begin(client, session, 9, "abandoned")
            await send(client, path, 0, b"begun")
            os.utime(blobs(clinic)[0], (0, 0))
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(uploads, "ABANDONED", -uploads.ABANDONED)
                sweep.sweep(clinic.db, store, clinic.settings)
            assert blobs(clinic) == []
            assert (await client.head(path)).status_code == 404

            path = await begin(client, session, 9, "erased")
            await send(client, path, 0, b"begun")
        erasure.erase_session(clinic.db, clinic.app.state.reviewed, clinic.settings, None, session)
        assert blobs(clinic) == []
