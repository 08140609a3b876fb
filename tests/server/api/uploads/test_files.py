from __future__ import annotations

import asyncio
import hashlib
import re
import resource
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import quote

import httpx
import pytest

from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.engines import on_both_engines
from tests.server.serving import serve

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"


async def new_session(clinic: Clinic, code: str) -> str:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        session: str = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
    return session


def blobs(clinic: Clinic) -> list[Path]:
    return [p for p in clinic.settings.blobs.rglob("*") if p.is_file()]


async def stored_names(clinic: Clinic, session: str) -> list[str]:
    async with clinic.client("clinician") as client:
        answer = await client.get(f"{API}/sessions/{session}/recording")
    return [f["name"] for f in answer.json()["files"]] if answer.status_code == 200 else []


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "walk.csv",
        "Gang 🚶‍♀️ łódź.csv",
        "take 1/MT_0120_00B40B91.txt",
        "100%.txt",
        "a+b;c=d&e?.txt",
        "#1.txt",
        "..hidden.txt",
        "quo\"te's.csv",
    ],
)
async def test_a_file_comes_back_byte_for_byte_under_its_own_name(clinic: Clinic, name: str) -> None:
    session = await new_session(clinic, re.sub(r"[/\u200d]", "_", f"name {name}"[:60]))
    content = bytes(range(256)) * 7
    async with clinic.client("clinician") as client:
        path = f"{API}/sessions/{session}/files/{quote(name)}"
        answer = await client.put(path, content=content)
        assert answer.status_code == 201
        assert answer.json() == {
            "name": name,
            "size": len(content),
            "sha256": hashlib.sha256(content).hexdigest(),
        }
        assert await stored_names(clinic, session) == [name]
        back = await client.get(path)
        assert back.content == content
        last = quote(name.rpartition("/")[2], safe="")
        assert f"filename*=UTF-8''{last}" in back.headers["content-disposition"]
        removed = await client.delete(path)
        assert removed.json()["files"] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "..", "a/./b", "", "a//b", "a\x00b", "..\\x", "x" * 600, " ", "a/\u2003"]
)
async def test_names_that_lead_elsewhere_are_refused(clinic: Clinic, name: str) -> None:
    session = await new_session(clinic, f"bad {abs(hash(name))}")
    initial = blobs(clinic)
    async with clinic.client("clinician") as client:
        encoded = quote(name, safe="").replace(".", "%2E")
        answer = await client.put(f"{API}/sessions/{session}/files/{encoded}", content=b"x")
        assert (answer.status_code, answer.json()["code"]) == (422, "bad_file_name")
        if name.isprintable() and name:  # httpx writes others as %00, and "" as no file
            form = await client.post(f"{API}/sessions/{session}/files", files={"files": (name, b"x")})
            assert (form.status_code, form.json()["code"]) == (422, "bad_file_name")
    assert blobs(clinic) == initial
    assert await stored_names(clinic, session) == []


async def test_the_same_name_replaces_the_file_in_a_draft(clinic: Clinic) -> None:
    session = await new_session(clinic, "replace")
    async with clinic.client("assistant") as client:
        for content in (b"first", b"second"):
            await client.put(f"{API}/sessions/{session}/files/a.csv", content=content)
        files = (await client.get(f"{API}/sessions/{session}/recording")).json()["files"]
    assert [(f["name"], f["size"]) for f in files] == [("a.csv", 6)]


async def test_a_form_uploads_several_files_with_their_folders(clinic: Clinic) -> None:
    session = await new_session(clinic, "form")
    async with clinic.client("assistant") as client:
        parts = [("files", ("take/a.txt", b"aaa")), ("files", ("👣.txt", b"bb"))]
        path = f"{API}/sessions/{session}/files"
        answer = await client.post(path, files=parts, data={"other": "field"})
        assert answer.status_code == 201
        assert [(f["name"], f["size"]) for f in answer.json()] == [("take/a.txt", 3), ("👣.txt", 2)]
        empty = await client.post(f"{API}/sessions/{session}/files", files={"wrong": ("a.txt", b"a")})
        assert (empty.status_code, empty.json()["code"]) == (422, "no_files")
        plain = await client.post(f"{API}/sessions/{session}/files", content=b"a")
        assert plain.json()["code"] == "no_form"
        broken = await client.post(
            f"{API}/sessions/{session}/files",
            content=b"--x\r\nnot a part",
            headers={"Content-Type": "multipart/form-data; boundary=x"},
        )
        assert broken.status_code in {400, 422}


