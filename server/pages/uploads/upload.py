"""Upload page: files, inspection results, and sensor placement."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.core.errors import title_of_code
from sagittal.core.frames import SEGMENTS
from sagittal.core.message import Message, read_message
from sagittal.core.plurals import plural
from sagittal.core.subject.anthropometry import LIMITS
from sagittal.core.user_text import UserText
from sagittal.core.user_text import quote as quote_text
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.devices import NO_PLACES, LastPlaces, recall_places
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.context import Blobs, Db, Id
from sagittal.server.pages.job_views import view_job
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.pages.words import PROTOCOLS, SEGMENT_NAMES, TEST_PROTOCOLS
from sagittal.server.report.files.bundle import ABOUT_FILES
from sagittal.server.results import histories
from sagittal.server.uploads import recordings, uploads
from sagittal.server.uploads.recordings import StoredRecording
from sagittal.web.words import number, seconds

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

SEGMENT_CHOICES: Final = (("", "Not used"), *((s, SEGMENT_NAMES[s]) for s in SEGMENTS))

CLOCK_WORDS: Final = {
    "counter": "one packet counter",
    "device": "each sensor's own clock",
    "index": "row number",
}

BASIS_WORDS: Final = {
    "manifest": "As set before. Correct if necessary.",
    "remembered": "As at this patient's last visit with these sensors. Please check.",
    "declared": "Taken from the files. Correct if necessary.",
    "label": "Suggested from the names. Correct if necessary.",
    "last_take": "As in the last trial with these sensors. Please check.",
    "movement": "Suggested from the motion of each sensor.",
}

KINDS: Final = {"error": "bad", "warning": "warn", "info": ""}
"""Severity of a notice → style."""

GONIOMETER: Final = (
    ("pelvis_tilt", "Anterior pelvic tilt"),
    ("hip_flexion_l", "Hip flexion, left"),
    ("hip_flexion_r", "Hip flexion, right"),
    ("knee_flexion_l", "Knee flexion, left"),
    ("knee_flexion_r", "Knee flexion, right"),
    ("ankle_dorsiflexion_l", "Dorsiflexion, left"),
    ("ankle_dorsiflexion_r", "Dorsiflexion, right"),
)
"""Standing angles requested on the page; the manifest accepts all of `core.subject.standing_angles`."""

TAPE: Final = (
    ("leg_m", "Leg", "Anterior superior iliac spine (ASIS) to medial malleolus, standing."),
    ("thigh_m", "Thigh", "Greater trochanter to the lateral knee joint line."),
    ("shank_m", "Shank", "Lateral knee joint line to lateral malleolus."),
    ("ankle_height_m", "Ankle height", "Lateral malleolus to the sole."),
    ("foot_m", "Foot", "Heel to longest toe."),
    ("pelvis_width_m", "Pelvis, width", "Between the anterior superior iliac spines (ASIS)."),
    ("pelvis_depth_m", "Pelvis, depth", "Mid-ASIS to mid-PSIS; used together with the width."),
)
"""Lengths of `subject.measures` requested on the page, with instructions."""

LENGTHS: Final = tuple((name, label, *LIMITS[name], how) for name, label, how in TAPE)

DUPLICATE: Final = "duplicate_stream"


@router.get("/sessions/{sid}/upload")
def show_upload(
    request: Request,
    db: Db,
    blobs: Blobs,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_SESSION)],
    lengths: Annotated[bool, Query(description="show the lengths of the body at once")] = False,
) -> Response:
    """Upload files, view inspection results, and assign sensors to segments."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = view_upload(c, recordings.current(c, sid), session, patient)
        coming = uploads.list_coming(c, blobs, sid)
    view["coming"] = [
        {"name": f.name, "size": f.size, "offset": f.offset, "href": f"/api/v1/sessions/{sid}/uploads/{f.id}"}
        for f in coming
    ]
    view["lengths_open"] = lengths or view["lengths_said"]
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "upload.html", "patients", session=session, patient=patient, **view)


