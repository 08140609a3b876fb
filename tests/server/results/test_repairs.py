"""Corrections of a set-up: proposal texts, and the corrected manifest."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from sagittal.core.signals.correction import SensorCorrection
from sagittal.server.results import analyses
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.analysing import REPAIRED
from sagittal.server.results.repairs import _list_changes, read_proposal, read_without_limits, take_setup
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic
from tests.server import analysed, feedback

WORN: Mapping[str, Any] = {"sensors": {"A": "foot_l", "B": "foot_r"}}


def test_a_sensor_that_moves_is_said_with_where_it_was() -> None:
    swapped = {"sensors": {"b": "foot_l", "A": "foot_r", "C": "pelvis", "D": None}}
    assert _list_changes(swapped, WORN) == (
        "Sensor A goes from foot_l to foot_r.",
        "Sensor C goes to pelvis.",
        "Sensor b goes from foot_r to foot_l.",
    )
    assert _list_changes({"sensors": {"a": "foot_l"}}, WORN) == ()


def test_a_correction_is_said_unless_it_was_there_before() -> None:
    turned = {"corrections": {"A": {"gyr_axes": ["-x", "-y", "-z"]}}}
    words = SensorCorrection(gyr_axes=("-x", "-y", "-z")).say()
    assert _list_changes(turned, WORN) == (f"Of sensor A {words}.",)
    assert _list_changes(turned, {"corrections": {"a": {"gyr_axes": ["-x", "-y", "-z"]}}}) == ()
    assert _list_changes(turned, None) == (f"Of sensor A {words}.",)


def test_how_a_sensor_is_worn_is_said_beside_what_was_declared() -> None:
    expected = {"mounting": {"pelvis": "back"}}
    assert _list_changes(expected, None) == ("The sensor of pelvis is worn “back”.",)
    assert _list_changes(expected, {"mounting": {"pelvis": "front"}}) == (
        "The sensor of pelvis is worn “back”, not “front”.",
    )
    assert _list_changes(expected, expected) == ()


def test_only_the_set_up_is_taken_over() -> None:
    mine = {
        "protocol": "walk",
        "subject": {"height_m": 1.7},
        "corrections": {"A": {}},
        "sensors": {"A": "chest"},
    }
    second = {"sensors": {"A": "pelvis"}, "mounting": {}, "protocol": "tug"}
    assert take_setup(mine, second) == {
        "protocol": "walk", "subject": {"height_m": 1.7}, "sensors": {"A": "pelvis"}, "mounting": {}
    }  # fmt: skip
    assert take_setup(None, None) == {}
    assert take_setup(mine, None) == {"protocol": "walk", "subject": {"height_m": 1.7}}


def proposing(stored: Clinic) -> AnalysisRecord:
    """Analysis that proposes to swap the feet."""
    result = json.loads(analysed.files()["analysis.json"]) | {
        "setup": {"evidence": ["The feet are exchanged."]}
    }
    repaired = {"sensors": {"A": "foot_r", "B": "foot_l"}, "protocol": "tug"}
    files = {
        **analysed.files(),
        "analysis.json": json.dumps(result).encode(),
        REPAIRED: json.dumps(repaired).encode(),
    }
    patient = feedback.person(stored)
    session = feedback.visit(stored, patient, 0)
    manifest = {**WORN, "protocol": "walk", "test_limits": {"start_s": 1.0}}
    analysed.finish(stored, patient, session, files, manifest)
    with stored.db.read() as c:
        return analyses.get_shown(c, session)


def test_a_proposal_is_evidence_changes_and_the_manifest_of_the_session_with_that_set_up(
    stored: Clinic,
) -> None:
    result = proposing(stored)
    with stored.db.read() as c:
        proposal = read_proposal(c, stored.app.state.blobs, result)
        without = read_without_limits(c, result)
    assert proposal is not None
    assert proposal.evidence == ("The feet are exchanged.",)
    assert proposal.changes == (
        "Sensor A goes from foot_l to foot_r.",
        "Sensor B goes from foot_r to foot_l.",
    )
    assert proposal.manifest["sensors"] == {"A": "foot_r", "B": "foot_l"}
    assert proposal.manifest["protocol"] == "walk"
    assert without is not None
    assert without["sensors"] == WORN["sensors"]
    assert "test_limits" not in without


def test_files_that_are_no_longer_the_sessions_propose_nothing(stored: Clinic) -> None:
    result = proposing(stored)
    state = (stored.db, stored.app.state.blobs, stored.settings)
    with receiving.receive(*state, None, result.session_id, "walk.txt") as upload:
        upload.write(b"another recording")
        upload.keep()
    with stored.db.read() as c:
        current = recordings.require_current(c, result.session_id)
        assert current.id != result.recording_id
        assert read_proposal(c, stored.app.state.blobs, result) is None
        assert read_without_limits(c, result) is None


def test_an_analysis_without_a_repair_proposes_nothing(stored: Clinic) -> None:
    session = feedback.walked(stored, feedback.person(stored), 0, 12.0)
    with stored.db.read() as c:
        assert read_proposal(c, stored.app.state.blobs, analyses.get_shown(c, session)) is None
