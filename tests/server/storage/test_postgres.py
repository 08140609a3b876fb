"""Unavailable PostgreSQL, copies between engines, and exclusive access."""

from __future__ import annotations

import datetime as dt
import sys
import threading
import time
import traceback
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from alembic import command
from sqlalchemy import insert, make_url, select
from sqlalchemy.exc import IntegrityError, OperationalError

from sagittal.server import audit
from sagittal.server.clinic import patients
from sagittal.server.jobs.opening import open_queue
from sagittal.server.main import main
from sagittal.server.safekeeping.custody import StrangersError, refuse_foreign_folder
from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage import migrate
from sagittal.server.storage.db import Database, highest_number
from sagittal.server.storage.high_water import set_mark
from sagittal.server.storage.postgres import PostgresServer
from sagittal.server.storage.refusal import is_busy
from sagittal.server.storage.schema.person_tables import api_token
from sagittal.server.storage.schema.tables import metadata, new_id, now, patient, user
from tests.helpers.clinic import ORIGIN, open_clinic
from tests.helpers.databases import write_database
from tests.helpers.engines import require_postgres
from tests.helpers.postgres import PASSWORD, run_sql
from tests.server.nodes.pair import describe, find_ports, start_process

pytestmark = [pytest.mark.postgres, pytest.mark.anyio]


def test_every_reason_why_it_cannot_be_used_is_a_sentence(
    postgres: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, _, _ = postgres.rpartition("/")
    known_variant = PASSWORD.replace(" ", "%20")
    for url, message in (
        (
            postgres.replace(known_variant, "SECRET"),
            r"refused postgresql://sagittal:\*\*\*@.*Check user, password",
        ),
        (postgres.replace(f":{known_variant}", ""), "refused .*Check user, password"),
        (f"{server}/nowhere", "refused .*nowhere.* does not exist"),
        (f"postgresql://a:{known_variant}@127.0.0.1:1/b", "is not reached at .*Check that it runs"),
    ):
        with pytest.raises(migrate.MigrationError, match=message) as refused:
            migrate.upgrade(url)
        assert "SECRET" not in str(refused.value)
        assert PASSWORD not in str(refused.value)
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "psycopg", None)
        with pytest.raises(migrate.MigrationError, match=r"pip install '.\[postgres\]'"):
            migrate.upgrade(postgres)


def test_a_server_without_room_for_a_connection_is_told_as_that(postgres: str) -> None:
    run_sql("CREATE ROLE crowded LOGIN PASSWORD 'of nobody' CONNECTION LIMIT 0")
    crowded = make_url(postgres).set(username="crowded", password="of nobody")
    with pytest.raises(migrate.MigrationError, match=r"no connection left.* max_connections"):
        migrate.upgrade(crowded.render_as_string(hide_password=False))


def test_a_wrong_setting_is_named_without_what_may_be_a_password(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="database_url") as refused:
        Settings(data_dir=tmp_path, database_url="mysql://a:SECRET@b/c")
    assert "SECRET" not in str(refused.value)
    assert "SECRET" not in repr(Settings(data_dir=tmp_path, database_url="postgresql://a:SECRET@b/c"))


def test_two_programs_that_migrate_at_once_do_it_once() -> None:
    with require_postgres(migrated=False) as url:
        failed: list[BaseException] = []

        def upgrade() -> None:
            try:
                migrate.upgrade(url)
            except BaseException as error:  # noqa: BLE001 - whatever it is, the test shows it
                failed.append(error)

        # Alembic's own context is one per process, so the other program is what holds the lock first
        with closing(Database(url)) as other_connection, other_connection.write():
            thread = threading.Thread(target=upgrade)
            thread.start()
            until = time.monotonic() + 30
            waiting = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
            while run_sql(waiting) == [(0,)] and thread.is_alive():
                assert time.monotonic() < until
                time.sleep(0.02)
            assert thread.is_alive()
        thread.join()
        assert failed == []
        migrate.require_current(url)
        assert migrate.upgrade(url) is None


def test_nothing_is_migrated_under_web_servers_that_run(tmp_path: Path) -> None:
    with require_postgres(migrated=False) as url:
        migrate.upgrade(url, target="0020")
        with closing(Database(url)) as older, older.serve("a") as serves:
            assert serves
            with pytest.raises(migrate.MigrationError, match="Stop all of them"):
                migrate.upgrade(url, backups=tmp_path)
            assert migrate.read_revision(url) == "0020"
            assert list(tmp_path.iterdir()) == []
        assert migrate.upgrade(url, backups=tmp_path) is not None
        with closing(Database(url)) as current, current.serve("a"):
            assert migrate.upgrade(url) is None
            run_sql("COMMENT ON SCHEMA procrastinate IS '0.0'", url)  # another version delivers
            with pytest.raises(migrate.MigrationError, match="Stop all of them"):
                migrate.upgrade(url)


