"""The walking condition of a visit: stated, shown, and the rule by which visits are compared at all."""

from __future__ import annotations

import csv
import datetime as dt
import io
import re
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.feedback import Cue
from sagittal.core.subject.condition import USUAL
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.live_takes import live, live_training
from sagittal.server.results import controls, prescriptions
from tests.helpers.clinic import Clinic
from tests.server import analysed, feedback

pytestmark = pytest.mark.anyio

API = "/api/v1"
OWN: dict[str, Any] = USUAL.stated
FAST = {**OWN, "pace": "fast"}


async def _get(clinic: Clinic, path: str) -> Any:
    async with clinic.client("clinician") as client:
        answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.json() if answer.headers["content-type"] == "application/json" else answer.text


async def _since(clinic: Clinic, session: str) -> str | None:
    report = await _get(clinic, f"{API}/sessions/{session}/report")
    return None if report["since"] is None else str(report["since"]["session_id"])


async def test_a_condition_is_stated_with_a_session_and_changed_later(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    async with clinic.client("clinician") as client:
        silent = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()
        assert [silent[name] for name in OWN] == [None] * 4
        assert silent["feedback"] is False
        path = f"{API}/sessions/{silent['id']}"
        changed = (await client.patch(path, json={"pace": "fast", "aid": "rollator"})).json()
        assert (changed["pace"], changed["aid"], changed["shoes"]) == ("fast", "rollator", None)
        refused = await client.patch(path, json={"aid": "broom"})
        assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "aid")
        body = (await client.post(f"{API}/patients/{patient}/sessions", json=FAST)).json()
        assert {name: body[name] for name in FAST} == FAST


