"""The session page of a take of squats."""

from __future__ import annotations

import json
import re

import pytest

from sagittal.core.pipeline import analyse
from sagittal.core.simulate import RecordingSetup, Squats, simulate_squats
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.squat_chain import place_as_agreed
from sagittal.server.report.files.exports import analysis_files
from tests.core.body.chain.squats import HEIGHT_M, squat_on
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
async def session(clinic: Clinic) -> str:
    """A visit with three squats, the second of them left out."""
    files = analysis_files(analyse(squat_on("left", 50.0, MEMS).recording))
    rows = files["repetitions.csv"].decode().splitlines()
    start = rows[2].split(",")[:4]
    rows[2] = ",".join([*start, *[""] * (len(rows[2].split(",")) - 5), "foot_moved"])
    files["repetitions.csv"] = "\n".join(rows).encode()
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "SQUAT"})).json()["id"]
        requests = {"title": "Squats", "protocol": "squat"}
        body = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()
    analysed.finish(clinic, patient, body["id"], files)
    return str(body["id"])


async def page(clinic: Clinic, path: str) -> str:
    async with clinic.client("admin") as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


async def test_the_page_lists_every_squat_and_draws_those_that_count(clinic: Clinic, session: str) -> None:
    html = await page(clinic, f"/sessions/{session}")
    card = html[html.index('id="h-squats"') :]
    card = card[: card.index("</section>")]
    assert "Squats, left leg" in card
    rows = re.findall(r"<tr>\s*<td.*?</tr>", card, re.DOTALL)
    assert len(rows) == 3
    assert "the foot moved" in rows[1]
    assert "–" in rows[1]
    assert "the foot moved" not in rows[0] + rows[2]
    assert card.count("chart cycle x-unit") == 6
    assert "% of squat" in card
    assert "gait cycle" not in card
    assert "left mean of 2 squats" in card
    assert "mean of the included squats" in html
    assert "Depth: knee flexion at the lowest point" in html
    assert "No strides" not in html
    assert "There is no norm for squats." in html


@pytest.mark.parametrize("part", ["kinematics", "data", "print", "parameters/squat_depth_deg", "timeline"])
async def test_the_other_pages_of_the_session_open(clinic: Clinic, session: str, part: str) -> None:
    html = await page(clinic, f"/sessions/{session}/{part}")
    assert "SQUAT" in html
    if part == "data":
        assert "repetitions.csv" in html


async def test_what_is_said_of_strides_is_not_said_of_squats(clinic: Clinic, session: str) -> None:
    timeline = await page(clinic, f"/sessions/{session}/timeline")
    assert "Squats have no contacts or strides." in timeline
    assert "earlier version" not in timeline
    assert "Run again" not in timeline
    kinematics = await page(clinic, f"/sessions/{session}/kinematics")
    assert "Curves of squats are on the overview" in kinematics
    assert "no included stride on this side" not in kinematics
    algorithms = await page(clinic, f"/sessions/{session}/algorithms")
    assert "Filters can be compared on walks only" in algorithms
    assert "Run on this trial" not in algorithms


async def test_paper_has_every_squat_and_their_curves(clinic: Clinic, session: str) -> None:
    paper = await page(clinic, f"/sessions/{session}/print")
    assert "Squats, left leg" in paper
    assert paper.count("chart cycle x-unit") == 6
    assert "the foot moved" in paper
    assert "no stride" not in paper
    assert "Walked" not in paper


async def test_the_form_of_a_new_visit_offers_squats(clinic: Clinic, session: str) -> None:
    async with clinic.client("admin") as client:
        patient = (await client.get(f"/api/v1/sessions/{session}")).json()["patient_id"]
    form = await page(clinic, f"/patients/{patient}/sessions/new")
    assert re.findall(r'name="protocol" value="(\w+)"', form)[:3] == ["walk", "treadmill", "squat"]


async def test_the_api_tells_the_squats(clinic: Clinic, session: str) -> None:
    async with clinic.client("admin") as client:
        body = (await client.get(f"/api/v1/sessions/{session}/report")).json()
    assert body["squats"]["sides"] == ["left"]
    assert body["squats"]["used"] == {"left": 2}
    assert [r["excluded"] for r in body["squats"]["repetitions"]] == [None, "the foot moved", None]
    assert "squat_depth_deg" in {p["name"] for p in body["parameters"]}
    assert json.dumps(body["squats"])


@pytest.fixture(scope="module")
async def both(clinic: Clinic) -> str:
    """A visit with squats of both legs in one take."""
    squats = Squats(repetitions=2, other="lifted", hinged=True)
    setup = RecordingSetup(rate_hz=50.0, noise=MEMS)
    result = simulate_squats(squats, HEIGHT_M, 0, setup, place_as_agreed(HEIGHT_M, squats.sides))
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "BOTH"})).json()["id"]
        requests = {"title": "Squats", "protocol": "squat"}
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()["id"]
    analysed.finish(clinic, patient, session, analysis_files(analyse(result.recording)))
    return str(session)


@pytest.mark.slow
async def test_both_legs_are_side_by_side(clinic: Clinic, both: str) -> None:
    html = await page(clinic, f"/sessions/{both}")
    card = html[html.index('id="h-squats"') :]
    card = card[: card.index("</section>")]
    assert "Squats, both legs" in card
    assert len(re.findall(r"<tr>\s*<td.*?</tr>", card, re.DOTALL)) == 4
    assert card.count("chart cycle x-unit") == 6
    assert "left mean of 2, right mean of 2 squats" in card
    assert "not counted as a squat: 1 of the left knee and 1 of the right knee." in card
    assert f'replay="/sessions/{both}/replay"' in html
    document = json.loads(re.findall(r'id="replay-data">(.*?)</script>', html, re.DOTALL)[0])
    assert [side for side, *_ in document["strides"]] == ["right", "right", "left", "left"]
    assert set(document["curves"]["knee_flexion"]) == {"left", "right"}
    paper = await page(clinic, f"/sessions/{both}/print")
    assert "Squats, both legs" in paper
    assert "no stride" not in paper


@pytest.mark.slow
async def test_the_sensitivity_is_a_tab_of_squats(clinic: Clinic, both: str) -> None:
    html = await page(clinic, f"/sessions/{both}")
    assert f'href="/sessions/{both}/sensitivity"' in html
    assert "/algorithms" not in html
    form = await page(clinic, f"/sessions/{both}/sensitivity")
    assert "How sensitive are these angles?" in form
    assert "Run on this trial" in form


async def test_squats_have_no_norm_columns_and_a_low_confidence_names_no_larger_side(
    clinic: Clinic, both: str
) -> None:
    html = await page(clinic, f"/sessions/{both}")
    values = html[html.index('id="rows"') : html.index('id="h-squats"')]
    assert "Compared with norm" not in values
    assert "grey box" not in values
    async with clinic.client("admin") as client:
        body = (await client.get(f"/api/v1/sessions/{both}/report")).json()
    rows = {p["name"]: p for p in body["parameters"]}
    valgus = rows["squat_knee_valgus_bottom_deg"]
    assert valgus["low_confidence"]
    assert (valgus["difference"], valgus["symmetry"]) == (None, None)
    assert not rows["squat_depth_deg"]["low_confidence"]
    tabs = html[html.index('class="tabs"') :]
    assert "Kinematics" not in tabs[: tabs.index("</nav>")]
