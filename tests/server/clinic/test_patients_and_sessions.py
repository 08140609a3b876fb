from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from sqlalchemy import select

from sagittal.core.errors import SagittalError
from sagittal.server import audit
from sagittal.server.clinic import jobs, patients, sessions
from sagittal.server.errors import Conflict, NotFound, ServiceError, TooLarge
from sagittal.server.jobs.queue import COMPARE_FILTERS
from sagittal.server.jobs.table import TableQueue
from sagittal.server.results import analyses, filter_runs
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import checks, erasure
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.schema import tables
from sagittal.server.uploads import receiving, recordings, reference_files

NO_TRIGGERS = {
    "sqlite": ("DROP TRIGGER audit_no_update", "DROP TRIGGER audit_no_delete"),
    "postgresql": ("SET LOCAL session_replication_role = replica",),
}
IN_A_FILE = pytest.mark.parametrize("source", ["sqlite"], indirect=True)
"""Tests that look at the bytes of the database's file."""


@dataclass(frozen=True)
class Person:
    user_id: str = "1" * 32
    name: str = "ada"


class Clinic:
    def __init__(self, folder: Path, source: Source) -> None:
        url = source if isinstance(source, str) else ""
        self.settings = Settings(
            data_dir=folder, database_url=url, min_free_bytes=0, max_file_bytes=1000, max_files=3
        )
        self.db = Database(source)
        self.blobs = FolderBlobs(self.settings.blobs)
        self.queue = TableQueue(self.db, 15.0)
        self.who = Person()

    def patient(self, code: str = "P-1") -> str:
        with self.db.write() as c:
            return patients.create(c, self.who, code=code, height_m=1.75).id

    def session(self, patient_id: str, day: dt.date = dt.date(2026, 3, 1)) -> str:
        with self.db.write() as c:
            return sessions.create(c, self.who, patient_id, performed_on=day).id

    def upload(
        self, session_id: str, name: str = "a.txt", content: bytes = b"signals"
    ) -> recordings.RecordedFile:
        with receiving.receive(self.db, self.blobs, self.settings, self.who, session_id, name) as upload:
            upload.write(content)
            return upload.keep()

    def recording(self, session_id: str) -> recordings.StoredRecording:
        with self.db.read() as c:
            current = recordings.current(c, session_id)
        assert current is not None
        return current

    def analyse(self, session_id: str, content: bytes = b"{}") -> analyses.AnalysisRecord:
        """Publish an analysis like a worker, without results."""
        with self.db.write() as c:
            view = analyses.submit(c, self.queue, None, session_id)
        if view.state == "queued":
            claim = self.queue.claim("w", (recordings.ANALYSE,))
            assert claim is not None
            stored = {"analysis.json": self.blobs.put(claim.params["space"], content)}
            assert self.queue.finish(claim, lambda c: analyses.publish(c, claim, stored, "0" * 64))
        with self.db.read() as c:
            latest = analyses.latest(c, session_id)
        assert latest is not None
        return latest

    def compare(self, session_id: str, reference: bytes, content: bytes = b"{}") -> None:
        """A comparison of filters against a reference, without the numbers."""
        with reference_files.receive_reference(
            self.db, self.blobs, self.settings, self.who, session_id, "optical.sto"
        ) as upload:
            upload.write(reference)
            upload.keep()
        with self.db.write() as c:
            filter_runs.submit(
                c, self.queue, None, session_id,
                filters=["mahony_2008"], magnetometer=True, reference="optical.sto",
            )  # fmt: skip
        claim = self.queue.claim("w", (COMPARE_FILTERS,))
        assert claim is not None
        stored = {"filters.json": self.blobs.put(claim.params["space"], content)}
        assert self.queue.finish(claim, lambda c: filter_runs.publish(c, claim, {}, stored))

    def trail(self) -> list[str]:
        with self.db.read() as c:
            return [row.action for row in reversed(audit.list_entries(c))]


@pytest.fixture
def clinic(tmp_path: Path, source: Source) -> Iterator[Clinic]:
    new_clinic = Clinic(tmp_path, source)
    yield new_clinic
    new_clinic.db.close()


