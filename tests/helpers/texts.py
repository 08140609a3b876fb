"""Messages of the sources, for web/texts; `python -m tests.helpers.texts` updates the catalogues."""

from __future__ import annotations

import ast
import functools
import itertools
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

from sagittal.core.errors import title_of_code
from sagittal.server.report.view.level import ANATOMICAL, STANDING
from sagittal.web.language import LANGUAGES, SOURCE, catalogue_path
from sagittal.web.message_format import has_words
from sagittal.web.stored_sentences import CITED
from sagittal.web.template_texts import list_texts, reads_like_text
from tests.data import ROOT

SAID: Final = re.compile(
    r"^(Notice|Repair|_notify|_refuse|Problem|Offer|SignalError|CalibrationError|EstimationError"
    r"|ServiceError|NotFound|NotAllowed|Conflict|TooLarge|__init__|KeyUnusable|ValueUnreadable)$"
)
"""Classes, and what makes them, whose arguments pages show, wherever they are made."""

WHOLE: Final = (
    "core/agreement/tell.py",
    "core/agreement/tell_live.py",
    "core/calibration/score.py",
    "core/calibration/score_rules.py",
    "core/change",
    "core/subject/condition.py",
    "core/estimators.py",
    "core/flags/rules.py",
    "core/fusion/algorithms/choice.py",
    "core/fusion/algorithms/listed.py",
    "core/norms",
    "core/parameters/catalogue",
    "core/quality/suspicion.py",
    "core/setup/propose.py",
    "core/squat/sensitivity.py",
    "server/export/kinds.py",
    "server/http/problems.py",
    "server/live/pairing.py",
    "server/live/sensors.py",
    "server/live/wire.py",
    "server/pages",
    "server/report",
    "server/results/comparisons.py",
    "server/clinic/course.py",
    "server/errors.py",
    "server/results/signals.py",
    "server/results/targets.py",
    "web/words.py",
)
"""Files and folders of which every text is shown on a page."""

STAYS_ENGLISH: Final[Mapping[str, str]] = {
    "core/formats": "why a file was refused names columns and bytes of it; shown as English",
    "core/simulate": "simulated people are of the command line",
    "server/commands": "the command line is English",
    "server/main.py": "the command line is English",
    "server/settings.py": "what is wrong with the settings is read in the server's log",
    "server/storage": "faults of the disk and the database are read in the server's log",
    "server/export/bids.py": "files that leave the server are English",
    "server/export/c3d.py": "why a file was refused; shown as English",
    "server/export/content.py": "why a file was refused; shown as English",
    "server/export/fhir.py": "files that leave the server are English",
    "server/export/opensim.py": "why a file was refused; shown as English",
    "server/export/sheets.py": "files that leave the server are English",
    "server/report/files/analysis_json.py": "files that leave the server are English",
    "server/report/files/exports.py": "files that leave the server are English",
    "server/report/files/activity_files.py": "files that leave the server are English",
    "server/report/files/filter_files.py": "files that leave the server are English",
    "server/report/tables.py": "files that leave the server are English",
    "server/web_server": "what is answered before a request reaches a page, or is read in the log",
    "server/viewer": "what the 3D figure says inside its frame comes from the viewer",
}
"""What speaks to people and has no texts in other languages → why."""

SPEAKS: Final = frozenset({"server/storage/field_cipher.py"})
"""Files of those that people read all the same."""

WORDS: Final = frozenset(
    re.findall(
        r"\S+",
        """
    corrected reduced increased shortened prolonged
    above acceleration active admin affected after ago anatomical and ankle assessment assessments
    assistant away back bad bar barefoot bars baseline before below both bouts cane centimetres changed
    chest children clinician complementary consistent copies copy crutch days degrees directions down
    early ended entered estimated exact fading failed fast faster feet female flexion foot forward
    frontal further good gravity gyroscope harness heading higher hip inclination inconsistent inside
    insoles inward kinematic knee larger late left less limits longer low lower magnetometer male mean
    measured median months more moving narrower no none norm norms now off on orientation outward pace
    pass paused pelvis points poor probe push-off reconstruction redo repetitions revoked rhythm right
    rollator sagittal shank shoes shorter silent slow slower smaller socks squat squats step steps
    steps/min stick still stopped straighter stride strides tests thigh threshold training trainings
    transverse treadmill trunk turns unaffected unknown up usable viewer walk walking week wider works
    yes
        """,
    )
)
"""Single small words that stand by themselves on pages."""

