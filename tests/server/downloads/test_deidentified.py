"""Research export: no identity, correct intervals, re-identification by the key only."""

from __future__ import annotations

import csv
import datetime as dt
import io
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from sagittal.core.events.edits import Edit
from sagittal.server import audit
from sagittal.server.clinic import consents, patients, sessions
from sagittal.server.commands.research import research
from sagittal.server.downloads.deidentified import MOST_SHIFT_DAYS, open_key
from sagittal.server.report.files.columns import read_table
from sagittal.server.results import reviews
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.engines import tell_commands
from tests.server import analysed, walk

pytestmark = pytest.mark.anyio

CANARY = "Swordfish"
DAYS = (dt.date(2025, 3, 3), dt.date(2025, 3, 24))


@pytest.fixture
async def clinic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Clinic]:
    async with open_clinic(tmp_path / "data") as result:
        tell_commands(monkeypatch, result.settings)
        yield result


def _fill(clinic: Clinic) -> tuple[str, list[str]]:
    with clinic.db.write() as c:
        person = patients.create(
            c, None, code=f"{CANARY}-1", note=f"{CANARY} street", birth_year=1930, height_m=1.61, sex="female"
        ).id
        other_id = patients.create(c, None, code=f"{CANARY}-2").id
        visits = [
            sessions.create(c, None, person, title=f"{CANARY} walk", note=CANARY, performed_on=day).id
            for day in DAYS
        ]
        sessions.create(c, None, other_id, title="nothing recorded")
        consents.give(c, None, person, purpose="research", evidence=f"{CANARY} form")
    for visit in visits:
        analysed.finish(clinic, person, visit, analysed.files())
    return person, visits


def _write(clinic: Clinic, out: Path, key: Path, **options: object) -> int:
    inputs = {"patients": (), "signals": False, "without_consent": False, "who": None, **options}
    return research(out, data_dir=clinic.settings.data_dir, key=key, **inputs)  # type: ignore[arg-type]


def _read(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert {info.date_time[0] for info in archive.infolist()} == {1980}
        return {name: archive.read(name) for name in archive.namelist()}


def _cells(text: bytes) -> set[str]:
    return {cell for row in csv.reader(io.StringIO(text.decode())) for cell in row}


def _table(files: dict[str, bytes], name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(files[f"{name}.csv"].decode())))


@pytest.mark.slow
async def test_nothing_says_who_and_only_the_key_leads_back(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    person, visits = _fill(clinic)
    contact = walk.events().times("left", "ic")[3]
    edit = Edit("exclude_stride", "left", contact + 0.5, reason=f"{CANARY} stumbled")
    reviews.make(clinic.db, clinic.app.state.reviewed, None, visits[0], edit)
    key, out = tmp_path / "research.key", tmp_path / "out.zip"
    assert _write(clinic, out, key, signals=True) == 0
    assert "1 patients; 1 have not agreed" in capsys.readouterr().out
    assert key.stat().st_mode & 0o077 == 0
    files = _read(out)

    # no word, id, day, checksum or serial number of it
    by_name = {name: content for name, content in files.items() if name != "README.md"}
    hidden = [CANARY, person, *visits, "F-left", "walk.txt", "sha256"]
    assert [word for word in hidden if word.encode() in b"".join(by_name.values())] == []
    cells = {cell for name, text in by_name.items() if name.endswith(".csv") for cell in _cells(text)}
    assert not cells & {"1930", "A1", "ff"}
    measured = [read_table(content) for name, content in by_name.items() if name.startswith("signals/")]
    assert [set(meta) for _, meta in measured] == [{"schema", "rate_hz"}] * 2
    assert all("foot_l_gyr_y_dps" in table.column_names for table, _ in measured)
    reasons = {row["excluded_reason"] for row in _table(files, "strides")}
    assert "manual" in reasons

    # the time between visits stays, the day and the age do not
    rows = _table(files, "visits")
    first, second = [dt.date.fromisoformat(row["shifted_day"]) for row in rows]
    assert second - first == DAYS[1] - DAYS[0]
    assert 1 <= (DAYS[0] - first).days <= MOST_SHIFT_DAYS
    assert {(row["age_years"], row["age_is_least"]) for row in rows} == {("89", "1")}
    (subject,) = {row["subject"] for row in rows}
    for name in ("persons", "parameters", "strides", "curves", "events"):
        assert {row["subject"] for row in _table(files, name)} == {subject}, name

    # the same key gives the same again, another one another pseudonym
    assert _write(clinic, tmp_path / "again.zip", key, signals=True) == 0
    assert (tmp_path / "again.zip").read_bytes() == out.read_bytes()
    assert _write(clinic, tmp_path / "none.zip", key, who=subject) == 0
    assert f"{subject} is {CANARY}-1" in capsys.readouterr().out
    assert not (tmp_path / "none.zip").exists()
    foreign = tmp_path / "other.key"
    assert open_key(foreign).name_person(person) != subject
    assert _write(clinic, tmp_path / "none.zip", foreign, who=subject) == 1


@pytest.mark.slow
async def test_who_has_not_agreed_is_in_it_only_when_that_is_said(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _fill(clinic)
    key, out = tmp_path / "research.key", tmp_path / "out.zip"
    chosen = [f"{CANARY}-2"]
    assert _write(clinic, out, key, patients=chosen) == 1
    assert "agreed to research" in capsys.readouterr().err
    assert _write(clinic, out, key, patients=["nobody"]) == 1
    assert not out.exists()
    assert _write(clinic, out, key, patients=chosen, without_consent=True) == 0
    files = _read(out)
    assert [row["reason"] for row in _table(files, "left_out")] == ["not_found"]
    assert not [name for name in files if name.startswith("signals/")]
    with clinic.db.read() as c:
        assert [row.action for row in audit.list_entries(c, limit=1)] == ["patient.deidentified"]
    key.write_text("no key")
    assert _write(clinic, out, key) == 1
    assert "64 hex digits" in capsys.readouterr().err
