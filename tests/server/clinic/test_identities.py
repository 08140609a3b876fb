"""Identities: encrypted, bound to their row, only with the chosen key."""

from __future__ import annotations

import contextlib
import datetime as dt
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import select, update

from sagittal.server import audit
from sagittal.server.clinic import identities, patients
from sagittal.server.clinic.identities import PatientIdentity
from sagittal.server.errors import Conflict, ServiceError
from sagittal.server.main import main
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.field_cipher import (
    FieldKeys,
    KeyUnusable,
    ValueUnreadable,
    add_key,
    make_keys,
    read_keys,
)
from sagittal.server.storage.schema.person_tables import patient_identity
from tests.helpers.engines import choose_url, tell_commands

WHO = {
    "name": "Erika Zzcanary-Öztürk",
    "born_on": dt.date(1951, 4, 30),
    "record_number": "R-77123",
    "insurance_number": "A123456789",
    "contact": "Am Canaryweg 7\n01234 567",
}


class Names:
    """Two patients, and the file of a key."""

    def __init__(self, db: Database, folder: Path) -> None:
        self.db, self.file = db, folder / "identity.key"
        with db.write() as c:
            self.one, self.two = (patients.create(c, None, code=code).id for code in ("P-1", "P-2"))

    def keep(self) -> None:
        identities.make_key(self.db, self.file)
        with self.db.write() as c:
            identities.change(c, self.file, None, self.one, WHO)
            identities.change(c, self.file, None, self.two, {"name": "Uwe Otter"})

    def get(self, patient_id: str) -> PatientIdentity:
        with self.db.read() as c:
            return identities.get(c, self.file, patient_id)

    def problems(self) -> list[str]:
        with self.db.read() as c:
            return identities.find_problems(c, self.file)


@pytest.fixture
def names(source: Source, tmp_path: Path) -> Iterator[Names]:
    with closing(Database(source)) as db:
        yield Names(db, tmp_path)


def test_what_was_written_down_comes_back_and_stands_nowhere_in_clear(names: Names) -> None:
    with pytest.raises(Conflict) as off:
        names.get(names.one)
    assert off.value.code == "identities_off"
    assert names.problems() == []
    names.keep()
    assert names.file.stat().st_mode & 0o077 == 0
    response = names.get(names.one)
    assert {name: getattr(response, name) for name in WHO} == WHO
    assert "Erika" not in repr(response)
    with names.db.read() as c:
        row = c.execute(select(patient_identity).where(patient_identity.c.patient_id == names.one)).one()
        sealed = [bytes(getattr(row, name)) for name in WHO]
        trail = [(r.action, r.detail) for r in audit.list_entries(c)]
    assert len(set(map(len, sealed[:4]))) == 1  # a name and a day are equally long
    assert not [one for one in sealed if b"Erika" in one or b"1951" in one or b"R-77" in one]
    assert ("identity.changed", {"fields": sorted(WHO)}) in trail
    assert "Erika" not in str(trail)
    assert names.problems() == []
    with names.db.write() as c:
        second = identities.change(c, names.file, None, names.one, {"name": " ", "born_on": None})
    assert (second.name, second.born_on, second.record_number) == (None, None, "R-77123")
    with names.db.write() as c:
        identities.change(c, names.file, None, names.one, dict.fromkeys(WHO))
        stored_mask = c.execute(select(patient_identity.c.patient_id)).scalars().all()
    assert stored_mask == [names.two]
    assert names.get(names.one) == PatientIdentity()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("name", "x" * 201),
        ("contact", "a\0b"),
        ("born_on", dt.date(1849, 1, 1)),
        ("born_on", dt.date(2999, 1, 1)),
        ("shoe", "42"),
    ],
)
def test_a_value_that_is_refused_is_not_repeated(names: Names, name: str, value: object) -> None:
    names.keep()
    with names.db.write() as c, pytest.raises(ServiceError) as refused:
        identities.change(c, names.file, None, names.one, {name: value})
    assert str(value) not in refused.value.message


def test_a_row_or_a_field_in_the_place_of_another_is_seen(names: Names) -> None:
    names.keep()
    with names.db.write() as c:
        rows = {r.patient_id: r for r in c.execute(select(patient_identity))}
        for own, second in ((names.one, names.two), (names.two, names.one)):
            c.execute(
                update(patient_identity)
                .where(patient_identity.c.patient_id == own)
                .values(name=rows[second].name)
            )
    for patient_id in (names.one, names.two):
        with pytest.raises(ValueUnreadable) as swapped:
            names.get(patient_id)
        assert swapped.value.code == "identity_damaged"
    assert len(names.problems()) == 2
    with names.db.write() as c:
        mine = patient_identity.c.patient_id == names.one
        values = {"name": rows[names.one].name, "record_number": rows[names.one].insurance_number}
        c.execute(update(patient_identity).where(mine).values(**values))
    with pytest.raises(ValueUnreadable, match="record number"):
        names.get(names.one)


