"""A backup made while the service runs, and what becomes of it in an empty folder."""

from __future__ import annotations

import datetime as dt
import io
import json
import tarfile
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import insert, select

from sagittal.server import audit
from sagittal.server.clinic import identities, patients, sessions
from sagittal.server.main import main
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import backups, checks, erasure
from sagittal.server.safekeeping.backups import MANIFEST, BackupError, MadeBackup, choose_kept, make_backup
from sagittal.server.safekeeping.restore_room import RestoreError
from sagittal.server.safekeeping.restoring import RestoredClinic, restore, try_restore
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.safekeeping.tombstones import Tombstones
from sagittal.server.settings import Settings, SettingsError
from sagittal.server.sharing import report_links
from sagittal.server.storage import fs
from sagittal.server.storage.archive import BackupFileError, ClinicKey, make_key, read_archive, read_key
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.schema.person_tables import patient_identity
from sagittal.server.storage.schema.report_tables import report_file, signed_report
from sagittal.server.storage.schema.tables import audit as audit_table
from sagittal.server.storage.schema.tables import login_session, now, user
from sagittal.server.uploads import receiving
from tests.faults.clinic import Clinic, find_room
from tests.helpers.engines import on_both_engines, tell_commands

CUT = "is damaged or was cut"
_put_back: list[Database] = []
"""What a test opened of what it restored; closed when it ends."""


@pytest.fixture
def clinic(tmp_path: Path) -> Iterator[Clinic]:
    """One patient with a file, a live log, and a signed-in user."""
    new_clinic = Clinic(tmp_path / "home", lease_s=5.0)
    (tmp_path / "disk").mkdir()
    new_clinic.settings.live.mkdir()
    (new_clinic.settings.live / f"{'a' * 32}.log").write_bytes(b"SAGLIVE1\n" + bytes(3000))
    timestamp = now()
    with new_clinic.db.write() as c:
        c.execute(
            insert(user).values(
                id="u" * 32, name="ada", display_name="Ada", role="admin", active=True, created_at=timestamp
            )
        )
        c.execute(
            insert(login_session).values(
                token_sha256="t" * 64,
                user_id="u" * 32,
                created_at=timestamp,
                last_seen_at=timestamp,
                expires_at=timestamp,
            )
        )
    yield new_clinic
    new_clinic.db.close()
    while _put_back:
        _put_back.pop().close()


@pytest.fixture(params=["plain", "encrypted"])
def key(request: pytest.FixtureRequest, tmp_path: Path) -> ClinicKey | None:
    if request.param == "plain":
        return None
    make_key(tmp_path / "clinic.key")
    return read_key(tmp_path / "clinic.key")


def upload(clinic: Clinic, session_id: str, name: str, content: bytes) -> None:
    with receiving.receive(clinic.db, clinic.blobs, clinic.settings, None, session_id, name) as incoming:
        incoming.write(content)
        incoming.keep()


def make(clinic: Clinic, key: ClinicKey | None = None) -> MadeBackup:
    return make_backup(clinic.db, clinic.settings, clinic.folder.parent / "disk", key)


def put_back(
    clinic: Clinic, result: MadeBackup, key: ClinicKey | None = None
) -> tuple[RestoredClinic, Clinic]:
    """Restore into a folder next to the clinic, and open the result."""
    return put_back_into(find_room(clinic, "again"), result, key)


def put_back_into(
    home: Settings, recording: MadeBackup, key: ClinicKey | None = None
) -> tuple[RestoredClinic, Clinic]:
    result = restore(recording.path, home, key)
    repeat = object.__new__(Clinic)
    repeat.settings, repeat.folder = home, home.data_dir
    repeat.db, repeat.blobs = Database(home.database_source), FolderBlobs(home.blobs)
    _put_back.append(repeat.db)
    return result, repeat


def defects(clinic: Clinic) -> list[str]:
    result = checks.check(clinic.db, clinic.blobs, clinic.settings)
    return [f"{f.area}: {f.message}" for f in result if f.area != "live"]