def test_a_patient_is_made_renamed_and_found(clinic: Clinic) -> None:
    first = clinic.patient("P-1")
    clinic.patient("Q_2")
    clinic.session(first, dt.date(2026, 2, 1))
    clinic.session(first, dt.date(2026, 4, 1))
    with clinic.db.write() as c:
        changed = patients.change(c, clinic.who, first, {"code": " P-9 ", "sex": "female"})
    assert (changed.code, changed.sex, changed.sessions, changed.last_visit, changed.running) == (
        "P-9",
        "female",
        2,
        dt.date(2026, 4, 1),
        False,
    )
    with clinic.db.read() as c:
        assert [p.code for p in patients.list_patients(c, None)] == ["P-9", "Q_2"]
        assert [p.code for p in patients.list_patients(c, None, search="p-9")] == ["P-9"]
        assert [p.code for p in patients.list_patients(c, None, search="_")] == ["Q_2"]  # no wildcard
        assert patients.list_patients(c, None, search="%") == []
    assert clinic.trail() == ["patient.created"] * 2 + ["session.created"] * 2 + ["patient.changed"]


def test_what_a_patient_cannot_be_is_refused_with_a_sentence(clinic: Clinic) -> None:
    first = clinic.patient("P-1")
    cases: list[tuple[dict[str, object], str]] = [
        ({"code": "P-2"}, "code_taken"),
        ({"code": "  "}, "bad_value"),
        ({"height_m": 175.0}, "bad_value"),
        ({"sex": "unknown"}, "bad_value"),
        ({"colour": "red"}, "bad_value"),
    ]
    clinic.patient("P-2")
    for values, code in cases:
        with pytest.raises(ServiceError) as caught, clinic.db.write() as c:
            patients.change(c, clinic.who, first, values)
        assert caught.value.code == code
    with pytest.raises(NotFound), clinic.db.write() as c:
        patients.change(c, clinic.who, "0" * 32, {})
    assert clinic.trail() == ["patient.created"] * 2


def test_a_session_knows_its_state(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())

    def state() -> str:
        with clinic.db.read() as c:
            return sessions.get(c, session_id).state

    assert state() == "empty"
    clinic.upload(session_id)
    assert state() == "uploaded"
    with clinic.db.write() as c:
        analyses.submit(c, clinic.queue, None, session_id)
    assert state() == "running"
    with clinic.db.read() as c:
        assert patients.list_patients(c, None)[0].running
    claim = clinic.queue.claim("w", (recordings.ANALYSE,))
    assert claim is not None
    clinic.queue.fail(claim, "no_walking", "No walking was found.")
    assert state() == "failed"
    clinic.analyse(session_id)
    assert state() == "done"


def test_files_are_added_replaced_and_removed(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "left 🦶.csv", b"1")
    clinic.upload(session_id, "trial\\right.csv", b"2")
    clinic.upload(session_id, "trial/right.csv", b"3")
    files = {f.name: f.size for f in clinic.recording(session_id).files}
    assert files == {"left 🦶.csv": 1, "trial/right.csv": 1}
    this = clinic.recording(session_id)
    with clinic.db.read() as c:
        assert recordings.file_bytes(c, clinic.blobs, this.id, "trial/right.csv") == b"3"
    with clinic.db.write() as c:
        final = recordings.remove_file(c, clinic.who, session_id, "left 🦶.csv")
    assert [f.name for f in final.files] == ["trial/right.csv"]
    assert final.id == this.id
    with pytest.raises(NotFound), clinic.db.write() as c:
        recordings.remove_file(c, clinic.who, session_id, "left 🦶.csv")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["", "/", "../a", "a/../b", "a\x00b", "a\nb", "x" * 501, "a\u202etxt.exe", "caf\ufffd.csv", "\u200ea"],
)
def test_a_name_that_is_no_name_is_refused(clinic: Clinic, name: str) -> None:
    session_id = clinic.session(clinic.patient())
    with pytest.raises(SagittalError) as caught:
        clinic.upload(session_id, name)
    assert caught.value.code == "bad_file_name"


