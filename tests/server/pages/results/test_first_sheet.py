"""The first sheet of paper: the profile where it has room, the trend of visits walked alike."""

from __future__ import annotations

import ctypes.util
import datetime as dt
import io
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import pypdfium2
import pytest

from sagittal.server.pages.results import session as session_page
from sagittal.server.pages.results.first_sheet import has_room_for_profile
from sagittal.server.report.view.headline import Headline, HeadlineSentence
from sagittal.server.results import comparisons
from sagittal.server.sharing.signed_reports import ASSESSMENT_CHARACTERS
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio
DAY = dt.date(2026, 11, 18)


def test_the_profile_stands_on_the_first_sheet_where_it_has_room() -> None:
    long = HeadlineSentence("gait_speed_mps", None, "speed", "norm", 2.0, "x" * 60, "y", "", "the norm")
    report: dict[str, Any] = {"score": {}, "bars": [{}] * 4, "since": None, "trend": None}
    report["headline"] = Headline("Good", (long,) * 5)
    assert has_room_for_profile(report, "x" * ASSESSMENT_CHARACTERS, "Short note")
    assert not has_room_for_profile(report, "x" * (ASSESSMENT_CHARACTERS + 1), "")
    assert not has_room_for_profile(report, "a\n\nb\n\nc\n\nd", "")
    assert not has_room_for_profile(report, "", "x" * 400)
    assert not has_room_for_profile(report | {"score": None}, "", "")
    # with a column of changes the rows of the table take two lines
    assert not has_room_for_profile(
        report | {"since": object(), "headline": Headline("Good", (long,) * 6)}, "", "Note"
    )


def walked(files: Mapping[str, bytes], speed_mps: float | None) -> dict[str, bytes]:
    """The same walk at another speed, or too short for one."""
    document = json.loads(files["analysis.json"])
    for row in document["parameters"]:
        if row["name"] == "gait_speed_mps":
            row |= dict.fromkeys(("mean", "sd", "ci_low", "ci_high"), speed_mps)
            row["reason"] = None if speed_mps else "few_strides"
    return {**files, "analysis.json": json.dumps(document).encode()}


async def add_visits(
    clinic: Clinic,
    code: str,
    files: Mapping[str, bytes],
    visits: Sequence[tuple[float | None, dict[str, Any]]],
) -> str:
    """Patient with visits four weeks apart, each with speed and conditions; return the last id."""
    session = ""
    async with clinic.client("clinician") as client:
        person = {"code": code, "height_m": 1.75, "sex": "male", "birth_year": 1961}
        patient = (await client.post("/api/v1/patients", json=person)).json()["id"]
        for back, (speed_mps, message) in zip(range(len(visits) - 1, -1, -1), visits, strict=True):
            day = (DAY - dt.timedelta(days=28 * back)).isoformat()
            requests = {"title": "Walk", "performed_on": day, **message}
            session = (await client.post(f"/api/v1/patients/{patient}/sessions", json=requests)).json()["id"]
            analysed.finish(clinic, patient, session, walked(files, speed_mps))
    return session


async def read_trend(clinic: Clinic, session: str, language: str = "en") -> list[list[str]] | None:
    """The rows of the trend on the print page as text, None without one."""
    async with clinic.client("viewer", {"accept-language": language}) as client:
        html = (await client.get(f"/sessions/{session}/print")).text
    match = re.search(r'<table class="tbl r-tbl r-trend">(.*?)</table>(.*?)</section>', html, re.DOTALL)
    if match is None:
        return None
    rows = re.findall(r"<tr>(.*?)</tr>", match[1], re.DOTALL)
    texts = [[plain(c) for c in re.findall(r"<t[hd].*?>(.*?)</t[hd]>", row, re.DOTALL)] for row in rows]
    return [*texts, [plain(match[2])]]


def plain(html: str) -> str:
    return " ".join(re.sub(r"<.*?>", " ", html.replace("\xad", "").replace("&nbsp;", " ")).split())


@pytest.mark.sweep
async def test_the_trend_follows_visits_walked_alike_from_the_third_on(clinic: Clinic) -> None:
    files = analysed.files()
    two = await add_visits(clinic, "T-2", files, [(0.5, {}), (0.6, {})])
    assert await read_trend(clinic, two) is None
    second: list[tuple[float | None, dict[str, Any]]] = [
        (0.5, {}),
        (1.9, {"pace": "fast"}),
        (0.55, {}),
        (1.8, {"feedback": True}),
        (0.7, {}),
    ]
    mixed = await read_trend(clinic, await add_visits(clinic, "T-3", files, second))
    assert mixed is not None
    assert mixed[0] == ["Trend same condition", "29 Jul 2026", "23 Sep 2026", "18 Nov 2026", "",
                        "Since the first visit"]  # fmt: skip
    # MDC 0.15 m/s (Lewek 2019)
    assert mixed[1] == ["Gait speed m/s", "0.50", "0.55", "0.70", "", "+0.20 changed MDC 0.15"]
    assert [row[0] for row in mixed[2:4]] == ["Sagittal profile score ° L", "Sagittal profile score ° R"]
    assert [row[-1] for row in mixed[2:4]] == ["0.0 no limit known"] * 2
    assert mixed[-1] == [""]
    fed = await add_visits(clinic, "T-4", files, [(0.5, {}), (0.6, {}), (0.6, {}), (0.7, {"feedback": True})])
    assert await read_trend(clinic, fed) is None


