from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
import time
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from alembic.script import ScriptDirectory

from server.storage import migrate
from server.storage.db import Database
from server.storage.tables import metadata
from tests.data import ROOT

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
    backup = migrate._backup(path, "x")
    assert backup.stat().st_mode & 0o777 == 0o600


def schema(path: Path) -> set[tuple[str, str, tuple[str, ...]]]:
    query = "SELECT type, name, coalesce(sql, '') FROM sqlite_master WHERE name NOT LIKE '%alembic%'"
    with closing(sqlite3.connect(path)) as c:
        rows = c.execute(query).fetchall()
    # the order of constraints inside a statement means nothing, nor do quotes around a renamed table
    return {
        (kind, name, tuple(sorted(s.strip().rstrip(",") for s in sql.replace('"', "").splitlines())))
        for kind, name, sql in rows
    }


def fill(path: Path) -> None:
    with closing(sqlite3.connect(path)) as c:
        c.execute("PRAGMA foreign_keys=ON")
        c.execute(
            "INSERT INTO patient (id, code, note, created_at) VALUES ('p', 'A', '', '2026-01-01 00:00:00')"
        )
        for i in range(2):
            c.execute(
                "INSERT INTO session (id, patient_id, title, performed_on, protocol, note, created_at) "
                "VALUES (?, 'p', 't', '2026-01-01', 'walk', '', '2026-01-01 00:00:00.000000')",
                (f"s{i}",),
            )
        c.commit()


def counts(path: Path) -> tuple[int, int]:
    with closing(sqlite3.connect(path)) as c:
        return (
            c.execute("SELECT count(*) FROM patient").fetchone()[0],
            c.execute("SELECT count(*) FROM session").fetchone()[0],
        )


@pytest.fixture
def head(scripts: Path) -> str:
    """The newest revision of this version; the tests' own step follows it."""
    config = migrate.configuration(Path("none.db"), scripts)
    found = ScriptDirectory.from_config(config).get_current_head()
    assert found is not None
    return found


@pytest.fixture
def scripts(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "migrations", tmp_path / "migrations"))


def test_the_migrated_schema_is_the_one_the_code_declares(tmp_path: Path) -> None:
    migrate.upgrade(tmp_path / "migrated.db")
    fresh = Database(tmp_path / "fresh.db")
    with fresh.write() as c:
        metadata.create_all(c)
    fresh.close()
    assert schema(tmp_path / "migrated.db") == schema(tmp_path / "fresh.db")
    command.check(migrate.configuration(tmp_path / "migrated.db"))