def view_upload(c: Connection, this: StoredRecording | None, s: Session, p: Patient) -> dict[str, Any]:
    """Template context: files of the session, running inspection, results."""
    files = [
        {"name": f.name, "size": f.size, "href": f"/api/v1/sessions/{s.id}/files/{quote(f.name)}"}
        for f in (this.files if this else ())
    ]
    manifest = (this.manifest if this else None) or {}
    results = (this.inspection if this else None) or {}
    measured = {"height_m": s.height_m or p.height_m, **(manifest.get("subject") or {})}
    look = this.job if this else None
    waiting = look is not None and not look.finished
    problem = None
    if this is not None and look is not None and look.state == "failed" and this.inspection is None:
        problem = {"title": "These files could not be read", "message": look.error_message}
    return {
        "files": files,
        "inspect_job": view_job(look) if look is not None and waiting else None,
        "problem": problem,
        "ask_columns": bool(files) and not waiting and _asks_columns(manifest, results),
        "found": None
        if this is None or this.inspection is None or waiting
        else view_inspection(this, find_remembered(c, s), _recall(c, this, s)),
        "segments": SEGMENT_CHOICES,
        "said": _said({"subject": results.get("subject") or {}}) | _said({**manifest, "subject": measured}),
        "goniometer": GONIOMETER,
        "lengths": LENGTHS,
        "lengths_said": bool((manifest.get("subject") or {}).get("measures")),
        "protocols": [(value, title) for value, title, _ in (*PROTOCOLS, *TEST_PROTOCOLS)],
    }


def _asks_columns(manifest: Mapping[str, Any], table: Mapping[str, Any]) -> bool:
    """Whether a table needs or has a mapping, so that its columns are shown."""
    left = any(n["code"] == "file_not_read" for n in table.get("notices", ()))
    return not table or left or any(s.get("columns") for s in manifest.get("sources") or ())


def _said(tree: Mapping[str, Any]) -> dict[str, object]:
    """Values by path, omitting missing ones."""
    return {path: value for path, value in _paths(tree) if value is not None}