@pytest.mark.parametrize("cut", [0, 5, 21, 30])
def test_a_damaged_value_is_a_sentence(names: Names, cut: int) -> None:
    names.keep()
    with names.db.write() as c:
        row = c.execute(select(patient_identity).where(patient_identity.c.patient_id == names.two)).one()
        mine = patient_identity.c.patient_id == names.two
        c.execute(update(patient_identity).where(mine).values(name=bytes(row.name)[:cut]))
    with pytest.raises(ValueUnreadable, match=r"damaged|changed"):
        names.get(names.two)
    assert discard(names, really=True) == [names.two]  # the key is there: only what is damaged goes
    assert names.get(names.one).name == WHO["name"]
    assert names.problems() == []


def test_a_missing_or_other_key_is_an_error_and_never_a_new_key(names: Names, tmp_path: Path) -> None:
    names.keep()
    stored_content = names.file.read_bytes()
    names.file.unlink()
    with pytest.raises(KeyUnusable, match="patient names is missing"):
        names.get(names.one)
    with names.db.write() as c, pytest.raises(KeyUnusable, match="patient names is missing"):
        identities.change(c, names.file, None, names.one, {"name": "X"})
    with pytest.raises(KeyUnusable, match="which is not at"):
        identities.make_key(names.db, names.file)
    assert not names.file.exists()
    assert "patient names is missing" in names.problems()[0]
    make_keys(names.file)
    with pytest.raises(KeyUnusable, match="the key file on this computer holds"):
        names.get(names.one)
    assert len(names.problems()) == 1
    for content in (b"", b"SAGITTAL-FIELD-KEY-1 12\n", b"\xff\xfe"):
        names.file.write_bytes(content)
        with pytest.raises(KeyUnusable):
            names.get(names.one)
    names.file.write_bytes(stored_content)
    assert names.get(names.one).name == WHO["name"]
    assert discard(names, really=True) == []
    with pytest.raises(KeyUnusable, match="exists"):
        identities.make_key(names.db, names.file)


