"""docs/how-to/contributing.md: what a newcomer touches to add something is all there is to touch."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import pytest
from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from jinja2 import ChoiceLoader, DictLoader
from starlette.responses import Response

from sagittal.core.errors import FormatError, Notice
from sagittal.core.events.foot_contact import FootContactParams
from sagittal.core.feedback import Prescription
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import registry as vendors
from sagittal.core.formats.vendors.registry import VendorFormat
from sagittal.core.parameters.catalogue import CATALOGUE, CurveFigure, ParameterEntry, errors
from sagittal.core.parameters.catalogue.entry import ANKLE_AND_FOOT, DORSIFLEXION
from sagittal.core.parameters.measure import Tracks, measure_gait
from sagittal.core.pipeline import WALK, PipelineConfig, PipelineStage, TakeAnalysis, analyse, recipes
from sagittal.core.pipeline.recipes import SIGNALS, run_stages, say_nothing
from sagittal.core.pipeline.stages import ORIENTATION, orient_segments
from sagittal.core.simulate import simulate_scenario
from sagittal.server import app
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db
from sagittal.server.http.templates import TEMPLATES
from sagittal.server.pages import routes, shell
from sagittal.server.pages.live_takes.live import list_terms
from sagittal.server.pages.results.prescription import group_trainable
from sagittal.server.report.files.exports import analysis_files
from tests.data import ROOT
from tests.helpers.clinic import open_clinic
from tests.helpers.parameter_page import PAGE, render_page
from tests.helpers.true_walks import true_tracks
from tests.server import analysed, feedback

API: Final = "/api/v1"

ADDED: Final = ParameterEntry(
    "ankle_dorsiflexion_min_swing_deg",
    label="Dorsiflexion, least in swing",
    group=ANKLE_AND_FOOT,
    digits=1,
    scale=(-50, 20),
    comparison=DORSIFLEXION,
    definition="Least dorsiflexion of the ankle in swing, from the person's own standing.",
    needs=("ankle",),
    curve=CurveFigure("ankle_dorsiflexion", "min", 60, 100),
    trainable=True,
    everyday="toes up",
    errors=errors.ANKLE,
)
"""A parameter that the product does not have."""


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> ParameterEntry:
    """The parameter in the catalogue, for the length of a test."""
    monkeypatch.setitem(CATALOGUE, ADDED.name, ADDED)
    return ADDED


@pytest.mark.slow
@pytest.mark.anyio
async def test_a_parameter_of_the_catalogue_is_in_report_api_and_csv(
    added: ParameterEntry, tmp_path: Path
) -> None:
    # the files of an analysis made now, not the kept ones of other tests
    files = analysis_files(analysed.analysis())
    stride_columns = files["strides.csv"].decode().splitlines()[0].split(",")
    assert added.name in stride_columns
    async with open_clinic(tmp_path) as clinic:
        patient = feedback.person(clinic)
        session = feedback.visit(clinic, patient, 0)
        analysed.finish(clinic, patient, session, files)
        async with clinic.client("clinician") as client:
            report = (await client.get(f"{API}/sessions/{session}/report")).json()
            behind = (await client.get(f"{API}/sessions/{session}/parameters/{added.name}")).json()
            table = (await client.get(f"{API}/sessions/{session}/parameters.csv")).text
            printed = (await client.get(f"/sessions/{session}/print")).text
            offers = await client.get(
                f"{API}/patients/{patient}/targets", params={"parameter": added.name, "side": "left"}
            )
    row = next(r for r in report["parameters"] if r["name"] == added.name)
    assert (row["title"], row["unit"], row["group"]) == (
        f"{added.label}, relative to standing",
        "°",
        added.group,
    )
    assert row["left"]["value"] < 20.0
    assert behind["definition"] == added.definition
    assert any(s["value"] is not None for s in behind["strides"])
    assert {r["side"] for r in csv.DictReader(io.StringIO(table)) if r["name"] == added.name} == {
        "left",
        "right",
    }
    assert added.label in printed
    assert offers.status_code == 200


def test_a_parameter_of_the_catalogue_can_be_trained_and_is_known_to_the_live_pages(
    added: ParameterEntry,
) -> None:
    assert Prescription.from_json({"parameter": added.name, "side": "left"}).parameter == added.name
    listed = {choice.name: group for group, choices in group_trainable() for choice in choices}
    assert listed[added.name] == added.group
    assert list_terms()[added.name]["everyday"] == "toes up"


def test_a_parameter_that_is_not_in_the_document_is_found(added: ParameterEntry) -> None:
    text = PAGE.read_text("utf-8")
    assert added.name not in text
    assert f"| `{added.name}` | {added.label} | ° |" in render_page(text)
    assert "maximum − minimum" in text


def _measured_names(tracks: Tracks) -> set[str]:
    return {p.name for p in measure_gait(tracks).parameters if p.mean is not None}


@pytest.mark.slow
def test_what_a_parameter_needs_is_what_it_is_missing_without() -> None:
    """Without paths, angles or sensors of the feet: exactly those that say so have no number."""
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    measured = _measured_names(tracks)
    assert tracks.angles is not None
    bare = replace(tracks.angles, angles={})
    for taken, needs in (
        (replace(tracks, feet=None), {"foot_path", "linked_feet"}),
        (replace(tracks, angles=bare), {"hip", "knee", "ankle"}),
        (replace(tracks, q={}, valid={}), {"foot_sensor"}),
    ):
        lost = measured - _measured_names(taken)
        assert lost == {name for name in measured if needs & set(CATALOGUE[name].needs)}, needs


SMALL_MARK: Final = b"small sensor 1\n"


def _read_small(data: bytes, source: str, spec: SourceSpec | None) -> tuple[Draft, ...]:
    """A made-up format: a first line, then acceleration in g, ten times a second."""
    lines = data.removeprefix(SMALL_MARK).decode().split()
    if not lines:
        raise FormatError("empty", f"{source} has no samples; export it again.")
    acc = 9.80665 * np.array([[float(x) for x in line.split(",")] for line in lines])
    return (Draft("SMALL-1", source, "index", np.arange(len(acc), dtype=float), acc, None, None, None, 10.0),)


def test_a_reader_in_the_list_reads_its_files(monkeypatch: pytest.MonkeyPatch) -> None:
    file = SourceFile.of_bytes("walk.bin", SMALL_MARK + b"0,0,1\n" * 30)
    with pytest.raises(FormatError):
        read_recording([file])
    small = VendorFormat("Small sensor", lambda data: data.startswith(SMALL_MARK), _read_small)
    monkeypatch.setattr(vendors, "VENDOR_FORMATS", [*vendors.VENDOR_FORMATS, small])
    recording = read_recording([file])
    assert list(recording.streams) == ["SMALL-1"]
    np.testing.assert_allclose(recording.streams["SMALL-1"].acc[0], (0.0, 0.0, 9.80665))
    with pytest.raises(FormatError, match="Small sensor"):
        read_recording([SourceFile.of_bytes("letter.txt", b"Dear reader,")])


def _hold_first(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """A made-up filter: orientations as usual, but every segment stays as it was at the start."""
    fused = orient_segments(analysis, config).fused
    assert fused is not None
    held = {segment: np.repeat(q[:1], len(q), axis=0) for segment, q in fused.q.items()}
    return replace(analysis, fused=replace(fused, q=held))


@pytest.mark.slow
def test_a_filter_in_a_recipe_is_what_later_stages_take() -> None:
    source = simulate_scenario("comfortable", 1, worn=("foot_l", "foot_r")).recording
    held = PipelineStage("orientation", 0.1, _hold_first, ("fused",), ("fusion",))
    recipe = tuple(held if stage is ORIENTATION else stage for stage in WALK)
    usual = run_stages(TakeAnalysis(source, PipelineConfig(), ""), WALK[:6], say_nothing)
    still = run_stages(TakeAnalysis(source, PipelineConfig(), ""), recipe[:6], say_nothing)
    assert usual.contacts is not None
    assert still.contacts is not None
    assert len(usual.contacts.events.events) > 20
    # a foot that never pitches steps by its movement alone, which is less certain
    least_s = FootContactParams().loose_sd_s
    assert all((e.uncertainty_s or 0.0) >= least_s for e in still.contacts.events.events)
    assert not all((e.uncertainty_s or 0.0) >= least_s for e in usual.contacts.events.events)


def _count_rests(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """A made-up protocol's own step: it says how often the person stood still."""
    assert analysis.quality is not None
    said = Notice("stood", f"Stood still {len(analysis.quality.rest)} times.", severity="error")
    return replace(analysis, problem=said)