def test_nothing_is_migrated_under_a_worker_that_waits_for_jobs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(migrate, "OTHERS_LEAVE_S", 0.2)
    with require_postgres(migrated=False) as url, closing(Database(url)) as db:
        migrate.upgrade(url, target="0020")
        with open_queue(db, 1.5).listen():
            until = time.monotonic() + 30
            while not PostgresServer(url).list_others():
                assert time.monotonic() < until
                time.sleep(0.02)
            with pytest.raises(migrate.MigrationError, match=r"workers perhaps \(at 127\.0\.0\.1\)"):
                migrate.upgrade(url, backups=tmp_path)
            assert migrate.read_revision(url) == "0020"
            assert list(tmp_path.iterdir()) == []
        assert migrate.upgrade(url, backups=tmp_path) is not None


def test_who_had_to_wait_for_a_migration_goes_on_beside_whoever_did_it(tmp_path: Path) -> None:
    with require_postgres(migrated=False) as url, closing(Database(url)) as first:
        done: list[object] = []
        with PostgresServer(url).take_turn_to_migrate() as turn:
            assert turn
            second = threading.Thread(target=lambda: done.append(migrate.upgrade(url)))
            second.start()
            until = time.monotonic() + 30
            while run_sql("SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted") == [
                (0,)
            ]:
                assert time.monotonic() < until
                time.sleep(0.02)
            command.upgrade(migrate.configuration(url), "head")
            PostgresServer(url).prepare_delivery()
            serving = first.serve("a")
            assert serving.__enter__()
        second.join()
        assert done == [None]
        serving.__exit__(None, None, None)


def test_a_web_server_that_is_refused_migrates_nothing(tmp_path: Path) -> None:
    with require_postgres(migrated=False) as url:
        migrate.upgrade(url, target="0020")
        # no clock agrees so well
        node = replace(describe(tmp_path, url, "a", find_ports(1)[0]), lease_s=1e-9)
        process = start_process(node)
        communicate = process.communicate(timeout=60)[1]
        assert process.returncode == 1
        assert "Set both by NTP" in communicate
        assert migrate.read_revision(url) == "0020"