def test_a_key_is_changed_while_all_can_be_read(names: Names, monkeypatch: pytest.MonkeyPatch) -> None:
    names.keep()
    (initial,) = read_keys(names.file).keys
    with monkeypatch.context() as patch:  # killed when the rows are written
        patch.setattr(identities, "drop_other_keys", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            identities.change_key(names.db, names.file)
    assert len(read_keys(names.file).keys) == 2
    assert names.problems() == []
    assert len(set(map(len, read_keys(names.file).keys.values()))) == 1
    link = names.file.with_name("link.key")  # kept elsewhere: the link stays one
    link.symlink_to(names.file)
    _, count = identities.change_key(names.db, link)
    assert link.is_symlink()
    assert count == 2
    (final,) = read_keys(names.file).keys
    assert final != initial
    assert names.get(names.one).contact == WHO["contact"]
    with names.db.read() as c:
        rows = c.execute(select(patient_identity)).all()
    sealed = [bytes(value) for row in rows for value in row if isinstance(value, bytes)]
    assert {value[1:9] for value in sealed} == {final}
    with pytest.raises(ValueUnreadable):
        FieldKeys({initial: bytes(32)}).open(sealed[0], names.one, "name")


def test_two_changes_at_once_lose_no_key(names: Names, monkeypatch: pytest.MonkeyPatch) -> None:
    names.keep()
    turns = threading.Barrier(2)

    def wait_and_add(path: Path) -> None:
        with contextlib.suppress(threading.BrokenBarrierError):
            turns.wait(0.5)  # were both here at once, one would write over the other's key
        add_key(path)

    monkeypatch.setattr(identities, "add_key", wait_and_add)
    with ThreadPoolExecutor(2) as pair:
        done = [pair.submit(identities.change_key, names.db, names.file) for _ in range(2)]
        assert [one.result()[1] for one in done] == [2, 2]
    assert len(read_keys(names.file).keys) == 1
    assert names.problems() == []


def test_a_key_where_nobody_may_look_stops_only_what_needs_it(
    names: Names, monkeypatch: pytest.MonkeyPatch
) -> None:
    names.keep()

    def refuse(path: Path, *args: object, **kwargs: object) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    for name in ("stat", "is_file", "read_text"):
        monkeypatch.setattr(Path, name, refuse)
    with names.db.read() as c:
        assert identities.are_kept(c, names.file)
    with pytest.raises(KeyUnusable, match="cannot be read"):
        names.get(names.one)


def discard(names: Names, *, really: bool = False, without_key: bool = False) -> list[str]:
    return identities.discard_unreadable(names.db, names.file, really=really, without_key=without_key)


@pytest.mark.parametrize("what", ["missing", "unreadable", "another"])
def test_names_whose_key_is_only_not_in_its_place_are_not_removed(names: Names, what: str) -> None:
    names.keep()
    stored_content = names.file.read_bytes()
    names.file.unlink()
    if what == "unreadable":
        names.file.write_bytes(b"\xff\xfe")
    elif what == "another":
        make_keys(names.file)
    assert len(discard(names)) == 2
    with pytest.raises(KeyUnusable, match="Nothing was removed"):
        discard(names, really=True)
    names.file.write_bytes(stored_content)
    assert names.get(names.one).name == WHO["name"]
    assert names.problems() == []


def test_one_key_seals_whatever_file_a_computer_has(names: Names, tmp_path: Path) -> None:
    second = tmp_path / "other" / "identity.key"
    second.parent.mkdir()
    identities.make_key(names.db, names.file)
    with pytest.raises(KeyUnusable, match="which is not at"):  # no name is there yet
        identities.make_key(names.db, second)
    assert not second.exists()
    with names.db.read() as c:
        assert identities.are_kept(c, second)
    make_keys(second)
    with names.db.write() as c, pytest.raises(KeyUnusable, match="the key file on this computer holds") as no:
        identities.change(c, second, None, names.one, {"name": "X"})
    assert no.value.code == "identity_key_wrong"
    with pytest.raises(KeyUnusable):
        identities.change_key(names.db, second)
    with names.db.read() as c:
        assert len(identities.find_problems(c, second)) == 1
    with names.db.write() as c:
        identities.change(c, names.file, None, names.one, WHO)
    second.write_bytes(names.file.read_bytes())
    with names.db.write() as c:
        identities.change(c, second, None, names.two, {"name": "Uwe Otter"})
    identities.change_key(names.db, names.file)
    with names.db.write() as c, pytest.raises(KeyUnusable):  # the copy has the old key only
        identities.change(c, second, None, names.two, {"name": "Uwe"})
    assert names.problems() == []


def test_a_key_that_was_added_and_not_yet_used_seals_nothing(names: Names) -> None:
    """A change of keys that was killed between its file and its commit."""
    names.keep()
    (initial,) = read_keys(names.file).keys
    retained = names.file.with_name("node-b.key")
    retained.write_bytes(names.file.read_bytes())
    add_key(names.file)
    with names.db.write() as c:
        identities.change(c, names.file, None, names.two, {"name": "Uwe"})
    with names.db.read() as c:
        assert identities.get(c, retained, names.two).name == "Uwe"
    assert identities.change_key(names.db, names.file)[1] == 2
    assert names.problems() == []
    assert initial not in read_keys(names.file).keys


def test_what_no_key_opens_is_listed_and_only_then_removed(names: Names) -> None:
    names.keep()
    names.file.unlink()
    joint_items = sorted([names.one, names.two])
    assert discard(names) == joint_items
    assert len(names.problems()) == 1
    assert discard(names, really=True, without_key=True) == joint_items
    assert names.problems() == []
    identities.make_key(names.db, names.file)
    assert names.get(names.one) == PatientIdentity()


@pytest.mark.slow
def test_the_command_makes_changes_and_discards(
    tmp_path: Path, db: Database, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tell_commands(monkeypatch, Settings(data_dir=tmp_path, database_url=choose_url(tmp_path)))
    home = ["--data", str(tmp_path)]
    assert main(["identity-key", "change", *home]) == 1
    assert "does not store names" in capsys.readouterr().err
    assert main(["identity-key", "make", *home]) == 0
    assert "keep a copy on" in capsys.readouterr().out
    assert main(["identity-key", "make", *home]) == 1
    with db.write() as c:
        one = patients.create(c, None, code="P-1").id
        identities.change(c, tmp_path / "identity.key", None, one, {"name": "Erika"})
    assert main(["identity-key", "change", *home]) == 0
    assert main(["check", *home]) == 0
    (tmp_path / "identity.key").unlink()
    capsys.readouterr()
    assert main(["check", *home]) == 1
    assert "keys: " in capsys.readouterr().out
    assert main(["identity-key", "discard", *home]) == 0
    assert f"patient {one}\n1 patients" in capsys.readouterr().out
    assert main(["identity-key", "discard", "--really", *home]) == 1
    assert "add --without-key" in capsys.readouterr().err
    assert main(["identity-key", "discard", "--really", "--without-key", *home]) == 0
    capsys.readouterr()
    assert main(["identity-key", "discard", *home]) == 0
    assert capsys.readouterr().out == f"0 patients' names cannot be read with {tmp_path / 'identity.key'}.\n"
    assert main(["check", *home]) == 0
