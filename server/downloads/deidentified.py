"""De-identified results for research: one zip for any number of patients; re-identification needs the key.

    for piece in export_deidentified(db, blobs, key, chosen): ...        # streamed

Pseudonyms and the shift of days are HMAC-SHA256 (RFC 2104) of the ids under the clinic's key: the same key
reproduces them, so later exports match earlier ones, and without it ids cannot be tested. All dates of a
patient are shifted by the same number of days, which preserves intervals; ages above 89 are given as 89. Free
text is omitted except for our own codes (docs/reference/exports.md, "For research").
"""

from __future__ import annotations

import datetime as dt
import hmac
import re
import secrets
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

from sqlalchemy import Connection

from sagittal.core.errors import FormatError, InputError
from sagittal.core.message import Message
from sagittal.core.subject.condition import CHOICES
from sagittal.server import audit
from sagittal.server.clinic import consents, patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.errors import NotFound
from sagittal.server.export import sheets
from sagittal.server.export.ages import OLDEST, coarsen_age
from sagittal.server.export.content import ExportContent, VisitFacts, open_content
from sagittal.server.export.sheets import Row, TableSheet
from sagittal.server.export.zipping import EARLIEST, ZipSink
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.report.files.columns import SCHEMA, floats_of, parquet_file, write_csv
from sagittal.server.results import analyses, edit_log
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore, IntegrityError

MOST_SHIFT_DAYS: Final = 1461
"""Four years: hides both season and year of a visit."""
PERSON_COLUMNS: Final = ("subject", "sex", "height_m", "affected_side", "is_control")
VISIT_COLUMNS: Final = (
    *("subject", "visit", "shifted_day", "age_years", "age_is_least", "height_m", "protocol"),
    *(*CHOICES, "feedback", "version"),
)
_KEY: Final = re.compile(r"[0-9a-f]{64}")
_CODE: Final = re.compile(r"[A-Za-z0-9_]*")
_CODED: Final = frozenset({"reason", "note", "excluded_reason", "source"})
"""Columns of which only the code is exported, as free text may follow it."""


@dataclass(frozen=True)
class ResearchKey:
    """Key that maps patients to pseudonyms; it remains in the clinic.

    Parameters
    ----------
    secret : 32 bytes.
    """

    secret: bytes = field(repr=False)

    def name_person(self, patient_id: str) -> str:
        """Pseudonym of a patient: 16 hex digits."""
        return self._digest("person", patient_id).hex()[:16]

    def name_visit(self, session_id: str) -> str:
        """Pseudonym of a visit: 16 hex digits."""
        return self._digest("visit", session_id).hex()[:16]

    def shift(self, patient_id: str, day: dt.date) -> dt.date:
        """Shift a date of a patient back by the patient's offset of 1 to 1461 days."""
        drawn = int.from_bytes(self._digest("days", patient_id)[:8], "big")
        return day - dt.timedelta(days=1 + drawn % MOST_SHIFT_DAYS)

    def _digest(self, value: str, identity: str) -> bytes:
        return hmac.digest(self.secret, f"{value}:{identity}".encode(), "sha256")


def open_key(path: Path) -> ResearchKey:
    """Read a key, or create one if the file does not exist; raises InputError `bad_research_key`, OSError."""
    if not path.exists():
        fs.write_file(path.absolute(), f"{secrets.token_hex(32)}\n".encode())
    text = path.read_bytes().strip().decode("ascii", "replace")
    if not _KEY.fullmatch(text):
        raise InputError(
            "bad_research_key",
            Message("{path} is no key for research: expected 64 hex digits. Give another file.", path=path),
        )
    return ResearchKey(bytes.fromhex(text))


def list_chosen(c: Connection, codes: Sequence[str]) -> list[Patient]:
    """Patients by code, all if none is given; raises NotFound for an unknown code."""
    everybody = {p.code: p for p in patients.list_patients(c, None, limit=patients.count(c, None))}
    for code in codes:
        if code not in everybody:
            raise NotFound("patient", code)
    return [everybody[code] for code in dict.fromkeys(codes)] if codes else list(everybody.values())


def has_agreed(c: Connection, patient_id: str) -> bool:
    """Whether a consent to research is recorded and not withdrawn."""
    return any(
        one.purpose == "research" and one.withdrawn_on is None for one in consents.of_patient(c, patient_id)
    )


def find_person(c: Connection, key: ResearchKey, pseudonym: str) -> Patient | None:
    """The patient with a pseudonym of this key, None if it belongs to another key or was erased."""
    return next((p for p in list_chosen(c, ()) if key.name_person(p.id) == pseudonym), None)


