"""What pages say to a therapist: the same thing in every place, once, and nothing that is not so."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from sagittal.core.body.model import NOMINAL_HEIGHT_M
from sagittal.core.online.calibrating import CalibratingParams
from sagittal.server.pages.results.charts import draw_chart
from sagittal.server.report.charts.panels import CurvePanel
from sagittal.server.results import analyses
from sagittal.server.uploads import recordings
from tests.data import ROOT
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def visit(clinic: Clinic, code: str, **changed: Any) -> tuple[str, str]:
    """Patient and session of an analysed walk; `changed` parts of its analysis.json."""
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": code})).json()["id"]
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json={"title": "Walk"})).json()
    files = dict(analysed.files())
    document = json.loads(files["analysis.json"])
    for key, value in changed.items():
        document[key] = {**document[key], **value} if isinstance(value, dict) else value
    files["analysis.json"] = json.dumps(document).encode()
    analysed.finish(clinic, patient, session["id"], files)
    return patient, session["id"]


async def page(clinic: Clinic, path: str, role: str = "admin") -> str:
    async with clinic.client(role) as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


def row_of(html: str, code: str) -> str:
    rows = (m.group() for m in re.finditer(r"<tr data-href.*?</tr>", html, re.DOTALL))
    return next(row for row in rows if code in row)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "changed", "kind", "word"),
    [
        ("Q-GOOD", {"warnings": []}, "ok", "Good data"),
        ("Q-USABLE", {"quality": {"level": "usable"}, "warnings": []}, "warn", "Usable with caution"),
        ("Q-POOR", {"quality": {"level": "poor"}, "warnings": []}, "bad", "Poor data"),
        ("Q-APART", {"estimator": {"verdict": "bad"}, "warnings": []}, "bad", "Sensors disagree"),
        (
            "Q-PATH",
            {
                "estimator": {
                    "verdict": "bad",
                    "health": [
                        {
                            "name": "zero_velocity_refused_pct",
                            "of": "foot_r",
                            "value": 28.0,
                            "warn": 2.0,
                            "bad": 20.0,
                            "verdict": "bad",
                        }
                    ],
                },
                "warnings": [],
            },
            "bad",
            "Foot path unreliable",
        ),
        ("Q-NONE", {"parameters": [], "warnings": []}, "bad", "No strides"),
    ],
)
async def test_every_list_says_of_a_session_what_its_own_page_says(
    clinic: Clinic, code: str, changed: dict[str, Any], kind: str, word: str
) -> None:
    patient, session = await visit(clinic, code, **changed)
    assert f'class="badge {kind}"' in await page(clinic, f"/sessions/{session}")
    shape = re.compile(rf'class="state {kind}">.*?{word}', re.DOTALL)
    assert shape.search(row_of(await page(clinic, "/patients"), code))
    assert shape.search(row_of(await page(clinic, f"/patients/{patient}"), session))


async def test_a_result_that_cannot_be_read_does_not_take_the_list_of_patients_away(clinic: Clinic) -> None:
    patient, _ = await visit(clinic, "Q-LOST")
    stored = [p for p in (clinic.settings.data_dir / "blobs" / patient).rglob("*") if p.is_file()]
    assert stored
    for blob in stored:
        blob.chmod(0o600)
        blob.write_bytes(b"damaged")
    assert "Cannot be read" in row_of(await page(clinic, "/patients"), "Q-LOST")


@pytest.mark.slow
async def test_damaged_poses_take_the_figure_away_and_no_number(clinic: Clinic) -> None:
    patient, session = await visit(clinic, "Q-POSES")
    with clinic.db.read() as c:
        sha256 = analyses.get_shown(c, session).files["poses.parquet"].sha256
    stored = [p for p in (clinic.settings.data_dir / "blobs" / patient).rglob("*") if sha256 in p.name]
    assert stored
    for blob in stored:
        blob.chmod(0o600)
        blob.write_bytes(b"damaged")
    for path in ("", "/kinematics"):
        html = await page(clinic, f"/sessions/{session}{path}")
        assert "data-first" not in html
        assert "<h2" in html


async def test_who_may_not_see_results_sees_no_verdict_on_them(clinic: Clinic) -> None:
    await visit(clinic, "Q-HIDDEN", quality={"level": "poor"})
    assert "Poor data" not in row_of(await page(clinic, "/patients", "assistant"), "Q-HIDDEN")


async def test_the_session_page_does_not_repeat_what_the_upload_page_said_of_files(clinic: Clinic) -> None:
    notices = [
        {"code": code, "message": f"{code} was told.", "sensor": None, "t_s": None, "severity": severity}
        for code, severity in (
            ("ignored_file", "info"),
            ("file_not_read", "warning"),
            ("file_given_twice", "info"),
            ("duplicate_stream", "info"),
            ("gap", "warning"),
        )
    ]
    _, session = await visit(clinic, "Q-FILES", warnings=notices)
    html = await page(clinic, f"/sessions/{session}")
    assert [n["code"] for n in notices if f"{n['code']} was told." in html] == ["gap"]
    _, session = await visit(clinic, "Q-FILES-2", warnings=notices[:-1])
    assert 'class="badge ok"' in await page(clinic, f"/sessions/{session}")


async def test_files_that_were_changed_after_the_analysis_are_not_taken_for_its_own(clinic: Clinic) -> None:
    _, session = await visit(clinic, "CHANGED")
    path, note = f"/sessions/{session}", "The files were changed after this analysis"
    assert note not in await page(clinic, path)
    assert "exactly as uploaded" in await page(clinic, f"{path}/data")
    async with clinic.client("clinician") as client:
        put = await client.put(f"/api/v1{path}/files/walk.txt", content=b"another one")
        requested_response = await client.post(f"/api/v1{path}/inspections")
    assert (put.status_code, requested_response.status_code) == (201, 202)
    assert "Changed files are read" in await page(clinic, path)
    queue = clinic.app.state.queue
    claim = queue.claim("test", [recordings.INSPECT])
    assert queue.finish(claim, lambda c: None)
    assert note in await page(clinic, path)
    messages = await page(clinic, f"{path}/data")
    assert "changed after this analysis; the files it used are in the archive" in messages
    assert "exactly as uploaded" not in messages


async def test_the_numbers_after_an_edit_are_no_page_of_their_own(clinic: Clinic) -> None:
    _, session = await visit(clinic, "Q-NUMBERS")
    address = f"/sessions/{session}/timeline/numbers"
    async with clinic.client("admin") as client:
        answer = await client.get(address)
        assert (answer.status_code, answer.headers["location"]) == (
            303,
            f"/sessions/{session}/timeline#numbers",
        )
        whole = await client.get(f"/sessions/{session}/timeline")
        part = await client.get(address, headers={"X-Sagittal-Fragment": "numbers"})
    assert 'id="numbers"' in whole.text
    assert part.status_code == 200
    assert part.text.lstrip().startswith('<div class="tl-numbers" id="numbers">')


async def test_every_page_assumes_the_same_height(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "Q-HEIGHT"})).json()["id"]
    words = f"{NOMINAL_HEIGHT_M:.2f} m is assumed"
    assert words in (await page(clinic, f"/patients/{patient}/sessions/new")).lower()
    templates = ROOT / "web" / "templates"
    by_name = {p.name: re.findall(r"\d\.\d\d m\b", p.read_text()) for p in templates.glob("*.html")}
    assert not {name: heights for name, heights in by_name.items() if heights}, "written by hand"
    assert "ASSUMED_HEIGHT ~ ' is assumed" in (templates / "_sensor_map.html").read_text()


def test_tablet_and_therapist_are_told_to_stand_as_long_as_the_server_waits() -> None:
    static = ROOT / "web" / "static" / "js"
    (matches,) = re.findall(r"STAND_S = (\d+)", (static / "common/standing.js").read_text())
    assert float(matches) == CalibratingParams().stand_s
    by_hand = [
        path.name
        for path in (*static.rglob("*.js"), *(ROOT / "web" / "templates").glob("*.html"))
        if re.search(r"\d seconds", path.read_text())
    ]
    assert by_hand == []
    visible_names = [p.name for p in static.rglob("*.js") if "${STAND_S} seconds" in p.read_text()]
    assert sorted(visible_names) == ["calibration.js", "view.js", "words.js"]


async def test_the_overview_is_light_and_the_rest_comes_when_it_is_opened(clinic: Clinic) -> None:
    _, session = await visit(clinic, "LIGHT")
    overview = await page(clinic, f"/sessions/{session}")
    assert len(overview.encode()) < 80_000
    assert "Compared with norm" in overview
    names = set(re.findall(r'class="plain" href="[^"]*/parameters/(\w+)"', overview))
    values = await page(clinic, f"/sessions/{session}/values")
    other_names = set(re.findall(r'class="plain" href="[^"]*/parameters/(\w+)"', values))
    assert len(names) == 9
    assert 'kinematics#h-map">Sagittal profile score' in overview, "the tenth"
    assert other_names > {"swing_time_s", "turning_angle_deg"}
    assert not names & other_names


async def test_a_report_is_drawn_once_until_something_it_shows_changes(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient, session = await visit(clinic, "ONCE")
    drawn: list[str] = []

    def draw(panel: CurvePanel, *args: Any, **kwargs: Any) -> dict[str, Any]:
        drawn.append(panel.variable.name)
        return draw_chart(panel, *args, **kwargs)

    monkeypatch.setattr("sagittal.server.pages.results.session.draw_chart", draw)
    first = await page(clinic, f"/sessions/{session}")
    assert drawn
    drawn.clear()
    assert await page(clinic, f"/sessions/{session}") == first
    assert not drawn
    async with clinic.client("admin") as client:
        answer = await client.patch(f"/api/v1/patients/{patient}", json={"sex": "male", "birth_year": 1950})
    assert answer.status_code == 200, answer.text
    assert await page(clinic, f"/sessions/{session}") != first
    assert drawn


async def test_a_sentence_leads_to_what_proves_it_and_its_number_stands_there(clinic: Clinic) -> None:
    _, session = await visit(clinic, "RANK")
    overview = await page(clinic, f"/sessions/{session}")
    values = await page(clinic, f"/sessions/{session}/values")
    matches = re.findall(r'href="([^"]*)">\s*<span class="rank"[^>]*>(\d)<', overview)
    assert matches
    proofs = {rank: address for address, rank in matches}
    rows = re.findall(
        r'<span class="rank"[^>]*>(\d)</span>\s*<a class="plain" href="([^"]*)"', overview + values
    )
    for rank, address in rows:
        assert proofs.pop(rank) == address
        await page(clinic, address)
    assert set(proofs.values()) == {"#limits"}
    assert 'id="limits"' in overview
    assert all(
        f'aria-hidden="true">{rank}</span></summary>' in re.sub(r"\s+<", "<", values) for rank in proofs
    )