PHRASES: Final = (
    "± {value} (95 %): {parts}",
    "{value} (95 %): {parts}",
    "{mean}, mean ± SD of {value} {what}",
    "{mean} , mean ± SD of {value} {what}",
    "{title} over {over}",
    "{end} ↑",
    "{end} ↓",
    "MDC {limit}: {source} ({people}).",
    "MDC {limit}: {source}, 1.96 √2 of its error of measurement ({people}).",
    "MDC {limit}: {source}, treadmill: the largest of its temporal limits, {least} to {most} % ({people}).",
    "MDC {limit}: {source}, treadmill: the largest of its joint angles, {least} to {most}° ({people}).",
    "MDC {limit}: {source}, treadmill, affected side ({people}).",
    "{source}, treadmill",
    "MDC {limit}: {source}.",
    "MCID {limit}: {source} ({people}).",
    "MCID {limit}: {source}.",
    "{group} ({source})",
    "{group}, n = {people} ({source})",
    "moments of contact ± {value}",
    "mean + 2 SD, {source}",
    "mean − 2 SD, {source}",
    "left {left}, right {right}",
    "{side} not measured: {why}",
    "{side} not reported: {why}",
    "{side} not measured by a sensor on each segment",
    "{side} not measured",
    "{name} left",
    "{name} right",
    "{side} stride, {start_s} to {end_s} s",
    "{side} stride, {start_s} to {end_s} s, excluded: {why}",
    "knee-ankle-foot orthosis",
    "{value} % lost",
    "Change (noun)",
    "None (ghost)",
    "✓ pass",
    "! redo",
    "the other side",
    "M, {age} y",
    "F, {age} y",
    "{age} y",
    (
        "Norm: healthy adults asked to walk at this speed ({at}), overground, mean ± 1 SD ({source}). "
        "These people were asked to walk at this speed; they do not habitually walk slowly."
    ),
    "Comfortable: {who}, overground at their comfortable 1.25 ± 0.16 m/s, mean ± 1 SD ({source}).",
    "left, mean of {left}, right, mean of {right} {what}",
    "1 cue was excluded because it has no stride in the analysis.",
    "{value} cues were excluded because they have no stride in the analysis.",
    "1 cue was excluded because its stride is excluded from the analysis.",
    "{value} cues were excluded because their strides are excluded from the analysis.",
)
"""What pages put together from parts, as a whole."""

NOT_WORDS: Final = re.compile(
    r"tbl |chart |stack |pair3d|ak-ring|bar part|words halo|strong halo|fb-o|reportpage|livepage|pscreen"
    r"|EventKind$|Comparison$|CurveFigure|Need$"
    r"|Norm(Key|Bands?|Placement|Values?)$|ChangeLimit|ParameterEntry|Scope$|[a-z]+/[a-z]+ [a-z]+$|utf|cap$"
    r"|(shank_l)?_?q[wxyz]$|CODE|filters\.csv|spread"
)
"""Strings that read like words and are none: classes of CSS, names of types."""

SENTENCE: Final = re.compile(r"(?=(\S+ ){3})[A-Z{“].*\.$", re.DOTALL)

UNMEASURED: Final = ("not measured: ", "not reported: ")
"""How a reason begins; in lists and beside a side's name it stands without."""

_CODE: Final = frozenset(
    re.findall(
        r"\S+",
        """
    APIRouter NewType Path Query TypeVar compile endswith exception findall fullmatch get getLogger
    getattr info match post render_page require search startswith sub warning write
        """,
    )
)
"""Calls whose arguments are no words."""


