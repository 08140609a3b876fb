"""Edits as rows: append-only, in order, one winner when two people edit at once, nothing left in memory."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from sqlalchemy import delete, func, select, update
from sqlalchemy.exc import IntegrityError as DatabaseIntegrityError

from sagittal.core.events.edits import Edit
from sagittal.server.clinic import patients, sessions
from sagittal.server.errors import Conflict
from sagittal.server.results import analyses, edit_log, reviews
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import erasure
from sagittal.server.storage.schema import tables
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed, walk

pytestmark = pytest.mark.anyio

CONTACT = walk.events().times("right", "ic")[4]
MOVE = Edit("move_event", "right", CONTACT, "ic", CONTACT + 0.03)
LEAVE_OUT = Edit("exclude_stride", "right", CONTACT + 0.4, reason="stumbled")


@pytest.fixture
async def clinic(tmp_path: Path, anyio_backend: str) -> AsyncIterator[Clinic]:
    async with open_clinic(tmp_path) as running:
        yield running


def session_of(clinic: Clinic) -> str:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="P-1", height_m=1.75).id
        session = sessions.create(c, None, patient).id
    analysed.finish(clinic, patient, session, analysed.files())
    return session


def make(clinic: Clinic, session: str, edit: Edit, observations: int | None = None) -> edit_log.EditHistory:
    return reviews.make(clinic.db, clinic.app.state.reviewed, None, session, edit, base_version=observations)[
        1
    ]


def rows(clinic: Clinic) -> list[str]:
    with clinic.db.read() as c:
        return list(c.execute(select(tables.edit.c.kind).order_by(tables.edit.c.seq)).scalars())


@pytest.mark.slow
async def test_undo_is_a_row_and_nothing_is_ever_rewritten(clinic: Clinic) -> None:
    session = session_of(clinic)
    make(clinic, session, MOVE)
    make(clinic, session, LEAVE_OUT)
    _, final = reviews.undo(clinic.db, None, session)
    assert final.edits == (MOVE,)
    assert rows(clinic) == ["move_event", "exclude_stride", "undo"]
    with pytest.raises(DatabaseIntegrityError, match="append-only"), clinic.db.write() as c:
        c.execute(update(tables.edit).values(kind="undo"))


async def test_a_number_of_a_state_is_never_given_twice(clinic: Clinic) -> None:
    session = session_of(clinic)
    first = make(clinic, session, MOVE).version
    with clinic.db.write() as c:
        c.execute(delete(tables.edit))
    assert make(clinic, session, MOVE).version > first


async def test_who_measured_on_a_state_that_changed_meanwhile_is_refused(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = session_of(clinic)
    measure = clinic.app.state.reviewed.measure_anew
    calls = []

    def interrupted(*args: object) -> object:
        calls.append(args)
        if len(calls) == 1:
            make(clinic, session, LEAVE_OUT)  # a colleague, while the numbers are being computed
        return measure(*args)

    monkeypatch.setattr(clinic.app.state.reviewed, "measure_anew", interrupted)
    with pytest.raises(Conflict) as refused:
        make(clinic, session, MOVE)
    assert refused.value.code == "edited_meanwhile"
    assert rows(clinic) == ["exclude_stride"]


async def test_an_edit_that_is_refused_leaves_no_row(clinic: Clinic) -> None:
    session = session_of(clinic)
    with pytest.raises(Exception, match="no right initial contact"):
        make(clinic, session, Edit("delete_event", "right", CONTACT + 0.2, "ic"))
    assert rows(clinic) == []


async def test_what_is_measured_is_kept_for_the_state_and_undo_finds_it_again(clinic: Clinic) -> None:
    session = session_of(clinic)
    reviewed: ReviewedAnalyses = clinic.app.state.reviewed
    one = make(clinic, session, MOVE)
    with clinic.db.read() as c:
        analysis = analyses.get_shown(c, session)
    stored_measurement = reviewed.measure(analysis, one)
    make(clinic, session, LEAVE_OUT)
    _, back = reviews.undo(clinic.db, None, session)
    assert back.version != one.version
    assert reviewed.measure(analysis, back) is stored_measurement


async def test_an_erased_session_is_erased_from_memory_too(clinic: Clinic) -> None:
    session = session_of(clinic)
    make(clinic, session, MOVE)
    reviewed: ReviewedAnalyses = clinic.app.state.reviewed
    assert len(reviewed._analyses) > 0
    erasure.erase_session(clinic.db, clinic.app.state.reviewed, clinic.settings, None, session)
    assert len(reviewed._analyses) == 0
    assert len(reviewed._results) == 0
    with clinic.db.read() as c:
        assert c.execute(select(func.count()).select_from(tables.edit)).scalar_one() == 0