@pytest.mark.slow
async def test_a_fast_walk_is_not_what_a_comfortable_one_is_compared_with(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    first = feedback.walked(clinic, patient, 0, **OWN)
    fast = feedback.walked(clinic, patient, 7, **FAST)
    later = feedback.walked(clinic, patient, 9, **OWN)
    assert [await _since(clinic, s) for s in (first, fast, later)] == [None, None, first]
    page = await _get(clinic, f"/sessions/{fast}")
    assert "No earlier visit in this condition to compare with: fast, no aid, shoes." in page
    assert "real change since" not in page


@pytest.mark.slow
async def test_belts_of_another_speed_are_not_compared(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    result = []
    for days, speed in ((0, 0.83), (7, 1.11), (14, 0.83)):
        session = feedback.visit(clinic, patient, days, protocol="treadmill", **OWN)
        belt = {"belt_speed_mps": speed, "protocol": "treadmill"}
        analysed.finish(clinic, patient, session, analysed.files(24.0), belt)
        result.append(session)
    slow, quick, second = result
    assert [await _since(clinic, s) for s in result] == [None, None, slow]
    answer = await _get(clinic, f"{API}/patients/{patient}/trends")
    assert [v["session_id"] for v in answer["visits"]] == [slow, second]
    assert [o["session_id"] for o in answer["others"]] == [quick]
    assert answer["others"][0]["condition"]["belt_speed_mps"] == 1.11


async def test_a_trend_follows_one_condition_and_offers_the_others(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    first = feedback.walked(clinic, patient, 0, **OWN)
    later = feedback.walked(clinic, patient, 9, **OWN)
    fast = feedback.walked(clinic, patient, 10, **FAST)
    silent = feedback.walked(clinic, patient, 11)
    path = f"{API}/patients/{patient}/trends"
    # what nobody stated is a condition of its own; the newest visit at comfortable pace is followed
    assert [v["session_id"] for v in (await _get(clinic, path))["visits"]] == [silent]
    own = await _get(clinic, f"{path}?like={first}")
    assert [v["session_id"] for v in own["visits"]] == [first, later]
    assert own["condition"]["words"] == "comfortable pace, no aid, shoes"
    offered = [(o["condition"]["words"], o["count"], o["session_id"]) for o in own["others"]]
    assert offered == [("condition not stated", 1, silent), ("fast, no aid, shoes", 1, fast)]
    page = await _get(clinic, f"/patients/{patient}/trends?like={first}")
    assert "1 visit in another condition: fast, no aid, shoes" in page
    rows = list(csv.DictReader(io.StringIO(await _get(clinic, f"{path}.csv?like={fast}"))))
    assert {(r["session_id"], r["condition"]) for r in rows} == {(fast, "fast, no aid, shoes")}
    async with clinic.client("viewer") as client:
        other_response = await client.get(
            f"{path}?like={feedback.walked(clinic, feedback.person(clinic), 0)}"
        )
    assert other_response.status_code == 404


async def test_the_newest_own_pace_is_followed_though_a_fast_walk_came_after(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    own = feedback.walked(clinic, patient, 0, **OWN)
    feedback.walked(clinic, patient, 0, **FAST)
    answer = await _get(clinic, f"{API}/patients/{patient}/trends")
    assert [v["session_id"] for v in answer["visits"]] == [own]


async def test_unlike_walks_side_by_side_say_so_and_claim_no_change(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    own = feedback.walked(clinic, patient, 0, **OWN)
    fast = feedback.walked(clinic, patient, 7, 12.0, **FAST)
    alike = feedback.walked(clinic, patient, 8, 12.0, **OWN)
    value = await _get(clinic, f"{API}/sessions/{fast}/compare/{own}")
    assert value["comparable"] is False
    assert "comfortable pace, then fast" in value["cautions"][0]
    assert [c["condition"]["pace"] for c in (value["before"], value["after"])] == ["comfortable", "fast"]
    there = [c for c in value["changes"] if c["difference"] is not None]
    assert there
    assert {(c["verdict"], c["towards_norm"]) for c in there} == {(None, None)}
    assert {c["words"] for c in there} == {"not assessed: the conditions differ"}
    page = await _get(clinic, f"/sessions/{fast}/compare/{own}")
    assert "Changes not assessed" in page
    assert "real change" not in page.lower()
    rows = csv.DictReader(io.StringIO(await _get(clinic, f"{API}/sessions/{fast}/compare/{own}/changes.csv")))
    assert {(r["verdict"], r["reason"]) for r in rows if r["change"]} == {("", "conditions_differ")}
    response = await _get(clinic, f"{API}/sessions/{alike}/compare/{own}")
    assert response["comparable"] is True
    assert {c["verdict"] for c in response["changes"]} >= {"within_measurement_error"}


async def test_walks_of_unstated_condition_are_compared_with_a_caution(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    one, two = feedback.walked(clinic, patient, 0), feedback.walked(clinic, patient, 7)
    response = await _get(clinic, f"{API}/sessions/{two}/compare/{one}")
    assert response["comparable"] is True
    assert response["cautions"] == [
        "Not stated for either visit: pace, aid, orthosis, shoes. Assumed to be the same."
    ]
    assert await _since(clinic, two) == one
    assert "condition not stated" in await _get(clinic, f"/patients/{patient}")


@pytest.mark.slow
async def test_a_training_with_feedback_is_a_small_mark_and_never_a_baseline(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    notices = feedback.walked(clinic, patient, 0, feedback=True, **OWN)
    first = feedback.walked(clinic, patient, 2, **OWN)
    second = feedback.walked(clinic, patient, 5, feedback=True, **OWN)
    later = feedback.walked(clinic, patient, 9, **OWN)
    # whatever the programme calls it
    with clinic.db.write() as c:
        plan = programmes.start(c, None, patient, starts_on=dt.date(2026, 3, 9))
        visits = {v.label: v.id for v in plan.visits}
        programmes.change_visit(c, None, visits["PRE"], {"session_id": notices})
    assert [await _since(clinic, s) for s in (notices, first, second, later)] == [None, None, None, first]
    assert "Walked with feedback: shown, not compared" in await _get(clinic, f"/sessions/{second}")
    answer = await _get(clinic, f"{API}/patients/{patient}/trends?show=stance_pct")
    kinds = ["training", "assessment", "training", "assessment"]
    assert [v["kind"] for v in answer["visits"]] == kinds
    for line in answer["trends"][0]["lines"]:
        assert (line["base"], line["latest"]) == (1, 3)
        assert [p["change"] is None for p in line["points"]] == [True, True, True, False]
    page = await _get(clinic, f"/patients/{patient}/trends?show=stance_pct")
    assert (page.count('class="pl-l"'), page.count('class="ps-l"')) == (2, 2)
    response = await _get(clinic, f"{API}/sessions/{second}/compare/{notices}")
    assert response["comparable"] is False


async def test_a_training_with_feedback_is_no_own_baseline_of_a_prescription(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    path = f"{API}/patients/{patient}/targets?parameter=stance_pct&side=left"

    async def own() -> dict[str, Any]:
        offers = await _get(clinic, path)
        return next(o for o in offers if o["source"] == "own_baseline")

    notices = feedback.walked(clinic, patient, 0, feedback=True, **OWN)
    assert (await own())["mean"] is None
    assert "without feedback" in (await own())["reason"]
    feedback.walked(clinic, patient, 3, **OWN)
    feedback.walked(clinic, patient, 5, **FAST)
    feedback.walked(clinic, patient, 6, feedback=True, **OWN)
    assert "5 Mar 2026" in (await own())["words"]
    body = {
        "parameter": "stance_pct",
        "side": "left",
        "target": {"source": "own_baseline", "session_id": notices},
    }
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=body)
    assert (answer.status_code, answer.json()["code"]) == (422, "no_target")


async def test_a_take_is_coached_from_the_walk_in_its_own_condition(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    aided = feedback.walked(clinic, patient, 0, **{**OWN, "aid": "stick"})
    feedback.walked(clinic, patient, 1, **OWN)
    feedback.walked(clinic, patient, 2, feedback=True, **{**OWN, "aid": "stick"})
    today = feedback.visit(clinic, patient, 3, **{**OWN, "aid": "stick"})
    body = {"parameter": "stance_pct", "side": "left", "target": {"source": "manual", "mean": 64, "sd": 1}}
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients/{patient}/prescriptions", json=body)
    assert answer.status_code == 201
    with clinic.db.read() as c:
        result = prescriptions.for_take(c, clinic.app.state.reviewed, today)
    assert result is not None
    assert result[1].session_id == aided


async def test_only_unaided_walks_of_controls_are_a_reference(clinic: Clinic) -> None:
    healthy = feedback.person(clinic, is_control=True, affected_side=None)
    plain = feedback.walked(clinic, healthy, 0, **OWN)
    fast = feedback.walked(clinic, healthy, 0, **FAST)
    silent = feedback.walked(clinic, healthy, 0)
    feedback.walked(clinic, healthy, 0, **{**OWN, "aid": "stick"})
    feedback.walked(clinic, healthy, 0, **{**OWN, "orthosis": "ankle_foot"})
    feedback.walked(clinic, healthy, 0, feedback=True, **OWN)
    patient = feedback.person(clinic)
    this = feedback.walked(clinic, patient, 0, **OWN)
    with clinic.db.read() as c:
        code = patients.get(c, healthy).code
        known_visits = controls.list_visits(c, patients.get(c, patient), sessions.get(c, this))
    assert {v.found.session_id for v in known_visits if v.person == code} == {plain, fast, silent}


@pytest.mark.slow
async def test_the_pages_ask_for_the_condition_and_say_it(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    new = re.sub(r">\s+<", "><", await _get(clinic, f"/patients/{patient}/sessions/new"))
    assert 'name="pace" value="comfortable" checked' in new
    for name in ("aid", "orthosis"):
        assert f'name="{name}"><option value="">not stated</option><option value="none" selected>' in new
    session = feedback.visit(clinic, patient, 0, **FAST)
    for page in ("upload", "live"):
        text = await _get(clinic, f"/sessions/{session}/{page}")
        assert "fast, no aid, shoes" in text
        assert f'data-api="PATCH /api/v1/sessions/{session}"' in text
    done = feedback.walked(clinic, patient, 1, **{**OWN, "orthosis": "ankle_foot"})
    words = "comfortable pace, no aid, ankle-foot orthosis, shoes"
    for page in (f"/sessions/{done}/print", f"/patients/{patient}", f"/sessions/{done}"):
        assert words in await _get(clinic, page)
    assert (await _get(clinic, f"{API}/sessions/{done}/report"))["condition"] == words
    rows = list(csv.DictReader(io.StringIO(await _get(clinic, f"{API}/sessions/{done}/parameters.csv"))))
    assert {r["condition"] for r in rows} == {words}


async def test_the_take_that_counts_says_whether_there_was_feedback(clinic: Clinic) -> None:
    patient = feedback.person(clinic)
    body = {"parameter": "stance_pct", "side": "left", "target": {"source": "manual", "mean": 64, "sd": 1}}
    async with clinic.client("clinician") as client:
        response = await client.post(f"{API}/patients/{patient}/prescriptions", json=body)
    prescription = response.json()["id"]
    session, second = feedback.visit(clinic, patient, 0), feedback.visit(clinic, patient, 1, feedback=True)
    view = Cue(1, "left", 1.0, 2.0, 64.0, 0.0, "in", True, None, 0, 63.0, 65.0)
    hidden = replace(view, shown=False, why_not="probe")
    for at, cue, noted in (
        (session, hidden, False),
        (session, view, True),
        (session, hidden, False),  # recorded once more without feedback
        (second, hidden, True),  # somebody said so, and no take says otherwise
    ):
        take = feedback.take(clinic, at, prescription, [cue])
        with clinic.db.write() as c:
            live_training.settle_feedback(c, None, live.get(c, take))
            assert sessions.get(c, at).feedback is noted
    with clinic.db.write() as c:
        live_training.note_feedback(c, [take.id for take in live.takes_of(c, session)])
        assert sessions.get(c, session).feedback is True


@pytest.mark.slow
async def test_paper_has_the_sentences_that_its_numbers_refer_to_the_changes_and_the_score(
    clinic: Clinic,
) -> None:
    patient = feedback.person(clinic)
    first, later = feedback.walked(clinic, patient, 0, **OWN), feedback.walked(clinic, patient, 7, **OWN)
    screen, paper = [await _get(clinic, f"/sessions/{later}{page}") for page in ("", "/print")]
    for words in ("Findings", "Changed since 2 Mar 2026", "Sagittal profile score"):
        assert words in paper
        assert words in screen
    begins = paper.index("r-tbl params")
    sentences, table = paper[paper.index('class="r-short"') : begins], paper[begins:]
    notices, marked = (
        set(re.findall(r'class="rank" aria-hidden="true">(\d)', part)) for part in (sentences, table)
    )
    assert marked <= notices
    assert f"/compare/{first}" not in paper
    assert re.search(r"\d+ within measurement error, \d+ without a known measurement error", sentences)