def test_a_clinic_moves_to_postgres_and_back_unchanged(
    tmp_path: Path, postgres: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    origin, back = tmp_path / "sagittal.db", tmp_path / "back.db"
    write_database(origin)
    with closing(Database(origin)) as db, db.write() as c:
        one = new_id()
        patients.create(c, None, code="Ä-1", height_m=1.755)
        c.execute(
            insert(user).values(
                id=one, name="ada", role="admin", active=True, created_at=now(), display_name="A"
            )
        )
        c.execute(
            insert(api_token).values(
                id=new_id(),
                user_id=one,
                name="t",
                token_sha256="0" * 64,
                scopes=["a", {"ü": [1.5, None]}],
                created_at=now(),
                expires_at=now() + dt.timedelta(days=1),
            )
        )
    assert main(["move-database", "--data", str(tmp_path)]) == 1
    assert "Set SAGITTAL_DATABASE_URL" in capsys.readouterr().err
    monkeypatch.setenv("SAGITTAL_DATABASE_URL", postgres)
    assert main(["move-database", "--data", str(tmp_path)]) == 0
    assert not origin.exists()
    origin = tmp_path / "backups" / "before-postgresql.db"
    migrate.copy_database(postgres, back)
    rows = []
    for source in (origin, postgres, back):
        with closing(Database(source)) as db, db.read() as c:
            rows.append({t.name: c.execute(select(t)).all() for t in metadata.sorted_tables})
            assert audit.find_problems(c) == []
    assert rows[0]["api_token"]
    assert rows[0] == rows[1] == rows[2]
    with pytest.raises(migrate.MigrationError, match="holds rows already"):
        migrate.copy_database(origin, postgres)
    with closing(Database(postgres)) as db, db.write() as c:
        audit.record(c, None, "x", "database", None)
        assert highest_number(c, "audit") == 2
        assert highest_number(c, "edit") == highest_number(c, "job") == 0


def test_a_writer_that_waits_too_long_is_told_that_the_database_is_busy(
    postgres: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.storage.postgres.WAIT_MS", 50)
    with closing(Database(postgres)) as one, closing(Database(postgres)) as two, one.write():
        with pytest.raises(OperationalError) as busy, two.write():
            pass
        assert is_busy(busy.value)


def test_no_value_of_a_row_is_in_the_text_of_an_error(postgres: str) -> None:
    with closing(Database(postgres)) as db:
        for wrong in ({"code": "CANARY", "birth_year": 85}, {"code": "CANARY", "note": None}):
            row = {"id": new_id(), "note": "", "created_at": now()} | wrong
            with pytest.raises(IntegrityError, match="violates") as refused, db.write() as c:
                c.execute(insert(patient).values(row))
            assert "CANARY" not in "".join(traceback.format_exception(refused.value))


async def test_what_only_postgres_refuses_is_a_problem_of_the_request(tmp_path: Path, postgres: str) -> None:
    async with open_clinic(tmp_path, database_url=postgres) as clinic, clinic.client("clinician") as client:
        for note, status in (("as usual", 201), ("\0", 422)):
            answer = await client.post(
                f"{ORIGIN}/api/v1/patients", json={"code": f"P-{status}", "note": note}
            )
            assert answer.status_code == status
        assert answer.json()["code"] in {"not_storable", "invalid_request"}


def test_a_frozen_writer_is_forgotten(postgres: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sagittal.server.storage.postgres.FORGOTTEN_S", 1)
    with closing(Database(postgres)) as frozen, closing(Database(postgres)) as other_connection:

        def hold() -> None:
            with frozen.write(), other_connection.write() as c:
                assert c.closed is False

        # whoever was forgotten cannot commit any more
        with pytest.raises(Exception, match="idle-in-transaction"):
            hold()


def test_only_one_web_server_is_on_a_database(postgres: str) -> None:
    with closing(Database(postgres)) as one, closing(Database(postgres)) as two:
        with one.serve("") as first, two.serve("") as second, two.serve("b") as named:
            assert (first, second, named) == (True, False, False)
        with two.serve("") as repeat:
            assert repeat


def test_web_servers_of_different_names_share_a_database_and_a_duty_is_done_by_one(postgres: str) -> None:
    with closing(Database(postgres)) as one, closing(Database(postgres)) as two:
        with one.serve("a") as a, two.serve("b") as b, two.serve("a") as same, two.serve("") as single:
            assert (a, b, same, single) == (True, True, False, False)
        with (
            one.do_alone("mark") as first,
            two.do_alone("mark") as second,
            two.do_alone("sweep") as alternative,
        ):
            assert (first, second, alternative) == (True, False, True)
        with two.do_alone("mark") as repeat:
            assert repeat


def test_a_worker_elsewhere_needs_the_servers_folder_and_its_time(
    tmp_path: Path, postgres: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, elsewhere = tmp_path / "shared", tmp_path / "elsewhere"
    place.mkdir()
    elsewhere.mkdir()
    settings = Settings(data_dir=place, database_url=postgres)
    with closing(Database(postgres)) as db:
        stop = threading.Event()
        threading.Timer(0.5, stop.set).start()
        refuse_foreign_folder(db, settings, stop, patience_s=0.0)  # no row yet: it waits to be told
        assert stop.is_set()
        stop.clear()
        with db.write() as c:
            patients.create(c, None, code="P-1")
        set_mark(db, settings.mark)
        refuse_foreign_folder(db, settings, stop)
        with pytest.raises(StrangersError, match="Share that folder"):
            refuse_foreign_folder(db, replace(settings, data_dir=elsewhere), stop, patience_s=0.0)
        monkeypatch.setattr("time.time", lambda: 0.0)
        with pytest.raises(StrangersError, match="clock"):
            refuse_foreign_folder(db, settings, stop)


def test_what_was_erased_is_in_no_table_of_the_disk_and_who_reads_only_delays_it(
    postgres: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sagittal.server.storage.postgres.WAIT_MS", 50)

    def found() -> bool:
        run_sql("CHECKPOINT")
        [[folder]] = run_sql("SHOW data_directory")
        # other tests' databases stand beside it
        [[own]] = run_sql("SELECT oid FROM pg_database WHERE datname = current_database()", postgres)
        tables = Path(folder) / "base" / str(own)
        return any(b"CANARY" in p.read_bytes() for p in tables.rglob("*") if p.is_file())

    with closing(Database(postgres)) as db:
        with db.write() as c:
            c.execute(insert(patient).values(id=new_id(), code="CANARY", note="", created_at=now()))
        assert found()
        with db.read() as c:
            c.execute(select(patient)).all()
            with db.write() as alternative:
                alternative.execute(patient.delete())
            assert not db.fold()
        assert db.fold()
        assert not found()
        db.probe()
        assert db.problems() == []
