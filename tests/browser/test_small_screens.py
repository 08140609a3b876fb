"""Layout of pages, forms and dialogs on upright tablets and phones."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import Filled, Opener, RunningServer
from tests.browser.filling import add, add_session, upload
from tests.data import data_folder

pytestmark = pytest.mark.usefixtures("unknown_sensors")

SIZES = ((1280, 800), (820, 1180), (390, 844))


@pytest.mark.parametrize("size", SIZES)
def test_edit_delete_and_the_note_are_there_in_every_size(
    size: tuple[int, int], opened: Opener, filled: Filled
) -> None:
    width, height = size
    page = opened(f"/sessions/{filled.done}", width=width, height=height, stays=True)
    for name in ("Delete visit", "Edit visit"):
        button = page.get_by_role("button", name=name)
        expect(button).to_be_visible()
        box = button.bounding_box()
        assert box is not None
        assert box["x"] + box["width"] <= width
    page.goto("/patients")
    row = page.locator("tbody tr", has_text="P-0042")
    expect(row.get_by_text("Stroke, left side affected").filter(visible=True)).to_have_count(1)
    state = row.locator("td").last.bounding_box()
    assert state is not None
    assert state["x"] + state["width"] <= width, "the note pushes the state of the visit out of sight"
    page.goto(f"/patients/{filled.patient}")
    for name in ("Delete patient", "Edit"):
        expect(page.get_by_role("button", name=name, exact=True)).to_be_visible()
    expect(page.get_by_text("Stroke, left side affected").first).to_be_visible()


@pytest.mark.parametrize("size", SIZES)
def test_forms_in_cards_keep_their_distance_from_the_edge(
    size: tuple[int, int], opened: Opener, filled: Filled
) -> None:
    width, height = size
    for path, label in (
        (f"/patients/{filled.patient}/sessions/new", "Name of the visit"),
        ("/account", "Repeat new password"),
    ):
        page = opened(path, width=width, height=height, stays=True)
        field = page.get_by_label(label)
        card = page.locator(".card", has=field)
        inner, outer = field.bounding_box(), card.bounding_box()
        assert inner is not None
        assert outer is not None
        assert inner["x"] - outer["x"] >= 12, path
        assert outer["x"] + outer["width"] - inner["x"] - inner["width"] >= 12, path


def test_the_one_question_comes_first_and_unused_files_are_folded(
    opened: Opener, running: RunningServer
) -> None:
    folder = data_folder("neura_walk")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as z:
        for path in sorted(p for p in Path(folder).rglob("*") if p.is_file()):
            z.write(path, f"neura_walk/{path.relative_to(folder)}")
    with running.client() as client:
        patient = add(client, "/patients", code="FOLDER")["id"]
        session = add_session(client, patient, "Walk, the whole folder")
        upload(client, session, {"neura_walk.zip": packed.getvalue()})
    for width, height in SIZES:
        page = opened(f"/sessions/{session}/upload", width=width, height=height, stays=True)
        question = page.locator("[data-ask]")
        expect(question).to_contain_text("on the left foot?")
        box = question.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= height, f"below the fold at {width}"
        initial_first = page.locator("sensor-map .note:visible").first
        assert initial_first.get_attribute("data-ask") is not None, "another box stands before the question"
        # beside it at most what was found about copies; what was no recording waits behind one line
        assert page.locator("sensor-map .note:visible").count() <= 2
        unused = page.locator("[data-unused]")
        expect(unused.locator("summary")).to_have_text(re.compile(r"1\d\s+files\s+were\s+not\s+used"))
        expect(unused.get_by_text("reference_angles.csv")).to_be_hidden()
        unused.locator("summary").click()
        expect(unused.get_by_text("reference_angles.csv")).to_be_visible()


def test_progress_is_told_once_by_the_bar_and_not_counted_in_steps(
    opened: Opener, filled: Filled, running: RunningServer
) -> None:
    page = opened("/jobs", stays=True)
    page.evaluate(
        """async () => {
          await import('/static/js/progress.js');
          const card = document.createElement('div');
          card.innerHTML = `<job-progress job="none"><p data-message></p><progress max="1"></progress>
            <span data-percent></span><ul>${[1, 2, 3, 4].map((n) => `<li data-stage="s${n}">
            <span class="state"><span data-shape="run"></span>Stage ${n}</span></li>`).join('')}</ul>
            </job-progress>`;
          document.querySelector('main').append(card);
          const job = card.querySelector('job-progress');
          job.disconnectedCallback(); // nobody else speaks
          job.show({ state: 'running', stage: 's4', fraction: 0.05 });
        }"""
    )
    expect(page.locator("main [data-message]").last).to_have_text("Stage 4")
    expect(page.locator("main [data-percent]").last).to_have_text("5 %")


@pytest.mark.parametrize("width", [1280, 820])
def test_titles_of_charts_are_read_whole_and_charts_of_a_row_stand_level(
    width: int, opened: Opener, filled: Filled
) -> None:
    page = opened(f"/sessions/{filled.done}/kinematics", width=width, height=1180, stays=True)
    cells = page.locator(".kin .cell")
    expect(cells).to_have_count(12)
    cut = page.evaluate(
        "() => [...document.querySelectorAll('.kin figcaption h3')]"
        ".filter((h) => h.scrollWidth > h.clientWidth + 1).map((h) => h.textContent)"
    )
    assert cut == []
    inside = page.evaluate(
        "() => [...document.querySelectorAll('.kin figcaption > *')].every((e) =>"
        " e.getBoundingClientRect().right <= e.closest('.cell').getBoundingClientRect().right + 1)"
    )
    assert inside
    feet = page.evaluate(
        "() => [...document.querySelectorAll('.kin .chart')].map((c) => c.getBoundingClientRect().bottom)"
    )
    for row in range(0, len(feet) - 2, 3):
        assert max(feet[row : row + 3]) - min(feet[row : row + 3]) < 1.5


def test_a_tablet_held_upright_shows_the_norm(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", width=820, height=1180, stays=True)
    expect(page.get_by_role("columnheader", name="Norm", exact=True)).to_be_visible()
    table, card = page.locator("table.params"), page.locator(".card", has=page.locator("table.params"))
    inner, outer = table.first.bounding_box(), card.first.bounding_box()
    assert inner is not None
    assert outer is not None
    assert inner["x"] + inner["width"] <= outer["x"] + outer["width"] + 1
