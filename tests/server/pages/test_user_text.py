"""Text that people entered or uploaded is the same on the English and on the German page."""

from __future__ import annotations

import datetime as dt
import html
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import pytest
from sqlalchemy import JSON, Column, Connection, String, Table, insert, select, update

from sagittal.server.clinic import identities, sessions
from sagittal.server.pages.shell import FRAGMENT
from sagittal.server.storage.schema.care_tables import clinic_option
from sagittal.server.storage.schema.columns import UserJson, UserString
from sagittal.server.storage.schema.report_tables import signed_report
from sagittal.server.storage.schema.tables import analysis, device_check, job, metadata, new_id, recording
from sagittal.web.language import catalogue_path, load_catalogue, read_messages
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed, crowd
from tests.server.pages.test_statements import ANSWERS, PAGES, QUERIES, TRAINED
from tests.server.pages.uploads.test_upload import device

pytestmark = pytest.mark.anyio

NOT_ENTERED: Final = {
    "analysis.code_version", "analysis_file.name", "audit.action", "audit.resource", "audit.resource_id",
    "clinic_option.name", "consent.purpose", "device_check.segment", "edit.kind", "failed_attempt.account",
    "failed_attempt.address", "filter_run.code_version", "filter_run_file.name", "identity_key.name",
    "identity_key.purpose", "job.checkpoint", "job.error_code", "job.error_message", "job.key", "job.kind",
    "job.message", "job.stage", "job.state", "job.worker", "live_event.kind", "live_take.node",
    "live_take.problem", "live_take.source", "live_take.state", "one_time_token.purpose",
    "patient.affected_side", "patient.sex", "planned_visit.kind", "planned_visit.label", "programme.template",
    "recording.wanted_key", "report_file.name", "security_key_challenge.purpose", "session.aid",
    "session.orthosis", "session.pace", "session.protocol", "session.shoes", "session_video.media_type",
    "signed_report.language", "tuning.code_version", "user.language", "user.role", "audit.hash",
    "audit.previous", "user.password_hash",
}  # fmt: skip
"""Columns whose texts are codes, names of our own files, or sentences of the product."""

JSON_OF_CODES: Final = {
    "analysis.config", "api_token.scopes", "audit.detail", "device_check.content", "edit.content",
    "filter_run.settings", "job.params", "live_event.content", "prescription.content", "recording.inspection",
    "second_factor.recovery", "tuning.result",
}  # fmt: skip
"""Columns of JSON with codes and sentences; what is entered among them is marked where it is read."""


def name_column(column: Column[Any]) -> str:
    return f"{column.table.name}.{column.name}"


ENTERED: Final = sorted(
    (column for table in metadata.sorted_tables for column in table.c if isinstance(column.type, UserString)),
    key=name_column,
)


def test_every_text_column_is_user_text_or_known_to_be_none() -> None:
    texts = {
        name_column(column)
        for table in metadata.sorted_tables
        for column in table.c
        if isinstance(column.type, String) and not column.foreign_keys
    }
    ids = {name for name in texts if name.endswith((".id", "_id", "sha256"))} - {"audit.resource_id"}
    assert texts - ids == NOT_ENTERED
    assert {
        name_column(column)
        for table in metadata.sorted_tables
        for column in table.c
        if isinstance(column.type, JSON)
    } == JSON_OF_CODES
    assert {
        name_column(column)
        for table in metadata.sorted_tables
        for column in table.c
        if isinstance(column.type, UserJson)
    } == {"recording.manifest", "analysis.manifest"}


NOTICED: Final = ("core/agreement/", "core/body/", "core/quality/", "core/timeline/")
MESSAGES: Final = sorted(
    message
    for message, said, files in read_messages(catalogue_path("de"))
    if all(
        name.startswith(("core/agreement/", "core/body/", "core/quality/", "core/timeline/"))
        for name in files
    )
    and 10 <= len(message) <= 32
    and message[0].isupper()
    and said != message
    and message.replace(" ", "").isalpha()
)
"""Titles of notices, none of which the clinic below has."""

KINDS: Final = 6


def make_hostile(kind: int, number: int) -> str:
    """Text that the catalogue would change: it looks like a message, or has a number in it."""
    texts = (
        f"Sensor {number}.csv",
        f"Pain{number}, left knee",
        f"Training {number}.5",
        f"{number} of 3 strides",
        f"{number}.5 kg",
        MESSAGES[number % len(MESSAGES)],
    )
    return texts[kind % KINDS]