@pytest.mark.sweep
async def test_a_change_since_a_later_visit_than_the_first_says_so(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A training in the first column is nothing to compare with."""
    monkeypatch.setattr(comparisons, "classify_visit", lambda s, _: s.title)
    kinds = [(0.5, "training"), (0.8, "assessment"), (0.9, "training")]
    visits = [(speed, {"title": kind}) for speed, kind in kinds]
    trend = await read_trend(clinic, await add_visits(clinic, "T-70", analysed.files(), visits))
    assert trend is not None
    assert trend[1][1:4] == ["0.50", "0.80", "0.90"]
    assert trend[1][-1].startswith("+0.10")
    assert trend[-1][0].startswith("Gait speed: change since 21 Oct 2026.")


@pytest.mark.sweep
async def test_the_takes_of_a_day_are_one_visit_of_the_trend(clinic: Clinic) -> None:
    files = analysed.files()
    first = {"performed_on": "2026-09-23"}
    twice: list[tuple[float | None, dict[str, Any]]] = [(0.5, first), (0.6, first), (0.7, {})]
    assert await read_trend(clinic, await add_visits(clinic, "T-71", files, twice)) is None
    trend = await read_trend(
        clinic, await add_visits(clinic, "T-72", files, [(0.4, first), *twice, (0.8, {})])
    )
    assert trend is not None
    assert trend[1][1:-2] == ["0.60", "0.70", "0.80"]


@pytest.mark.sweep
async def test_a_visit_without_the_number_has_a_dash_and_the_reason(clinic: Clinic) -> None:
    files = analysed.files()
    late = await add_visits(clinic, "T-5", files, [(None, {}), (0.5, {}), (0.58, {})])
    trend = await read_trend(clinic, late)
    assert trend is not None
    assert trend[1][1:] == ["–", "0.50", "0.58", "", "+0.08 within error MDC 0.15"]
    reason = "not measured: requires at least 10 included strides"
    assert trend[-1] == [f"No value: 23 Sep 2026, {reason}. Gait speed: change since 21 Oct 2026."]
    lacking = await read_trend(clinic, await add_visits(clinic, "T-6", files, [(0.5, {})] * 9 + [(None, {})]))
    assert lacking is not None
    # of ten visits the first and the last four, the others are in the drawn line
    assert lacking[0][1:6] == ["11 Mar 2026", "… 26 Aug 2026", "23 Sep 2026", "21 Oct 2026", "18 Nov 2026"]
    assert lacking[1][1:] == ["0.50"] + ["0.50"] * 3 + ["–", "", "–"]
    german = await read_trend(clinic, late, "de")
    assert german is not None
    assert german[1][-1] == "+0,08 im Messfehler MDC 0,15"
    assert german[-1][0].endswith("Ganggeschwindigkeit: Veränderung seit 21.10.2026.")


@pytest.mark.sweep
async def test_all_that_the_doctor_reads_stands_on_one_sheet_in_german(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many lines and as long an assessment as fit next to the profile."""
    if ctypes.util.find_library("pangoft2-1.0") is None:
        pytest.skip("the system library Pango is not installed")
    requests: list[tuple[Mapping[str, Any], str]] = []

    def listen(report: Mapping[str, Any], assessment: str, note: str) -> bool:
        requests.append((report, assessment))
        return has_room_for_profile(report, assessment, note)

    monkeypatch.setattr(session_page, "has_room_for_profile", listen)
    session = await add_visits(
        clinic, "T-7", analysed.files(), [(None, {}), *[(0.6 + 0.02 * i, {}) for i in range(9)]]
    )
    text = "\n\n".join(["lang genug " * 12] * 3)[:ASSESSMENT_CHARACTERS]
    async with clinic.client("clinician", {"accept-language": "de"}) as client:
        await client.put(f"/api/v1/sessions/{session}/assessment", json={"content": text})
        await client.get(f"/sessions/{session}/print")
        note = next(
            n for n in ("x " * k for k in range(700, 0, -1)) if has_room_for_profile(*requests[-1], n)
        )
        await client.patch(f"/api/v1/sessions/{session}", json={"note": note})
        answer = await client.get(f"/sessions/{session}/report.pdf")
    pages = pypdfium2.PdfDocument(io.BytesIO(answer.content))
    first = plain(pages[0].get_textpage().get_text_range())
    for there in ("Was auffällt", "Verändert seit", "Ganggeschwindigkeit", "Verlauf gleiche Bedingung",
                  "Kein Wert: 11.03.2026", "Knieflexion", "Fußkontakt", "Abstand von der Norm", "Beurteilung",
                  "Unterschrift", "1 / 4"):  # fmt: skip
        assert there in first, there
