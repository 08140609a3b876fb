"""Simulated clinic of `sagittal demo`: visits of virtual patients, uploaded like real recordings.

Run as a module, it fills the data folder of its environment; it runs in its own process because simulating
takes seconds of CPU time.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from math import degrees, hypot, inf
from typing import TYPE_CHECKING

from sagittal.core.frames import SEGMENTS, Segment, Side
from sagittal.core.subject.condition import USUAL, WalkingCondition
from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.opening import open_queue
from sagittal.server.results import analyses, prescriptions
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings, load_settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.tables import now
from sagittal.server.uploads import receiving, recordings

if TYPE_CHECKING:
    from sagittal.core.signals.recording import Recording
    from sagittal.core.simulate import Simulation

GONIOMETER = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
"""Standing angles that are entered."""

FEET: tuple[Segment, ...] = ("foot_l", "foot_r")

SENSORS: Mapping[Segment, str] = {segment: f"00B4D3A{i}" for i, segment in enumerate(SEGMENTS)}
"""The clinic's own sensors, each with a fixed segment."""


@dataclass(frozen=True)
class DemoPerson:
    """A simulated patient."""

    code: str
    sex: str
    birth_year: int
    height_m: float
    note: str
    affected_side: Side | None = None


@dataclass(frozen=True)
class DemoVisit:
    """One visit of a simulated patient.

    Parameters
    ----------
    script, seed : see sagittal.core.simulate. days_ago : date. worn : sensors, None = all seven.
    condition : walking condition. fails : a sensor and the time in s at which it drops out.
    """

    person: DemoPerson
    title: str
    script: str
    days_ago: int
    seed: int
    note: str = ""
    worn: tuple[Segment, ...] | None = None
    fails: tuple[Segment, float] | None = None
    condition: WalkingCondition = USUAL


VOLUNTEER = DemoPerson("REF-004", "female", 1989, 1.70, "Simulated. Healthy volunteer, no complaints.")
STROKE = DemoPerson(
    "NR-2107", "male", 1961, 1.76, "Simulated. Left hemiparesis, walks without an aid.", "left"
)
KNEE = DemoPerson(
    "OR-1188", "female", 1974, 1.66, "Simulated. Left knee replaced, little flexion in swing.", "left"
)
NERVE = DemoPerson("NR-2133", "male", 1983, 1.81, "Simulated. Left peroneal palsy, drop foot.", "left")
PARKINSON = DemoPerson("NR-2090", "male", 1953, 1.72, "Simulated. Parkinson's disease, short quick steps.")
CROUCH = DemoPerson("PD-0412", "female", 2009, 1.58, "Simulated. Bilateral cerebral palsy, crouch gait.")
HIP = DemoPerson(
    "OR-1203", "male", 1966, 1.79, "Simulated. Pain in the left hip, waiting for surgery.", "left"
)
FALLS = DemoPerson("GE-0317", "female", 1943, 1.62, "Simulated. Two falls in the last year.")

VISITS = (
    DemoVisit(VOLUNTEER, "Reference walk, comfortable speed", "healthy", 3, 11),
    DemoVisit(
        STROKE, "Discharge from rehabilitation", "hemi_mild", 2, 22, "After six weeks of gait training."
    ),
    DemoVisit(
        NERVE, "Barefoot, without orthosis", "drop_foot", 5, 41, condition=replace(USUAL, shoes="barefoot")
    ),
    DemoVisit(FALLS, "Falls clinic, corridor walk", "elderly", 6, 61, "Two sensors, feet only.", FEET),
    DemoVisit(HIP, "Before surgery, short set-up", "antalgic", 8, 71, "Pelvis and feet.", ("pelvis", *FEET)),
    DemoVisit(PARKINSON, "Medication review, on", "parkinson", 9, 51),
    DemoVisit(KNEE, "Twelve weeks after surgery", "stiff_knee", 12, 31),
    DemoVisit(
        CROUCH,
        "Annual review",
        "crouch",
        15,
        81,
        "The sensor on the left shank stopped in the second walk.",
        fails=("shank_l", 18.0),
    ),
    DemoVisit(STROKE, "Admission to rehabilitation", "hemiparetic", 44, 21),
    DemoVisit(
        VOLUNTEER, "Course with turns, fast", "fast_with_turns", 31, 12, condition=replace(USUAL, pace="fast")
    ),
)
"""In order of analysis: the latest visit of each patient first."""