@pytest.mark.parametrize("text", [make_hostile(kind, 2) for kind in range(KINDS)])
def test_a_hostile_text_is_changed_unless_it_is_user_text(text: str) -> None:
    assert load_catalogue("de").translate(text) != text


class Hostile:
    """Hostile texts, each used once, and the columns that they are in."""

    def __init__(self, shift: int) -> None:
        self._shift = shift
        self.places: dict[str, str] = {}

    def make(self, place: str) -> str:
        """A text for a column or another place, which no other has."""
        text = make_hostile(self._shift + len(self.places), 11 + len(self.places))
        self.places[text] = place
        return text

    def enter(self, c: Connection, table: Table) -> None:
        """Put a unique text into every row and text column of a table."""
        columns = [column for column in table.c if isinstance(column.type, UserString)]
        keys = list(table.primary_key)
        for row in c.execute(select(*keys)).all():
            mine = [key == value for key, value in zip(keys, row, strict=True)]
            c.execute(update(table).where(*mine).values({k.name: self.make(name_column(k)) for k in columns}))


def add_missing(c: Connection, reference: dict[str, str], rest_of: Mapping[str, dict[str, Any]]) -> None:
    """Add a row to every table with user text that has none."""
    for table in metadata.sorted_tables:
        if not any(column in ENTERED for column in table.c) or c.execute(select(table)).first() is not None:
            continue
        values = {column.name: find_value(column, reference) for column in table.c if not column.nullable}
        c.execute(insert(table).values(values | rest_of.get(table.name, {})))


def find_value(column: Column[Any], reference: Mapping[str, str]) -> Any:
    if column.foreign_keys:
        return reference[next(iter(column.foreign_keys)).column.table.name]
    kind = getattr(column.type, "impl_instance", column.type).python_type
    now = dt.datetime.now(dt.UTC)
    result: dict[type, Any] = {
        str: new_id(), int: 1, bool: True, dt.datetime: now, dt.date: now.date(), object: {},
        bytes: new_id().encode(),
    }  # fmt: skip
    return result[kind]


NOT_CHANGED: Final = ("audit", "device_check")
"""The names in the trail are those of the accounts; the ids of sensors are serial numbers in an address."""

EXCLUDED: Final = {"kind": "exclude_stride", "side": "left", "time_s": 5.5}


def suspect(device_id: str) -> dict[str, Any]:
    """A notice of the inspection that names a sensor."""
    message = (
        f"Sensor {device_id} was recorded at 20 Hz; at least 25 Hz are needed to find foot contacts. "
        "Record again at 60 Hz or more."
    )
    return {"code": "rate_low", "message": message, "severity": "warning", "sensor": device_id}


async def fill(clinic: Clinic, hostile: Hostile) -> Mapping[str, str]:
    """A clinic with everything that pages show, every text of which is hostile; parts of its addresses."""
    results = analysed.files()
    identities.make_key(clinic.db, clinic.settings.identity_key_file)
    ((second, sid),) = crowd.fill(clinic, 1, 2, results)
    with clinic.db.write() as c:
        c.execute(
            update(device_check)
            .where(device_check.c.device_id == crowd.DEVICES[0])
            .values(device_id="Saturated")
        )
        pid = sessions.get(c, sid).patient_id
        recording_id = c.execute(select(recording.c.id).where(recording.c.session_id == sid)).scalar_one()
    for name in ("viewer", "clinician"):
        clinic.user(name)
    async with clinic.client("admin") as client:
        of_patient, of_session = f"/api/v1/patients/{pid}", f"/api/v1/sessions/{sid}"
        reference = {name: hostile.make(f"identity.{name}") for name in identities.MOST}
        excluded = EXCLUDED | {"reason": hostile.make("edit.reason")}
        sent = [
            await client.patch(f"{of_patient}/identity", json=reference),
            await client.post(f"{of_patient}/prescriptions", json=TRAINED),
            await client.post(f"/sessions/{sid}/report/sign", json={}),
            await client.post(f"{of_session}/edits", json=excluded),
        ]
        assert [s.text for s in sent if s.status_code >= 400] == []
        report_id = sent[2].json()["id"]
    now = dt.datetime.now(dt.UTC)
    with clinic.db.write() as c:
        reference = {
            "patient": pid, "session": sid, "recording": recording_id, "user": clinic.users["admin"],
            "signed_report": report_id,
            "job": c.execute(select(job.c.id)).scalars().all()[0],
        }  # fmt: skip
        # a run without files is no page: it belongs to the other visit
        other_one = select(analysis.c.id).where(analysis.c.recording_id != recording_id)
        reference["analysis"] = c.execute(other_one).scalar_one()
        remaining: dict[str, dict[str, Any]] = {
            "emergency_access": {"ends_at": now + dt.timedelta(hours=1)},
            "consent": {"purpose": "recording"},
            "session_video": {"media_type": "video/mp4", "sha256": "0" * 64},
            "api_token": {"scopes": ["read"], "expires_at": now + dt.timedelta(days=3)},
            "filter_run": {"reference_name": "x"},
        }
        devices = [hostile.make(f"device {i} of the files") for i in range(2)]
        inspected = [device(devices[0], "pelvis"), device(devices[1], duplicate_of=devices[0])]
        inspected[0]["notices"] = [suspect(devices[0])]
        result = {"devices": inspected, "duration_s": 25.0, "protocol": "walk", "notices": []}
        mapped = {"sensors": {devices[0]: "pelvis"}}
        c.execute(update(recording).values(inspection=result, manifest=mapped))
        c.execute(update(analysis).values(manifest=mapped))
        c.execute(insert(clinic_option).values(name="care_teams", since=now))
        c.execute(update(signed_report).values(reopened_at=now, reopened_because="x"))
        add_missing(c, reference, remaining)
        for table in metadata.sorted_tables:
            if any(column in ENTERED for column in table.c) and table.name not in NOT_CHANGED:
                hostile.enter(c, table)
    return {
        "pid": pid,
        "sid": sid,
        "other": second,
        "name": "stance_pct",
        "report_id": report_id,
        "token": "x" * 43,
        "language": "en",
        "version": "none",
        "device_id": "Saturated",
    }


