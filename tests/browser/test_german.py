"""The pages in German: every text of them, and their layout with its longer words."""

from __future__ import annotations

from typing import Final

import pytest
from playwright.sync_api import Page

from sagittal.core.message import PLACEHOLDER
from sagittal.web.language import load_catalogue
from tests.browser.conftest import Filled, Opener
from tests.browser.design import layout_faults, text_faults
from tests.browser.test_look import OUT, PAGES

pytestmark = pytest.mark.browser

DESK, TABLET = (1280, 800), (820, 1180)
BOTH: Final = frozenset({"session", "patient", "timeline", "parameter", "compare"})
"""Pages with tables and cards side by side, looked at on a desk too: elsewhere the tablet is the narrower."""

SHOWN: Final = """() => {
  const said = [], walk = document.createTreeWalker(document.documentElement, NodeFilter.SHOW_TEXT);
  for (let node; (node = walk.nextNode());)
    if (!node.parentElement.closest("script, style, template, [lang=en], option[value]"))
      said.push(node.data);
  for (const name of ["title", "aria-label", "placeholder", "alt"])
    for (const e of document.querySelectorAll(`[${name}]`)) said.push(e.getAttribute(name));
  return said.map((text) => text.trim().replace(/\\s+/g, " ")).filter(Boolean);
}"""
"""Every text of a page and every attribute that people read."""

TYPED: Final = frozenset({"Walk", "Note"})
"""What the clinic of these tests typed, and what is a message too."""


def left_english(page: Page) -> list[str]:
    """Texts of the page that are English messages with another German text."""
    messages = load_catalogue("de").messages
    return sorted({text for text in page.evaluate(SHOWN) if messages.get(text, text) != text} - TYPED)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_german_and_keeps_to_the_design(name: str, opened: Opener, filled: Filled) -> None:
    page = opened(PAGES[name](filled), signed_in=name not in OUT, locale="de-DE", stays=True)
    page.wait_for_load_state()
    assert page.locator("html").get_attribute("lang") == "de"
    for width, height in (DESK, TABLET) if name in BOTH else (TABLET,):
        page.set_viewport_size({"width": width, "height": height})
        # a button that its script has just allowed is on its way to its colours
        page.wait_for_function("() => document.getAnimations().every((a) => a.playState !== 'running')")
        assert left_english(page) == []
        assert not layout_faults(page) | text_faults(page), f"{width}"


def test_scripts_say_in_german_who_a_norm_is_of(opened: Opener, filled: Filled) -> None:
    """A target of a prescription: the pattern of a group and its source took their number for the group."""
    page = opened(PAGES["prescription"](filled), locale="de-DE")
    evaluation = page.evaluate(
        "async (text) => (await import('/static/js/common/words.js')).translate(text)",
        "healthy adults asked to walk at this speed, n = 52 (Schreiber & Moissenet 2019 (Sci Data 6:111))",
    )
    assert evaluation == (
        "gesunde Erwachsene, die in diesem Tempo gehen sollten, n = 52 "
        "(Schreiber & Moissenet 2019 (Sci Data 6:111))"
    )


def test_a_printed_report_is_german_and_stays_on_its_sheets(opened: Opener, filled: Filled) -> None:
    page = opened(PAGES["print"](filled), locale="de-DE")
    page.wait_for_load_state()
    assert page.locator(".r-short").count() == 1
    assert page.locator(".r-short [lang=en]").count() == 0
    wide = "() => [...document.querySelectorAll('.sheet')].map((s) => s.scrollWidth - s.clientWidth)"
    assert max(page.evaluate(wide)) <= 0


def test_the_check_can_fail(opened: Opener) -> None:
    page = opened("/patients", locale="de-DE")
    page.evaluate("() => { document.querySelector('h1').textContent = 'Skip to content'; }")
    assert left_english(page) == ["Skip to content"]


def test_scripts_speak_german_and_write_decimal_commas(opened: Opener) -> None:
    page = opened("/capture", signed_in=False, locale="de-DE")
    page.get_by_role("button", name="Code eingeben").wait_for()
    evaluation = page.evaluate(
        """async () => {
          const { fixed, speak, translate } = await import("/static/js/common/words.js");
          const rest = speak`${fixed(1.25, 2)} s are only on this tablet.`;
          return [rest, translate("Stand still."), speak`Stop`];
        }"""
    )
    assert evaluation == ["1,25 s sind noch allein auf diesem Tablet.", "Stehen Sie still.", "Stopp"]


@pytest.mark.parametrize("typed", ["Sensor 2.csv", "Pain, left knee", "Training 2.5", "2.5", "Stop"])
def test_scripts_show_what_people_typed_as_it_is(typed: str, opened: Opener) -> None:
    page = opened("/capture", signed_in=False, locale="de-DE")
    page.get_by_role("button", name="Code eingeben").wait_for()
    evaluation = page.evaluate(
        """async (typed) => {
          const { speak, translate } = await import("/static/js/common/words.js");
          const refused = `The code '${typed}' belongs to another patient; choose a new one.`;
          return [speak`Uploading ${typed}…`, translate(refused), translate(`Left out, “${typed}”`)];
        }""",
        typed,
    )
    assert evaluation[0] == f"{typed} wird hochgeladen …"
    assert evaluation[1] == f"Das Kürzel „{typed}“ gehört einem anderen Patienten; wählen Sie ein neues."
    assert f"„{typed}“" in evaluation[2]


@pytest.mark.journey
def test_an_account_keeps_its_language_whatever_the_browser_asks(opened: Opener) -> None:
    page = opened("/account", locale="de-DE")
    page.wait_for_load_state()  # the script that sends the form is there
    page.get_by_label("Sprache").select_option("en")
    page.get_by_role("button", name="Speichern").click()
    page.locator("html[lang=en]").wait_for(state="attached")
    page.wait_for_load_state()
    assert page.get_by_role("heading", name="Change password").is_visible()
    page.get_by_label("Language").select_option("")
    page.get_by_role("button", name="Save").click()
    page.locator("html[lang=de]").wait_for(state="attached")


def test_placeholders_are_filled(opened: Opener, filled: Filled) -> None:
    page = opened(f"/sessions/{filled.done}", locale="de-DE")
    page.wait_for_load_state()
    assert [text for text in page.evaluate(SHOWN) if PLACEHOLDER.search(text)] == []
