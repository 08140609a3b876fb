"""Review of an analysis: effects of edits, refusals, undo, dependent results."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import httpx
import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.files.tracks import NAME, tracks_parquet
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.server import analysed, walk

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"
CONTACT = walk.events().times("left", "ic")[3]


@pytest.fixture
async def path(clinic: Clinic) -> str:
    """Address of a freshly analysed session."""
    return _session(clinic, analysed.files())


def _session(clinic: Clinic, results: Any) -> str:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code=f"P-{new_id()[:8]}", height_m=1.75).id
        session = sessions.create(c, None, patient).id
    analysed.finish(clinic, patient, session, results)
    return f"{API}/sessions/{session}"


def parameter(answer: dict[str, Any], name: str, side: str) -> dict[str, Any]:
    fields: dict[str, Any] = next(p for p in answer["parameters"] if (p["name"], p["side"]) == (name, side))
    return fields


def move(by_s: float = 0.04) -> dict[str, Any]:
    return {"kind": "move_event", "side": "left", "event": "ic", "time_s": CONTACT, "to_s": CONTACT + by_s}


LEAVE_OUT = {"kind": "exclude_stride", "side": "left", "time_s": CONTACT + 0.5, "reason": "stumbled"}


async def test_without_edits_the_review_is_the_stored_analysis(clinic: Clinic, path: str) -> None:
    async with clinic.client("viewer") as client:
        review = (await client.get(f"{path}/edits")).json()
    assert (review["version"], review["edits"], review["editable"]) == (0, [], True)
    assert len(review["events"]) == len(walk.events().events)
    assert {s["excluded_by"] for s in review["strides"]} == {"rule", None}


async def test_a_moved_contact_changes_its_strides_and_says_who_did_it(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:
        initial_body = (await client.get(f"{path}/edits")).json()
        response = await client.post(f"{path}/edits", json=move())
        final_body = response.json()
    assert response.status_code == 201
    assert final_body["version"] > 0
    (edit,) = final_body["edits"]
    assert (edit["kind"], edit["by"], edit["to_s"]) == ("move_event", "clinician", CONTACT + 0.04)
    moved = [e for e in final_body["events"] if e["source"] == "manual"]
    assert [(e["side"], e["kind"]) for e in moved] == [("left", "ic")]
    assert moved[0]["time_s"] == pytest.approx(CONTACT + 0.04, abs=1e-6)
    assert (
        parameter(final_body, "stride_time_s", "left")["sd"]
        > parameter(initial_body, "stride_time_s", "left")["sd"]
    )
    right = [parameter(x, "stride_time_s", "right")["mean"] for x in (initial_body, final_body)]
    assert right[0] == pytest.approx(right[1], abs=1e-6)


async def test_undo_gives_back_exactly_what_was_there(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:
        initial_body = (await client.get(f"{path}/edits")).json()
        first = (await client.post(f"{path}/edits", json=move())).json()
        await client.post(f"{path}/edits", json=LEAVE_OUT)
        one = (await client.delete(f"{path}/edits")).json()
        none = (await client.delete(f"{path}/edits")).json()
        refused = await client.delete(f"{path}/edits")
    for name in ("events", "strides", "parameters"):
        assert one[name] == first[name]
        assert none[name] == initial_body[name]
    assert (none["edits"], refused.status_code, refused.json()["code"]) == ([], 409, "nothing_to_undo")


async def test_redo_makes_again_what_was_undone_until_there_is_a_new_edit(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:

        async def redo() -> httpx.Response:
            return await client.post(f"{path}/edits/redo")

        assert (await redo()).json()["code"] == "nothing_to_redo"
        one = (await client.post(f"{path}/edits", json=move())).json()
        joint_body = (await client.post(f"{path}/edits", json=LEAVE_OUT)).json()
        for left in (1, 2):
            assert (await client.delete(f"{path}/edits")).json()["redoable"] == left
        second_bodies = [(await redo()).json() for _ in range(2)]
        assert [r["redoable"] for r in second_bodies] == [1, 0]
        for name in ("events", "strides", "parameters"):
            assert [r[name] for r in second_bodies] == [one[name], joint_body[name]]
        assert (await redo()).status_code == 409
        await client.delete(f"{path}/edits")
        new = await client.post(f"{path}/edits", json={**LEAVE_OUT, "reason": "turned"})
        assert (new.status_code, new.json()["redoable"]) == (201, 0)
        refused = await redo()
    assert (refused.status_code, refused.json()["code"]) == (409, "nothing_to_redo")


async def test_an_undone_state_and_another_edit_are_not_confused(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:
        one = (await client.post(f"{path}/edits", json=move(0.04))).json()
        await client.delete(f"{path}/edits")
        other_body = (await client.post(f"{path}/edits", json=move(0.02))).json()
    assert one["parameters"] != other_body["parameters"]
    assert len(other_body["edits"]) == 1


@pytest.mark.slow
async def test_report_tables_and_pages_follow_the_edits(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:

        async def seen() -> dict[str, Any]:
            report = (await client.get(f"{path}/report")).json()
            tables = {}
            for name in ("parameters", "curves", "strides", "events"):
                answer = await client.get(f"{path}/{name}.csv")
                assert answer.status_code == 200
                assert "nan" not in answer.text.lower()
                tables[name] = list(csv.DictReader(io.StringIO(answer.text)))
            page = (await client.get(path.removeprefix(API), headers={"Accept": "text/html"})).text
            words = re.search(r"(\d+) of \d+ included", page)
            assert words is not None
            return {"report": report, "words": words[1], **tables}

        initial = await seen()
        await client.post(f"{path}/edits", json=LEAVE_OUT)
        final = await seen()
        await client.delete(f"{path}/edits")
        assert await seen() == initial
    assert int(final["words"]) == int(initial["words"]) - 1
    assert sum(s["used"] for s in final["report"]["strides"]) == int(final["words"])
    (message,) = [w["message"] for w in final["report"]["warnings"] if w["code"] == "edited"]
    assert "1 stride excluded" in message
    assert any(r["excluded_reason"] == "manual:stumbled" for r in final["strides"])
    counts = [
        next(int(r["n"]) for r in table if r["name"] == "stride_time_s" and r["side"] == "left")
        for table in (initial["parameters"], final["parameters"])
    ]
    assert counts[1] == counts[0] - 1
    assert initial["curves"] != final["curves"]


async def test_the_stored_files_stay_as_the_worker_wrote_them(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:
        review = (await client.post(f"{path}/edits", json=move())).json()
        for name, content in analysed.files().items():
            stored = await client.get(f"{API}/analyses/{review['analysis_id']}/files/{name}")
            assert stored.content == content, name


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({**move(), "to_s": CONTACT + 1.0}, 422, "event_order"),
        ({**move(), "time_s": CONTACT + 0.2}, 422, "no_such_event"),
        ({**move(), "to_s": 1000.0}, 422, "event_outside"),
        ({**move(), "to_s": -5.0}, 422, "event_outside"),
        ({**LEAVE_OUT, "reason": None}, 422, "bad_edit"),
        ({"kind": "add_event", "side": "left", "time_s": 1.0}, 422, "bad_edit"),
        ({"kind": "forget", "side": "left", "time_s": 1.0}, 422, None),
    ],
)
async def test_what_cannot_be_is_refused_and_changes_nothing(
    clinic: Clinic, path: str, body: dict[str, Any], status: int, code: str | None
) -> None:
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{path}/edits", json=body)
        review = (await client.get(f"{path}/edits")).json()
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert code is None or answer.json()["code"] == code
    assert review["version"] == 0


async def test_who_decided_on_an_older_state_is_told(clinic: Clinic, path: str) -> None:
    async with clinic.client("clinician") as client:
        first = await client.post(f"{path}/edits", params={"seen": 0}, json=move())
        late = await client.post(f"{path}/edits", params={"seen": 0}, json=LEAVE_OUT)
        undo = await client.delete(f"{path}/edits", params={"seen": 0})
        redo = await client.post(f"{path}/edits/redo", params={"seen": 0})
        now = await client.post(f"{path}/edits", params={"seen": first.json()["version"]}, json=LEAVE_OUT)
    assert (late.status_code, late.json()["code"]) == (409, "edited_meanwhile")
    for refused in (undo, redo):
        assert (refused.status_code, refused.json()["code"]) == (409, "edited_meanwhile")
    assert now.status_code == 201


async def test_only_clinicians_change_and_only_readers_see(clinic: Clinic, path: str) -> None:
    for role, read, write in (("viewer", 200, 403), ("assistant", 403, 403), ("admin", 200, 201)):
        async with clinic.client(role) as client:
            assert (await client.get(f"{path}/edits")).status_code == read
            assert (await client.get(f"{path}/signals")).status_code == read
            assert (await client.post(f"{path}/edits", json=move())).status_code == write
            assert (await client.post(f"{path}/edits/redo")).status_code == (403 if write == 403 else 409)


async def test_every_change_is_audited_without_the_reason(clinic: Clinic, path: str) -> None:
    async with clinic.client("admin") as client:
        await client.post(f"{path}/edits", json=LEAVE_OUT)
        await client.delete(f"{path}/edits")
        await client.post(f"{path}/edits/redo")
        rows = (await client.get(f"{API}/audit", params={"limit": 3})).json()
    assert [r["action"] for r in rows] == ["edit.redone", "edit.undone", "stride.left_out"]
    assert rows[2]["detail"]["side"] == rows[0]["detail"]["side"] == "left"
    assert "stumbled" not in str(rows)


async def test_an_analysis_of_an_earlier_version_opens_but_cannot_be_edited(clinic: Clinic) -> None:
    old = {k: v for k, v in analysed.files().items() if k not in {"tracks.parquet", "signals.parquet"}}
    path = _session(clinic, old)
    async with clinic.client("clinician") as client:
        review = (await client.get(f"{path}/edits")).json()
        refused = await client.post(f"{path}/edits", json=move())
        lanes = (await client.get(f"{path}/signals")).json()
        page = await client.get(path.removeprefix(API) + "/timeline", headers={"Accept": "text/html"})
    assert review["editable"] is False
    assert (refused.status_code, refused.json()["code"]) == (409, "no_tracks")
    assert "Run the analysis again" in refused.json()["detail"]
    assert "knee_flexion" in {lane["name"] for lane in lanes}
    assert page.status_code == 200
    assert "Run the analysis again" in page.text
    assert " editable" not in page.text


async def test_an_analysis_that_stopped_early_says_why_and_shows_what_the_sensors_measured(
    clinic: Clinic,
) -> None:
    path = _session(clinic, analysis_files(analysed.analysis(reached=False)))
    async with clinic.client("clinician") as client:
        page = await client.get(path.removeprefix(API) + "/timeline", headers={"Accept": "text/html"})
        refused = await client.post(f"{path}/edits", json=move())
        lanes = (await client.get(f"{path}/signals")).json()
        raw = await client.get(f"{path}/signals/foot_l_gyr")
        missing = await client.get(f"{path}/strides.csv")
    assert "stopped before events were looked for. No rest found." in page.text
    assert (refused.status_code, refused.json()["code"]) == (409, "no_tracks")
    assert {lane["raw"] for lane in lanes} == {True}
    assert raw.json()["high"]["z"]
    assert missing.status_code == 404


async def test_who_may_only_read_sees_the_timeline_without_tools(clinic: Clinic, path: str) -> None:
    address = path.removeprefix(API) + "/timeline"
    pages = {}
    for role in ("viewer", "clinician"):
        async with clinic.client(role, headers={"Accept": "text/html"}) as client:
            pages[role] = (await client.get(address)).text
    assert ("data-undo" in pages["clinician"], "data-undo" in pages["viewer"]) == (True, False)
    assert "Run the analysis again" not in pages["viewer"]


async def test_an_erased_session_takes_its_edits_along(clinic: Clinic, path: str) -> None:
    async with clinic.client("admin") as client:
        await client.post(f"{path}/edits", json=move())
        assert (await client.delete(path)).status_code == 204
        assert (await client.get(f"{path}/edits")).status_code == 404


async def test_signals_are_listed_and_thinned_without_losing_a_peak(clinic: Clinic, path: str) -> None:
    async with clinic.client("viewer") as client:
        lanes = {lane["name"]: lane for lane in (await client.get(f"{path}/signals")).json()}
        assert {"foot_pitch", "foot_rate", "foot_acceleration", "foot_height", "knee_flexion"} <= lanes.keys()
        assert lanes["pelvis_gyr"] | {"raw": True, "lines": ["x", "y", "z"]} == lanes["pelvis_gyr"]

        async def window(name: str, **query: Any) -> dict[str, Any]:
            answer = await client.get(f"{path}/signals/{name}", params=query)
            assert answer.status_code == 200, answer.text
            fields: dict[str, Any] = answer.json()
            return fields

        whole = await window("foot_pitch", points=4000)
        assert whole["step_s"] == pytest.approx(0.01)
        thin = await window("foot_pitch", points=50)
        assert len(thin["low"]["left"]) <= 50
        for line in ("left", "right"):
            assert max(thin["high"][line]) == max(whole["high"][line])
            assert min(thin["low"][line]) == min(whole["low"][line])
        part = await window("foot_pitch", start_s=3.0, end_s=4.0, points=500)
        assert part["start_s"] == pytest.approx(3.0)
        i = round(part["start_s"] / 0.01)
        assert part["low"]["left"] == whole["low"]["left"][i : i + len(part["low"]["left"])]
        missing: httpx.Response = await client.get(f"{path}/signals/heart_rate")
        assert missing.status_code == 404


async def test_a_lost_sample_is_null(clinic: Clinic) -> None:
    lost = walk.tracks()
    lost.valid["foot_l"][100:150] = False
    path = _session(clinic, {**analysed.files(), NAME: tracks_parquet(lost)})
    async with clinic.client("viewer") as client:
        answer = await client.get(f"{path}/signals/foot_pitch", params={"points": 4000})
    assert "NaN" not in answer.text
    left = answer.json()["low"]["left"]
    assert [i for i, v in enumerate(left) if v is None] == list(range(100, 150))
