"""Export of one patient: complete, nothing of others, no secrets."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import pytest
from sqlalchemy import insert

from sagittal.server.clinic import consents, notes, patients, sessions
from sagittal.server.downloads.patient_export import export_patient
from sagittal.server.errors import NotFound
from sagittal.server.storage.archive import PIECE
from sagittal.server.storage.references import list_referenced
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import new_id, now
from sagittal.server.uploads import receiving
from tests.faults.clinic import Clinic


@pytest.mark.slow
def test_everything_of_one_patient_and_nothing_else(tmp_path: Path) -> None:
    clinic = Clinic(tmp_path, lease_s=5.0)
    visit, take = clinic.session.id, new_id()
    for name, content in (("left/walk.csv", b"outside"), ("big.bin", bytes(3 * PIECE + 7))):
        with receiving.receive(clinic.db, clinic.blobs, clinic.settings, None, visit, name) as upload:
            upload.write(content)
            upload.keep()
    with clinic.db.write() as c:
        agreed = consents.give(c, None, clinic.patient.id, purpose="research", evidence="form 12")
        consents.withdraw(c, None, agreed.id)
        notes.add(c, None, clinic.patient.id, content="Walks to the bakery.")
        c.execute(
            insert(live_take).values(
                id=take, session_id=visit, state="closed", code_sha256="c" * 64, token_sha256="d" * 64,
                created_at=now(), finished_at=now(),
            )
        )  # fmt: skip
        c.execute(insert(live_event).values(take_id=take, kind="mark", content={"x": 1}, at=now()))
        second = patients.create(c, None, code="P-OTHER")
        sessions.create(c, None, second.id, title="of the other")
    with clinic.db.read() as c:
        used = {sha256 for space, sha256 in list_referenced(c) if space == clinic.patient.id}
    lost = next(f for f in clinic.blobs.files() if clinic.blobs.find_path(f).read_bytes() == b"signals")
    clinic.blobs.find_path(lost).write_bytes(b"damaged")
    pieces = list(export_patient(clinic.db, clinic.blobs, clinic.patient.id))
    assert max(map(len, pieces)) < 2 * PIECE
    with zipfile.ZipFile(io.BytesIO(b"".join(pieces))) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        about = json.loads(archive.read("patient.json"))
        trail = json.loads(archive.read("audit.json"))
        missing = json.loads(archive.read("missing.json"))
        stored_by_name = {name: archive.read(name) for name in names if name.startswith("files/")}
    assert sorted(stored_by_name.values()) == [bytes(3 * PIECE + 7), b"outside"]
    assert not [name for name in names if ".." in name]
    assert [one["name"].endswith("a.txt") for one in missing] == [True]
    rows = about["rows"]
    assert {row["sha256"] for row in rows["recording_file"]} == used
    assert rows["patient_note"][0]["content"] == "Walks to the bakery."
    assert rows["consent"][0]["withdrawn_on"] is not None
    assert rows["live_event"][0]["kind"] == "mark"
    assert {"patient.created", "session.created", "recording.file_added"} <= {row["action"] for row in trail}
    text = json.dumps([about, trail])
    assert second.id not in text
    assert "of the other" not in text
    assert "c" * 64 not in text
    assert "d" * 64 not in text
    with pytest.raises(NotFound):
        export_patient(clinic.db, clinic.blobs, "0" * 32)
    clinic.db.close()