def test_down_and_up_again_leave_the_same_schema(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    migrate.upgrade(path)
    before = schema(path)
    command.downgrade(migrate.configuration(path), "base")
    assert schema(path) <= {row for row in schema(path) if row[1].startswith("sqlite_")}
    migrate.upgrade(path)
    assert schema(path) == before


def test_data_survive_up_and_down_and_a_backup_is_made_before(
    tmp_path: Path, scripts: Path, head: str
) -> None:
    path = tmp_path / "a.db"
    assert migrate.upgrade(path, target=head, scripts=scripts) is None
    fill(path)
    (scripts / "versions" / "next.py").write_text(HANG.format(head=head, then="pass"))
    backup = migrate.upgrade(path, scripts=scripts)
    assert migrate.read_revision(path) == "next"
    assert counts(path) == (1, 2)
    assert backup is not None
    assert (counts(backup), migrate.read_revision(backup)) == ((1, 2), head)
    command.downgrade(migrate.configuration(path, scripts), head)
    assert counts(path) == (1, 2)
    assert migrate.upgrade(path, scripts=scripts) is not None
    assert counts(path) == (1, 2)


def test_earlier_sessions_have_no_condition_but_the_feedback_that_was_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    config = migrate.configuration(path)
    migrate.upgrade(path, target="0005")
    fill(path)
    cues = {"s0": {"shown": False, "why_not": "bandwidth"}, "s1": {"shown": False, "why_not": "probe"}}
    at = "2026-01-01 00:00:00.000000"
    with closing(sqlite3.connect(path)) as c:
        for session, cue in cues.items():
            c.execute(
                "INSERT INTO recording (id, session_id, created_at) VALUES (?, ?, ?)",
                (f"r{session}", session, at),
            )
            c.execute(
                "INSERT INTO live_take (id, session_id, state, recording_id, created_at, finished_at) "
                "VALUES (?, ?, 'finished', ?, ?, ?)",
                (f"t{session}", session, f"r{session}", at, at),
            )
            c.execute(
                "INSERT INTO live_event (take_id, kind, content, at) VALUES (?, 'cue', ?, ?)",
                (f"t{session}", json.dumps(cue), at),
            )
        c.commit()
    migrate.upgrade(path)
    query = "SELECT id, pace, aid, orthosis, shoes, feedback FROM session ORDER BY id"
    with closing(sqlite3.connect(path)) as c:
        assert c.execute(query).fetchall() == [("s0", *[None] * 4, 1), ("s1", *[None] * 4, 0)]
    command.downgrade(config, "0005")
    assert counts(path) == (1, 2)


def test_a_failing_migration_leaves_exactly_the_old_revision(
    tmp_path: Path, scripts: Path, head: str
) -> None:
    path = tmp_path / "a.db"
    migrate.upgrade(path, target=head, scripts=scripts)
    fill(path)
    before = schema(path)
    step = scripts / "versions" / "next.py"
    for wrong in (
        "raise RuntimeError('broken')",
        "op.execute(\"UPDATE session SET patient_id = 'nobody'\")",  # dangling: seen before COMMIT
    ):
        step.write_text(HANG.format(head=head, then=wrong))
        with pytest.raises(RuntimeError):
            migrate.upgrade(path, scripts=scripts)
        assert (schema(path), migrate.read_revision(path), counts(path)) == (before, head, (1, 2))
    step.write_text(HANG.format(head=head, then="pass"))
    migrate.upgrade(path, scripts=scripts)
    assert migrate.read_revision(path) == "next"


def test_a_migration_killed_in_the_middle_leaves_exactly_the_old_revision(
    tmp_path: Path, scripts: Path, head: str
) -> None:
    path, marker = tmp_path / "a.db", tmp_path / "reached"
    migrate.upgrade(path, target=head, scripts=scripts)
    fill(path)
    before = schema(path)
    step = scripts / "versions" / "next.py"
    step.write_text(HANG.format(head=head, then=f"pathlib.Path({str(marker)!r}).touch(); time.sleep(600)"))
    script = textwrap.dedent(f"""
        from pathlib import Path
        from server.storage.migrate import upgrade
        upgrade(Path({str(path)!r}), scripts=Path({str(scripts)!r}))
    """)
    process = subprocess.Popen([sys.executable, "-c", script], cwd=ROOT)
    limit = time.monotonic() + 60
    while not marker.exists():
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert (schema(path), migrate.read_revision(path), counts(path)) == (before, head, (1, 2))
    step.write_text(HANG.format(head=head, then="pass"))
    migrate.upgrade(path, scripts=scripts)
    assert (migrate.read_revision(path), counts(path)) == ("next", (1, 2))


def test_an_unknown_revision_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    migrate.upgrade(path)
    with closing(sqlite3.connect(path)) as c:
        c.execute("UPDATE alembic_version SET version_num = 'f00d'")
        c.commit()
    for start in (migrate.upgrade, migrate.require_current):
        with pytest.raises(migrate.MigrationError, match="f00d"):
            start(path)


def test_a_file_that_is_no_database_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    path.write_bytes(b"not a database" * 1000)
    with pytest.raises(migrate.MigrationError, match="Restore it from a backup"):
        migrate.upgrade(path)


def test_a_worker_refuses_a_database_that_is_behind(tmp_path: Path) -> None:
    with pytest.raises(migrate.MigrationError, match="sagittal migrate"):
        migrate.require_current(tmp_path / "none.db")