@cache
def list_messages() -> dict[str, list[str]]:
    """Messages of the sources with the files that contain them."""
    result: dict[str, list[str]] = {}

    def keep(messages: Iterator[str], path: Path) -> None:
        name = path.relative_to(ROOT).as_posix()
        for message in messages:
            if message and not NOT_WORDS.match(message) and not CITED.search(message):
                files = result.setdefault(message, [])
                if name not in files:
                    files.append(name)

    for path in sorted((ROOT / "web" / "templates").glob("*.html")):
        keep(list_texts(path.read_text("utf-8")), path)
    for path in sorted((ROOT / "web" / "static" / "js").rglob("*.js")):
        if path.parts[-2:] != ("common", "words.js"):  # what it says of `speak` itself
            keep(script_texts(path.read_text("utf-8")), path)
    for part in ("core", "server", "web"):
        for path in sorted((ROOT / part).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name in SPEAKS or not any(_is_in(name, silent) for silent in STAYS_ENGLISH):
                whole = any(_is_in(name, place) for place in WHOLE)
                keep(python_texts(path.read_text("utf-8"), whole=whole), path)
            elif _is_in(name, "core/formats"):
                # its notices are called something above their English sentence
                keep(titles_of(ast.parse(path.read_text("utf-8"))), path)
    for word in sorted(WORDS):
        result.setdefault(word, []).append("tests/helpers/texts.py")
    for phrase in PHRASES:
        result.setdefault(phrase, ["tests/helpers/texts.py"])
    # what a figure is, where a goniometer gave the zero (server/report/view/level.py)
    for message in [m for m in result if m.endswith(f", {STANDING}.")]:
        result.setdefault(message.replace(STANDING, ANATOMICAL), result[message])
    for beginning in UNMEASURED:
        for message in [m for m in result if m.startswith(beginning)]:
            result.setdefault(message.removeprefix(beginning), result[message])
    return result


def _is_in(name: str, place: str) -> bool:
    return name == place or name.startswith(f"{place}/")


_TAGGED: Final = re.compile(
    r"\bspeak`((?:[^`\\$]|\\.|\$(?!\{)|\$\{(?:[^{}`]|\{[^{}]*\}|`[^`]*`)*\})*)`", re.DOTALL
)


def script_texts(source: str) -> Iterator[str]:
    """Texts of a script, tagged `speak`; values are {0}, {1} …"""
    for matche in _TAGGED.finditer(source):
        numbers = itertools.count()
        inner = re.sub(
            r"\$\{(?:[^{}`]|\{[^{}]*\}|`[^`]*`)*\}", lambda _, n=numbers: f"{{{next(n)}}}", matche[1]
        )
        yield re.sub(
            r"\\u([0-9a-fA-F]{4})|\\(.)", lambda m: chr(int(m[1], 16)) if m[1] else m[2], inner
        ).strip()
        for value in re.findall(r"\$\{(?:[^{}`]|\{[^{}]*\}|`[^`]*`)*\}", matche[1]):
            yield from script_texts(value)
            yield from (text for text in re.findall(r'"([^"]+)"', value) if re.fullmatch(r"[a-z ]{3,}", text))


def python_texts(source: str, *, whole: bool) -> Iterator[str]:
    """Texts of a module: all of them, or those that go into what `SAID` names."""
    tree = ast.parse(source)
    no_text = set(_no_texts(tree))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and SAID.match(_name(n.func))]
    yield from titles_of(tree)
    result = set() if whole else {id(node) for call in calls for node in ast.walk(call)}
    for node in ast.walk(tree):
        if id(node) not in no_text and _is_text(node):
            for message in (text for notices in messages_of(node) for text in _between_tags(notices)):
                # elsewhere a sentence may be made before the call that tells it
                told_here = whole or id(node) in result or (bool(calls) and SENTENCE.match(message))
                if told_here and reads_like_text(message) and has_words(message):
                    yield message


def titles_of(tree: ast.AST) -> Iterator[str]:
    """What notices without a title of their own are called, by their codes."""
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and SAID.match(_name(call.func)) and _name(call.func) != "Message":
            codes = (a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str))
            code = next(codes, "")
            if re.fullmatch(r"[a-z][a-z_]{2,}", code):
                yield title_of_code(code)


def _between_tags(notices: str) -> list[str]:
    """Texts of an HTML fragment; other content is unchanged."""
    return (
        [t.strip() for t in re.findall(r">([^<>]+)(?=<)", notices)] if notices.startswith("<") else [notices]
    )


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.JoinedStr)
        or (isinstance(node, ast.Constant) and isinstance(node.value, str))
        or (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add))
    )


