"""All analysed visits of a patient with their numbers as they count, for trends over them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from sqlalchemy import Connection

from core.norms import Norms, NormValue, norms_for, temporal_values
from server.report.trends import Visit
from server.services import analyses, programmes, reviews, sessions
from server.services.patients import Patient
from server.services.programmes import Programme
from server.services.sessions import Session
from server.storage.blobs import BlobStore


@dataclass(frozen=True, eq=False)
class History:
    """The visits of a patient that can be compared.

    Parameters
    ----------
    protocol : what all of them walked; None without a visit. visits : analysed, oldest first.
    others : protocol → analysed visits of another one. programmes : newest first.
    """

    patient: Patient
    protocol: str | None
    visits: tuple[Visit, ...]
    others: dict[str, int]
    programmes: tuple[Programme, ...]

    @property
    def norms(self) -> Norms | None:
        """Of this person at the speed of the last visit; None without one."""
        if not self.visits:
            return None
        numbers = self.visits[-1].numbers
        speed = next((p.mean for p in numbers.parameters if p.name == "gait_speed_mps"), None)
        return norms_for(self._age, self.patient.sex, speed, self.patient.height_m)  # type: ignore[arg-type]

    @property
    def usual(self) -> dict[str, NormValue]:
        """Of people of this age and sex at their comfortable speed."""
        return dict(temporal_values(self._age, self.patient.sex).values)  # type: ignore[arg-type]

    @property
    def _age(self) -> int | None:
        if not self.visits or not self.patient.birth_year:
            return None
        return self.visits[-1].performed_on.year - self.patient.birth_year


@dataclass(frozen=True)
class Analysed:
    """A session with the analysis that counts and its edits."""

    session: Session
    found: analyses.Analysis
    edits: reviews.Edits


def analysed(c: Connection, patient_id: str) -> list[Analysed]:
    """The sessions of a patient with a result, oldest first."""
    done = []
    for session in reversed(sessions.of_patient(c, patient_id)):
        found = analyses.latest(c, session.id)
        if found is not None:
            done.append(Analysed(session, found, reviews.edits_of(c, found.id)))
    return done


def history(
    blobs: BlobStore,
    patient: Patient,
    done: list[Analysed],
    plans: list[Programme],
    protocol: str | None = None,
) -> History:
    """Read the numbers of the visits of one protocol, that of the newest unless asked; IntegrityError."""
    walked = Counter(a.session.protocol for a in done)
    chosen = protocol or (done[-1].session.protocol if done else None)
    planned = {v.session_id: v for plan in plans for v in plan.visits if v.session_id is not None}
    visits = []
    for a in done:
        if a.session.protocol != chosen:
            continue
        plan = planned.get(a.session.id)
        visits.append(
            Visit(
                a.session.id,
                a.session.performed_on,
                a.session.title,
                None if plan is None else plan.label,
                "assessment" if plan is None else plan.kind,
                a.session.protocol,
                reviews.numbers(blobs, a.found, a.edits),
            )
        )
    others = {name: n for name, n in walked.items() if name != chosen}
    return History(patient, chosen, tuple(visits), others, tuple(plans))


def read(c: Connection, patient: Patient) -> tuple[list[Analysed], list[programmes.Programme]]:
    """What `history` needs of the database."""
    return analysed(c, patient.id), programmes.of_patient(c, patient.id)
