"""Each angle has one title on all pages, responses and files."""

from __future__ import annotations

import csv
import datetime as dt
import io
import re
from collections import Counter
from dataclasses import replace

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.shell import FRAGMENT
from sagittal.server.report.files.exports import angles_parquet
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.server import analysed, walk

pytestmark = pytest.mark.anyio

API = "/api/v1"
STANDING = {"hip_flexion_l": 12.0, "hip_flexion_r": 12.0, "knee_flexion_l": 6.0, "knee_flexion_r": 6.0}


def _visits(clinic: Clinic) -> tuple[str, str]:
    """An earlier visit without a goniometer, and one with."""
    known_variant = replace(walk.angles(), standing_deg=STANDING)
    results = (analysed.files(), {**analysed.files(), "angles.parquet": angles_parquet(known_variant)})
    with clinic.db.write() as c:
        patient = patients.create(c, None, code=f"N-{new_id()[:8]}", height_m=1.75, birth_year=1980).id
        ids = [sessions.create(c, None, patient, performed_on=dt.date(2026, 3, day)).id for day in (2, 30)]
    for session, files in zip(ids, results, strict=True):
        analysed.finish(clinic, patient, session, files)
    return ids[0], ids[1]


def _texts(html: str, pattern: str) -> list[str]:
    return [
        re.sub(r"<[^>]*>|&nbsp;|\s+", " ", matche).strip() for matche in re.findall(pattern, html, re.DOTALL)
    ]


def _rows(html: str) -> list[str]:
    """First cells of the parameter tables, without units and details."""
    tables = re.findall(r'<table class="[^"]*params[^"]*">.*?</table>', html, re.DOTALL)
    return [t for table in tables for t in _texts(table, ROW)]


ROW = r'<tr[^>]*>\s*<td>\s*(?:<span class="rank"[^>]*>\d</span>\s*)?(.*?)(?:<span|</td>)'


def _charts(html: str) -> list[str]:
    return _texts(html, r"<figcaption>\s*<h3>(.*?)</h3>") or _texts(html, r"<figure>\s*<h3>(.*?)</h3>")


@pytest.mark.slow
async def test_no_name_occurs_twice_with_different_values(clinic: Clinic) -> None:
    earlier, session = _visits(clinic)
    async with clinic.client("clinician") as client:

        async def read(address: str) -> str:
            answer = await client.get(address, headers={FRAGMENT: "numbers"})
            assert answer.status_code == 200, (address, answer.text[:300])
            return answer.text

        page = await read(f"/sessions/{session}") + await read(f"/sessions/{session}/values")
        kinematics = await read(f"/sessions/{session}/kinematics")
        paper = await read(f"/sessions/{session}/print")
        compared = await read(f"/sessions/{session}/compare/{earlier}")
        report = (await client.get(f"{API}/sessions/{session}/report")).json()
        parameters = list(csv.DictReader(io.StringIO(await read(f"{API}/sessions/{session}/parameters.csv"))))
        curves = list(csv.DictReader(io.StringIO(await read(f"{API}/sessions/{session}/curves.csv"))))
    for html in (page, paper):
        names = _rows(html)
        assert "Hip flexion at contact, anatomical" in names
        assert max(Counter(names).values()) == 1, Counter(names).most_common(3)
        assert "Hip flexion at contact, relative to standing" not in names
    sheet = paper.partition("<h1>Kinematics</h1>")[2]  # the first sheet has three of these curves too
    for html in (kinematics, sheet):
        titles = _charts(html)
        assert any(t.startswith("Hip flexion") and "anatomical" in t for t in titles), titles
        assert max(Counter(titles).values()) == 1
    assert max(Counter(r["title"] for r in report["parameters"]).values()) == 1
    assert max(Counter((r["name"], r["side"]) for r in parameters).values()) == 1
    (contact,) = (r for r in report["parameters"] if r["name"] == "hip_flexion_ic_anatomical_deg")
    (hip,) = (c for c in report["curves"] if c["variable"] == "hip_flexion")
    assert (hip["zero"], hip["norm"] is None) == ("anatomical", False)
    first = next(
        r for r in curves if (r["variable"], r["side"], r["pct_cycle"]) == ("hip_flexion", "left", "0")
    )
    for message in (hip["sides"]["left"]["mean_deg"][0], float(first["mean_deg"])):
        assert message == pytest.approx(contact["left"]["value"], abs=0.01)
    bare = [c for c in report["curves"] if c["zero"] != "anatomical"]
    assert bare
    assert all(c["norm"] is None for c in bare)
    assert 'class="band"' not in "".join(re.findall(r'<div class="chart cycle.*?</div>', compared, re.DOTALL))
    assert "Hip flexion at contact, relative to standing" in compared
