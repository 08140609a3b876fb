from __future__ import annotations

import logging
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy.exc import IntegrityError

from sagittal.server.commands import serve
from sagittal.server.settings import Settings
from sagittal.server.storage import migrate
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.schema.tables import metadata
from tests.data import ROOT
from tests.helpers.postgres import run_sql

HANG = """
import pathlib, time
from alembic import op
import sqlalchemy as sa
revision, down_revision = "next", "{head}"
def upgrade():
    op.create_table("extra", sa.Column("id", sa.Integer, primary_key=True))
    with op.batch_alter_table("patient") as batch:
        batch.add_column(sa.Column("shoe", sa.Integer))
    {then}
def downgrade():
    with op.batch_alter_table("patient") as batch:
        batch.drop_column("shoe")
    op.drop_table("extra")
"""


@pytest.mark.slow
def test_nobody_else_may_read_the_database_in_a_folder_that_was_there(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    path = tmp_path / "sagittal.db"
    migrate.upgrade(path)
    path.chmod(0o644)  # of an earlier version
    migrate.upgrade(path)
    with closing(Database(path)) as db, db.write() as c:
        c.exec_driver_sql("UPDATE patient SET note = ''")
        files = [p for p in tmp_path.iterdir() if p.is_file()]
        assert {(p.name, p.stat().st_mode & 0o777) for p in files} == {
            (path.name + end, 0o600) for end in ("", "-wal", "-shm")
        }
    backup = migrate._backup(path, "x", tmp_path / "backups", None)
    assert backup.stat().st_mode & 0o777 == 0o600


TABLES_OF_POSTGRES = """
SELECT 'column', table_name || '.' || column_name, concat_ws(' ', data_type, character_maximum_length,
    is_nullable, column_default) FROM information_schema.columns
    WHERE table_schema = 'public' AND table_name NOT LIKE '%alembic%'
UNION ALL SELECT 'rule', conname, pg_get_constraintdef(oid) FROM pg_constraint
    WHERE connamespace = 'public'::regnamespace AND conname NOT LIKE '%alembic%'
UNION ALL SELECT 'index', indexname, indexdef FROM pg_indexes
    WHERE schemaname = 'public' AND indexname NOT LIKE '%alembic%'
UNION ALL SELECT 'trigger', tgname, pg_get_triggerdef(pg_trigger.oid) FROM pg_trigger
    JOIN pg_class ON pg_class.oid = tgrelid
    WHERE NOT tgisinternal AND relnamespace = 'public'::regnamespace
UNION ALL SELECT 'function', proname, prosrc FROM pg_proc WHERE pronamespace = 'public'::regnamespace
"""


def schema(source: Source) -> set[tuple[str, str, tuple[str, ...]]]:
    if isinstance(source, str):
        return {(kind, name, (text,)) for kind, name, text in run_sql(TABLES_OF_POSTGRES, source)}
    query = "SELECT type, name, coalesce(sql, '') FROM sqlite_master WHERE name NOT LIKE '%alembic%'"
    # the order of constraints inside a statement means nothing, nor do quotes around a renamed table
    return {
        (kind, name, tuple(sorted(s.strip().rstrip(",") for s in sql.replace('"', "").splitlines())))
        for kind, name, sql in ask(source, query)
        if not name.startswith("sqlite_")
    }


def ask(source: Source, query: str) -> list[tuple[Any, ...]]:
    with closing(Database(source)) as db, db.read() as c:
        return [tuple(row) for row in c.exec_driver_sql(query)]


def run(source: Source, *statements: str) -> None:
    with closing(Database(source)) as db, db.write() as c:
        for statement in statements:
            c.exec_driver_sql(statement)


def fill(source: Source) -> None:
    run(
        source,
        "INSERT INTO patient (id, code, note, created_at) "
        "VALUES ('p', 'A', '', '2026-01-01 00:00:00.000000')",
        "INSERT INTO session (id, patient_id, title, performed_on, protocol, note, created_at) "
        "VALUES ('s0', 'p', 't', '2026-01-01', 'walk', '', '2026-01-01 00:00:00.000000'),"
        "('s1', 'p', 't', '2026-01-01', 'walk', '', '2026-01-01 00:00:00.000000')",
    )


def counts(source: Source) -> tuple[int, int]:
    query = "SELECT (SELECT count(*) FROM patient), (SELECT count(*) FROM session)"
    [(people, visits)] = ask(source, query)
    return people, visits


@pytest.fixture
def head(scripts: Path) -> str:
    """The newest revision of this version; the tests' own step follows it."""
    config = migrate.configuration(Path("none.db"), scripts)
    current_head = ScriptDirectory.from_config(config).get_current_head()
    assert current_head is not None
    return current_head


@pytest.fixture
def scripts(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "migrations", tmp_path / "migrations"))


