"""Pages and prints of every simulated patient with every rule at every rank, in every language.

The default run covers one patient, with every rule once among displayed and once among omitted findings.
"""

from __future__ import annotations

import ctypes.util
import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import pytest
from markupsafe import escape
from starlette.requests import Request
from starlette.responses import Response

from sagittal.core.flags import RULES, Flag, Rule
from sagittal.core.flags.rules import CURVES
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms import Norms
from sagittal.core.parameters.catalogue import find_entry
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.simulate import PATIENTS
from sagittal.server.export.fhir import write_fhir
from sagittal.server.http.templates import TEMPLATES, render
from sagittal.server.pages import shell
from sagittal.server.pages.sharing import paper
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.pdf import render_pdf
from sagittal.server.report.view.headline import MOST, Headline, HeadlineSentence
from sagittal.server.report.view.standouts import find_standouts
from sagittal.server.report.words.limits import limits_view
from sagittal.server.storage.schema.tables import new_id
from sagittal.web.language import LANGUAGES
from tests.helpers.clinic import Clinic
from tests.helpers.marks import sweep_after
from tests.helpers.true_walks import true_tracks
from tests.helpers.walks import simulated
from tests.server import analysed
from tests.server.export.opened import open_walk

pytestmark = pytest.mark.anyio

NAMES: Final = sorted(PATIENTS, key=lambda name: (name != "hemiparetic", name))
SHOWN: Final = ("session.html", "_values.html", "print.html", "leaflet.html")
RANKS: Final = range(MOST + 2)
"""Places among the sentences; the last two have no room on the page."""

SPOKEN: Final[tuple[tuple[Side, ...], ...]] = (("left",), ("right",), SIDES)


@dataclass(frozen=True, eq=False)
class Shown:
    """A template with the context that a page gave it."""

    template: str
    context: Mapping[str, Any]

    def write(self, language: str, report: Mapping[str, Any] | None = None) -> str:
        changed = {} if report is None else {"report": {**self.context["report"], **report}}
        result = TEMPLATES[language].get_template(self.template)
        return result.render({**self.context, **changed})


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> dict[str, Shown]:
    """What pages that are opened from now on are made of, by template."""
    result: dict[str, Shown] = {}

    def look(
        request: Request, template: str, context: Mapping[str, Any], *remainder: Any, **others: Any
    ) -> Response:
        result[template] = Shown(template, {**context, "request": request})
        return render(request, template, context, *remainder, **others)

    monkeypatch.setattr(shell, "render", look)
    return result


async def open_pages(clinic: Clinic, name: str) -> None:
    """Store the exact analysis of a simulated patient and open all that is shown of it."""
    tracks = true_tracks(simulated(name)[1])
    whole = replace(
        analysed.analysis(), tracks=tracks, angles=tracks.angles, measured=measure_gait(tracks), posed=None
    )
    person = {"code": f"R-{new_id()[:8]}", "sex": "male", "birth_year": 1979, "height_m": 1.75}
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json=person)).json()["id"]
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json={"title": "Walk"})).json()[
            "id"
        ]
        files = analysis_files(whole)
        analysed.finish(clinic, patient, session, files)
        for path in ("", "/print", "/leaflet", "/kinematics"):
            answer = await client.get(f"/sessions/{session}{path}")
            assert answer.status_code == 200, (path, answer.text)
        answer = await client.get(f"/sessions/{session}/values", headers={shell.FRAGMENT: "1"})
        assert answer.status_code == 200, answer.text
    assert json.loads(write_fhir(open_walk(files=files)))["resourceType"] == "Bundle"


def raise_flags(rule: Rule, sides: Sequence[Side]) -> list[Flag]:
    """The rule beyond its limit on these sides, all others unknown."""
    limit = 10.0 if rule.limit is None else rule.limit
    value = limit * 1.5 if rule.beyond == "above" else limit - abs(limit) - 1.0
    result = []
    for second in RULES:
        for side in SIDES:
            beyond = second is rule and side in sides
            result.append(
                Flag(
                    second.name, side, second.measure, second.kind, value if beyond else None, second.unit,
                    limit if beyond else second.limit, second.beyond, True if beyond else None, second.source,
                    verified=second.verified, n=20, marked=beyond,
                    zero="standing" if second.measure in CURVES else None,
                    reason=None if beyond else "no_strides", spread=1.0, certain=beyond,
                )
            )  # fmt: skip
    return result


