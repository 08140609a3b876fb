"""A really full disk: changes are refused, reading and sign-in continue, no guarantee is broken."""

from __future__ import annotations

import contextlib
import datetime as dt
import errno
import itertools
import subprocess
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest

from sagittal.server import audit, trail
from sagittal.server.clinic import patients, sessions
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.migrate import MigrationError, upgrade
from sagittal.server.storage.readiness import Readiness
from sagittal.server.storage.schema.tables import now
from tests.faults.failing import FailingSystem
from tests.faults.small_disk import full, mounted, on_small_disk, run
from tests.helpers.clinic import PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines
from tests.helpers.marks import sqlite_only
from tests.helpers.postgres import run_sql
from tests.server import analysed, walk

pytestmark = pytest.mark.anyio

API = "/api/v1"
CONTACT = walk.events().times("left", "ic")[3]


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    with mounted(tmp_path / "disk", 24) as folder:
        yield folder


class Visit:
    """Clinic on a small disk with one analysed session and a signed-in user."""

    def __init__(self, clinic: Clinic) -> None:
        self.clinic = clinic
        for role in ("admin", "clinician", "viewer"):
            clinic.user(role)
        with clinic.db.write() as c:
            self.patient = patients.create(c, None, code="P-1", height_m=1.75).id
            self.session = sessions.create(c, None, self.patient).id
        self.analysis = analysed.finish(clinic, self.patient, self.session, analysed.files())

    def rows(self) -> list[Any]:
        with self.clinic.db.read() as c:
            return audit.list_entries(c, limit=1000)


@pytest.fixture
async def visit(disk: Path) -> AsyncIterator[Visit]:
    async with open_clinic(disk, min_free_bytes=0) as clinic:
        yield Visit(clinic)


def changes(v: Visit) -> list[tuple[str, str, dict[str, Any]]]:
    """One valid request of every kind that writes: method, path and body."""
    session, patient = f"{API}/sessions/{v.session}", f"{API}/patients/{v.patient}"
    edit = {"kind": "exclude_stride", "side": "left", "time_s": CONTACT + 0.5, "reason": "stumbled"}
    training = {
        "parameter": "stance_pct",
        "side": "left",
        "target": {"source": "manual", "mean": 62.0, "sd": 2.0},
    }
    return [
        ("POST", f"{API}/patients", {"json": {"code": "P-2"}}),
        ("PATCH", patient, {"json": {"note": "uses a stick"}}),
        ("POST", f"{patient}/sessions", {"json": {"title": "Walk"}}),
        ("POST", f"{patient}/programmes", {"json": {"starts_on": "2026-03-02"}}),
        ("POST", f"{patient}/prescriptions", {"json": training}),
        ("PATCH", session, {"json": {"title": "Walk"}}),
        ("PUT", f"{session}/files/b.txt", {"content": b"x" * 100_000}),
        ("POST", f"{session}/files", {"files": {"files": ("c.txt", b"x" * 100_000)}}),
        ("PUT", f"{session}/manifest", {"json": {"sensors": {"A1": "pelvis"}}}),
        ("POST", f"{session}/inspections", {}),
        ("POST", f"{session}/edits", {"json": edit}),
        ("POST", f"{session}/live", {}),
        ("POST", f"{API}/users", {"json": {"name": "new", "password": PASSWORD, "role": "viewer"}}),
        ("POST", f"{API}/account/password", {"json": {"current": PASSWORD, "password": "another long one"}}),
        ("DELETE", session, {}),
    ]


@sqlite_only
async def test_a_full_disk_answers_every_change_with_507_and_a_sentence(visit: Visit, disk: Path) -> None:
    async with visit.clinic.client("admin", raises=False) as client:
        initial_rows = visit.rows()
        with full(disk):
            for method, path, body in changes(visit):
                answer = await client.request(method, path, **body)
                message = f"{method} {path}: {answer.text}"
                assert answer.status_code == 507, message
                assert answer.headers["content-type"] == "application/problem+json", message
                assert answer.json()["code"] == "disk_full", message
                assert "make room" in answer.json()["detail"], message
        assert visit.rows() == initial_rows
        for method, path, body in changes(visit):
            answer = await client.request(method, path, **body)
            assert answer.status_code < 300, f"{method} {path}: {answer.text}"


