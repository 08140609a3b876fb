"""Prescriptions over the API, and what of them a live take is given."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.core.feedback import Baseline, FeedbackEngine, Prescription
from sagittal.core.parameters.result import Parameter
from sagittal.server.results import prescriptions
from sagittal.server.results.histories import list_analysed
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.schema.tables import audit
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.helpers.feedback import prescription, train
from tests.server import feedback

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"
MANUAL: dict[str, Any] = {
    "parameter": "stance_pct",
    "side": "left",
    "target": {"source": "manual", "mean": 62.0, "sd": 2.0},
}


def _numbers(clinic: Clinic, patient: str, name: str, side: str) -> Parameter:
    with clinic.db.read() as c:
        last = list_analysed(c, patient)[-1]
    reviewed: ReviewedAnalyses = clinic.app.state.reviewed
    numbers = reviewed.read_numbers(last.found, last.edits)
    return next(p for p in numbers.parameters if (p.name, p.side) == (name, side))


def _for_take(clinic: Clinic, session: str) -> tuple[Prescription, Baseline]:
    with clinic.db.read() as c:
        result = prescriptions.for_take(c, clinic.app.state.reviewed, session)
    assert result is not None
    return result


async def test_a_change_ends_the_old_prescription_and_keeps_it(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    async with clinic.client("clinician") as client:
        first = await client.post(f"{API}/patients/{patient}/prescriptions", json=MANUAL)
        assert first.status_code == 201, first.text
        second = await client.post(
            f"{API}/patients/{patient}/prescriptions", json=MANUAL | {"modes": ["zone", "tone"]}
        )
        listed = (await client.get(f"{API}/patients/{patient}/prescriptions")).json()
    assert [p["id"] for p in listed] == [second.json()["id"], first.json()["id"]]
    assert (listed[0]["ended_at"], listed[0]["by"]) == (None, "clinician")
    assert listed[1]["ended_at"] is not None
    assert listed[0]["content"]["modes"] == ["zone", "tone"]
    assert "Trained: Stance, left" in listed[0]["words"]
    assert "Target: 62.0 ± 2.0\u202f%, entered" in listed[0]["words"]
    with clinic.db.read() as c:
        rows = c.execute(audit.select().where(audit.c.resource_id == patient).order_by(audit.c.seq)).all()
    message = [(r.action, r.detail["parameter"]) for r in rows if r.action.startswith("prescription.")]
    assert message == [
        ("prescription.written", "stance_pct"),
        ("prescription.ended", "stance_pct"),
        ("prescription.written", "stance_pct"),
    ]


async def test_a_prescription_is_ended_once(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    async with clinic.client("clinician") as client:
        body = (await client.post(f"{API}/patients/{patient}/prescriptions", json=MANUAL)).json()
        ended = await client.post(f"{API}/prescriptions/{body['id']}/end")
        second_response = await client.post(f"{API}/prescriptions/{body['id']}/end")
    assert ended.json()["ended_at"] is not None
    assert (second_response.status_code, second_response.json()["code"]) == (409, "prescription_ended")
    with clinic.db.read() as c:
        assert prescriptions.in_force(c, patient) is None
        session = feedback.visit(clinic, patient, 0)
    with clinic.db.read() as c:
        assert prescriptions.for_take(c, clinic.app.state.reviewed, session) is None


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"parameter": "beauty"}, "Expected one of gait_speed_mps"),
        ({"target": {"source": "manual"}}, "Expected both numbers"),
        ({"target": {"source": "norm"}}, "No walk without feedback has been analysed for this person yet"),
        ({"schedule": {"shares_pct": [0, 100]}}, "Expected no share above the one before"),
        ({"schedule": {"speed": 1}}, "schedule.speed"),
        ({"parameter": "stride_length_m"}, "is common to both sides of a walk"),
        ({"target": {"source": "manual", "mean": 1000.0, "sd": 2.0}}, "Expected 0 to 110"),
        ({"target": {"source": "manual", "mean": 62.0, "sd": 1000.0}}, "Expected at most 110"),
        ({"band_sd": 0}, "band_sd is 0.0. Expected a number from 0.1 to 5"),
    ],
)
async def test_what_makes_no_sense_is_refused_with_a_sentence(
    clinic: Clinic, changes: dict[str, Any], said: str
) -> None:
    patient = feedback.person(clinic)
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=MANUAL | changes)
        assert answer.status_code == 422
        assert said in answer.json()["detail"]
        assert (await client.get(f"{API}/patients/{patient}/prescriptions")).json() == []


async def test_only_who_runs_live_takes_prescribes_and_who_sees_results_reads(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    path = f"{API}/patients/{patient}/prescriptions"
    for role, reads, writes in (("viewer", 200, 403), ("assistant", 403, 403), ("admin", 200, 201)):
        async with clinic.client(role) as client:
            assert (await client.get(path)).status_code == reads
            assert (await client.post(path, json=MANUAL)).status_code == writes


async def test_targets_are_the_persons_own_numbers_or_a_norm_at_their_speed(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    feedback.walked(clinic, patient, 0)
    async with clinic.client("viewer") as client:
        path = f"{API}/patients/{patient}/targets?parameter=stride_time_s&side=left"
        offers = {o["source"]: o for o in (await client.get(path)).json()}
        pair = {o["source"]: o for o in (await client.get(path.replace("&side=left", ""))).json()}
        stance = (await client.get(f"{API}/patients/{patient}/targets?parameter=stance_pct&side=left")).json()
        unknown = await client.get(f"{API}/patients/{patient}/targets?parameter=beauty")
    left = _numbers(clinic, patient, "stride_time_s", "left")
    assert [offers["own_baseline"][k] for k in ("mean", "sd")] == [left.mean, left.sd]
    assert offers["own_baseline"]["words"] == f"left side, {left.n} strides on 2 Mar 2026"
    assert "Enter mean and SD" in offers["manual"]["reason"]
    assert "Choose one side; the other is then the target" in pair["own_better_side"]["reason"]
    norm = next(o for o in stance if o["source"] == "norm")
    assert 55.0 < norm["mean"] < 68.0, "contacts are those of a walkway"
    assert unknown.status_code == 422


@pytest.mark.parametrize("parameter", ["step_length_m", "circumduction_m"])
async def test_the_better_side_is_a_target_for_the_other_one_only(clinic: Clinic, parameter: str) -> None:
    patient = feedback.person(clinic)
    feedback.walked(clinic, patient, 0)
    means = {side: _numbers(clinic, patient, parameter, side).mean or 0.0 for side in ("left", "right")}
    worse, better = sorted(means, key=lambda s: means[s], reverse=parameter == "circumduction_m")
    async with clinic.client("viewer") as client:
        path = f"{API}/patients/{patient}/targets?parameter={parameter}&side="
        offers = [(await client.get(path + side)).json() for side in (worse, better)]
    inputs, refused = (next(o for o in result if o["source"] == "own_better_side") for result in offers)
    assert inputs["mean"] == means[better]
    assert refused["mean"] is None
    assert f"The {better} side is the better one" in refused["reason"]


async def test_a_parameter_without_a_better_end_has_no_better_side(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    feedback.walked(clinic, patient, 0)
    async with clinic.client("clinician") as client:
        own = {"parameter": "stance_pct", "side": "left", "target": {"source": "own_better_side"}}
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=own)
    assert answer.status_code == 422
    assert "neither higher nor lower is better by itself" in answer.json()["detail"]


async def test_a_prescribed_norm_has_its_numbers_and_its_people(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    feedback.walked(clinic, patient, 0)
    norm = {"parameter": "knee_flexion_rom_deg", "side": "left", "target": {"source": "norm"}}
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=norm)
        assert answer.status_code == 201, answer.text
    target = answer.json()["content"]["target"]
    assert target["mean"] == pytest.approx(60.0, abs=5.0)
    assert "healthy adults asked to walk at this speed, n = 52" in target["words"]


async def test_a_take_gets_target_baseline_and_the_limit_of_the_other_side(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    initial = feedback.walked(clinic, patient, 0)
    own = {"parameter": "stance_pct", "side": "left", "target": {"source": "own_baseline"}}
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=own)
        assert answer.status_code == 201, answer.text
    inputs, baseline = _for_take(clinic, feedback.visit(clinic, patient, 7))
    left = _numbers(clinic, patient, "stance_pct", "left")
    assert (inputs.target.source, inputs.target.mean) == ("own_baseline", left.mean)
    assert (baseline.mean, baseline.sd, baseline.n) == (left.mean, left.sd, left.n)
    assert (baseline.session_id, baseline.after_training) == (initial, False)
    assert baseline.other_mdc == 4.2
    assert "Kesar" in (baseline.other_mdc_source or "")
    FeedbackEngine(inputs, baseline)
    _, first = _for_take(clinic, initial)
    assert first.mean is None, "nothing was known before the first walk"
    assert first.other_mdc == 4.2, "the limit holds all the same"


async def test_a_visit_after_a_training_begins_with_retention_and_goes_on_at_its_level(
    clinic: Clinic,
) -> None:
    patient = feedback.person(clinic)
    async with clinic.client("clinician") as client:
        path = f"{API}/patients/{patient}/prescriptions"
        body = (
            await client.post(path, json=prescription().to_json() | {"parameter": "step_length_m"})
        ).json()
        cues, _ = train([0.6] * 30)
        trained = feedback.visit(clinic, patient, 0)
        feedback.take(clinic, trained, body["id"], cues)
        later = feedback.visit(clinic, patient, 7)
        _, baseline = _for_take(clinic, later)
        assert (baseline.after_training, baseline.last_level) == (True, 2)
        assert not _for_take(clinic, trained)[1].after_training, "the second take of the same visit"
        repeat = prescription(schedule={"kind": "fading"}).to_json()
        await client.post(path, json=repeat)
        _, baseline = _for_take(clinic, later)
        assert (baseline.after_training, baseline.last_level) == (True, None), "a new record of the same"
        await client.post(path, json=MANUAL)
        assert not _for_take(clinic, later)[1].after_training, "something else is trained"