async def test_a_body_beyond_the_limit_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    async with open_clinic(
        tmp_path, max_file_bytes=3_000_000, max_set_bytes=4_000_000, max_files=2
    ) as clinic:
        session = await new_session(clinic, "limits")
        path = f"{API}/sessions/{session}/files"

        async def endless() -> AsyncIterator[bytes]:
            while True:
                yield b"x" * 100_000

        async with clinic.client("clinician") as client:
            for content in (b"x" * 3_000_001, endless()):
                answer = await client.put(f"{path}/big.bin", content=content)
                assert (answer.status_code, answer.json()["code"]) == (413, "file_too_large")
            form = await client.post(path, files={"files": ("big.bin", b"x" * 3_000_001)})
            assert (form.status_code, form.json()["code"]) == (413, "file_too_large")
            assert blobs(clinic) == []
            assert (await client.put(f"{path}/a", content=b"x" * 3_000_000)).status_code == 201
            full = await client.put(f"{path}/b", content=b"x" * 1_000_001)
            assert (full.status_code, full.json()["code"]) == (413, "set_too_large")
            assert (await client.put(f"{path}/b", content=b"x")).status_code == 201
            many = await client.put(f"{path}/c", content=b"x")
            assert (many.status_code, many.json()["code"]) == (413, "too_many_files")
            huge = await client.post(path, files={"files": ("big.bin", b"x" * 4_100_000)})
            assert huge.status_code == 413
        assert await stored_names(clinic, session) == ["a", "b"]


async def test_a_full_disk_is_said_before_the_body_is_read(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, min_free_bytes=10**18) as clinic:
        session = await new_session(clinic, "full")
        async with clinic.client("clinician") as client:
            answer = await client.put(f"{API}/sessions/{session}/files/a", content=b"x")
            ready = await client.get("/health/ready")
        assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
        assert (ready.status_code, ready.json()["status"]) == (503, "failing")


async def test_nothing_is_read_from_somebody_who_may_not_upload(clinic: Clinic) -> None:
    session = await new_session(clinic, "stranger")
    pulled = 0

    async def body() -> AsyncIterator[bytes]:
        nonlocal pulled
        for _ in range(100):
            pulled += 1
            yield b"x" * 100_000

    for role in (None, "viewer"):
        async with clinic.client(role) as client:
            for method, path in (("PUT", "files/a"), ("POST", "files")):
                answer = await client.request(method, f"{API}/sessions/{session}/{path}", content=body())
                assert answer.status_code == (403 if role else 401)
    assert pulled == 0


@pytest.mark.parametrize("kind", ["length", "chunked", "form"])
async def test_an_upload_that_is_cut_half_way_leaves_nothing(clinic: Clinic, kind: str) -> None:
    session = await new_session(clinic, f"cut {kind}")
    initial = blobs(clinic)
    target = f"{API}/sessions/{session}/files"
    head = [f"Host: 127.0.0.1\r\nCookie: sid={clinic.token('clinician')}\r\n"]
    if kind == "form":
        first = f"POST {target}"
        head.append("Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 9000000\r\n")
        start = b'--b\r\nContent-Disposition: form-data; name="files"; filename="a"\r\n\r\n'
    else:
        first = f"PUT {target}/a"
        head.append("Content-Length: 9000000\r\n" if kind == "length" else "Transfer-Encoding: chunked\r\n")
        start = b"" if kind == "length" else b"7a1200\r\n"
    async with serve(clinic.app) as port:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"{first} HTTP/1.1\r\n{''.join(head)}\r\n".encode() + start + b"x" * 5_000_000)
        await writer.drain()
        if kind != "form":  # a form is kept apart until it is complete
            await _until(lambda: len(blobs(clinic)) > len(initial))
        writer.close()
        await writer.wait_closed()
        await _until(lambda: blobs(clinic) == initial)
    assert await stored_names(clinic, session) == []


async def _until(condition: object) -> None:
    for _ in range(500):
        if condition():  # type: ignore[operator]
            return
        await asyncio.sleep(0.02)
    raise AssertionError("it did not happen within 10 s")


async def test_a_file_is_reached_only_through_its_own_session(clinic: Clinic) -> None:
    mine, second = await new_session(clinic, "mine"), await new_session(clinic, "other")
    async with clinic.client("clinician") as client:
        for session in (mine, second):
            await client.put(f"{API}/sessions/{session}/files/shared.txt", content=session.encode())
        await client.put(f"{API}/sessions/{mine}/files/only.txt", content=b"mine")
        assert (await client.get(f"{API}/sessions/{second}/files/shared.txt")).text == second
        for method in ("GET", "DELETE"):
            answer = await client.request(method, f"{API}/sessions/{second}/files/only.txt")
            assert (answer.status_code, answer.json()["code"]) == (404, "not_found")
    assert await stored_names(clinic, mine) == ["only.txt", "shared.txt"]


@pytest.mark.bench
async def test_the_memory_of_an_upload_does_not_grow_with_its_size(clinic: Clinic) -> None:
    session = await new_session(clinic, "memory")

    async def body(megabytes: int) -> AsyncIterator[bytes]:
        piece = bytes(65536)
        for _ in range(megabytes * 16):
            yield piece

    async with serve(clinic.app) as port:
        cookies = {"sid": clinic.token("clinician")}
        async with httpx.AsyncClient(
            base_url=f"http://127.0.0.1:{port}", cookies=cookies, timeout=120
        ) as client:
            path = f"{API}/sessions/{session}/files/big.bin"
            await client.put(path, content=body(20))
            initial_ru_maxrss = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            answer = await client.put(path, content=body(200))
            final_ru_maxrss = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert answer.status_code == 201
    assert answer.json()["size"] == 200 * 16 * 65536
    # kB; reading the body whole would add 210 000
    assert final_ru_maxrss - initial_ru_maxrss < 20_000