@sqlite_only
async def test_a_page_on_a_full_disk_says_so_in_a_page(visit: Visit, disk: Path) -> None:
    form = {"Accept": "text/html", "Content-Type": "application/x-www-form-urlencoded"}
    async with visit.clinic.client("clinician", headers=form, raises=False) as client:
        with full(disk):
            answer = await client.post(f"{API}/sessions/{visit.session}/live")
    assert answer.status_code == 507
    assert answer.headers["content-type"].startswith("text/html")
    assert "make room" in answer.text


def readings(v: Visit) -> list[str]:
    session = f"/sessions/{v.session}"
    return [
        "/patients",
        f"/patients/{v.patient}",
        session,
        f"{session}/timeline",
        f"{session}/data",
        f"{API}{session}/report",
        f"{API}{session}/signals",
        f"{API}{session}/strides.csv",
        f"{API}/analyses/{v.analysis}/files/poses.parquet",
    ]


@sqlite_only
async def test_on_a_full_disk_people_sign_in_read_results_and_sign_out(visit: Visit, disk: Path) -> None:
    clinic = visit.clinic
    person = {"name": "viewer", "password": PASSWORD}
    async with clinic.client(raises=False) as client:
        with full(disk):
            initial_rows = visit.rows()
            signed = await client.post(f"{API}/sign-in", json=person)
            assert signed.status_code == 200, signed.text
            for path in readings(visit):
                answer = await client.get(path)
                assert answer.status_code == 200, f"{path}: {answer.text}"
            wrong = await client.post(f"{API}/sign-in", json=person | {"password": "a wrong password"})
            assert wrong.status_code == 401
            assert (await client.post(f"{API}/sign-out")).status_code == 204
            assert (await client.get(f"{API}/account")).status_code == 401
            assert visit.rows() == initial_rows
        # what was looked at meanwhile is written before the next that is
        async with clinic.client("admin") as admin:
            await admin.get(f"{API}/patients/{visit.patient}")
    new = [r for r in reversed(visit.rows()) if r.seq > initial_rows[0].seq]
    message = [(r.action, r.user_name) for r in new]
    assert message[0] == ("sign_in", "viewer")
    assert message[-1] == ("patient.opened", "admin")
    assert ("sign_out", "viewer") in message
    expected = {"report.opened", "session.opened", "patient.opened", "analysis.file_opened"}
    assert expected <= {action for action, _ in message}
    assert all(earlier.at <= later.at for earlier, later in itertools.pairwise(new))
    with clinic.db.read() as c:
        assert audit.find_problems(c) == []


