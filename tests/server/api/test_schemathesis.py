"""Every request within the OpenAPI document, and many outside it, gets a documented response."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import hypothesis
import pytest
import schemathesis
from schemathesis.python import asgi

from sagittal.server.api.documents import openapi
from sagittal.server.app import create_app
from sagittal.server.clinic import patients, sessions
from sagittal.server.settings import Settings
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic
from tests.helpers.databases import write_database
from tests.helpers.marks import sweep_after

EXAMPLES = 12
# beyond a schema, so 422 for what it allows: rules between the parts of a manifest (two sensors on one
# segment) or of an edit (only a move says where to), names that lead elsewhere, filters that nobody has,
# films that are none or that nobody agreed to, and days of a mistyped year
BEYOND_SCHEMA = (
    "manifest", "analyses", "edits", "{name}", "prescriptions", "targets", "tunings", "video", "notes",
    "programmes", "planned-visits", "uploads",
)  # fmt: skip
BEYOND = [schemathesis.checks.positive_data_acceptance]
PARTS = 24
"""The operations are dealt out to so many tests: their names are known when the application is there."""


class Target:
    """The running application, and ids of things that exist in it."""

    def __init__(self, clinic: Clinic) -> None:
        self.clinic = clinic
        self.schema = schemathesis.openapi.from_dict(openapi(clinic.app))
        self.schema.app = clinic.app
        self.ids: dict[str, str] = {}
        self._token: str | None = None
        self._numbers = itertools.count()

    def existing(self) -> dict[str, str]:
        """Make a patient with a session, a file and a job."""
        clinic = self.clinic
        with clinic.db.write() as c:
            patient = patients.create(c, None, code=f"P{next(self._numbers)}")
            session = sessions.create(c, None, patient.id)
        with receiving.receive(
            clinic.db, clinic.app.state.blobs, clinic.settings, None, session.id, "a.csv"
        ) as upload:
            upload.write(b"t,x\n0,1\n")
            upload.keep()
        with clinic.db.write() as c:
            job = recordings.inspect(c, clinic.app.state.queue, None, session.id)
            clinic.app.state.queue.cancel(c, job.id)  # the event stream of a finished job ends
        ids = {"patient_id": patient.id, "session_id": session.id, "job_id": job.id}
        return ids | {"user_id": clinic.user("viewer"), "name": "a.csv", "confirm": patient.code}

    def aim(self, case: Any) -> None:
        """Let half of the well-formed ids point to something that exists."""
        if case.method == "DELETE" or not self.ids:
            self.ids = self.existing()
        for place in (case.path_parameters, case.query):
            for name, value in (place or {}).items():
                if name in self.ids and isinstance(value, str) and value and ord(value[0]) % 2:
                    place[name] = self.ids[name]

    def token(self, path: str) -> str:
        """A sign-in; a fresh one where calls may end it."""
        if self._token is None or path.endswith(("sign-out", "password")):
            self._token = self.clinic.token("admin")
        return self._token


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Target]:
    # takes are opened and recorded, nothing is estimated
    settings = Settings(data_dir=tmp_path_factory.mktemp("fuzz"), allowed_hosts=(asgi.HOST,), live_workers=0)
    write_database(settings.database)
    clinic = Clinic(create_app(settings), settings)
    with asgi.get_client(clinic.app):  # starts the lifespan, which goes on until it is shut down below
        pass
    yield Target(clinic)
    asgi.shutdown_lifespans()


@pytest.mark.slow
@pytest.mark.parametrize("part", sweep_after(1, range(PARTS)))
def test_every_answer_is_one_the_document_names(target: Target, part: int) -> None:
    operations = [
        (path, method) for path, item in openapi(target.clinic.app)["paths"].items() for method in item
    ]
    assert len(operations) > PARTS
    for path, method in operations[part::PARTS]:
        try:
            check_operation(target, path, method)
        except BaseException as error:
            error.add_note(f"{method.upper()} {path}")
            raise


def check_operation(target: Target, path: str, method: str) -> None:
    @hypothesis.given(case=target.schema[path][method].as_strategy())
    @hypothesis.settings(
        max_examples=EXAMPLES,
        derandomize=True,  # the fixed seed
        database=None,
        deadline=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    def answer(case: Any) -> None:
        target.aim(case)
        case.call_and_validate(
            cookies={"sid": target.token(path)},
            excluded_checks=BEYOND if path.endswith(BEYOND_SCHEMA) else None,
        )

    answer()