NOT_SHOWN: Final = {
    "security_key.host", "security_key.name",  # where the site has TLS
    "web_node.address", "web_node.name",  # where several web servers serve
}  # fmt: skip

Pages = Mapping[str, Mapping[str, str]]


@pytest.fixture(
    scope="module", params=[0, *(pytest.param(n, marks=pytest.mark.sweep) for n in range(1, KINDS))]
)
async def hostile_pages(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, anyio_backend: str
) -> tuple[Hostile, Pages]:
    """Every page in English and German, with the texts that may appear."""
    hostile = Hostile(request.param)
    visible_by_page: dict[str, dict[str, str]] = {page: {} for page in PAGES}
    async with open_clinic(tmp_path_factory.mktemp("hostile")) as clinic:
        values = await fill(clinic, hostile)
        async with clinic.client("admin") as client:
            for page in PAGES:
                path = (page + QUERIES.get(page, "")).format(**values)
                for language in ("en", "de"):
                    headers = {"Accept-Language": language, "Accept": "text/html", FRAGMENT: "numbers"}
                    response = await client.get(path, headers=headers)
                    assert response.status_code == ANSWERS.get(page, 200), path
                    visible_by_page[page][language] = html.unescape(response.text)
    return hostile, visible_by_page


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_user_text_is_the_same_in_german(hostile_pages: tuple[Hostile, Pages], page: str) -> None:
    hostile, pages = hostile_pages
    english, german = pages[page]["en"], pages[page]["de"]
    assert {
        text: place for text, place in hostile.places.items() if english.count(text) != german.count(text)
    } == {}


def test_every_text_that_people_enter_was_on_a_page(hostile_pages: tuple[Hostile, Pages]) -> None:
    hostile, pages = hostile_pages
    visible_places = {
        place for text, place in hostile.places.items() if any(text in page["en"] for page in pages.values())
    }
    assert set(hostile.places.values()) - visible_places == NOT_SHOWN


async def test_what_is_searched_for_stands_in_the_page_as_it_was_typed(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client("admin") as client:
        for path in ("/patients", "/study"):
            response = await client.get(
                path, params={"q": "Pain, left knee"}, headers={"Accept-Language": "de"}
            )
            assert 'value="Pain, left knee"' in response.text
        response = await client.get(
            "/patients", params={"q": "Training 2.5"}, headers={"Accept-Language": "de"}
        )
        assert "„Training 2.5“" in response.text


async def test_a_refusal_quotes_what_was_typed(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client("admin") as client:
        headers = {"Accept-Language": "de", "Accept": "text/html"}
        await client.post("/api/v1/patients", json={"code": "Training 2.5"})
        second_response = await client.post("/api/v1/patients", json={"code": "Training 2.5"})
        assert "„Training 2.5“" in load_catalogue("de").translate(second_response.json()["detail"])
        missing = await client.get("/sensors/Saturated", headers=headers)
        assert "„Saturated“" in missing.text
