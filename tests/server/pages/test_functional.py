"""The session page of a functional test: total, segments, norm, last visit, times by hand."""

from __future__ import annotations

import html as escaped
import json
import re
from dataclasses import replace

import pytest

from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import GivenLimits
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.tug import simulate_tug
from sagittal.server.report.files.exports import analysis_files
from tests.helpers.clinic import Clinic
from tests.helpers.kept import keep
from tests.server import analysed

pytestmark = pytest.mark.anyio

YEAR = 1950


@keep
def files(patient: str, start_s: float | None = None) -> dict[str, bytes]:
    simulation = simulate_tug(patient, 1, setup=replace(ON_SKIN, worn=("pelvis",)))
    return analysis_files(analyse(replace(simulation.recording, test_limits=GivenLimits(start_s))))


@pytest.fixture(scope="module")
async def visits(clinic: Clinic) -> list[str]:
    """Two visits of one person, the second one corrected by hand."""
    result = []
    async with clinic.client("admin") as client:
        user = {"code": "TUG", "birth_year": YEAR}
        patient = (await client.post("/api/v1/patients", json=user)).json()["id"]
        for day, content in (("2026-01-10", files("elderly")), ("2026-03-10", files("healthy", 3.0))):
            requests = {"title": "Up and go", "protocol": "tug", "performed_on": day}
            body = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()
            analysed.finish(clinic, patient, body["id"], content)
            result.append(str(body["id"]))
    return result


async def page(clinic: Clinic, path: str) -> str:
    async with clinic.client("admin") as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


def card_of(html: str) -> str:
    card = html[html.index('id="h-test"') :]
    return card[: card.index("</section>")]


@pytest.mark.slow
async def test_the_card_has_total_segments_norm_and_no_last_visit_at_first(
    clinic: Clinic, visits: list[str]
) -> None:
    card = card_of(await page(clinic, f"/sessions/{visits[0]}"))
    total = re.search(r'class="v">([\d.]+)<', card)
    assert total is not None
    assert float(total.group(1)) == pytest.approx(20.9, abs=0.3)
    labels = re.findall(r"<td>(.*?)</td>", card)
    assert labels == ["Rising", "Walk out", "Turn", "Walk back", "Turn and sitting down"]
    assert card.count("<rect") == 5
    assert "slower than average above 10.2 s" in card
    assert "Bohannon 2006" in card
    assert "Previous visit" not in card
    assert "measured by the sensor: pelvis" in card


@pytest.mark.slow
async def test_values_that_have_no_side_have_no_columns_of_sides(clinic: Clinic, visits: list[str]) -> None:
    html = await page(clinic, f"/sessions/{visits[0]}")
    table = html[html.index('<table class="tbl tight params ten click">') :]
    head = re.findall(r"<th(?: [^>]*)?>\s*(.*?)\s*</th>", table[: table.index("</thead>")], re.DOTALL)
    assert head == ["Parameter", "Value"]
    assert "○ right" not in html
    assert re.search(r"Timed up and go</a>.*?<td class=\"n\">.*?>2[01]\.\d", table, re.DOTALL)


async def test_the_second_visit_stands_beside_the_first_and_tells_the_hand(
    clinic: Clinic, visits: list[str]
) -> None:
    html = await page(clinic, f"/sessions/{visits[1]}")
    card = card_of(html)
    initial = card[card.index("Previous visit") :]
    assert re.search(r'class="v">2[01]\.\d<', initial)
    assert "start and end confirmed or set manually" in card
    assert "No strides" not in html
    match = re.search(r'name="manifest" data-type="json" value="(.*?)"', card)
    assert match is not None
    assert "test_limits" not in json.loads(escaped.unescape(match.group(1)))
    assert 'name="manifest.test_limits.start_s"' in card
    assert 'value="3.00"' in card


@pytest.mark.parametrize("part", ["kinematics", "data", "print", "timeline", "parameters/tug_duration_s"])
async def test_the_other_pages_of_the_session_open(clinic: Clinic, visits: list[str], part: str) -> None:
    assert "TUG" in await page(clinic, f"/sessions/{visits[1]}/{part}")


async def test_the_api_tells_the_test(clinic: Clinic, visits: list[str]) -> None:
    async with clinic.client("admin") as client:
        body = (await client.get(f"/api/v1/sessions/{visits[1]}/report")).json()
    test = body["functional"]
    assert [s["label"] for s in test["segments"]][:2] == ["Rising", "Walk out"]
    assert test["corrected"]
    assert body["quality"]["kind"] == "ok"
    rows = {p["name"]: p for p in body["parameters"]}
    assert rows["tug_duration_s"]["both"]["uncertainty"] > 0.0


async def test_a_new_visit_offers_the_tests(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        response = await client.post("/api/v1/patients", json={"code": "NEW"})
        html = (await client.get(f"/patients/{response.json()['id']}/sessions/new")).text
    for name in ("tug", "five_sit_to_stand", "walk_10m", "walk_6min", "standing_eyes_open"):
        assert f'value="{name}"' in html


async def test_a_test_without_curves_has_no_tab_and_no_sheet_of_them(
    clinic: Clinic, visits: list[str]
) -> None:
    overview = await page(clinic, f"/sessions/{visits[0]}")
    tabs = overview[overview.index('class="tabs"') :]
    tabs = tabs[: tabs.index("</nav>")]
    assert "Kinematics" not in tabs
    assert "Algorithms" not in tabs
    assert "Timeline" in tabs
    assert "<gait-view" not in overview
    assert "This test has no curves" in await page(clinic, f"/sessions/{visits[0]}/kinematics")
    assert "Filters can be compared on walks only" in await page(clinic, f"/sessions/{visits[0]}/algorithms")
    paper = await page(clinic, f"/sessions/{visits[0]}/print")
    assert paper.count('class="sheet paper"') == 1
    assert "<h1>Timed up and go</h1>" in paper
    assert "mean of 0" not in paper