def _no_texts(tree: ast.AST) -> Iterator[int]:
    """Nodes that are not texts: docstrings, keys, compared values, parts of a translated text."""
    for node in ast.walk(tree):
        parts: list[ast.AST] = []
        match node:
            case ast.Expr():
                parts = [node.value]
            case ast.Assign(targets=[ast.Name(id="__all__")]):
                parts = [*ast.walk(node.value)]
            case ast.FormattedValue(value=ast.Call(func=func, args=args)) if _name(func) == "plural":
                parts = [*args]
            case ast.Call() if _name(node.func) in _CODE:
                parts = [*ast.walk(node)]
            case ast.Raise(exc=ast.Call(func=func)) if SAID.match(_name(func)):
                pass
            case ast.Raise() | ast.Compare() | ast.Assert():
                parts = [*ast.walk(node)]
            case ast.Subscript():
                parts = [*ast.walk(node.slice)]
            case ast.match_case():
                parts = [*ast.walk(node.pattern)]
            case ast.JoinedStr() | ast.BinOp():
                parts = [*_pieces(node)]
            case ast.Dict():
                parts = [key for key in node.keys if key is not None]
        yield from map(id, parts)


def _pieces(node: ast.expr) -> Iterator[ast.AST]:
    if isinstance(node, ast.JoinedStr):
        yield from node.values
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        yield from (piece for side in (node.left, node.right) for piece in (side, *_pieces(side)))


def messages_of(node: ast.AST) -> Iterator[str]:
    """The messages that a string or f-string makes: one for each choice of a word inside of it."""
    for choice in itertools.product(*_parts(node, [])):
        # what is filled in later, "{value:.0f}", as what is filled in here
        yield re.sub(r"\{(\w+):[^{}]*\}", r"{\1}", "".join(choice).strip())


def _parts(node: ast.AST, names: list[str]) -> list[tuple[str, ...]]:
    parts = functools.partial(_parts, names=names)
    match node:
        case ast.Constant():
            return [(str(node.value),)]
        case ast.JoinedStr():
            return [part for value in node.values for part in parts(value)]
        case ast.FormattedValue():
            return parts(node.value)
        case ast.BinOp(op=ast.Add(), right=ast.Constant(value=int())):
            return parts(node.left)  # a number further on is a number
        case ast.BinOp(op=ast.Add()):
            return [*parts(node.left), *parts(node.right)]
        case ast.IfExp(body=one, orelse=other) | ast.Call(func=ast.Name(id="plural"), args=[_, one, other]):
            branches = [[*itertools.product(*parts(branch))] for branch in (one, other)]
            return [tuple(dict.fromkeys("".join(choice) for branch in branches for choice in branch))]
        case ast.Call(args=[ast.Name() | ast.Attribute() as first, *_]):
            matches = re.findall(r"[A-Za-z]\w+", ast.unparse(first))
        case _:
            matches = re.findall(r"[A-Za-z]\w+", ast.unparse(node).split("(")[0])
    name = matches[-1] if matches else "value"
    count = names.count(name)
    names.append(name)
    return [(f"{{{name}{count + 1 if count else ''}}}",)]


def _name(func: ast.expr) -> str:
    return func.attr if isinstance(func, ast.Attribute) else func.id if isinstance(func, ast.Name) else ""


def update(language: str) -> tuple[int, int]:
    """Bring the catalogue of a language up to date: new messages come in empty, stale ones go.

    Returns
    -------
    messages in all, and of them without a text.
    """
    path = catalogue_path(language)
    with path.open("rb") as file:
        earlier = read_po(file)
    initial = {str(entry.id): str(entry.string) for entry in earlier if entry.id}
    # the date stays: without a new message the file is the same to the byte
    catalog = Catalog(locale=language, project="Sagittal", fuzzy=False, creation_date=earlier.creation_date)
    catalog.header_comment = f"# {LANGUAGES[language]} texts of Sagittal (docs/how-to/languages.md)."
    messages = list_messages()
    for message, files in messages.items():
        catalog.add(message, initial.get(message, ""), locations=[(name, None) for name in files])  # type: ignore[misc]  # without lines
    with path.open("wb") as file:
        write_po(file, catalog, width=110, sort_by_file=False, omit_header=False)
    return len(messages), sum(not initial.get(message) for message in messages)


if __name__ == "__main__":
    for code in LANGUAGES:
        if code != SOURCE:
            total, missing = update(code)
            print(f"{code}: {total} messages, {missing} without a text")