def test_limits_of_size_and_number_hold_and_leave_nothing(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    with pytest.raises(ServiceError) as caught:
        clinic.upload(session_id, "big", bytes(1001))
    assert caught.value.code == "file_too_large"
    for i in range(3):
        clinic.upload(session_id, f"{i}", b"x")
    with pytest.raises(ServiceError) as caught:
        clinic.upload(session_id, "fourth", b"x")
    assert caught.value.code == "too_many_files"
    assert len(list(clinic.blobs.files())) == 1


def test_an_analysed_recording_never_changes(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "a", b"1")
    result = clinic.analyse(session_id)
    clinic.upload(session_id, "b", b"2")
    successor = clinic.recording(session_id)
    assert successor.id != result.recording_id
    assert [f.name for f in successor.files] == ["a", "b"]
    with clinic.db.read() as c:
        assert [f.name for f in recordings.get(c, result.recording_id).files] == ["a"]


def test_the_same_wish_is_one_job_another_mapping_is_another(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id)
    first = clinic.analyse(session_id)
    assert clinic.analyse(session_id).id == first.id
    with clinic.db.write() as c:
        recordings.set_manifest(c, clinic.who, session_id, {"sensors": {"x": "pelvis"}})
    second = clinic.analyse(session_id)
    assert second.id != first.id
    assert second.recording_id == first.recording_id
    with clinic.db.write() as c:
        recordings.set_manifest(c, clinic.who, session_id, None)
    assert clinic.analyse(session_id).id == first.id  # the page shows what was asked for last
    with clinic.db.read() as c:
        assert len(analyses.of_session(c, session_id)) == 2


def test_height_and_protocol_fill_what_the_manifest_leaves_open(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id)
    assert clinic.analyse(session_id).manifest == {"subject": {"height_m": 1.75}, "protocol": "walk"}
    with clinic.db.write() as c:
        sessions.change(c, clinic.who, session_id, {"height_m": 1.8, "protocol": "treadmill"})
    assert clinic.analyse(session_id).manifest == {"subject": {"height_m": 1.8}, "protocol": "treadmill"}
    with clinic.db.write() as c:
        recordings.set_manifest(c, clinic.who, session_id, {"subject": {"height_m": 1.6}})
    manifest = clinic.analyse(session_id).manifest
    assert manifest is not None
    assert manifest["subject"] == {"height_m": 1.6}


def test_a_wrong_manifest_is_refused_and_not_kept(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id)
    with pytest.raises(SagittalError) as caught, clinic.db.write() as c:
        recordings.set_manifest(c, clinic.who, session_id, {"sensors": {"x": "tail"}})
    assert caught.value.code == "unknown_segment"
    assert clinic.recording(session_id).manifest is None


def test_without_files_there_is_nothing_to_do(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    for wish in (analyses.submit, recordings.inspect):
        with pytest.raises(Conflict) as caught, clinic.db.write() as c:
            wish(c, clinic.queue, None, session_id)
        assert caught.value.code == "no_files"


def test_an_inspection_of_files_that_have_changed_is_not_kept(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "a", b"1")
    initial = clinic.recording(session_id)
    with clinic.db.write() as c:
        recordings.publish_inspection(c, initial.id, initial.input_sha256, {"devices": []})
    assert clinic.recording(session_id).state == "ready"
    clinic.upload(session_id, "b", b"2")
    assert clinic.recording(session_id).state == "draft"
    with pytest.raises(Conflict), clinic.db.write() as c:
        recordings.publish_inspection(c, initial.id, initial.input_sha256, {"devices": []})


def test_files_are_looked_at_once_until_they_or_the_way_to_read_them_change(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "a", b"1")

    def look() -> str:
        with clinic.db.write() as c:
            view = recordings.inspect(c, clinic.queue, None, session_id)
            assert recordings.inspect(c, clinic.queue, None, session_id).id == view.id
        claim = clinic.queue.claim("w", (recordings.INSPECT,))
        if claim is not None:
            digest = claim.params["input_sha256"]
            result: dict[str, object] = {"devices": []}
            assert clinic.queue.finish(
                claim, lambda c: recordings.publish_inspection(c, str(claim.recording_id), digest, result)
            )
        assert clinic.recording(session_id).state == "ready"
        return view.id

    first = look()
    assert look() == first
    clinic.upload(session_id, "b", b"2")
    with clinic.db.write() as c:
        recordings.remove_file(c, None, session_id, "b")
    assert clinic.recording(session_id).state == "draft"
    second = look()
    assert second != first
    with clinic.db.write() as c:
        recordings.set_manifest(c, None, session_id, {"sensors": {"x": "pelvis"}})
    assert look() == second
    source = {"file": "a", "rate_hz": 100.0, "columns": {"pelvis": {"acc": ["x", "y", "z"]}}}
    with clinic.db.write() as c:
        recordings.set_manifest(c, None, session_id, {"sources": [source]})
    assert look() != second


def test_erasing_a_patient_needs_the_code_and_leaves_only_the_trail(clinic: Clinic) -> None:
    patient_id, other_id = clinic.patient("P-1"), clinic.patient("P-2")
    session_id, other_session = clinic.session(patient_id), clinic.session(other_id)
    for s in (session_id, other_session):
        clinic.upload(s, "same.txt", b"same bytes")
        clinic.analyse(s)
    with clinic.db.write() as c:
        view = recordings.inspect(c, clinic.queue, None, session_id)
    claim = clinic.queue.claim("w", (recordings.INSPECT,))
    assert claim is not None
    with pytest.raises(Conflict) as caught:
        erasure.erase_patient(
            clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, clinic.who, patient_id, confirm="P-2"
        )
    assert caught.value.code == "not_confirmed"
    erasure.erase_patient(
        clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, clinic.who, patient_id, confirm="P-1"
    )
    assert {f.space for f in clinic.blobs.files()} == {other_id}
    assert not clinic.queue.finish(claim, lambda c: None)  # its worker finds the fence closed
    with clinic.db.read() as c:
        for table in (tables.patient, tables.session, tables.recording, tables.recording_file, tables.job):
            assert len(c.execute(select(table)).all()) == 1
        tombstone = audit.list_entries(c)[0]
        assert (tombstone.action, tombstone.resource_id) == ("patient.erased", patient_id)
        with pytest.raises(NotFound):
            jobs.get(c, view.id)
        everything = str(c.execute(select(tables.audit)).all())
    assert "P-1" not in everything
    assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []


@IN_A_FILE
def test_no_byte_of_an_erased_patient_is_left_in_the_data_folder(clinic: Clinic) -> None:
    patient_id = clinic.patient("CANARY-CODE")
    with clinic.db.write() as c:
        patients.change(c, clinic.who, patient_id, {"note": "CANARY-NOTE " * 500})
        session_id = sessions.create(c, clinic.who, patient_id, title="CANARY-TITLE").id
    clinic.upload(session_id, "CANARY-FILE", b"CANARY-BYTES")
    clinic.analyse(session_id, b"CANARY-RESULT")
    clinic.compare(session_id, b"CANARY-REFERENCE", b"CANARY-FILTERS")

    def found() -> set[str]:
        files = [p for p in clinic.settings.data_dir.rglob("*") if p.is_file()]
        return {str(p.name) for p in files if b"CANARY" in p.read_bytes()}

    assert found()
    erasure.erase_patient(
        clinic.db,
        ReviewedAnalyses(clinic.blobs),
        clinic.settings,
        clinic.who,
        patient_id,
        confirm="CANARY-CODE",
    )
    assert found() == set()


@IN_A_FILE
def test_no_byte_of_an_erased_session_is_left_and_who_reads_an_older_state_only_delays_it(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.storage.sqlite_file.BUSY_TIMEOUT_MS", 10)
    patient_id = clinic.patient()
    with clinic.db.write() as c:
        session_id = sessions.create(c, clinic.who, patient_id, title="CANARY-TITLE").id
        sessions.change(c, clinic.who, session_id, {"note": "CANARY-NOTE " * 500})
    clinic.upload(session_id, "CANARY-FILE", b"CANARY-BYTES")
    clinic.analyse(session_id, b"CANARY-RESULT")
    clinic.compare(session_id, b"CANARY-REFERENCE", b"CANARY-FILTERS")

    def found() -> bool:
        return any(b"CANARY" in p.read_bytes() for p in clinic.settings.data_dir.rglob("*") if p.is_file())

    with clinic.db.read() as c:
        sessions.get(c, session_id)
        erasure.erase_session(
            clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, clinic.who, session_id
        )
        assert found()
    erasure.finish(clinic.db, clinic.blobs, clinic.settings)
    assert not found()
    assert not list(clinic.settings.erasing.iterdir())


def test_erasing_a_session_keeps_the_files_another_one_shares(clinic: Clinic) -> None:
    patient_id = clinic.patient()
    one, two = clinic.session(patient_id), clinic.session(patient_id)
    clinic.upload(one, "a", b"shared")
    clinic.upload(one, "b", b"own")
    clinic.upload(two, "a", b"shared")
    erasure.erase_session(clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, clinic.who, one)
    assert [clinic.blobs.find_path(f).read_bytes() for f in clinic.blobs.files()] == [b"shared"]
    assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []


def test_a_reference_that_was_replaced_stays_with_the_comparison_that_used_it(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id)
    clinic.analyse(session_id)
    clinic.compare(session_id, b"first")
    clinic.compare(session_id, b"second")
    with clinic.db.write() as c:
        assert len(reference_files.list_files(c, session_id)) == 1
        reference_files.remove(c, clinic.who, session_id, "optical.sto")
        assert reference_files.list_files(c, session_id) == []
        used = [run.reference_sha256 for run in filter_runs.of_session(c, session_id)]
    assert len(set(used)) == 2
    # the newest recording, its analysis and the state of the session do not know of it
    assert clinic.recording(session_id).files[0].name == "a.txt"
    assert sweep(clinic.db, clinic.blobs, replace(clinic.settings, sweep_grace_s=0.0)) == 0
    assert {f.name for f in clinic.blobs.files()} > set(used)
    assert clinic.trail().count("reference.added") == 2


def test_more_references_than_a_session_takes_are_refused(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reference_files, "MOST_FILES", 1)
    session_id = clinic.session(clinic.patient())
    for name in ("a.sto", "a.sto", "b.sto"):
        with reference_files.receive_reference(
            clinic.db, clinic.blobs, clinic.settings, clinic.who, session_id, name
        ) as upload:
            upload.write(name.encode())
            if name == "a.sto":
                upload.keep()
                continue
            with pytest.raises(TooLarge) as caught:
                upload.keep()
            assert caught.value.code == "too_many_files"


def test_the_sweep_takes_only_old_files_that_nothing_refers_to(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "a", b"kept")
    orphan = clinic.blobs.put("f" * 32, b"of a lost claim")
    assert sweep(clinic.db, clinic.blobs, clinic.settings) == 0
    assert sweep(clinic.db, clinic.blobs, replace(clinic.settings, sweep_grace_s=0.0)) == 1
    assert [clinic.blobs.find_path(f).read_bytes() for f in clinic.blobs.files()] == [b"kept"]
    with pytest.raises(SagittalError):
        clinic.blobs.require("f" * 32, orphan.sha256)


def test_the_check_finds_what_is_wrong(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id, "a", b"one")
    clinic.upload(session_id, "b", b"two")
    assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []
    files = list(clinic.blobs.files())
    clinic.blobs.find_path(files[0]).write_bytes(b"onf")
    clinic.blobs.find_path(files[1]).unlink()
    with clinic.db.write() as c:
        for statement in NO_TRIGGERS[c.dialect.name]:
            c.exec_driver_sql(statement)
        c.exec_driver_sql("UPDATE audit SET user_name = 'somebody else' WHERE seq = 1")
        c.exec_driver_sql("DELETE FROM audit WHERE seq = 3")
    findings = checks.check(clinic.db, clinic.blobs, clinic.settings)
    assert sorted(f.area for f in findings) == ["audit", "audit", "files", "files"]


@IN_A_FILE
def test_the_check_speaks_of_a_damaged_database_instead_of_failing(clinic: Clinic) -> None:
    for i in range(50):
        clinic.patient(f"P-{i}")
    clinic.db.close()
    path = clinic.settings.database
    content = bytearray(path.read_bytes())
    content[4096 : len(content) // 2] = bytes(len(content) // 2 - 4096)
    path.write_bytes(content)
    with closing(Database(path)) as damaged:
        findings = checks.check(damaged, clinic.blobs, clinic.settings)
    assert {f.area for f in findings} == {"database"}


def test_audit_rows_cannot_be_changed_or_removed(clinic: Clinic) -> None:
    from sqlalchemy.exc import IntegrityError

    clinic.patient()
    for statement in ("UPDATE audit SET action = 'x'", "DELETE FROM audit"):
        with pytest.raises(IntegrityError, match="append-only"), clinic.db.write() as c:
            c.exec_driver_sql(statement)


def test_jobs_are_listed_with_whose_they_are_and_cancelled_with_a_trail(clinic: Clinic) -> None:
    session_id = clinic.session(clinic.patient())
    clinic.upload(session_id)
    with clinic.db.write() as c:
        view = recordings.inspect(c, clinic.queue, None, session_id)
    with clinic.db.write() as c:
        listed = jobs.list_jobs(c, None, active_only=True)
        assert [(x.id, x.session_id, x.patient_code) for x in listed] == [(view.id, session_id, "P-1")]
        assert jobs.cancel(c, clinic.queue, clinic.who, view.id).state == "cancelled"
        assert jobs.list_jobs(c, None, active_only=True) == []
        assert [v.id for v in jobs.of_session(c, session_id)] == [view.id]
        with pytest.raises(NotFound):
            jobs.cancel(c, clinic.queue, clinic.who, "0" * 32)
    assert clinic.trail()[-1] == "job.cancelled"