@pytest.mark.slow
def test_a_protocol_is_a_tuple_of_stages_that_the_loop_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    standing = (*SIGNALS, PipelineStage("rests", 0.5, _count_rests, ("problem",)))
    monkeypatch.setattr(recipes, "choose_recipe", lambda analysis: standing)
    told: list[str] = []
    source = simulate_scenario("comfortable", 1, worn=("foot_l", "foot_r")).recording
    found = analyse(source, progress=lambda stage, share: told.append(stage))
    assert told[:4] == ["timeline", "agreement", "quality", "rests"]
    assert found.problem is not None
    assert found.problem.code == "stood"


GREETING: Final = """{% extends "_base.html" %}
{% block title %}Greeting{% endblock %}
{% block h1 %}Greeting{% endblock %}
{% block main %}<p class="greeting">{{ person | verbatim }}</p>{% endblock %}
"""

made_up_page: Final = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@made_up_page.get("/greeting")
def _show_greeting(
    request: Request, db: Db, who: Annotated[Identity, require(Action.MANAGE_USERS)]
) -> Response:
    return shell.render_page(request, db, who, "greeting.html", "greeting", person=who.name)


@pytest.mark.slow
@pytest.mark.anyio
async def test_a_page_in_the_routes_has_its_frame_and_its_guard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(routes, "ROUTERS", (*routes.ROUTERS, made_up_page))
    monkeypatch.setattr(app, "wire_routes", app.wire_routes.__wrapped__)
    entry = ("greeting", "people", "Greeting", "/greeting", Action.MANAGE_USERS)
    monkeypatch.setattr(shell, "NAVIGATION", (*shell.NAVIGATION, entry))
    for templates in TEMPLATES.values():
        loader = templates.env.loader
        assert loader is not None
        with_page = ChoiceLoader([loader, DictLoader({"greeting.html": GREETING})])
        monkeypatch.setattr(templates.env, "loader", with_page)
    async with open_clinic(tmp_path) as clinic:
        async with clinic.client("admin") as client:
            page = await client.get("/greeting")
        async with clinic.client("viewer") as client:
            refused = await client.get("/greeting")
    assert page.status_code == 200
    assert '<p class="greeting">' in page.text
    assert 'href="/greeting"' in page.text
    assert refused.status_code in {403, 404}


def test_there_is_an_exercise_for_each() -> None:
    text = (ROOT / "docs" / "how-to" / "contributing.md").read_text("utf-8")
    for heading in ("Add a parameter", "Add a reader", "Add a filter", "Add a protocol", "Add a page"):
        assert f"## {heading}\n" in text


def test_the_glossary_names_what_there_is_in_code() -> None:
    page = (ROOT / "docs" / "reference" / "glossary.md").read_text("utf-8")
    named = {name for cell in re.findall(r"`([^`]+)`", page) for name in re.findall(r"\b[A-Z]\w+", cell)}
    sources = "\n".join(
        p.read_text("utf-8") for part in ("core", "server") for p in (ROOT / part).rglob("*.py")
    )
    known = set(re.findall(r"^class (\w+)|^(\w+)(?:: Final[^=]*)? = ", sources, re.MULTILINE))
    assert named - {name for pair in known for name in pair} <= {"R_segment_sensor"}