async def test_a_sign_in_from_before_the_disk_was_full_goes_on_and_can_be_ended(
    visit: Visit, disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clinic = visit.clinic
    async with clinic.client("viewer", raises=False) as client:
        cookie = {"Cookie": f"sid={client.cookies['sid']}"}
        # a minute later its activity would be written
        monkeypatch.setattr(clinic.app.state.logins, "_clock", lambda: now() + dt.timedelta(minutes=1))
        with full(disk):
            assert (await client.get(f"{API}/account")).status_code == 200
            assert (await client.post(f"{API}/sign-out")).status_code == 204
            assert (await client.get(f"{API}/account", headers=cookie)).status_code == 401


@sqlite_only
async def test_a_disk_that_became_read_only_is_said_and_can_be_read(disk: Path, tmp_path: Path) -> None:
    frozen = tmp_path / "frozen"
    frozen.mkdir()
    run("mount", "--bind", str(disk), str(frozen))
    try:
        subprocess.run(["mount", "-o", "remount,bind,ro", str(frozen)], check=True)
        async with open_clinic(disk, min_free_bytes=0) as clinic:
            v = Visit(clinic)
            # the same folder, seen read-only; the write-ahead log is there, as when a disk is remounted
            target = Database(frozen / clinic.settings.database.name)
            engines = clinic.db._reader, clinic.db._writer
            clinic.db._reader, clinic.db._writer = target._reader, target._writer
            blobs = clinic.app.state.blobs
            blobs.root, blobs.incoming = frozen / "blobs", frozen / "blobs" / "incoming"
            await _use_read_only(v)
            target.close()
            clinic.db._reader, clinic.db._writer = engines
    finally:
        subprocess.run(["umount", "--lazy", str(frozen)], check=False)


async def _use_read_only(v: Visit) -> None:
    async with v.clinic.client(raises=False) as client:
        person = {"name": "clinician", "password": PASSWORD}
        assert (await client.post(f"{API}/sign-in", json=person)).status_code == 200
        for path in readings(v):
            answer = await client.get(path)
            assert answer.status_code == 200, f"{path}: {answer.text}"
        for path, body in ((f"{API}/patients", {"code": "P-2"}), (f"{API}/sessions/{v.session}/live", None)):
            answer = await client.post(path, json=body)
            assert (answer.status_code, answer.json()["code"]) == (507, "disk_not_writable")
        upload = await client.put(f"{API}/sessions/{v.session}/files/b.txt", content=b"x")
        assert (upload.status_code, upload.json()["code"]) == (507, "disk_not_writable")
        checks = (await client.get("/health/ready")).json()["checks"]
        assert "cannot be written" in checks["database"]
        assert "cannot be written" in checks["files"]


@sqlite_only
async def test_ready_really_writes_and_says_when_it_cannot(visit: Visit, disk: Path) -> None:
    clinic = visit.clinic
    time_s = 0.0
    clinic.app.state.readiness = Readiness(clinic.settings, clinic.db, clinic.app.state.blobs, lambda: time_s)
    async with clinic.client() as client:

        async def ask() -> tuple[int, dict[str, str]]:
            answer = await client.get("/health/ready")
            return answer.status_code, answer.json()["checks"]

        assert await ask() == (200, {"database": "ok", "files": "ok", "schema": "ok", "disk": "ok"})
        with full(disk):
            time_s += Readiness.EVERY_S
            status, checks = await ask()
            assert status == 503
            assert "full" in checks["database"]
            assert "full" in checks["files"]
        assert await ask() == (status, checks)  # asked too soon: the same answer, nothing is written
        time_s += Readiness.EVERY_S
        assert (await ask())[0] == 200
        assert [f for f in clinic.app.state.blobs.files() if f.space == "incoming"] == []


async def test_the_length_of_an_upload_is_counted_before_its_first_byte(disk: Path) -> None:
    async with open_clinic(disk, min_free_bytes=1_000_000) as clinic:
        v = Visit(clinic)
        files = f"{API}/sessions/{v.session}/files"
        pulled = 0

        async def body() -> AsyncIterator[bytes]:
            nonlocal pulled
            for _ in range(40):
                pulled += 1
                yield b"x" * 1_000_000

        async with clinic.client("clinician", raises=False) as client:
            declared = {"Content-Length": "40000000"}
            answer = await client.put(f"{files}/big", content=body(), headers=declared)
            assert (answer.status_code, answer.json()["code"], pulled) == (507, "disk_full", 0)
            form = declared | {"Content-Type": "multipart/form-data; boundary=x"}
            answer = await client.post(files, content=body(), headers=form)
            assert (answer.status_code, answer.json()["code"], pulled) == (507, "disk_full", 0)
            # a length that nobody declared: refused at the limit, and the disk is as free as before
            answer = await client.put(f"{files}/big", content=body())
            assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
            assert pulled < 40
            assert (await client.put(f"{files}/small", content=b"x" * 1_000_000)).status_code == 201


@pytest.mark.death
@pytest.mark.parametrize(
    ("number", "code"), [(errno.ENOSPC, "disk_full"), (errno.EROFS, "disk_not_writable")]
)
async def test_an_upload_refused_at_any_call_answers_507_and_can_be_sent_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, code: str
) -> None:
    async with open_clinic(tmp_path, min_free_bytes=0) as clinic:
        v = Visit(clinic)
        async with clinic.client("clinician", raises=False) as client:
            for failures in itertools.count():
                monkeypatch.setattr(fs, "system", FailingSystem(failures + 1, number))
                answer = await client.put(f"{API}/sessions/{v.session}/files/b.txt", content=b"x" * 2_000_000)
                monkeypatch.setattr(fs, "system", fs.System())
                if answer.status_code == 201:
                    break
                assert (answer.status_code, answer.json()["code"]) == (507, code)
            assert failures >= 5