def contents(clinic: Clinic) -> set[bytes]:
    return {clinic.blobs.find_path(f).read_bytes() for f in clinic.blobs.files()}


@on_both_engines
@pytest.mark.slow
def test_a_backup_under_load_comes_back_whole(clinic: Clinic, key: ClinicKey | None) -> None:
    stop = threading.Event()

    def work() -> None:
        number = 0
        while not stop.wait(0.001):
            number += 1
            upload(clinic, clinic.session.id, "a.txt", b"walk %d" % number)

    make_key(clinic.settings.second_factor_key)
    writer = threading.Thread(target=work)
    writer.start()
    try:
        recording = make(clinic, key)
    finally:
        stop.set()
        writer.join()
    assert recording.missing == []
    assert [p.name for p in clinic.settings.backups.iterdir()] == ["lock"]
    assert recording.path.stat().st_mode & 0o077 == 0
    assert (b"walk" in recording.path.read_bytes()) == (key is None)
    restored_files, second_restored_files = put_back(clinic, recording, key)
    assert (
        restored_files.patients,
        restored_files.sessions,
        restored_files.erased_again,
        restored_files.missing,
    ) == (1, 1, 0, 0)
    database = set() if second_restored_files.settings.database_url else {"sagittal.db"}
    assert {p.name for p in second_restored_files.folder.iterdir()} - database == {
        "audit.mark", "blobs", "live", "second-factor.key", "server.lock",
    }  # fmt: skip
    second = second_restored_files.settings.second_factor_key
    assert second.read_bytes() == clinic.settings.second_factor_key.read_bytes()
    assert defects(second_restored_files) == []
    log = f"{'a' * 32}.log"
    assert (second_restored_files.settings.live / log).read_bytes() == (
        clinic.settings.live / log
    ).read_bytes()
    with second_restored_files.db.read() as c:
        assert c.execute(select(login_session)).all() == []
        last = c.execute(select(audit_table).order_by(audit_table.c.seq.desc())).first()
        assert recording.head is not None
        retained = c.execute(
            select(audit_table.c.hash).where(audit_table.c.seq == recording.head.seq)
        ).scalar()
        assert audit.find_problems(c) == []
    assert last is not None
    assert (last.action, retained) == ("backup.restored", recording.head.hash)
    # an older state takes nothing away that it does not know
    assert (
        sweep(
            second_restored_files.db,
            second_restored_files.blobs,
            replace(second_restored_files.settings, sweep_grace_s=0.0),
        )
        == 0
    )
    second_restored_files.blobs.put(clinic.patient.id, b"of a newer state")
    assert (
        sweep(
            second_restored_files.db,
            second_restored_files.blobs,
            replace(second_restored_files.settings, sweep_grace_s=0.0),
        )
        == 1
    )
    assert list(second_restored_files.settings.trash.glob("*/*/*"))


def test_a_link_that_was_revoked_since_does_not_open_again(clinic: Clinic) -> None:
    report, visit, timestamp = "d" * 32, clinic.session.id, now()
    with clinic.db.write() as c:
        made_from = {"id": report, "session_id": visit, "analysis_id": "e" * 32}
        c.execute(insert(signed_report).values(**made_from, number=1, language="en", signed_at=timestamp))
        document = clinic.blobs.put(clinic.patient.id, b"signed")
        row = {"report_id": report, "name": "report.html", "size": document.size}
        c.execute(insert(report_file).values(**row, sha256=document.sha256))
        link, token = report_links.make(c, None, report, 90, "Ada")
    recording = make(clinic)
    with clinic.db.write() as c:
        report_links.revoke(c, None, link.id)
    _, second_restored_files = put_back(clinic, recording)
    with second_restored_files.db.read() as c:
        assert not report_links.get(c, link.id).is_open
        with pytest.raises(report_links.LinkNotFound):
            report_links.find_by_token(c, token)


