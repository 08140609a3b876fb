"""Who the web servers are, and whose something is, without starting any."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import update

from sagittal.server.clinic import patients, sessions
from sagittal.server.errors import NodeAway
from sagittal.server.live.rows import Rows, claim_take
from sagittal.server.live_takes import live, live_recordings
from sagittal.server.nodes.pins import Owner, Pin, find_owner, find_pin
from sagittal.server.nodes.registry import FORGOTTEN, Nodes
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping.custody import StrangersError
from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.node_tables import web_node
from sagittal.server.storage.schema.tables import new_id, now

ID = "0123456789abcdef" * 2
URL = "postgresql://sagittal@127.0.0.1/sagittal"


@pytest.fixture
def db(source: Path | str) -> Iterator[Database]:
    """Database on both engines."""
    with closing(Database(source)) as db:
        yield db


def describe(folder: Path, name: str) -> Settings:
    return Settings(
        data_dir=folder, database_url=URL, node_name=name, node_address=f"http://{name}:8000", lease_s=60.0
    )


@contextlib.contextmanager
def running(db: Database, settings: Settings, fenced: list[str] | None = None) -> Iterator[Nodes]:
    nodes = Nodes(settings, db, lambda: (fenced if fenced is not None else []).append(settings.node_name))
    nodes.start()
    try:
        yield nodes
    finally:
        nodes.stop()


def make_take(db: Database, nodes: Nodes, code: str = "P-1") -> live.LiveTakeRecord:
    with db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code=code).id, title="Walk")
        return live.open_take(c, None, session.id, live.TakeOwner(nodes.name, nodes.run))[0]


@pytest.mark.parametrize(
    ("path", "query", "pin"),
    [
        (f"/sessions/{ID}/live/feed", b"", Pin("session", ID)),
        (f"/sessions/{ID}/live/figure", b"dark=1", Pin("session", ID)),
        (f"/api/v1/sessions/{ID}/live", b"", Pin("session", ID)),
        (f"/api/v1/sessions/{ID}/live/close", b"", Pin("session", ID)),
        (f"/api/v1/live/takes/{ID}/film/3", b"", Pin("take", ID)),
        (f"/views/{ID}/", b"", Pin("view", ID)),
        (f"/views/{ID}", b"", Pin("view", ID)),
        (f"/sessions/{ID}/replay", f"tab=1&view={ID}".encode(), Pin("view", ID)),
        (f"/sessions/{ID}/replay", b"view=../../secret", None),
        (f"/sessions/{ID}/live", b"", None),
        (f"/api/v1/sessions/{ID}/live/events", b"", None),
        ("/views/client/0123", b"", None),
    ],
)
def test_what_is_pinned_is_known_by_its_address(path: str, query: bytes, pin: Pin | None) -> None:
    assert find_pin({"path": path, "query_string": query}) == pin


def test_a_name_without_an_address_or_on_a_file_is_refused(tmp_path: Path) -> None:
    whole = describe(tmp_path, "a")
    with pytest.raises(SettingsError, match="one is missing"):
        replace(whole, node_address="")
    with pytest.raises(SettingsError, match="Several need PostgreSQL: set SAGITTAL_DATABASE_URL"):
        replace(whole, database_url="")
    for name in ("A", "a/b", "..", "x" * 33):
        with pytest.raises(SettingsError, match="node_name"):
            replace(whole, node_name=name)
    for address in ("10.0.0.1:8000", "http://a", "http://user@a:1", "http://a:1/path", "ftp://a:1"):
        with pytest.raises(SettingsError, match="node_address"):
            replace(whole, node_address=address)


def test_all_agree_where_something_lives_and_it_moves_when_one_is_away(tmp_path: Path, db: Database) -> None:
    with running(db, describe(tmp_path, "b")) as b, running(db, describe(tmp_path, "a")) as a:
        b._look()
        words = [new_id() for _ in range(40)]
        at_a, at_b = [[nodes.find_home(word) for word in words] for nodes in (a, b)]
        assert [place is None for place in at_a] == [target is not None for target in at_b]
        assert {place is None for place in at_a} == {True, False}
        offset = next(home for home in at_a if home is not None)
        a.suspect(offset)
        assert all(a.find_home(word) is None for word in words)
        b._write_beat(now())
        a._look()
        assert a.find_home(words[at_a.index(offset)]) is not None


def test_an_open_take_is_its_nodes_alone_and_one_that_is_over_anybodys_while_that_is_away(
    tmp_path: Path, db: Database
) -> None:
    with running(db, describe(tmp_path, "a")) as a, running(db, describe(tmp_path, "b")) as b:
        take = make_take(db, a)
        pin = Pin("session", take.session_id)
        assert find_owner(db, a, pin) is None
        owner = find_owner(db, b, pin)
        assert owner is not None
        assert (owner.name, owner.must, owner.node is not None) == ("a", True, True)
        with db.write() as c:
            c.execute(update(web_node).where(web_node.c.name == "a").values(beat_at=None))
        b._look()
        assert find_owner(db, b, pin) == Owner("a", None, must=True)
        with db.write() as c:
            live.end(c, None, take.id, "closed", count=0)
        assert find_owner(db, b, pin) is None


def test_a_later_start_of_a_node_fences_off_the_one_before(tmp_path: Path, db: Database) -> None:
    fenced: list[str] = []
    rows = Rows(db, ReviewedAnalyses(FolderBlobs(tmp_path / "blobs")))
    settings = replace(describe(tmp_path, "a"), lease_s=0.15)
    with running(db, settings, fenced) as first:
        take = make_take(db, first)
        with running(db, settings) as second:
            rows.claim(take, live.TakeOwner("a", second.run))
            first._thread.join(10)
            assert fenced == ["a"]
            with pytest.raises(NodeAway):
                rows.claim(take, live.TakeOwner("a", first.run))
            with pytest.raises(NodeAway):
                rows.claim(take, live.TakeOwner("b", 1))
            first.stop()  # does not tell that the second has stopped
            assert [node.beat_at is None for node in second.list_all()] == [False]


def test_who_was_silent_for_a_month_is_forgotten_and_its_starts_still_count_on(
    tmp_path: Path, db: Database
) -> None:
    with running(db, describe(tmp_path, "a")) as a:
        make_take(db, a)
    with running(db, describe(tmp_path, "b")) as b:
        assert [node.name for node in b.list_all()] == ["a", "b"]
        with db.write() as c:
            c.execute(update(web_node).where(web_node.c.name == "a").values(beat_at=now() - 2 * FORGOTTEN))
    with running(db, describe(tmp_path, "b")) as b, running(db, describe(tmp_path, "a")) as repeat:
        assert [node.name for node in b.list_all()] == ["a", "b"]
        assert (repeat.run, b.run) == (2, 2)


def test_a_node_on_another_folder_is_refused(tmp_path: Path, db: Database) -> None:
    with running(db, describe(tmp_path / "shared", "a")):
        strange = Nodes(describe(tmp_path / "own", "b"), db, lambda: None)
        with pytest.raises(StrangersError, match="not the folder of the web servers"):
            strange.start()


def test_logs_of_who_cannot_run_beside_it_are_taken_in(tmp_path: Path, db: Database) -> None:
    single = Settings(data_dir=tmp_path)
    a, b = describe(tmp_path, "a"), describe(tmp_path, "b")
    for settings, name in ((single, "1"), (b, "2")):
        settings.live.mkdir(parents=True)
        (settings.live / f"{name * 32}.log").write_bytes(b"")
    (single.live / f"{'1' * 32}.film").write_bytes(b"")
    a.live.mkdir(parents=True)
    live_recordings._take_in(db, a)
    assert sorted(path.name[0] for path in a.live.iterdir()) == ["1", "1"]
    assert [path.name[0] for path in b.live.iterdir()] == ["2"]
    live_recordings._take_in(db, single)
    assert sorted(path.name[0] for path in single.live.iterdir()) == ["1", "1", "2"]


def test_a_film_that_waits_is_found_where_it_was_taken_in(tmp_path: Path, db: Database) -> None:
    single = Settings(data_dir=tmp_path)
    single.live.mkdir(parents=True)
    with db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code="P-1").id, title="Walk")
        take = live.open_take(c, None, session.id, live.ALONE)[0]
        live.end(c, None, take.id, "closed", count=0)
    (single.live / f"{take.id}.film").write_bytes(b"")
    pin = Pin("take", take.id)
    with running(db, describe(tmp_path, "a")) as a, running(db, describe(tmp_path, "b")) as b:
        for settings in (describe(tmp_path, "a"), describe(tmp_path, "b")):  # the second finds nothing
            settings.live.mkdir(parents=True)
            live_recordings._take_in(db, settings)
        a._look()
        assert find_owner(db, a, pin) is None
        owner = find_owner(db, b, pin)
        assert owner is not None
        assert (owner.name, owner.must) == ("a", True)
        # killed between the move and the note of it
        with db.write() as c:
            c.execute(update(live_take).values(node=None))
        live_recordings._take_in(db, describe(tmp_path, "a"))
        assert find_owner(db, b, pin) == owner
    live_recordings._take_in(db, single)
    with db.read() as c:
        assert live.get(c, take.id).node is None


def test_a_server_without_a_name_has_every_take(db: Database) -> None:
    with db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code="P-9").id, title="Walk")
        take = live.open_take(c, None, session.id, live.TakeOwner("gone", 3))[0]
        mine = claim_take(c, take.id, live.ALONE)
        assert (mine.node, mine.node_run) == (None, None)