def export_deidentified(
    db: Database,
    blobs: BlobStore,
    key: ResearchKey,
    chosen: Iterable[Patient],
    *,
    with_signals: bool = False,
) -> Iterator[bytes]:
    """Yield the zip in parts; visits without an analysis or with damaged files are listed in
    `left_out.csv`.
    """
    sink = ZipSink()
    tables: dict[str, list[Row]] = {"persons": [], "visits": [], "left_out": []}
    headers: dict[str, tuple[str, ...]] = {
        "persons": PERSON_COLUMNS,
        "visits": VISIT_COLUMNS,
        "left_out": ("subject", "visit", "reason"),
    }
    with zipfile.ZipFile(sink, "w") as archive:

        def add(name: str, content: bytes) -> bytes:
            archive.writestr(zipfile.ZipInfo(name, EARLIEST), content, zipfile.ZIP_DEFLATED)
            return sink.take()

        yield add("README.md", README.encode())
        for person in sorted(chosen, key=lambda p: key.name_person(p.id)):
            subject = key.name_person(person.id)
            with db.write() as c:
                visits = sessions.of_patient(c, person.id)
                audit.record(c, None, "patient.deidentified", "patient", person.id, {"by": "console"})
            tables["persons"].append(
                (subject, person.sex, person.height_m, person.affected_side, int(person.is_control))
            )
            for visit in reversed(visits):
                named = key.name_visit(visit.id)
                try:
                    content = _open(db, blobs, key, person, visit)
                    measured = _strip_signals(content) if with_signals else None
                except (NotFound, FormatError, IntegrityError) as error:
                    tables["left_out"].append((subject, named, error.code))
                    continue
                tables["visits"].append(_describe(content.visit, visit))
                for name, sheet in _list_sheets(content).items():
                    headers[name] = sheet.header
                    tables.setdefault(name, []).extend(sheet.rows)
                if measured is not None:
                    yield add(f"signals/{subject}_{named}.parquet", measured)
        for name, rows in tables.items():
            yield add(f"{name}.csv", write_csv(headers[name], dict.fromkeys(rows)))
    yield sink.take()


def _open(db: Database, blobs: BlobStore, key: ResearchKey, person: Patient, visit: Session) -> ExportContent:
    with db.read() as c:
        record = analyses.get_shown(c, visit.id)
        edits = edit_log.edits_of(c, record.id).edits
    facts = VisitFacts(
        subject=key.name_person(person.id),
        visit=key.name_visit(visit.id),
        day=key.shift(person.id, visit.performed_on).isoformat(),
        protocol=visit.protocol,
        age_years=coarsen_age(person.find_age(visit.performed_on)),
        height_m=person.find_height(visit),
        version=CODE_VERSION,
    )
    readers = {name: partial(analyses.file_bytes, blobs, record, name) for name in record.files}
    return open_content(readers, facts, edits)


def _describe(facts: VisitFacts, visit: Session) -> Row:
    least = None if facts.age_years is None else int(facts.age_years == OLDEST)
    walked = (*(getattr(visit, name) for name in CHOICES), int(visit.feedback), facts.version)
    return (
        *(facts.subject, facts.visit, facts.day, facts.age_years, least, facts.height_m, facts.protocol),
        *walked,
    )


def _list_sheets(content: ExportContent) -> dict[str, TableSheet]:
    """Tables of a visit by file name, with the same columns for every visit."""
    v = content.visit
    curves = sheets.list_curves(content)
    long = tuple(
        (v.subject, v.visit, name, row[0], row[i])
        for i, name in enumerate(curves.header)
        if i
        for row in curves.rows
    )
    return {
        "parameters": _with_visit(v, sheets.list_parameters(content)),
        "strides": _keep_codes(sheets.list_values(content)),
        "events": _with_visit(v, sheets.list_events(content)),
        "curves": TableSheet("Curves", ("subject", "visit", "curve", "pct_cycle", "value"), long),
        "data_dictionary": sheets.list_dictionary(content),
    }


def _with_visit(v: VisitFacts, sheet: TableSheet) -> TableSheet:
    rows = tuple((v.subject, v.visit, *row) for row in sheet.rows)
    return _keep_codes(TableSheet(sheet.name, ("subject", "visit", *sheet.header), rows))


def _keep_codes(sheet: TableSheet) -> TableSheet:
    coded = [name in _CODED for name in sheet.header]

    def reduce(is_code: bool, value: object) -> object:
        return _CODE.match(value)[0] if is_code and isinstance(value, str) else value  # type: ignore[index] # matches ""

    rows = tuple(tuple(map(reduce, coded, row)) for row in sheet.rows)
    return TableSheet(sheet.name, sheet.header, rows)


def _strip_signals(content: ExportContent) -> bytes:
    """Sensor signals by segment, starting at 0 s and without serial numbers."""
    table, meta = content.signals
    t_s = floats_of(table, "t_s")
    columns = {name: table.column(name).combine_chunks() for name in table.column_names if name != "t_s"}
    return parquet_file(t_s, columns, {"schema": SCHEMA, "rate_hz": meta["rate_hz"]})


README: Final = f"""# De-identified results of walks

Written by Sagittal. Research and documentation software, not a medical device, not for diagnosis.

What was done:

- `subject` and `visit` are pseudonyms, made from random ids with a secret key (HMAC-SHA256). The clinic keeps
  the key. Who has it can lead back to the person, nobody else; so this is pseudonymised data under the GDPR.
- `shifted_day`: all days of a person are moved back by the same number of days, 1 to {MOST_SHIFT_DAYS},
  another one for each person. The time between two visits is right, the day, the season and the year are not.
- Ages are whole years. Ages of {OLDEST} and more are {OLDEST} with `age_is_least` 1.
- Not in here: names and codes, years of birth, notes, titles, assessments, prescriptions, videos, files as
  uploaded, names of files, checksums, serial numbers of sensors, who examined. Where a person left a stride
  out the reason is `manual`, without the words.
- Times in seconds count from the start of a recording. What a person corrected is counted in.

What may still tell who somebody is, to one who knows the person: a rare combination of sex, age and height,
and the walk itself. Give this to nobody without an agreement on its use, and do not publish it as it is.

Files: `persons.csv`, `visits.csv`, `parameters.csv` (one row per value of a visit), `strides.csv` (one row
per stride and value), `curves.csv` (angles over the stride), `events.csv` (contacts), `left_out.csv` (visits
without results and why), `data_dictionary.csv` (every column and value), and `signals/` where it was asked
for: what the sensors measured, m/s² and °/s, by where they were worn.
"""
