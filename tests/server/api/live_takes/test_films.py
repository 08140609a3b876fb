"""The film of a take: acknowledged when it is on the disk, whole, aligned, gone with its session."""

from __future__ import annotations

import datetime as dt
import os
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from sagittal.server.live.client import stream
from sagittal.server.live_takes import films, live
from sagittal.server.safekeeping import sweep
from sagittal.server.storage import segments
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.live_clinic import Visit, visit
from tests.helpers.live_takes import HELLO, frame
from tests.server.live.test_client import given
from tests.server.serving import serve

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
async def port(clinic: Clinic) -> AsyncIterator[int]:
    async with serve(clinic.app) as number:
        yield number


PIECES = [b"\x1a\x45\xdf\xa3" + bytes(1000), b"two" * 500, b"three" * 400]
BEGAN_US = 5_000_000
LATE_US = 1_250_000
"""The first sample is so much later than the first picture."""


class Camera:
    """A tablet's camera by the API."""

    def __init__(self, v: Visit, port: int | None = None) -> None:
        self.path = f"/api/v1/live/takes/{v.take}/film"
        self.url = f"http://127.0.0.1:{port or v.port}"
        self.headers = {"Authorization": f"Bearer {v.token}"}

    async def ask(self, method: str, more: str = "", **body: Any) -> httpx.Response:
        async with httpx.AsyncClient(base_url=self.url, headers=self.headers, trust_env=False) as client:
            return await client.request(method, self.path + more, **body)

    async def begin(self, **said: Any) -> httpx.Response:
        return await self.ask("POST", json={"consent": True, "began_us": BEGAN_US} | said)

    async def add(self, number: int, piece: bytes) -> httpx.Response:
        return await self.ask("PUT", f"/{number}", content=piece)

    async def end(self) -> httpx.Response:
        return await self.ask("POST", "/end")


async def walk(v: Visit) -> None:
    """Stream a take to its end."""
    sent = BEGAN_US + LATE_US + 20_000  # the last of three samples is sent at once
    frames = [frame(i, stream=0, sent_us=sent + 30_000 * i) for i in range(60)]
    await stream(v.socket, v.token, replace(HELLO, take=v.take), given(frames))