@contextlib.contextmanager
def refusing(clinic: Clinic, code: str) -> Iterator[None]:
    """While the block runs the database takes nothing more, by the engine's own refusal."""
    url = clinic.settings.database_url
    if not url:
        pragma = "max_page_count=1" if code == "disk_full" else "query_only=ON"
        with clinic.db.write() as c:
            c.exec_driver_sql(f"PRAGMA {pragma}")
        yield
        clinic.db.close()  # the next connection may write
        return
    name = url.rpartition("/")[2]
    with contextlib.ExitStack() as until:
        if code == "disk_full":
            until.enter_context(full(until.enter_context(on_small_disk(name, 48))))
        else:
            run_sql(f"ALTER DATABASE {name} SET default_transaction_read_only = on")
            until.callback(run_sql, f"ALTER DATABASE {name} RESET default_transaction_read_only")
        clinic.db.close()  # the setting is for new connections
        yield
        clinic.db.close()


@on_both_engines
@pytest.mark.parametrize("code", ["disk_full", "disk_not_writable"])
async def test_a_database_that_takes_nothing_refuses_changes_and_lets_people_read(
    tmp_path: Path, code: str
) -> None:
    async with open_clinic(tmp_path, min_free_bytes=0) as clinic:
        v = Visit(clinic)
        async with clinic.client("clinician", raises=False) as client:
            with refusing(clinic, code):
                for i in range(300):  # a full one has some room in its last pages
                    answer = await client.post(f"{API}/patients", json={"code": f"N-{i}", "note": "x" * 2000})
                    if answer.status_code != 201:
                        break
                assert (answer.status_code, answer.json()["code"]) == (507, code)
                for path in readings(v):
                    assert (await client.get(path)).status_code == 200
            assert (await client.post(f"{API}/patients", json={"code": "last"})).status_code == 201
        with clinic.db.read() as c:
            assert audit.find_problems(c) == []


def test_a_server_that_finds_a_full_disk_says_so_and_sends_nobody_to_the_backups(
    disk: Path,
) -> None:
    database = Settings(data_dir=disk).database
    upgrade(database)
    with full(disk), pytest.raises(MigrationError) as error:
        upgrade(database)
    assert "is full" in str(error.value)
    assert "make room" in str(error.value)
    assert "backup" not in str(error.value)
    assert upgrade(database) is None


async def test_nothing_is_shown_when_too_many_rows_wait_and_all_are_written_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trail, "MOST_WAITING", 5)
    async with open_clinic(tmp_path, min_free_bytes=0) as clinic:
        v = Visit(clinic)
        path = f"{API}/patients/{v.patient}"
        async with clinic.client("viewer", raises=False) as client:
            with refusing(clinic, "disk_not_writable"):
                initial_seq = v.rows()[0].seq
                visible_status_codes = [(await client.get(path)).status_code for _ in range(7)]
                assert visible_status_codes == [200] * 5 + [507] * 2
                wrong = await client.post(f"{API}/sign-in", json={"name": "viewer", "password": "wrong"})
                assert wrong.status_code == 401
                assert v.rows()[0].seq == initial_seq
    async with open_clinic(tmp_path, min_free_bytes=0) as clinic:
        v.clinic = clinic
        new = [(r.action, r.user_name) for r in v.rows() if r.seq > initial_seq]
    assert new == [("patient.opened", "viewer")] * 5
