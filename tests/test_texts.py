"""The catalogues in web/texts: every message of the sources has its text, and nothing is left behind."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

import pytest
from babel.messages.pofile import read_po

from sagittal.core.frames import SIDES
from sagittal.core.message import PLACEHOLDER
from sagittal.core.parameters.catalogue import CATALOGUE, LIMIT_FIGURES
from sagittal.core.user_text import UserText, quote
from sagittal.server.report.view.level import STANDING, define_parameter
from sagittal.server.report.words.headline_phrases import PATTERNS, PHRASES
from sagittal.server.report.words.wording import JUDGED, PATH_JUDGED, REASONS, reason_words
from sagittal.web.language import (
    LANGUAGES,
    SOURCE,
    Catalogue,
    catalogue_path,
    choose_language,
    load_catalogue,
)
from sagittal.web.language import script_texts as script_catalogue
from sagittal.web.shown import Shown
from sagittal.web.template_texts import list_texts, speak_template
from tests.data import ROOT
from tests.helpers.texts import STAYS_ENGLISH, list_messages, python_texts, script_texts

OTHERS: Final = [language for language in LANGUAGES if language != SOURCE]

DE: Final = load_catalogue("de")

MOST_OF_HEADLINE: Final = 95
"""Characters of a sentence that a person reads first."""

HINT: Final = "python -m tests.helpers.texts updates the catalogue; then give each new message its text"


def entries(language: str) -> dict[str, str]:
    with catalogue_path(language).open("rb") as file:
        return {str(entry.id): str(entry.string) for entry in read_po(file) if entry.id}


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
def test_every_message_of_the_sources_has_a_text(language: str) -> None:
    known = entries(language)
    assert [message for message in list_messages() if not known.get(message)] == [], HINT


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
def test_no_text_is_left_of_a_message_that_is_gone(language: str) -> None:
    messages = list_messages()
    assert [message for message in entries(language) if message not in messages] == [], HINT


@pytest.mark.parametrize("language", OTHERS)
def test_texts_have_the_placeholders_of_their_messages(language: str) -> None:
    differ = {
        message: said
        for message, said in entries(language).items()
        if set(PLACEHOLDER.findall(message)) != set(PLACEHOLDER.findall(said))
        or message.count("*") != said.count("*")
    }
    assert differ == {}


@pytest.mark.parametrize("language", OTHERS)
def test_headline_sentences_are_read_at_a_glance(language: str) -> None:
    catalogue = load_catalogue(language)
    values = {
        "side": "left",
        "norm": ", norm 57 ± 5°",
        "d": "18°",
        "v": "38°",
        "o": "56°",
        "l": "−12°",
        "r": "−10°",
    }
    said = [
        catalogue.translate(
            PLACEHOLDER.sub(
                lambda m, p=phrases: {"noun": p.noun, "word": p.less or p.low, **values}.get(m[1], "0.65"),
                text,
            )
        ).replace("*", "")
        for text in PATTERNS
        for phrases in PHRASES.values()
    ]
    assert len(said) > 90
    assert [text for text in said if len(text) > MOST_OF_HEADLINE] == []


COUNTABLE: Final = (
    "batches|bows|bytes|changes|characters|checks|conditions|contacts|controls|copies|cues|days|detectors|files"
    "|filters|hours|keys|leans|links|minutes|months|notices|packets|parts|patients|people|points|repetitions|rises"
    "|rows|samples|sensors|squats|steps|stretches|strides|swings|takes|tests|times|tokens|trainings|values|visits"
    "|weeks|years"
)
"""Nouns that messages count."""

ADJECTIVES: Final = "fewer|more|other|possible|real|straight"
COUNT: Final = re.compile(
    r"(?<!to )(?<!at most )(?<!at least )(?<!At most )(?<!At least )"
    rf"\{{(?!of\}}|side\}})(\w+)\}}[ \u2009\u202f](?:(?:{ADJECTIVES}) )?({COUNTABLE})\b"
)
"""A count and its noun. Of a range and of a limit the noun is always in the plural, of a constant too."""

SINGULAR: Final = {
    "are": "is", "batches": "batch", "copies": "copy", "count": "included", "do": "does",
    "follow": "follows", "have": "has", "lack": "lacks", "say": "says", "stand": "stands", "stay": "stays",
    "stretches": "stretch", "were": "was",
}  # fmt: skip

MORE_THAN_ONE: Final = (
    "The assessment has {text} characters",
    # constants of the product and settings with a least value
    "{film_minutes} minutes", "{gyro_noise} times", "{filters} filters", "{hours} hours", "{window} strides",
    "{strides_per_share} strides", "Expected {0} samples a second", "{1} steps, {2} s",
    "{0} steps", "{0} strides are needed to adjust", "{steps} straight steps are needed",
    # groups of people that norms and limits are made of
    "{norm_n} people", "{people} people", "{controls} people", "{first} years",
    # differences beyond measurement error, in steps a minute or in percent of a stride
    "{value} times its usual",
    # shown or refused because there are several
    "in {still} parts", "{segments} sensors are available", "{chosen} visits match",
    "{t_s} days; at most", "{days} days; expected", "{value} samples at {rate} Hz", "samples of {id}",
    "{count} samples of {device}", "starts again after {wrap} samples",
    "The file has {size} bytes", "announced with {size} bytes", "{offset} of {size} bytes",
    # "4 left and 1 right strides"
    "{cycle_counts} strides",
    # the wording for one does without the number
    "{n} more times after this test", "{copies} sensors are copies",
    "all {checked} checks passed", "{value} cues were excluded",
)  # fmt: skip
"""Parts of messages whose count is never one, or is not given where it is one."""

LOOSE_PLURAL: Final = re.compile(r"\w\((s|es|n|e|en|er|r)\)")


def reduce_number(message: str) -> str:
    """A message in the singular, its counts left out: both wordings of a message become the same."""
    words = re.sub(r"\{\w+\}|\b1\b|\bone\b", "#", message).split(" ")
    kept = []
    for word in words:
        bare = re.sub(r"[^a-zA-Z]", "", word)
        one = SINGULAR.get(bare) or (bare[:-1] if re.fullmatch(COUNTABLE, bare) else bare)
        kept.append(word.replace(bare, one) if bare else word)
    return " ".join(kept)


def find_uncounted(messages: Collection[str]) -> list[str]:
    """Messages that count a noun in the plural only."""
    wordings: dict[str, set[str]] = {}
    for message in messages:
        wordings.setdefault(reduce_number(message), set()).add(message)
    counting = [m for m in messages if any(not found[1].isupper() for found in COUNT.finditer(m))]
    return [m for m in counting if len(wordings[reduce_number(m)]) == 1]


@pytest.mark.slow
def test_a_count_has_a_message_for_one() -> None:
    formats = [
        message
        for path in sorted((ROOT / "core" / "formats").rglob("*.py"))
        for message in python_texts(path.read_text("utf-8"), whole=False)
    ]
    found = find_uncounted([*list_messages(), *formats])
    assert [m for m in found if not any(part in m for part in MORE_THAN_ONE)] == []
    assert [part for part in MORE_THAN_ONE if not any(part in m for m in found)] == []


def test_the_check_of_counts_can_fail() -> None:
    assert find_uncounted(["{n} rows were left out", "{n} other files"]) == [
        "{n} rows were left out",
        "{n} other files",
    ]
    assert (
        find_uncounted(["{n} rows were left out", "{n} row was left out", "{MOST} rows", "1 to {n} rows"])
        == []
    )


@pytest.mark.parametrize("language", OTHERS)
def test_no_text_has_an_ending_in_brackets(language: str) -> None:
    texts = {text for pair in entries(language).items() for text in pair}
    assert [text for text in texts if LOOSE_PLURAL.search(text)] == []


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("1 more finding", "1 weitere Auffälligkeit"),
        ("2 more findings", "2 weitere Auffälligkeiten"),
        ("1 more change", "1 weitere Veränderung"),
        (
            "0.62\u202fm, mean ± SD of 1 stride",
            "0,62\u202fm, Mittel ± SD (Doppelschritt: 1)",
        ),
        (
            "0.62 ± 0.03\u202fm, mean ± SD of 12 strides",
            "0,62 ± 0,03\u202fm, Mittel ± SD (Doppelschritte: 12)",
        ),
    ],
)
def test_one_thing_is_in_the_singular(english: str, german: str) -> None:
    assert DE.translate(english) == german


def test_what_stays_english_is_there() -> None:
    assert [place for place in STAYS_ENGLISH if not (ROOT / place).exists()] == []


def test_messages_are_found_in_python() -> None:
    source = (
        '"""A docstring is none."""\n'
        "Notice('few_steps', f'{count} step{\"\" if count == 1 else \"s\"} of the {side} foot.', 'pelvis')\n"
        "raise ValueError('An error of a program.')\n"
    )
    assert list(python_texts(source, whole=False)) == [
        "Few steps",
        "{count} step of the {side} foot.",
        "{count} steps of the {side} foot.",
    ]


def test_messages_are_found_in_templates() -> None:
    source = (
        "<p title=\"A title\">In all {{ n }} visit{{ '' if n == 1 else 's' }}\n  <b>{{ name }}</b></p>"
        '<a class="tbl tight">{{ ico("x") }}Open</a>'
    )
    found = list(list_texts(source))
    assert {"A title", "In all {n} visits", "In all {n} visit", "Open"} <= set(found)
    spoken = speak_template(source)
    assert 'title="{{ say_plain_message("A title") }}"' in spoken
    assert "<b>{{ say(name) }}</b>" in spoken


def test_messages_are_found_in_scripts() -> None:
    assert list(script_texts("a = speak`Sensor ${n + 1} is ready`; b = `not this ${one}`;")) == [
        "Sensor {0} is ready"
    ]


@pytest.mark.parametrize(
    ("english", "german"),
    [
        ("Step length", "Schrittlänge"),
        ("step length", "Schrittlänge"),
        ("12.3 ± 0.4", "12,3 ± 0,4"),
        ("0.98 m/s", "0,98 m/s"),
        ("18 Nov 2026", "18.11.2026"),
        # how a person walks, and how a clock runs
        ("slow", "langsam"),
        ("fast", "schnell"),
        (
            "Clock runs slow, 12\u202fms over the trial, not corrected",
            "Uhr läuft zu langsam, 12\u202fms über die Aufnahme, so belassen",
        ),
        ("Clock 12\u202fms late, corrected", "Uhr 12\u202fms zu spät, richtiggestellt"),
        ("Right hip, in the pelvis", "Hüfte rechts, im Segment Becken"),
        ("Left ankle, in the left shank", "Sprunggelenk links, im Segment Unterschenkel links"),
        ("Gravity reads 2 % more since 23 Nov 2026", "Schwerkraft: 2 % mehr seit 23.11.2026"),
        ("left longer by 0.04 s", "links länger um 0,04 s"),
        ("left shorter by 4.8 points", "links kürzer um 4,8 Punkte"),
        (
            "vs the other side and people at this speed",
            "gegen die andere Seite und Menschen in diesem Tempo",
        ),
        (
            "112 strides included, 56 left and 56 right.",
            "112 Doppelschritte verwendet, 56 links und 56 rechts.",
        ),
        (
            "Knee flexion in swing is *18° less on the left* (38° vs 56°, norm 57 ± 5°)",
            "Knieflexion in der Schwungphase: *links 18° weniger* (38° gegenüber 56°, Norm 57 ± 5°)",
        ),
        (
            "Peak knee flexion in swing, relative to standing",
            "Knieflexion, Gipfel der Schwungphase, vom Stand aus",
        ),
        (
            "within measurement error; includes the standing posture",
            "innerhalb des Messfehlers; enthält, wie die Person stand",
        ),
        (
            "3.4 cm forward, 2.1 cm down, 1.0 cm back",
            "3,4 cm nach vorn, 2,1 cm nach unten, 1,0 cm nach hinten",
        ),
        ("0.600 ± 0.030\u202fm, entered", "0,600 ± 0,030\u202fm, eingegeben"),
        (
            "± 4.2\u202f% (95 %): strides ± 1.0, moments of contact ± 4.1",
            "± 4,2\u202f% (95 %): Doppelschritte ± 1,0, Zeitpunkte der Kontakte ± 4,1",
        ),
        (
            "MCID 8.5°: Guzik et al. 2020 (J Clin Med 9:3305) (children).",
            "MCID 8,5°: Guzik et al. 2020 (J Clin Med 9:3305) (Kinder).",
        ),
        (
            "MDC 15.6°: Guzik et al. 2020 (Med 9:3305), 1.96 √2 of its error of measurement (children).",
            "MDC 15,6°: Guzik et al. 2020 (Med 9:3305), 1,96 √2 ihres Messfehlers (Kinder).",
        ),
    ],
)
def test_what_was_made_from_a_message_is_found_again(english: str, german: str) -> None:
    assert DE.translate(english) == german


def test_an_unknown_sentence_stays_english_and_says_so() -> None:
    said = "The <cat> sat on the mat."
    assert DE.find(said) is None
    assert str(Shown(DE).say(said)) == '<span lang="en">The &lt;cat&gt; sat on the mat.</span>'


def test_what_a_person_typed_stays_as_it_is() -> None:
    shown = Shown(DE)
    for typed in ("Left", "Sensor 2.csv", "Pain, left knee", "Training 2.5"):
        assert shown.say(typed) != typed
        assert shown.say(UserText(typed)) == shown.say_plain(UserText(typed)) == typed
        assert str(shown.say_message("Edit {code}", code=UserText(typed))) == f"{typed} bearbeiten"
    assert str(shown.say_message("Edit {code}", code=UserText("<b>"))) == "&lt;b&gt; bearbeiten"


@pytest.mark.parametrize("typed", ["Left", "Sensor 2.csv", "Pain, left knee", "Training 2.5", "2.5"])
def test_what_a_sentence_quotes_stays_as_it_is(typed: str) -> None:
    said = DE.translate(f"The code '{typed}' belongs to another patient; choose a new one.")
    assert said == f"Das Kürzel „{typed}“ gehört einem anderen Patienten; wählen Sie ein neues."
    stride = DE.translate(f"left stride, 1.50 to 2.25 s, excluded: {quote(UserText(typed))}")
    assert stride == f"Doppelschritt links, 1,50 bis 2,25 s, ausgelassen: „{typed}“"
    figure = f"<title>left stride, 1.50 to 2.25 s, excluded: {quote(UserText(typed))}</title>"
    assert Shown(DE).say_figure(figure) == f"<title>{stride}</title>"
    nested = f"say “{typed}” twice"
    assert DE.translate(f"left stride, 1.50 to 2.25 s, excluded: “{nested}”").endswith(f"„{nested}“")
    missing = DE.translate(f"There is no trial “{typed}”, “{typed}” among the visit's files.")
    assert missing == f"Unter den Dateien der Sitzung fehlt die Aufnahme „{typed}“, „{typed}“."
    low = f"Sensor {typed} has no sample with both acceleration and angular rate; export it again."
    assert f"Sensor {typed} " in DE.translate(low)


def test_a_long_text_costs_no_more_than_its_sentences() -> None:
    """A text of many parts is looked for in sentences; patterns on all of it would take minutes."""
    text = "The cat sat, and the dog; and a fox, or a hen: no, " * 100
    assert DE.find(text) is None


@pytest.mark.parametrize("language", OTHERS)
def test_what_every_figure_is_is_said(language: str) -> None:
    catalogue = load_catalogue(language)
    entries = (*CATALOGUE.values(), *LIMIT_FIGURES.values())
    said = {e.definition: catalogue.find(e.definition) for e in entries if e.definition}
    assert [text for text, other in said.items() if other in (None, text)] == []


@pytest.mark.parametrize("language", OTHERS)
def test_what_a_figure_from_the_anatomical_zero_is_is_said(language: str) -> None:
    catalogue = load_catalogue(language)
    names = [n for n, e in CATALOGUE.items() if STANDING in e.definition and n.endswith("_deg")]
    said = [define_parameter(f"{name.removesuffix('_deg')}_anatomical_deg") for name in names]
    assert said
    assert [text for text in said if catalogue.find(text) in (None, text)] == []


@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("side", SIDES)
def test_why_one_side_has_no_number_is_said(language: str, side: str) -> None:
    """The table puts the side before the reason where the other side has a number."""
    catalogue = load_catalogue(language)
    named = [f"{side} {reason_words(code)}" for code in (None, *REASONS)]
    assert [text for text in named if side in (catalogue.find(text) or side)] == []


@pytest.mark.parametrize("language", OTHERS)
def test_a_level_that_an_estimator_lowers_is_said(language: str) -> None:
    assert [s for s in (*JUDGED.values(), PATH_JUDGED) if load_catalogue(language).find(s) is None] == []


def test_a_sum_in_a_sentence_is_one_value() -> None:
    few = "3 steps detected, but never 6 in a row: no walking bout is reported. Record a longer walk."
    assert DE.translate(few).startswith("3 Schritte wurden gefunden, nirgends 6 ohne Pause:")
    assert DE.translate("Day 3") == "Tag 3"


def test_what_a_helper_refuses_is_said_as_a_whole() -> None:
    refused = (
        "left thigh: its flexion axis is 81° off the specified one; limit 35°. Attach the sensor as "
        "specified in the protocol, or calibrate from the table."
    )
    assert DE.translate(refused) == (
        "Oberschenkel links: es beugt um eine Achse, die 81° von der vereinbarten abweicht; Grenze 35°. "
        "Legen Sie den Sensor an wie vereinbart, oder kalibrieren Sie vom Tisch."
    )


def test_english_says_what_the_sources_say() -> None:
    empty = Catalogue("de", {})
    assert empty.translate("No message") == "No message"


@pytest.mark.parametrize(
    ("accepted", "chosen"),
    [
        ("de", "de"),
        ("de-AT,de;q=0.9,en;q=0.8", "de"),
        ("fr, en;q=0.5", "en"),
        ("de;q=0", "en"),
        ("de;q=x", "en"),
    ],
)
def test_the_browser_says_which_language(accepted: str, chosen: str) -> None:
    assert choose_language(accepted) == chosen


def test_scripts_are_handed_what_they_say() -> None:
    version, content = script_catalogue("de")
    assert re.fullmatch(r"[0-9a-f]{16}", version)
    assert '"Stop":"Stopp"' in content.decode()