def code_of(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["code"]


@pytest.mark.slow
async def test_a_film_stands_beside_its_take_aligned_though_pieces_came_twice_and_early(
    clinic: Clinic, port: int
) -> None:
    async with visit(clinic, port) as v:
        camera = Camera(v)
        assert (await camera.add(0, PIECES[0])).status_code == 404
        assert (await camera.begin()).json()["next_piece"] == 0
        assert (await camera.add(0, PIECES[0])).json()["next_piece"] == 1
        assert code_of(await camera.add(2, PIECES[2])) == (409, "film_gap")
        assert (await camera.add(0, PIECES[0])).json()["next_piece"] == 1
        assert (await camera.add(1, PIECES[1])).json()["next_piece"] == 2
        assert (await camera.begin()).json()["next_piece"] == 2  # asked again, it only says how far it is
        await camera.add(2, PIECES[2])
        assert code_of(await camera.end()) == (409, "take_open")
        await walk(v)
        assert (await camera.end()).json() == {"kept": True}
        assert (await camera.end()).json() == {"kept": True}
        stored_body = (await v.http.get(f"/api/v1/sessions/{v.session}/video")).json()
        whole = await v.http.get(f"/api/v1/sessions/{v.session}/video/content")
        part = await v.http.get(
            f"/api/v1/sessions/{v.session}/video/content", headers={"Range": "bytes=1000-1009"}
        )
        assert whole.content == b"".join(PIECES)
        assert (part.status_code, part.content) == (206, whole.content[1000:1010])
        assert stored_body["offset_s"] == pytest.approx(LATE_US / 1e6, abs=0.001)
        assert stored_body["media_type"] == "video/webm"
        assert stored_body["name"].endswith(".webm")
        assert stored_body["consent_by"]
        assert not films.film_path(clinic.settings.live, v.take).exists()


async def test_without_consent_or_token_nothing_is_kept(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        camera = Camera(v)
        assert code_of(await camera.begin(consent=False)) == (422, "no_consent")
        camera.headers = {"Authorization": "Bearer wrong"}
        for answer in (await camera.begin(), await camera.add(0, PIECES[0]), await camera.end()):
            assert code_of(answer) == (401, "token_not_valid")
        assert not films.film_path(clinic.settings.live, v.take).exists()


@pytest.mark.slow
async def test_what_was_acknowledged_is_there_after_a_restart_and_a_torn_piece_is_asked_for_again(
    tmp_path: Path,
) -> None:
    async with (
        open_clinic(tmp_path, live_workers=0) as clinic,
        serve(clinic.app) as port,
        visit(clinic, port) as v,
    ):
        await Camera(v).begin()
        await Camera(v).add(0, PIECES[0])
        path = films.film_path(clinic.settings.live, v.take)
    with path.open("ab") as file:
        file.write(b"\x40\x00\x00\x00half a piece")
    async with open_clinic(tmp_path, live_workers=0) as clinic, serve(clinic.app) as port:
        camera = Camera(v, port)
        assert (await camera.add(2, PIECES[2])).status_code == 409
        assert (await camera.add(1, PIECES[1])).json()["next_piece"] == 2
        assert [one.body for _, one in segments.read_records(path) if one.kind == "B"] == PIECES[:2]


async def test_a_film_is_no_larger_than_a_file_may_be(tmp_path: Path) -> None:
    async with (
        open_clinic(tmp_path, live_workers=0, max_file_bytes=2000) as clinic,
        serve(clinic.app) as port,
        visit(clinic, port) as v,
    ):
        camera = Camera(v)
        assert (await camera.begin()).json()["limit_bytes"] == 2000
        assert (await camera.add(0, PIECES[0])).status_code == 200
        assert code_of(await camera.add(1, PIECES[1])) == (413, "file_too_large")
        assert (await camera.begin()).json()["next_piece"] == 1


async def test_the_film_of_a_take_that_came_to_nothing_is_discarded(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        camera = Camera(v)
        await camera.begin()
        await camera.add(0, PIECES[0])
        assert (await v.http.post(f"{v.api}/close")).status_code == 200
        assert (await camera.end()).json() == {"kept": False}
        assert not films.film_path(clinic.settings.live, v.take).exists()
        assert (await v.http.get(f"/api/v1/sessions/{v.session}/video")).status_code == 404


async def test_erasing_the_session_erases_the_pieces_too(clinic: Clinic, port: int) -> None:
    async with visit(clinic, port) as v:
        camera = Camera(v)
        await camera.begin()
        await camera.add(0, PIECES[0])
        await v.http.post(f"{v.api}/close")
        async with clinic.client("admin") as admin:
            answer = await admin.delete(f"/api/v1/sessions/{v.session}")
        assert answer.status_code == 204, answer.text
        assert not films.film_path(clinic.settings.live, v.take).exists()
        assert code_of(await camera.add(1, PIECES[1])) == (401, "token_not_valid")


async def test_a_film_whose_tablet_never_came_back_is_kept_as_far_as_it_came(
    clinic: Clinic, port: int
) -> None:
    async with visit(clinic, port) as v:
        camera = Camera(v)
        await camera.begin()
        await camera.add(0, PIECES[0])
        await walk(v)
        sweep.sweep(clinic.db, clinic.app.state.blobs, clinic.settings)
        path = films.film_path(clinic.settings.live, v.take)
        assert path.exists()  # the tablet may still come
        long_ago = (dt.datetime.now(dt.UTC) - live.TOKEN_LIFE).timestamp() - 60
        os.utime(path, (long_ago, long_ago))
        sweep.sweep(clinic.db, clinic.app.state.blobs, clinic.settings)
        assert not path.exists()
        whole = await v.http.get(f"/api/v1/sessions/{v.session}/video/content")
        assert whole.content == PIECES[0]
