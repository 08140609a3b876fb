"""Undescribed tables: guess by shape, check, description, reuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sagittal.core.errors import ManifestError
from sagittal.core.frames import GRAVITY
from sagittal.server.errors import NotFound
from sagittal.server.uploads import receiving, tables
from sagittal.server.uploads.tables import TableShape
from tests.core.formats.making import signals
from tests.helpers.clinic import Clinic
from tests.server import feedback

ACC, GYR = signals(600, still=200)


def table(header: str = "n;acc_x;acc_y;acc_z;gyr_x;gyr_y;gyr_z", lift: float = 0.0) -> bytes:
    rows = np.hstack([np.arange(len(ACC))[:, None], ACC / GRAVITY + lift, np.degrees(GYR)])
    return (header + "\n" + "\n".join(";".join(f"{v:.4f}" for v in row) for row in rows)).encode()


def uploaded(stored: Clinic, files: dict[str, bytes]) -> str:
    session = feedback.visit(stored, feedback.person(stored), 0)
    state = (stored.db, stored.app.state.blobs, stored.settings)
    for name, content in files.items():
        with receiving.receive(*state, None, session, name) as upload:
            upload.write(content)
            upload.keep()
    return session


def listed(stored: Clinic, session: str) -> tuple[TableShape, ...]:
    with stored.db.read() as c:
        return tables.list_tables(c, stored.app.state.blobs, session)


def problems(stored: Clinic, session: str, name: str, source: dict[str, Any]) -> int:
    with stored.db.read() as c:
        (reading,) = tables.check_table(c, stored.app.state.blobs, session, name, source)
    return len(reading.problems)


def test_files_of_one_shape_are_one_table_and_a_text_is_none(stored: Clinic) -> None:
    session = uploaded(
        stored,
        {
            "a_lf.csv": table(),
            "b_rf.csv": table(),
            "c.csv": table("m;Acc_X;Acc_Y;Acc_Z;Gyr_X;Gyr_Y;Gyr_Z"),
            "notes.txt": b"no",
        },
    )
    shapes = listed(stored, session)
    assert sorted(s.files for s in shapes) == [("a_lf.csv", "b_rf.csv"), ("c.csv",)]
    first = next(s for s in shapes if len(s.files) == 2)
    assert first.names == ("n", "acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z")
    assert first.basis == "guessed"
    assert (first.source["acc_unit"], first.source["gyr_unit"]) == ("g", "deg/s")
    assert len(first.rows) > 1


def test_what_is_described_once_is_known_of_the_next_table_of_its_shape_that_fits(stored: Clinic) -> None:
    header = "k;acc_x;acc_y;acc_z;gyr_x;gyr_y;gyr_z"
    session = uploaded(stored, {"one.csv": table(header), "two.csv": table(header)})
    source = {**listed(stored, session)[0].source, "rate_hz": 100}
    assert problems(stored, session, "one.csv", source) == 0
    assert problems(stored, session, "one.csv", source | {"acc_unit": "m/s2", "gyr_unit": "rad/s"}) == 2
    with stored.db.write() as c:
        result = tables.map_tables(c, None, session, ["one.csv"], source)
    assert result.manifest is not None
    assert [s["file"] for s in result.manifest["sources"]] == ["one.csv"]
    items, guessed = sorted(listed(stored, session), key=lambda s: s.files)
    assert (items.files, items.basis, items.source["rate_hz"]) == (("one.csv",), "said", 100)
    assert (guessed.files, guessed.basis) == (("two.csv",), "guessed")

    second = uploaded(stored, {"three.csv": table(header)})
    lifted = uploaded(stored, {"four.csv": table(header, lift=3.0)})
    with stored.db.read() as c:
        (reference,) = tables.find_known(c, stored.app.state.blobs, second)
        assert tables.find_known(c, stored.app.state.blobs, lifted) == ()
        assert [s.basis for s in tables.list_tables(c, stored.app.state.blobs, lifted)] == ["known"]
    assert (reference.files, reference.basis, reference.source["rate_hz"]) == (("three.csv",), "known", 100)
    assert list(reference.source["columns"]) == ["*"]


def test_a_table_described_anew_has_one_entry(stored: Clinic) -> None:
    session = uploaded(stored, {"one.csv": table("j;a;b;c;d;e;f")})
    columns = {"*": {"acc": ["a", "b", "c"], "gyr": ["d", "e", "f"]}}
    for unit in ("g", "m/s2"):
        with stored.db.write() as c:
            source = {"columns": columns, "rate_hz": 100, "acc_unit": unit, "gyr_unit": "deg/s"}
            result = tables.map_tables(c, None, session, ["one.csv"], source)
    assert result.manifest is not None
    assert [s["acc_unit"] for s in result.manifest["sources"]] == ["m/s2"]


def test_a_file_that_is_not_there_and_an_entry_that_is_none_are_refused(stored: Clinic) -> None:
    session = uploaded(stored, {"one.csv": table()})
    source = {"columns": {"*": {}}, "speed": 1}
    with stored.db.write() as c:
        with pytest.raises(NotFound, match=r"none\.csv"):
            tables.map_tables(c, None, session, ["one.csv", "none.csv"], source)
        with pytest.raises(ManifestError):
            tables.map_tables(c, None, session, ["one.csv"], source)
    with stored.db.read() as c, pytest.raises(NotFound, match=r"none\.csv"):
        tables.check_table(c, stored.app.state.blobs, session, "none.csv", source)
