"""Compressed and uncompressed responses."""

from __future__ import annotations

import asyncio
import gzip
import zlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from sagittal.server.clinic import patients, sessions
from sagittal.server.http.compression import LONG_BYTES, Compression, accepts
from sagittal.server.results import analyses
from sagittal.server.uploads import receiving
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed
from tests.server.serving import serve

pytestmark = pytest.mark.anyio
SOON_S = 10.0
SHEET = "/static/css/base.css"


@dataclass
class Visit:
    """An analysed session in a clinic on a port, and one whose job waits for a worker that does not come."""

    clinic: Clinic
    port: int
    session_id: str
    analysis_id: str
    waiting_job_id: str

    @asynccontextmanager
    async def browser(self, **headers: str) -> AsyncIterator[httpx.AsyncClient]:
        """Signed-in client; httpx requests gzip by default."""
        cookie = {"Cookie": f"sid={self.clinic.token('clinician')}"}
        async with httpx.AsyncClient(
            base_url=f"http://127.0.0.1:{self.port}",
            headers={**cookie, **headers},
            trust_env=False,
            timeout=60,
        ) as client:
            yield client


@pytest.fixture(scope="module")
async def visit(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Visit]:
    folder = tmp_path_factory.mktemp("clinic")
    async with open_clinic(folder) as clinic, serve(clinic.app, clinic.settings) as port:
        state = clinic.app.state
        with clinic.db.write() as c:
            patient_id = patients.create(c, None, code="Z-1").id
            done, waiting = (sessions.create(c, None, patient_id).id for _ in range(2))
        analysis_id = analysed.finish(clinic, patient_id, done, analysed.files())
        with receiving.receive(clinic.db, state.blobs, clinic.settings, None, waiting, "b.txt") as upload:
            upload.write(b"recording")
            upload.keep()
        with clinic.db.write() as c:
            job_id = analyses.submit(c, state.queue, None, waiting).id
        yield Visit(clinic, port, done, analysis_id, job_id)


async def both_ways(visit: Visit, path: str) -> tuple[httpx.Response, bytes, bytes]:
    """The head of the compressed answer, its bytes on the line, and the bytes of the plain answer."""
    async with visit.browser() as client, client.stream("GET", path) as answer:
        raw = b"".join([part async for part in answer.aiter_raw()])
    async with visit.browser(**{"Accept-Encoding": "identity"}) as client:
        plain = await client.get(path)
    assert "content-encoding" not in plain.headers
    assert answer.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"
    return answer, raw, plain.content


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/sessions/{session}", SHEET, "/api/v1/openapi.json"])
async def test_pages_sheets_and_json_come_compressed_and_whole(visit: Visit, path: str) -> None:
    answer, raw, plain = await both_ways(visit, path.format(session=visit.session_id))
    assert answer.status_code == 200
    assert answer.headers["content-encoding"] == "gzip"
    assert len(raw) < 0.4 * len(plain)
    assert gzip.decompress(raw) == plain


async def test_an_answer_that_fits_a_packet_is_left_alone(visit: Visit) -> None:
    _, raw, plain = await both_ways(visit, f"/api/v1/jobs/{visit.waiting_job_id}")
    assert raw == plain


async def test_an_event_comes_before_the_next_one(visit: Visit) -> None:
    path = f"/api/v1/jobs/{visit.waiting_job_id}/events"
    async with visit.browser() as client, client.stream("GET", path) as stream:
        assert "content-encoding" not in stream.headers
        assert b"queued" in await asyncio.wait_for(first_part(stream, b"queued"), SOON_S)


async def first_part(stream: httpx.Response, until: bytes) -> bytes:
    heard = b""
    async for part in stream.aiter_raw():
        heard += part
        if until in heard:
            break
    return heard


async def test_a_file_to_save_comes_byte_for_byte(visit: Visit) -> None:
    path = f"/api/v1/analyses/{visit.analysis_id}/files/strides.csv"
    async with visit.browser() as client, client.stream("GET", path) as answer:
        assert answer.headers["content-disposition"].startswith("attachment")
        assert "content-encoding" not in answer.headers
        raw = b"".join([part async for part in answer.aiter_raw()])
    assert raw == analysed.files()["strides.csv"]


async def test_a_part_of_a_file_is_a_part_of_the_file(visit: Visit) -> None:
    async with visit.browser() as client:
        whole = (await client.get(SHEET)).content
        part = await client.get(SHEET, headers={"Range": "bytes=100-2099"})
    assert part.status_code == 206
    assert "content-encoding" not in part.headers
    assert part.content == whole[100:2100]


async def test_a_kept_sheet_is_asked_for_and_not_sent_again(visit: Visit) -> None:
    async with visit.browser() as client:
        tag = (await client.get(SHEET)).headers["etag"]
        second_response = await client.get(SHEET, headers={"If-None-Match": tag})
    assert tag.startswith('W/"')
    assert (second_response.status_code, second_response.content, second_response.headers["vary"]) == (
        304,
        b"",
        "Accept-Encoding",
    )


async def test_what_another_site_asks_for_does_not_tell_by_its_length_what_is_in_it(visit: Visit) -> None:
    page = f"/sessions/{visit.session_id}"
    async with visit.browser(**{"Sec-Fetch-Site": "cross-site"}) as client:
        assert "content-encoding" not in (await client.get(page)).headers
    async with visit.browser(**{"Sec-Fetch-Site": "same-origin"}) as client:
        assert (await client.get(page)).headers["content-encoding"] == "gzip"


async def test_the_head_of_an_answer_says_the_length_of_the_plain_one(visit: Visit) -> None:
    async with visit.browser(**{"Accept-Encoding": "identity"}) as client:
        plain = await client.get(SHEET)
    async with visit.browser() as client:
        head = await client.head(SHEET)
    assert head.headers["content-length"] == str(len(plain.content))


async def test_the_first_part_of_a_page_is_readable_before_the_last_is_made() -> None:
    event = asyncio.Event()
    parts = [b"<p>head" * 10, b"<p>body" * LONG_BYTES]

    async def page(scope: Scope, receive: Receive, send: Send) -> None:
        headers = [(b"content-type", b"text/html; charset=utf-8")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": parts[0], "more_body": True})
        await event.wait()
        await send({"type": "http.response.body", "body": parts[1]})

    reader = zlib.decompressobj(31)
    async with (
        serve(Compression(page)) as port,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client,
        client.stream("GET", "/") as answer,
    ):
        coming = answer.aiter_raw()
        assert reader.decompress(await asyncio.wait_for(anext(coming), SOON_S)) == parts[0]
        event.set()
        assert b"".join([reader.decompress(part) async for part in coming]) == parts[1]
        assert reader.eof


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("gzip, deflate, br", True),
        ("GZIP", True),
        ("br;q=1.0, gzip;q=0.5", True),
        ("*", True),
        ("", False),
        ("br", False),
        ("identity", False),
        ("gzip;q=0", False),
        ("gzip; q=0.00, *", False),
        ("*;q=0, gzip", True),
    ],
)
def test_gzip_goes_to_those_who_take_it(header: str, expected: bool) -> None:
    assert accepts("gzip", header) is expected