def speak(rule: Rule, flags: Sequence[Flag], sides: Sequence[Side]) -> HeadlineSentence:
    """The sentence of a rule: its own where it has one, else one about the same figure."""
    own = find_standouts((), Norms(None, None), flags)[0]
    second = HeadlineSentence(
        rule.measure,
        sides[0] if len(sides) == 1 else None,
        "trunk",
        "limit",
        2.0,
        "",
        rule.name,
        "",
        "limits",
    )
    return own[0] if own else second


def fill_headline(earlier: Headline, sentence: HeadlineSentence, rank: int) -> Headline:
    """A headline of as many sentences as there are ranks, this one at its rank."""
    target = [*earlier.stands_out]
    while len(target) < len(RANKS):
        target.append(
            HeadlineSentence("step_length_m", "left", "step", "sides", 2.0, "The ", "left", " step", "sides")
        )
    return replace(earlier, stands_out=(*target[:rank], sentence, *target[rank : len(RANKS) - 1]))


def list_cases(*, whole: bool) -> list[tuple[Rule, int, tuple[Side, ...]]]:
    """Rules with ranks and sides: all combinations, or of every rule one with room and one without."""
    if whole:
        return list(itertools.product(RULES, RANKS, SPOKEN))
    ranks = (RANKS[:MOST], RANKS[MOST:])
    return [
        (rule, among[i % len(among)], SPOKEN[i % len(SPOKEN)])
        for i, rule in enumerate(RULES)
        for among in ranks
    ]


def vary(
    cases: Iterable[tuple[Rule, int, tuple[Side, ...]]], report: Mapping[str, Any]
) -> Iterable[tuple[Rule, int, dict[str, Any]]]:
    """Page content for each case with the given findings."""
    for rule, rank, sides in cases:
        flags = raise_flags(rule, sides)
        headline = fill_headline(report["headline"], speak(rule, flags, sides), rank)
        changed = {
            "quality": replace(report["quality"], kind="ok"),
            "headline": headline,
            "ranks": headline.ranks,
            "curve_ranks": headline.curve_ranks,
            "limits": limits_view(flags),
        }
        yield rule, rank, changed


def check_pages(pages: Mapping[str, Shown], cases: Iterable[tuple[Rule, int, tuple[Side, ...]]]) -> None:
    """Write overview, values and print of all cases in all languages."""
    for rule, rank, report in vary(cases, pages["session.html"].context["report"]):
        entry = find_entry(rule.measure)
        assert entry is not None
        for language, template in itertools.product(
            LANGUAGES, ("session.html", "_values.html", "print.html")
        ):
            html = pages[template].write(language, report)
            if language == "en" and rank >= MOST and template != "_values.html":
                assert escape(entry.label) in html, (rule.name, rank, template)


def test_every_figure_of_a_rule_has_a_name_and_a_definition() -> None:
    for rule in RULES:
        entry = find_entry(rule.measure)
        assert entry is not None, rule.measure
        assert entry.label
        assert entry.definition


@pytest.mark.slow
@pytest.mark.parametrize("name", sweep_after(1, NAMES))
async def test_every_rule_is_shown_whatever_its_rank(
    clinic: Clinic, pages: dict[str, Shown], name: str
) -> None:
    await open_pages(clinic, name)
    assert set(SHOWN) <= set(pages)
    check_pages(pages, list_cases(whole=False))
    for template in SHOWN:
        assert pages[template].write("de")


@pytest.mark.sweep
@pytest.mark.parametrize("name", NAMES)
async def test_every_rule_is_shown_at_every_rank_on_every_side(
    clinic: Clinic, pages: dict[str, Shown], name: str
) -> None:
    await open_pages(clinic, name)
    check_pages(pages, list_cases(whole=True))


@pytest.mark.sweep
async def test_every_rule_is_in_the_pdf(clinic: Clinic, pages: dict[str, Shown]) -> None:
    if ctypes.util.find_library("pangoft2-1.0") is None:
        pytest.skip("the system library Pango is not installed")
    await open_pages(clinic, NAMES[0])
    view, language = pages["print.html"], itertools.cycle(LANGUAGES)
    with_room, without = (list_cases(whole=False)[i::2] for i in range(2))
    cases = [pair[i % 2] for i, pair in enumerate(zip(with_room, without, strict=True))]
    for _, _, changed in vary(cases, view.context["report"]):
        context = {**view.context, "report": {**view.context["report"], **changed}}
        html = paper.write_document(next(language), view.template, context)
        assert render_pdf(html.decode()).startswith(b"%PDF")
