"""Cues of a live trial assigned to analysed strides, and retention at the next visit."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from sagittal.core.feedback import Baseline, Cue, FeedbackEngine, Prescription
from sagittal.server.results import analyses, edit_log, prescriptions
from tests.helpers.clinic import Clinic
from tests.helpers.feedback import Walked
from tests.server import feedback

pytestmark = pytest.mark.anyio

API = "/api/v1"
GIVEN: dict[str, Any] = {
    "parameter": "stance_pct",
    "side": "left",
    "target": {"source": "manual", "mean": 64.0, "sd": 1.0},
    "schedule": {"kind": "every", "probe_every": 6, "probe_strides": 3, "retention_strides": 5},
}
TOLD = 0.2
"""The live value is so much above that of the analysis."""


async def _prescribe(clinic: Clinic, patient: str) -> str:
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=GIVEN)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def _live(clinic: Clinic, session: str, inputs: Prescription, baseline: Baseline) -> tuple[list[Cue], str]:
    """The cues that the strides of a session's analysis would have got, and its recording."""
    reviewed = clinic.app.state.reviewed
    with clinic.db.read() as c:
        analysis = analyses.get_shown(c, session)
        edits = edit_log.edits_of(c, analysis.id)
    strides = reviewed.read_bundle(analysis, edits).strides.strides
    column = reviewed.read_columns(analysis, edits)[inputs.parameter]
    engine = FeedbackEngine(inputs, baseline)
    cues = []
    for n, (s, value) in enumerate(zip(strides, column, strict=True)):
        counted_strides = s.excluded_reason is None
        notices = None if value is None else value + TOLD
        stride = Walked(
            n, s.side, s.start_s - 0.03, s.end_s, s.end_s, {inputs.parameter: notices}, {}, counted_strides
        )
        cue = engine.push(stride)
        if cue is not None:
            cues.append(cue)
    return cues, analysis.recording_id


async def _train(
    clinic: Clinic, patient: str, prescription: str, days: int, **values: Any
) -> tuple[str, list[Cue]]:
    session = feedback.walked(clinic, patient, days, 48.0, **values)
    with clinic.db.read() as c:
        inputs = prescriptions.for_take(c, clinic.app.state.reviewed, session)
    assert inputs is not None
    cues, recording = _live(clinic, session, *inputs)
    feedback.take(clinic, session, prescription, cues, recording)
    return session, cues


