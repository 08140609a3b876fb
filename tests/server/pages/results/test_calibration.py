"""The page of a calibration: its verdict, the picture, and what to do."""

from __future__ import annotations

import json
from math import degrees

import pytest

from sagittal.core.calibration import calibrate
from sagittal.core.calibration.score import score_calibration
from sagittal.core.errors import Notice
from sagittal.server.report.view.calibration_checks import view_calibration_checks
from tests.helpers.clinic import Clinic
from tests.helpers.walks import simulated
from tests.server import analysed

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
def walk() -> dict[str, bytes]:
    """Result files with the score of a simulated walk."""
    files = dict(analysed.files())
    stored = json.loads(files["analysis.json"])
    calibrated = calibrate(simulated()[0])
    stored["calibration_score"] = score_calibration(calibrated).to_json()
    mounted = calibrated.calibration.segments.items()
    stored["calibration"]["segments"] = {
        s: {"method": x.method, "forward_sd_deg": None if x.forward_sd is None else degrees(x.forward_sd)}
        for s, x in mounted
    }
    return files | {"analysis.json": json.dumps(stored).encode()}


async def show(clinic: Clinic, code: str, files: dict[str, bytes] | None) -> str:
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": code})).json()["id"]
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json={})).json()["id"]
        if files is not None:
            analysed.finish(clinic, patient, session, files)
        answer = await client.get(f"/sessions/{session}/calibration")
    assert answer.status_code == 200, answer.text
    return answer.text


@pytest.mark.slow
async def test_a_good_calibration(clinic: Clinic, walk: dict[str, bytes]) -> None:
    html = await show(clinic, "GOOD", walk)
    assert "Calibration: all" in html
    assert 'aria-label="Left thigh: pass"' in html
    assert 'href="#checks-thigh_l"' in html
    assert 'id="checks-thigh_l"' in html
    assert 'id="checks-take"' in html
    assert "from standing and walking" in html


async def test_a_failed_check_says_why_and_what_to_do(clinic: Clinic, walk: dict[str, bytes]) -> None:
    files = walk
    stored = json.loads(files["analysis.json"])
    score = stored["calibration_score"]
    score["verdict"] = score["segments"]["shank_l"] = "redo"
    check = next(c for c in score["checks"] if c["segment"] == "shank_l" and c["name"] == "knee_axis")
    check |= {"verdict": "redo", "value": 21.3, "why": "Thigh and shank disagree.", "todo": "Fasten both."}
    sd = stored["calibration"]["segments"]["shank_l"]["forward_sd_deg"]
    slipped = Notice("sensor_slipped", "The sensor on thigh_r slipped by 12°.", "thigh_r", 9.0)
    stored["warnings"] = [slipped.to_json()]
    html = await show(clinic, "BAD", files | {"analysis.json": json.dumps(stored).encode()})
    assert "Calibrate again: 1 of" in html
    assert "at the left shank." in html
    assert 'aria-label="Left shank: redo"' in html
    assert 'aria-label="Right shank: pass"' in html
    assert "Thigh and shank disagree." in html
    assert "Fasten both." in html
    assert "21.3°" in html
    right = html.partition('id="checks-thigh_r"')[2]
    assert "The sensor on right thigh slipped by 12°." in right.partition("</section>")[0]
    assert 1.0 < sd < 8.0
    assert f"forward axis ± {sd:.1f}°" in html


async def test_nothing_to_judge_yet(clinic: Clinic, walk: dict[str, bytes]) -> None:
    assert "No recording yet" in await show(clinic, "EMPTY", None)
    files = walk
    stored = json.loads(files["analysis.json"])
    del stored["calibration_score"]
    html = await show(clinic, "OLD", files | {"analysis.json": json.dumps(stored).encode()})
    assert "No calibration to check" in html


def test_no_score_no_view() -> None:
    assert view_calibration_checks(None, None, ()) is None