def _paths(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Values of nested mappings by their path, "subject.shoe.back_m"."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _paths(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def find_remembered(c: Connection, s: Session) -> Mapping[str, str | None]:
    """Sensor placement at this patient's latest other analysed visit that has one."""
    for visit in reversed(histories.list_analysed(c, s.patient_id)):
        if visit.session.id == s.id:
            continue
        sensors: Mapping[str, str | None] = (visit.found.manifest or {}).get("sensors") or {}
        if any(sensors.values()):
            return sensors
    return {}


def _recall(c: Connection, this: StoredRecording, s: Session) -> LastPlaces:
    """Placement of this upload's sensors in the clinic's latest trials, including other patients'."""
    own = [d["device_id"] for d in (this.inspection or {})["devices"]]
    return recall_places(c, own, but=s.id)


def fits_names(devices: Sequence[Mapping[str, Any]], sensors: Mapping[str, str | None]) -> bool:
    """Whether the placement is consistent with segments named by files or sensor labels."""
    by_name = [d for d in devices if d["basis"] in {"declared", "label"} and d["suggested"]]
    named = {d["device_id"]: d["suggested"] for d in by_name}
    segments_taken = {segment: device for device, segment in named.items()}
    return all(named.get(d, s) == s and segments_taken.get(s, d) == d for d, s in sensors.items() if s)


def fits_movement(devices: Sequence[Mapping[str, Any]], sensors: Mapping[str, str | None]) -> bool:
    """Whether a remembered mapping covers these sensors and is consistent with their movement."""
    own = {d["device_id"] for d in devices}
    instrumented = {device for device, segment in sensors.items() if segment}
    if not instrumented or not instrumented <= own:
        return False
    sides: dict[int, set[str]] = {1: set(), 2: set()}
    for d in devices:
        segment = sensors.get(d["device_id"])
        if not segment or not d["suggested_part"]:
            continue
        part, _, side = segment.partition("_")
        if part != d["suggested_part"]:
            return False
        if d["suggested_leg"]:
            sides[d["suggested_leg"]].add(side)
    return all(len(segments) <= 1 for segments in sides.values()) and not sides[1] & sides[2]


def view_inspection(
    this: StoredRecording, earlier: Mapping[str, str | None], last: LastPlaces = NO_PLACES
) -> dict[str, Any]:
    """Template context of an inspection: facts, sensors with their most likely segment, notices.

    The segment of a sensor is, in order of priority: set by the user, declared by the files, from this
    patient's last visit with these sensors, from a name, from the clinic's last trial with it, suggested by
    movement. Earlier placements are used as a whole or not at all, if inconsistent with names or movement.

    Parameters
    ----------
    earlier : mapping of an earlier visit, used if it covers these sensors and fits their movement.
    last : placement in the clinic's latest trials, used if nothing else is known and it fits names and
        movement.
    """
    results: Mapping[str, Any] = this.inspection or {}
    devices: Sequence[Mapping[str, Any]] = results["devices"]
    manual: Mapping[str, str | None] = (this.manifest or {}).get("sensors") or {}
    past = earlier if not manual and fits_movement(devices, earlier) else {}
    usual: Mapping[str, str | None] = {} if manual or past else last.segments
    if not (fits_names(devices, usual) and fits_movement(devices, usual)):
        usual = {}
    chosen = {d["device_id"]: _segment(d, manual, past, usual) for d in devices}
    guessed = any(basis == "movement" for _, basis in chosen.values())
    bases = {basis for segment, basis in chosen.values() if segment and basis}
    hint = next(
        (text for basis, text in BASIS_WORDS.items() if basis in bases), "Assign each sensor to a segment."
    )
    left_out = [read_message(n) for n in results["notices"] if n["code"] in ABOUT_FILES]
    return {
        "facts": _facts(results, devices),
        "unused": left_out,
        "sensors": [_sensor(d, chosen[d["device_id"]][0]) for d in devices],
        "notices": _notices(results, devices),
        "manifest": dict(this.manifest or {}),
        "hint": hint,
        "ask_sides": guessed,
        "as_before": _as_before(chosen, last),
    }


def _as_before(
    chosen: Mapping[str, tuple[str | None, str | None]], last: LastPlaces
) -> dict[str, Any] | None:
    """Number of placements taken from an earlier trial and its origin, for one notice; None = none."""
    bases = [basis for segment, basis in chosen.values() if segment]
    for basis in ("remembered", "last_take"):
        if n := bases.count(basis):
            day = last.day if basis == "last_take" else None
            return {"count": n, "day": day, "of_patient": basis == "remembered"}
    return None


def _segment(
    device: Mapping[str, Any],
    manual: Mapping[str, str | None],
    past: Mapping[str, str | None],
    usual: Mapping[str, str | None],
) -> tuple[str | None, str | None]:
    """Segment to preselect and its basis; for a leg of unknown side, leg 1 is assumed to be left."""
    if device["device_id"] in manual:
        return manual[device["device_id"]], "manifest"
    if device["declared"]:
        return device["segment"], "declared"
    if past:
        return past.get(device["device_id"]), "remembered"
    if device["duplicate_of"]:
        return None, None
    if device["device_id"] in usual and device["basis"] != "label":
        return usual[device["device_id"]], "last_take"
    if device["suggested"] and (device["basis"] == "label" or device["suggested"] not in usual.values()):
        return device["suggested"], device["basis"]
    if not usual and device["suggested_part"] and device["suggested_leg"]:
        return f"{device['suggested_part']}_{'l' if device['suggested_leg'] == 1 else 'r'}", "movement"
    return None, None


def _sensor(device: Mapping[str, Any], segment: str | None) -> dict[str, Any]:
    severities = {n["severity"] for n in device["notices"]}
    state: tuple[str, str]
    if device["duplicate_of"]:
        state = ("none", Message("copy of {quote_id}", quote_id=quote_id(device["duplicate_of"])))
    elif not device["has_gyro"]:
        state = ("bad", "no gyroscope")
    elif "error" in severities:
        state = ("bad", "see the notice")
    elif "warning" in severities:
        state = ("warn", "see the notice")
    else:
        state = ("ok", f"{device['rate_hz']:g} Hz")
    return {
        "id": UserText(device["device_id"]),
        "segment": segment,
        "state": {"kind": state[0], "text": state[1]},
        "lost": f"{number(device['lost_pct'], 1)} %",
    }


def quote_id(sensor: str) -> str:
    """A sensor id in a sentence, quoted as it may be a file name; a segment by its name."""
    return SEGMENT_NAMES.get(sensor) or quote_text(UserText(sensor))


def _facts(inspection: Mapping[str, Any], devices: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    own = [d for d in devices if not d["duplicate_of"]]
    copies = len(devices) - len(own)
    rates = sorted({round(d["rate_hz"], 1) for d in own})
    still = [d["still_norm_mps2"] for d in own]
    clocks = sorted({d["clock"] for d in own})
    signals = [
        name
        for name, key in (
            ("gyroscope", "has_gyro"),
            ("magnetometer", "has_mag"),
            ("orientation", "has_orientation"),
        )
        if own and all(d[key] for d in own)
    ]
    worst = max((d["lost_pct"] for d in own), default=0.0)
    gap = max((d["longest_gap_s"] for d in own), default=0.0)
    return [
        (
            "Sensors",
            str(len(own)),
            Message(f"and {{copies}} {plural(copies, 'copy', 'copies')}", copies=copies) if copies else "",
        ),
        ("Rate", ", ".join(f"{r:g}" for r in rates) + " Hz", ""),
        ("Duration", seconds(inspection["duration_s"]), ""),
        (
            "Lost samples",
            f"{number(worst, 1)} %",
            Message("longest gap {gap:.0f} ms", gap=gap * 1000) if gap else "",
        ),
        ("Signals", ", ".join(["acceleration", *signals]), ""),
        ("Units", "m/s², rad/s" if "gyroscope" in signals else "m/s²", _at_rest(still)),
        ("Time from", ", ".join(CLOCK_WORDS.get(c, c) for c in clocks), ""),
    ]


def _at_rest(still: Sequence[float]) -> str:
    return (
        Message("(at rest {still:.2f} to {still2:.2f} m/s²)", still=min(still), still2=max(still))
        if still
        else ""
    )


def _notices(inspection: Mapping[str, Any], devices: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Distinct notices; file copies share one sentence, unused files are listed separately."""
    copies = [d for d in devices if d["duplicate_of"]]
    notices = []
    if copies:
        pairs = ", ".join(f"{quote_id(d['device_id'])} of {quote_id(d['duplicate_of'])}" for d in copies)
        title = (
            "One sensor is a copy of another"
            if len(copies) == 1
            else Message("{copies} sensors are copies of others", copies=len(copies))
        )
        message = Message(
            "Identical samples under another id: {pairs}. Copies are not analysed unless selected.",
            pairs=pairs,
        )
        notices.append({"kind": "", "title": title, "message": message})
    everything = [*inspection["notices"], *(n for d in devices for n in d["notices"])]
    for n in everything:
        if n["code"] == DUPLICATE or n["code"] in ABOUT_FILES:
            continue
        suffix = f", {quote_id(n['sensor'])}" if n["sensor"] else ""
        title = title_of_code(n["code"]) + suffix
        notice = {"kind": KINDS[n["severity"]], "title": title, "message": read_message(n)}
        if notice not in notices:
            notices.append(notice)
    order = list(KINDS.values())
    return sorted(notices, key=lambda n: order.index(n["kind"]))
