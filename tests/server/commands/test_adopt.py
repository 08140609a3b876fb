"""`sagittal adopt`."""

from __future__ import annotations

import pytest

from sagittal.core.formats.live_log import FILE_MARK, hello_json, record
from sagittal.server.clinic import jobs
from sagittal.server.commands.adopt import adopt
from sagittal.server.live_takes import live_recordings
from sagittal.server.uploads import recordings
from tests.faults.clinic import Clinic
from tests.helpers.live_takes import HELLO, frame

STRAY = "a" * 32


@pytest.fixture
def stray(clinic: Clinic) -> str:
    """A live log of twenty batches that the database does not know."""
    path = live_recordings.log_path(clinic.settings.live, STRAY)
    path.parent.mkdir()
    batches = b"".join(record("B", frame(i)) for i in range(20))
    path.write_bytes(FILE_MARK + record("H", hello_json(HELLO)) + batches)
    return STRAY


@pytest.mark.parametrize(("take", "session"), [(STRAY, None), (None, "s1")])
def test_a_take_without_a_session_or_a_session_without_a_take_is_refused(
    clinic: Clinic, capsys: pytest.CaptureFixture[str], take: str | None, session: str | None
) -> None:
    assert adopt(take, session=session, data_dir=clinic.folder) == 2
    assert capsys.readouterr().err.startswith("Give both a take and --session")


def test_strays_are_listed_with_how_to_give_them_away(
    clinic: Clinic, stray: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert adopt(None, session=None, data_dir=clinic.folder) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{stray}  ")
    assert "3 sensors, 20 batches" in first
    assert second == "Give one to a session: sagittal adopt TAKE --session ADDRESS-OF-ITS-PAGE"


def test_without_a_stray_that_is_said(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    assert adopt(None, session=None, data_dir=clinic.folder) == 0
    assert capsys.readouterr().out == "The database knows every live recording.\n"


@pytest.mark.parametrize("address", ["{}", "http://127.0.0.1:8000/sessions/{}/"])
def test_a_stray_becomes_the_recording_of_the_session_and_is_analysed(
    clinic: Clinic, stray: str, address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    session = clinic.session.id
    assert adopt(stray, session=address.format(session), data_dir=clinic.folder) == 0
    assert f"newest recording of /sessions/{session} now" in capsys.readouterr().out
    with clinic.db.read() as c:
        current = recordings.require_current(c, session)
        kinds = {view.kind for view in jobs.of_session(c, session)}
    assert [f.name for f in current.files] != ["a.txt"]
    assert recordings.ANALYSE in kinds


def test_a_session_that_is_not_there_leaves_the_log(
    clinic: Clinic, stray: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert adopt(stray, session="c" * 32, data_dir=clinic.folder) == 1
    assert "no session" in capsys.readouterr().err
    assert live_recordings.log_path(clinic.settings.live, stray).exists()
