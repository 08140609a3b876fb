"""A patient's page: visits with their takes, speed and change, notes by date."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

import pytest

from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio

API = "/api/v1"


async def walked(clinic: Clinic, code: str, walks: Sequence[tuple[str, float, dict[str, Any]]]) -> list[str]:
    """Patient with analysed walks of a day, with speed and conditions; return their ids."""
    result = []
    async with clinic.client("admin") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        for day, speed, more in walks:
            body = {"title": f"Walk at {speed}", "performed_on": day, "pace": "comfortable", **more}
            session = (await client.post(f"{API}/patients/{patient}/sessions", json=body)).json()["id"]
            files = dict(analysed.files())
            document = json.loads(files["analysis.json"])
            for p in document["parameters"]:
                if p["name"] == "gait_speed_mps":
                    p |= {"mean": speed, "sd": 0.02, "n": 40, "ci_low": speed - 0.01, "ci_high": speed + 0.01}
            files["analysis.json"] = json.dumps(document).encode()
            analysed.finish(clinic, patient, session, files)
            result.append(session)
    return [patient, *result]


async def text_of(clinic: Clinic, path: str, role: str = "admin") -> str:
    async with clinic.client(role) as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


def rows_of(html: str) -> list[str]:
    body = re.search(r'<table class="tbl click (?:results|patients)">.*?</table>', html, re.DOTALL)
    assert body is not None
    rows = re.findall(r"<tr[^>]* data-href.*?</tr>", body[0], re.DOTALL)
    return [re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", row)).strip() for row in rows]


@pytest.mark.slow
async def test_takes_of_a_day_walked_alike_are_one_visit_with_their_mean(clinic: Clinic) -> None:
    patient, _, _, _, fast = await walked(
        clinic,
        "V-1",
        [
            ("2026-03-02", 0.60, {}),
            ("2026-04-06", 0.90, {}),
            ("2026-04-06", 1.00, {}),
            ("2026-04-06", 1.40, {"pace": "fast"}),
        ],
    )
    html = await text_of(clinic, f"/patients/{patient}")
    rows = rows_of(html)
    whole = next(r for r in rows if "2 trials" in r)
    assert "0.95" in whole
    assert "+0.35 changed" in whole, "the mean of the takes against the visit before"
    assert [r for r in rows if re.search(r"trial 1\b.*0\.90", r)]
    assert [r for r in rows if re.search(r"trial 2\b.*1\.00", r)]
    assert "first in this condition" in next(r for r in rows if "Walk at 1.4" in r)
    assert "first in this condition" in next(r for r in rows if "Walk at 0.6" in r)
    assert 'aria-label="Trials 0.90, 1.00, mean 0.95 m/s"' in html
    assert html.count('name="visit"') == 4, "every take can be compared"
    page = await text_of(clinic, f"/sessions/{fast}")
    assert "No earlier visit in this condition" in page


async def test_a_take_is_compared_with_the_day_before_and_not_with_the_take_before(clinic: Clinic) -> None:
    _, first, _, last = await walked(
        clinic, "V-2", [("2026-03-02", 0.60, {}), ("2026-04-06", 0.90, {}), ("2026-04-06", 1.00, {})]
    )
    html = await text_of(clinic, f"/sessions/{last}")
    takes = html[html.index("2 trials in this visit") :]
    takes = takes[: takes.index("</details>")]
    row = next(r for r in re.findall(r"<tr>.*?</tr>", takes, re.DOTALL) if "Gait speed" in r)
    assert re.findall(r"0\.\d\d ± 0\.02|1\.00 ± 0\.02|<b>0\.95</b>", row) == [
        "0.90 ± 0.02", "1.00 ± 0.02", "<b>0.95</b>",
    ]  # fmt: skip
    assert "trials in this visit" not in await text_of(clinic, f"/sessions/{first}")
    assert f"/sessions/{last}/compare/{first}" in html
    assert "Changed since 2 Mar 2026" in html


async def test_notes_stand_by_date_beside_those_of_visits_and_go_with_the_patient(clinic: Clinic) -> None:
    patient, _ = await walked(clinic, "V-5", [("2026-03-02", 0.60, {"note": "Tired after six minutes."})])
    async with clinic.client("clinician") as client:
        for day, text in (("2026-03-05", "New orthosis."), ("2026-02-20", "Wants to walk to the bakery.")):
            answer = await client.post(
                f"{API}/patients/{patient}/notes", json={"content": text, "written_on": day}
            )
            assert answer.status_code == 201, answer.text
        empty = await client.post(f"{API}/patients/{patient}/notes", json={"content": "  "})
        assert empty.status_code == 422
        listed = (await client.get(f"{API}/patients/{patient}/notes")).json()
        assert [(n["written_on"], n["by"]) for n in listed] == [
            ("2026-03-05", "clinician"),
            ("2026-02-20", "clinician"),
        ]
        html = (await client.get(f"/patients/{patient}")).text
        indexes = [html.index(s) for s in ("New orthosis.", "Tired after six", "Wants to walk")]
        assert indexes == sorted(indexes)
        gone = await client.delete(f"{API}/notes/{listed[0]['id']}")
        assert gone.status_code == 204
        assert "New orthosis." not in (await client.get(f"/patients/{patient}")).text
        erased = await client.delete(f"{API}/patients/{patient}?confirm=V-5")
        assert erased.status_code == 204, erased.text
    async with clinic.client("viewer") as client:
        assert (
            await client.post(f"{API}/patients/{patient}/notes", json={"content": "x"})
        ).status_code == 403


async def test_who_may_not_plan_or_map_is_not_led_there(clinic: Clinic) -> None:
    patient, session = await walked(clinic, "V-ROLES", [("2026-03-02", 0.60, {})])
    async with clinic.client("viewer") as client:
        assert "Plan a programme" not in (await client.get(f"/patients/{patient}")).text
        assert "A clinician can start one." in (await client.get(f"/patients/{patient}/programme")).text
        data = (await client.get(f"/sessions/{session}/data")).text
        assert "Change mapping" not in data
    async with clinic.client("clinician") as client:
        assert "Plan a programme" in (await client.get(f"/patients/{patient}")).text
        assert "Change mapping" in (await client.get(f"/sessions/{session}/data")).text