@pytest.mark.slow
def test_the_migrated_schema_is_the_one_the_code_declares(bare_source: Source) -> None:
    fresh = Database(bare_source)
    with fresh.write() as c:
        metadata.create_all(c)
    declared = schema(bare_source)
    with fresh.write() as c:
        metadata.drop_all(c)
        if isinstance(bare_source, str):
            c.exec_driver_sql("DROP FUNCTION refuse_change()")
    fresh.close()
    assert schema(bare_source) == set()
    migrate.upgrade(bare_source)
    assert schema(bare_source) == declared
    command.check(migrate.configuration(bare_source))


@pytest.mark.slow
def test_down_and_up_again_leave_the_same_schema(bare_source: Source) -> None:
    migrate.upgrade(bare_source)
    initial_schema = schema(bare_source)
    command.downgrade(migrate.configuration(bare_source), "base")
    assert schema(bare_source) == set()
    migrate.upgrade(bare_source)
    assert schema(bare_source) == initial_schema


@pytest.mark.slow
def test_data_survive_up_and_down_and_a_backup_is_made_before(
    bare_source: Source, tmp_path: Path, scripts: Path, head: str
) -> None:
    source, retained = bare_source, tmp_path / "kept"
    assert migrate.upgrade(source, target=head, scripts=scripts, backups=retained) is None
    fill(source)
    (scripts / "versions" / "next.py").write_text(HANG.format(head=head, then="pass"))
    backup = migrate.upgrade(source, scripts=scripts, backups=retained)
    assert migrate.read_revision(source) == "next"
    assert counts(source) == (1, 2)
    assert backup is not None
    assert (counts(backup), migrate.read_revision(backup)) == ((1, 2), head)
    command.downgrade(migrate.configuration(source, scripts), head)
    assert counts(source) == (1, 2)
    assert migrate.upgrade(source, scripts=scripts, backups=retained) is not None
    assert counts(source) == (1, 2)


@pytest.mark.slow
def test_earlier_sessions_have_no_condition_but_the_feedback_that_was_kept(
    bare_source: Source, tmp_path: Path
) -> None:
    source = bare_source
    migrate.upgrade(source, target="0005")
    fill(source)
    run(
        source,
        "INSERT INTO recording (id, session_id, created_at) SELECT 'r' || id, id, created_at FROM session",
        "INSERT INTO live_take (id, session_id, state, recording_id, created_at, finished_at) "
        "SELECT 't' || id, id, 'finished', 'r' || id, created_at, created_at FROM session",
        "INSERT INTO live_event (take_id, kind, content, at) VALUES "
        """('ts0', 'cue', '{"shown": false, "why_not": "bandwidth"}', '2026-01-01 00:00:00.000000'),"""
        """('ts1', 'cue', '{"shown": false, "why_not": "probe"}', '2026-01-01 00:00:00.000000')""",
    )
    migrate.upgrade(source, backups=tmp_path / "kept")
    query = "SELECT id, pace, aid, orthosis, shoes, feedback FROM session ORDER BY id"
    assert ask(source, query) == [("s0", *[None] * 4, True), ("s1", *[None] * 4, False)]
    command.downgrade(migrate.configuration(source), "0005")
    assert counts(source) == (1, 2)


@pytest.mark.slow
def test_a_failing_migration_leaves_exactly_the_old_revision(
    bare_source: Source, tmp_path: Path, scripts: Path, head: str
) -> None:
    source, retained = bare_source, tmp_path / "kept"
    migrate.upgrade(source, target=head, scripts=scripts)
    fill(source)
    initial_schema = schema(source)
    step = scripts / "versions" / "next.py"
    for wrong in (
        "raise RuntimeError('broken')",
        "op.execute(\"UPDATE session SET patient_id = 'nobody'\")",  # dangling: seen before COMMIT
    ):
        step.write_text(HANG.format(head=head, then=wrong))
        with pytest.raises((RuntimeError, IntegrityError)):
            migrate.upgrade(source, scripts=scripts, backups=retained)
        assert (schema(source), migrate.read_revision(source), counts(source)) == (
            initial_schema,
            head,
            (1, 2),
        )
    step.write_text(HANG.format(head=head, then="pass"))
    migrate.upgrade(source, scripts=scripts, backups=retained)
    assert migrate.read_revision(source) == "next"