@pytest.mark.slow
async def test_strides_with_and_without_feedback_are_told_apart(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    session, cues = await _train(clinic, patient, await _prescribe(clinic, patient), 0)
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/sessions/{session}/feedback")).json()
        table = (await client.get(f"{API}/sessions/{session}/feedback.csv")).text
        page = (await client.get(f"/sessions/{session}")).text
        paper = (await client.get(f"/sessions/{session}/print")).text
    assert answer["reason"] is None
    assert (answer["parameter"], answer["unit"], answer["side"]) == ("stance_pct", "%", "left")
    rows = {r["kind"]: r for r in answer["rows"]}
    by_kind = {kind: sum(c.why_not == kind for c in cues) for kind in ("baseline", "probe")}
    assert rows["baseline"]["n"] == by_kind["baseline"] == 10
    assert rows["probe"]["n"] == rows["without"]["n"] == by_kind["probe"]
    assert rows["with"]["n"] == sum(c.shown for c in cues)
    mean = sum(c.value - TOLD for c in cues if c.shown) / rows["with"]["n"]
    assert rows["with"]["mean"] == pytest.approx(mean), "the value of the analysis, not the one that was told"
    assert len(answer["probes"]) == len({c.block for c in cues} - {None})
    assert any(f"{TOLD:.2f} ±" in note for note in answer["notes"])
    assert {e["name"]: e["kind"] for e in answer["effects"]} == {
        "other_side": "ok",
        "gps_sagittal_deg": "ok",
    }
    assert answer["retention"] is None
    lines = list(csv.DictReader(io.StringIO(table)))
    assert len(lines) == len(cues)
    assert {line["kind"] for line in lines} == {"baseline", "with", "probe"}
    assert float(lines[-1]["live_value"]) - float(lines[-1]["value"]) == pytest.approx(TOLD, abs=1e-5)
    for text in (page, paper):
        assert "With feedback" in text
        assert "of these, in probe blocks" in text
        assert "fb-plot" in text


@pytest.mark.slow
async def test_an_edited_stride_leaves_the_sums_and_is_said(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    session, cues = await _train(clinic, patient, await _prescribe(clinic, patient), 0)
    visible_item = next(c for c in cues if c.shown)
    middle = 0.5 * (visible_item.start_s + visible_item.t_s)
    edit = {"kind": "exclude_stride", "side": "left", "time_s": middle, "reason": "stumbled"}
    async with clinic.client("clinician") as client:
        initial_body = (await client.get(f"{API}/sessions/{session}/feedback")).json()
        assert (await client.post(f"{API}/sessions/{session}/edits", json=edit)).status_code == 201
        final_body = (await client.get(f"{API}/sessions/{session}/feedback")).json()

    def n(answer: dict[str, Any]) -> int:
        return next(int(r["n"]) for r in answer["rows"] if r["kind"] == "with")

    assert n(final_body) == n(initial_body) - 1
    assert "1 cue was excluded because its stride is excluded from the analysis." in final_body["notes"]


@pytest.mark.slow
async def test_the_next_visit_is_held_against_the_end_of_the_last_training(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    prescription = await _prescribe(clinic, patient)
    first, _ = await _train(clinic, patient, prescription, 0)
    second, cues = await _train(clinic, patient, prescription, 7)
    assert [c.why_not for c in cues[:6]] == ["retention"] * 5 + [None]
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/sessions/{second}/feedback")).json()
        page = (await client.get(f"/sessions/{second}")).text
    retained = answer["retention"]
    assert (retained["session_id"], retained["performed_on"]) == (first, "2026-03-02")
    assert (retained["now"]["n"], retained["end"]["n"]) == (5, 20)
    assert retained["difference"] == pytest.approx(retained["now"]["mean"] - retained["end"]["mean"])
    assert retained["limit"] == 4.2
    assert "within the measurement error of 4.20" in retained["verdict"]
    assert "End of the last training" in page


async def test_retention_is_held_against_the_last_training_walked_alike(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    prescription = await _prescribe(clinic, patient)
    with_stick, _ = await _train(clinic, patient, prescription, 0, aid="stick", feedback=True)
    await _train(clinic, patient, prescription, 3, aid="none", feedback=True)
    last, _ = await _train(clinic, patient, prescription, 7, aid="stick", feedback=True)
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/sessions/{last}/feedback")).json()
    assert answer["retention"]["session_id"] == with_stick


async def test_without_feedback_there_is_a_reason_and_no_section(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    session = feedback.walked(clinic, patient, 0)
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/sessions/{session}/feedback")).json()
        table = (await client.get(f"{API}/sessions/{session}/feedback.csv")).text
        page = (await client.get(f"/sessions/{session}")).text
        missing = await client.get(f"{API}/sessions/{'0' * 32}/feedback")
    assert (answer["reason"], answer["rows"]) == ("No live take of this session gave feedback.", [])
    assert len(table.splitlines()) == 1
    assert "With feedback" not in page
    assert missing.status_code == 404


async def test_a_take_that_is_not_the_analysed_recording_says_so(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    prescription = await _prescribe(clinic, patient)
    session, cues = await _train(clinic, patient, prescription, 0)
    alternative = feedback.walked(clinic, patient, 1)
    with clinic.db.read() as c:
        recording = analyses.get_shown(c, session).recording_id
    feedback.take(clinic, alternative, prescription, cues, recording)
    waiting = feedback.visit(clinic, patient, 2)
    feedback.take(clinic, waiting, prescription, cues)
    async with clinic.client("viewer") as client:
        wrong = (await client.get(f"{API}/sessions/{alternative}/feedback")).json()
        early = (await client.get(f"{API}/sessions/{waiting}/feedback")).json()
    assert "another recording" in wrong["reason"]
    assert "not analysed yet" in early["reason"]