PRESCRIBED: tuple[DemoPerson, Mapping[str, object]] = (
    STROKE,
    {
        "parameter": "step_length_m",
        "side": "left",
        "target": {"source": "manual", "mean": 0.6, "sd": 0.03},
        "modes": ["bar", "tone", "tick"],
        "schedule": {"kind": "fading", "strides_per_share": 60, "probe_every": 30, "probe_strides": 6},
    },
)
"""Prescription of the live walks: longer steps (server/demo/live.py)."""


def record(visit: DemoVisit) -> Simulation:
    """Simulate the trial of a visit."""
    from sagittal.core.simulate import Dropout, simulate_scenario

    fails = visit.fails and (Dropout(*visit.fails, end_s=inf),)
    return simulate_scenario(visit.script, visit.seed, visit.person.height_m, worn=visit.worn, dropouts=fails)


def label_sensors(recording: Recording) -> Recording:
    """Label the sensors with the serial numbers of the clinic's set of seven, one per segment."""
    own = {d: SENSORS[s] for d, s in recording.segments.items() if s is not None}
    streams = {own[d]: replace(x, device_id=own[d]) for d, x in recording.streams.items()}
    return replace(recording, streams=streams, segments={own[d]: s for d, s in recording.segments.items()})


def fill(settings: Settings) -> None:
    """Add all patients and visits and request their analyses."""
    from sagittal.core.simulate import mt_files

    with closing(Database(settings.database_source)) as db:
        blobs = open_blobs(settings)
        patient_ids: dict[str, str] = {}
        with db.write() as c:
            for person in dict.fromkeys(v.person for v in VISITS):
                fields = {k: v for k, v in vars(person).items() if k != "code"}
                patient_ids[person.code] = patients.create(c, None, code=person.code, **fields).id
            person, content = PRESCRIBED
            prescriptions.write(c, ReviewedAnalyses(blobs), None, patient_ids[person.code], content)
        for visit in VISITS:
            simulation = record(visit)
            labelled = label_sensors(simulation.recording)
            files = mt_files(labelled, visit.script, simulation.first_counter)
            manifest = _manifest(simulation) | {"sensors": dict(labelled.segments)}
            _add(db, blobs, settings, visit, patient_ids[visit.person.code], manifest, files)


def _manifest(simulation: Simulation) -> dict[str, object]:
    """Measurements that a therapist takes with tape measure and goniometer during quiet standing."""
    truth = simulation.truth
    apart = truth.p["foot_l"][0, :2] - truth.p["foot_r"][0, :2]
    angles = {n: round(degrees(a)) for n, a in truth.zero_offset.items() if n.startswith(GONIOMETER)}
    subject = {"standing_width_m": round(float(hypot(*apart)), 2), "standing_angles_deg": angles}
    return {"subject": subject}


def _add(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    visit: DemoVisit,
    patient_id: str,
    manifest: Mapping[str, object],
    files: Mapping[str, bytes],
) -> None:
    day = now().date() - dt.timedelta(days=visit.days_ago)
    stated_conditions = visit.condition.stated
    with db.write() as c:
        session = sessions.create(
            c, None, patient_id, title=visit.title, performed_on=day, note=visit.note, **stated_conditions
        )
    for name, content in files.items():
        with receiving.receive(db, blobs, settings, None, session.id, name) as upload:
            upload.write(content)
            upload.keep()
    with db.write() as c:
        queue = open_queue(db, settings.lease_s)
        recordings.set_manifest(c, None, session.id, manifest)
        recordings.inspect(c, queue, None, session.id)
        analyses.submit(c, queue, None, session.id)


if __name__ == "__main__":
    fill(load_settings())
