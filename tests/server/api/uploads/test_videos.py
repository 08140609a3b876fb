"""Video of a trial: consent, playable formats, ranges, deletion with its session."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio

API = "/api/v1"
FILM = b"\x1a\x45\xdf\xa3" + bytes(range(256)) * 40
"""It begins as a WebM does."""


async def session_of(clinic: Clinic, code: str) -> tuple[str, str]:
    async with clinic.client("admin") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={"title": "Walk"})).json()[
            "id"
        ]
    return patient, session


def blobs(clinic: Clinic, patient: str) -> list[Path]:
    return [p for p in (clinic.settings.data_dir / "blobs" / patient).rglob("*") if p.is_file()]


async def test_nobody_is_filmed_without_having_agreed(clinic: Clinic) -> None:
    patient, session = await session_of(clinic, "F-1")
    path = f"{API}/sessions/{session}/video"
    async with clinic.client("clinician") as client:
        assert (await client.put(f"{path}?name=a.webm", content=FILM)).status_code == 422
        refused = await client.put(f"{path}?name=a.webm&consent=false", content=FILM)
        assert (refused.status_code, refused.json()["code"]) == (422, "no_consent")
        assert blobs(clinic, patient) == []
        assert (await client.get(path)).status_code == 404
        response = await client.put(f"{path}?name=a.webm&consent=true", content=FILM)
        assert response.status_code == 201, response.text
        stored_body = (await client.get(path)).json()
    assert (stored_body["name"], stored_body["consent_by"], stored_body["offset_s"]) == (
        "a.webm",
        "clinician",
        None,
    )


async def test_a_video_has_the_limit_of_a_file_and_its_alignment_that_of_a_request(clinic: Clinic) -> None:
    patient, session = await session_of(clinic, "F-6")
    path = f"{API}/sessions/{session}/video"
    film = FILM + bytes(3_000_000)
    async with clinic.client("clinician") as client:
        response = await client.put(f"{path}?name=a.webm&consent=true", content=film)
        assert response.status_code == 201, response.text
        assert [p.stat().st_size for p in blobs(clinic, patient)] == [len(film)]
        declared = {"content-length": str(clinic.settings.max_file_bytes + 1)}
        refused = await client.put(f"{path}?name=a.webm&consent=true", content=FILM, headers=declared)
        assert refused.status_code == 413
        assert (await client.patch(path, content=b" " * 1_000_001)).status_code == 413


async def test_what_no_browser_plays_is_refused(clinic: Clinic) -> None:
    _, session = await session_of(clinic, "F-2")
    path = f"{API}/sessions/{session}/video?name=walk.avi&consent=true"
    async with clinic.client("clinician") as client:
        for content in (b"RIFF....AVI LIST", b"", b"<html>"):
            answer = await client.put(path, content=content)
            assert (answer.status_code, answer.json()["code"]) == (422, "no_video")
        for begins, kind in (
            (b"\0\0\0\x20ftypisom", "video/mp4"),
            (b"\0\0\0\x14ftypqt  ", "video/quicktime"),
        ):
            assert (await client.put(path, content=begins + FILM)).status_code == 201
            assert (await client.get(f"{API}/sessions/{session}/video")).json()["media_type"] == kind


async def test_a_player_gets_ranges_and_no_copy_stays_in_its_cache(clinic: Clinic) -> None:
    _, session = await session_of(clinic, "F-3")
    path = f"{API}/sessions/{session}/video"
    async with clinic.client("clinician") as client:
        await client.put(f"{path}?name=a.webm&consent=true", content=FILM)
        piece = await client.get(f"{path}/content", headers={"Range": "bytes=4-259"})
    assert piece.status_code == 206
    assert piece.content == FILM[4:260]
    assert piece.headers["content-type"] == "video/webm"
    assert piece.headers["cache-control"] == "no-store"
    async with clinic.client("assistant") as client:
        assert (await client.get(f"{path}/content")).status_code == 403


async def test_an_alignment_is_a_time_and_can_be_taken_back(clinic: Clinic) -> None:
    _, session = await session_of(clinic, "F-4")
    path = f"{API}/sessions/{session}/video"
    async with clinic.client("clinician") as client:
        await client.put(f"{path}?name=a.webm&consent=true", content=FILM)
        for offset in (-3.25, None):
            answer = await client.patch(path, json={"offset_s": offset})
            assert answer.json()["offset_s"] == offset
        assert (await client.patch(path, json={"offset_s": 1e9})).status_code == 422
    async with clinic.client("viewer") as client:
        assert (await client.patch(path, json={"offset_s": 0.0})).status_code == 403


@pytest.mark.slow
async def test_a_video_is_on_the_page_and_in_no_report_and_goes_with_its_session(clinic: Clinic) -> None:
    patient, session = await session_of(clinic, "F-5")
    analysed.finish(clinic, patient, session, analysed.files())
    path = f"{API}/sessions/{session}/video"
    async with clinic.client("clinician") as client:
        assert "<take-video" not in (await client.get(f"/sessions/{session}")).text
        initial_count = len(blobs(clinic, patient))
        for film in (FILM, FILM + b"again"):  # the one that was replaced goes too
            await client.put(f"{path}?name=a.webm&consent=true", content=film)
        assert "<take-video" in (await client.get(f"/sessions/{session}")).text
        assert "video" not in (await client.get(f"/sessions/{session}/print")).text
        assert len(blobs(clinic, patient)) == initial_count + 2
        assert (await client.delete(f"{API}/sessions/{session}")).status_code == 204
    assert blobs(clinic, patient) == []