@pytest.mark.slow
def test_names_come_back_from_an_encrypted_backup_and_need_their_key_from_another(
    clinic: Clinic,
    key: ClinicKey | None,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    elsewhere = clinic.folder.parent / "safe" / "names.key"
    elsewhere.parent.mkdir()
    clinic.settings = replace(clinic.settings, identity_key=str(elsewhere))
    identities.make_key(clinic.db, elsewhere)
    with clinic.db.write() as c:
        identities.change(c, elsewhere, None, clinic.patient.id, {"name": "Erika Zzcanary"})
        other_id = patients.create(c, None, code="P-2").id
        identities.change(c, elsewhere, None, other_id, {"name": "Uwe Otter"})
    recording = make(clinic, key)
    assert b"Zzcanary" not in recording.path.read_bytes()
    assert recording.left_out == (elsewhere if key is None else None)
    assert try_restore(recording.path, clinic.settings, key).names_open == (key is not None)
    reviewed = ReviewedAnalyses(clinic.blobs)
    erasure.erase_patient(clinic.db, reviewed, clinic.settings, None, other_id, confirm="P-2")
    with clinic.db.read() as c:
        assert c.execute(select(patient_identity.c.patient_id)).scalars().all() == [clinic.patient.id]
    make_backup(clinic.db, clinic.settings, recording.path.parent / "later.tar", None)
    restored_files, second_restored_files = put_back(clinic, recording, key)
    assert restored_files.erased_again == 1
    put = second_restored_files.folder / "identity.key"
    assert put.exists() == (key is not None)
    if key is None:
        put = elsewhere
    with second_restored_files.db.read() as c:
        assert c.execute(select(patient_identity.c.patient_id)).scalars().all() == [clinic.patient.id]
        assert identities.get(c, put, clinic.patient.id).name == "Erika Zzcanary"
    assert defects(second_restored_files) == []
    monkeypatch.setenv("SAGITTAL_IDENTITY_KEY", str(elsewhere))
    tell_commands(monkeypatch, clinic.settings)
    stdout = str(recording.path.with_name("told.tar"))
    assert main(["backup", stdout, "--data", str(clinic.folder)]) == 0
    assert f"{elsewhere}, is not in it" in capsys.readouterr().out
    if key is None:  # the key is in its place and opens them: nobody is told that names are closed
        assert main(["restore", str(recording.path), "--test", "--data", str(clinic.folder)]) == 0
        stdout = capsys.readouterr().out
        assert f"was not in the backup. It has to be at {elsewhere}; `sagittal check` says" in stdout
    if key is not None:  # a restore by hand says where the key is to go, and that another one is there
        monkeypatch.setenv("SAGITTAL_DATABASE_URL", "")
        pair = str(clinic.folder.parent / "clinic.key")
        for number, message in ((1, None), (2, "another one is at"), (3, "Move it to")):
            if number == 2:
                elsewhere.write_bytes(b"of another database")
            if number == 3:
                elsewhere.unlink()
            home = str(clinic.folder.parent / f"by-hand-{number}")
            assert main(["restore", str(recording.path), "--key", pair, "--data", home]) == 0
            stdout = capsys.readouterr().out
            assert "was not in the backup" not in stdout
            assert ("Move it to" if message is None else message) in stdout


@pytest.mark.slow
@on_both_engines
def test_who_was_erased_since_stays_erased(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        alternative = patients.create(c, None, code="P-2")
        visits = [sessions.create(c, None, alternative.id).id for _ in range(2)]
    upload(clinic, visits[0], "x.txt", b"of the visit that goes")
    upload(clinic, visits[1], "y.txt", b"of the visit that stays")
    recording = make(clinic)
    reviewed = ReviewedAnalyses(clinic.blobs)
    erasure.erase_patient(clinic.db, reviewed, clinic.settings, None, clinic.patient.id, confirm="P-1")
    erasure.erase_session(clinic.db, reviewed, clinic.settings, None, visits[0])
    later = make_backup(clinic.db, clinic.settings, clinic.folder.parent / "disk" / "later.tar", None)
    restored_files, second_restored_files = put_back(clinic, recording)
    assert (restored_files.patients, restored_files.sessions, restored_files.erased_again) == (1, 1, 2)
    assert contents(second_restored_files) == {b"of the visit that stays"}
    if not second_restored_files.settings.database_url:
        assert b"signals" not in second_restored_files.settings.database.read_bytes()
    assert defects(second_restored_files) == []
    assert try_restore(later.path, clinic.settings, None).erased_again == 0
    # without the list beside it an older backup cannot know; another list may be given
    recording.path.with_name("erased.json").unlink()
    home = find_room(clinic, "third")
    gone = Tombstones(frozenset({clinic.patient.id}))
    assert restore(recording.path, home, None, gone).erased_again == 1


def test_a_file_that_is_swept_meanwhile_is_taken_from_the_trash_and_a_lost_one_is_named(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(clinic, clinic.session.id, "b.txt", b"walk two")
    add_live = backups._add_blobs

    def later(archive: object, settings: Settings, used: object, content: object) -> None:
        for stored in list(clinic.blobs.files()):
            path = clinic.blobs.find_path(stored)
            if path.read_bytes() == b"signals":
                path.unlink()
            else:
                fs.move_file(path, settings.trash / "20260101T000000Z" / stored.space / stored.name)
        add_live(archive, settings, used, content)  # type: ignore[arg-type]

    monkeypatch.setattr(backups, "_add_blobs", later)
    recording = make(clinic)
    assert len(recording.missing) == 1
    restored_files, second_restored_files = put_back(clinic, recording)
    assert restored_files.missing == 1
    assert contents(second_restored_files) == {b"walk two"}
    assert len(defects(second_restored_files)) == 1


@pytest.mark.slow
@on_both_engines
def test_what_is_damaged_or_cut_is_refused_and_nothing_is_put_in_place(
    clinic: Clinic, key: ClinicKey | None, tmp_path: Path
) -> None:
    recording = make(clinic, key)
    whole = recording.path.read_bytes()
    home = find_room(clinic, "again")
    places = [len(whole) * i // 7 for i in range(1, 7)] if key else [whole.index(b"signals"), 700]
    spoiled = [whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :] for place in places]
    spoiled += [whole[: len(whole) * i // 5] for i in range(5)]
    spoiled += [whole[: whole.rindex(b'{"format"') - 512]] if key is None else [whole[:-1]]
    for content in spoiled:
        bad = tmp_path / "bad.tar"
        bad.write_bytes(content)
        with pytest.raises((RestoreError, BackupFileError)):
            restore(bad, home, key)
        assert [p.name for p in home.data_dir.iterdir()] == ["server.lock"]
    restore(recording.path, home, key)
    with pytest.raises(RestoreError, match=r"is not empty|holds a clinic already"):
        restore(recording.path, home, key)


def test_a_key_opens_only_its_own_and_a_public_one_only_encrypts(clinic: Clinic, tmp_path: Path) -> None:
    public = make_key(tmp_path / "clinic.key")
    make_key(tmp_path / "other.key")
    (tmp_path / "public.key").write_text(f"# of the clinic\n{public}\n")
    (tmp_path / "none.key").write_text("hunter2\n")
    assert (tmp_path / "clinic.key").stat().st_mode & 0o077 == 0
    with pytest.raises(BackupFileError, match="never overwritten"):
        make_key(tmp_path / "clinic.key")
    with pytest.raises(BackupFileError, match="holds no key"):
        read_key(tmp_path / "none.key")
    recording = make(clinic, read_key(tmp_path / "public.key"))
    for name, words in (("other", "another key"), ("public", "private key"), (None, "private key")):
        with pytest.raises(BackupFileError, match=words):
            try_restore(recording.path, clinic.settings, read_key(tmp_path / f"{name}.key") if name else None)
    assert try_restore(recording.path, clinic.settings, read_key(tmp_path / "clinic.key")).patients == 1


def test_what_a_backup_of_another_make_may_not_do(clinic: Clinic, tmp_path: Path) -> None:
    recording = make(clinic)
    sparse = {"GNU.sparse.size": "1000000000000", "GNU.sparse.map": "0,1"}
    words = {
        "newer": "reads 1",
        "outside": "no backup does",
        "link": "which is no file",
        "sparse": "which is no file",
        "no numbers": CUT,
    }
    for change, message in words.items():
        bad = tmp_path / f"{change}.tar"
        with tarfile.open(bad, "w") as tar:
            for name, size, content in read_archive(recording.path, None):
                data = content.read(size)
                if name == MANIFEST and change == "newer":
                    data = json.dumps(json.loads(data) | {"format": 2}).encode()
                member = tarfile.TarInfo("../blobs/x" if change == "outside" else name)
                member.size = len(data)
                if change == "link":
                    member.type, member.linkname, member.size = tarfile.SYMTYPE, "/etc/passwd", 0
                if change == "sparse":
                    member.pax_headers = sparse
                if change == "no numbers":
                    member.pax_headers = sparse | {"GNU.sparse.map": "a,b"}
                tar.addfile(member, io.BytesIO(data))
        with pytest.raises((RestoreError, BackupFileError), match=message):
            try_restore(bad, clinic.settings, None)


def test_a_backup_is_kept_apart_and_never_written_over(clinic: Clinic, tmp_path: Path) -> None:
    with pytest.raises(BackupError, match="lost with it"):
        make_backup(clinic.db, clinic.settings, clinic.folder / "x.tar", None)
    with pytest.raises(BackupError, match="no folder"):
        make_backup(clinic.db, clinic.settings, tmp_path / "gone" / "x.tar", None)
    (tmp_path / "x.tar").touch()
    with pytest.raises(BackupError, match="never written over"):
        make_backup(clinic.db, clinic.settings, tmp_path / "x.tar", None)
    with pytest.raises(SettingsError, match="another disk"):
        Settings(data_dir=tmp_path, backup_dir=str(tmp_path / "backups"))


def test_days_weeks_and_months_are_kept() -> None:
    today = dt.datetime(2026, 6, 30, 2, 30, tzinfo=dt.UTC)
    times = [today - dt.timedelta(hours=12 * i) for i in range(800)]
    stored_items = sorted(choose_kept(times), reverse=True)
    assert [t.date() for t in stored_items[:7]] == [(today - dt.timedelta(days=i)).date() for i in range(7)]
    assert len(stored_items) <= 7 + 4 + 12
    assert min(stored_items).date() == dt.date(2025, 7, 31)
    # tomorrow's rule keeps what today's kept, as long as each is the newest of its time
    assert choose_kept(stored_items) == set(stored_items)


@pytest.mark.postgres
def test_a_backup_goes_into_postgres_and_one_of_postgres_into_a_file(clinic: Clinic, postgres: str) -> None:
    folder = clinic.folder.parent
    home = replace(clinic.settings, data_dir=folder / "on a server", database_url=postgres)
    result, moved = put_back_into(home, make(clinic))
    with closing(moved.db):
        assert (result.patients, result.sessions) == (1, 1)
        assert not moved.settings.database.exists()
        assert (defects(moved), contents(moved)) == ([], contents(clinic))
        (folder / "other disk").mkdir()
        backup = make_backup(moved.db, moved.settings, folder / "other disk", None)
        other_variant = replace(home, data_dir=folder / "elsewhere")
        with pytest.raises(RestoreError, match="PostgreSQL database holds a clinic"):
            restore(backup.path, other_variant, None)
    _, back = put_back_into(replace(home, data_dir=folder / "back", database_url=""), backup)
    with closing(back.db):
        assert (defects(back), contents(back)) == ([], contents(clinic))