@pytest.mark.slow
def test_a_migration_killed_in_the_middle_leaves_exactly_the_old_revision(
    bare_source: Source, tmp_path: Path, scripts: Path, head: str
) -> None:
    source, retained, marker = bare_source, tmp_path / "kept", tmp_path / "reached"
    migrate.upgrade(source, target=head, scripts=scripts)
    fill(source)
    initial_schema = schema(source)
    step = scripts / "versions" / "next.py"
    step.write_text(HANG.format(head=head, then=f"pathlib.Path({str(marker)!r}).touch(); time.sleep(600)"))
    script = textwrap.dedent(f"""
        from pathlib import PosixPath
        from sagittal.server.storage.migrate import upgrade
        upgrade({source!r}, scripts={scripts!r}, backups={retained!r})
    """)
    process = subprocess.Popen([sys.executable, "-c", script], cwd=ROOT)
    limit = time.monotonic() + 60
    while not marker.exists():
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert (schema(source), migrate.read_revision(source), counts(source)) == (initial_schema, head, (1, 2))
    step.write_text(HANG.format(head=head, then="pass"))
    migrate.upgrade(source, scripts=scripts, backups=retained)
    assert (migrate.read_revision(source), counts(source)) == ("next", (1, 2))


@pytest.mark.slow
def test_an_unknown_revision_is_refused(bare_source: Source) -> None:
    migrate.upgrade(bare_source)
    run(bare_source, "UPDATE alembic_version SET version_num = 'f00d'")
    for start in (migrate.upgrade, migrate.require_current):
        with pytest.raises(migrate.MigrationError, match="f00d"):
            start(bare_source)


def test_a_file_that_is_no_database_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    path.write_bytes(b"not a database" * 1000)
    with pytest.raises(migrate.MigrationError, match="Restore it from a backup"):
        migrate.upgrade(path)


@pytest.mark.slow
def test_a_server_whose_port_is_in_use_migrates_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("os.umask", lambda _: 0)
    migrate.upgrade(tmp_path / "sagittal.db", target="0020")
    with socket.create_server(("127.0.0.1", 0)) as other_server:
        settings = Settings(data_dir=tmp_path, port=other_server.getsockname()[1])
        assert serve.run(settings, pytest.fail) == 1
    assert "choose another with --port" in capsys.readouterr().err
    assert migrate.read_revision(tmp_path / "sagittal.db") == "0020"
    assert not (tmp_path / "backups").exists()


def test_a_worker_waits_until_a_server_has_migrated(
    bare_source: Source, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    class Stop(threading.Event):
        """A server starts while the worker pauses for the third time."""

        pauses = 0

        def wait(self, timeout: float | None = None) -> bool:
            self.pauses += 1
            if self.pauses == 3:
                migrate.upgrade(bare_source, backups=tmp_path / "backups")
            return self.is_set()

    if isinstance(bare_source, Path):  # a folder without a database is the wrong one
        migrate.upgrade(bare_source, target="0020")
    stop = Stop()
    with caplog.at_level(logging.INFO, logger=migrate.__name__):
        migrate.await_current(bare_source, stop)
    assert stop.pauses == 3
    migrate.require_current(bare_source)
    [line] = [r for r in caplog.records if r.name == migrate.__name__]
    assert line.getMessage().startswith("waiting until a server has prepared the database")


def test_a_stopped_worker_does_not_wait_and_a_newer_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sagittal.db"
    migrate.upgrade(path, target="0020")
    stop = threading.Event()
    stop.set()
    migrate.await_current(path, stop)
    with closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE alembic_version SET version_num = 'from the future'")
        db.commit()
    with pytest.raises(migrate.MigrationError, match="newer one"):
        migrate.await_current(path, threading.Event())


@pytest.mark.slow
def test_the_command_waits_quietly_and_ends_when_told(tmp_path: Path) -> None:
    migrate.upgrade(tmp_path / "sagittal.db", target="0020")
    worker = subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", "worker", "--data", str(tmp_path)],
        cwd=ROOT, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    with worker:
        assert worker.stderr is not None
        assert "waiting until a server has prepared the database" in worker.stderr.readline()
        worker.terminate()
        assert worker.communicate(timeout=60)[1] == ""
    assert worker.returncode == 0


def test_a_worker_refuses_a_database_that_is_behind(tmp_path: Path) -> None:
    details = tmp_path / "behind.db"
    details.touch()
    with pytest.raises(migrate.MigrationError, match="sagittal migrate"):
        migrate.require_current(details)


def test_a_worker_makes_no_database(bare_source: Source) -> None:
    with pytest.raises(migrate.MigrationError, match=r"There is no database|has no clinic"):
        migrate.require_current(bare_source)
    assert not migrate.exists(bare_source)
