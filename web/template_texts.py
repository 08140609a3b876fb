"""Translatable texts of templates, between tags and in user-visible attributes.

Templates are written in English without markers. For other languages `speak_template` wraps every text and
displayed value in a call; `list_texts` lists the same messages for the catalogue. User input is `UserText`
and is displayed unchanged.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator
from typing import Final

from jinja2 import Environment, nodes

from sagittal.core.message import PLACEHOLDER
from sagittal.web.message_format import has_words

READ_ATTRIBUTES: Final = frozenset({"alt", "aria-label", "aria-description", "label", "placeholder", "title"})

_TOKEN: Final = re.compile(
    r"(\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<!.*?>|<(?:[^<>{]|\{\{.*?\}\}|\{%.*?%\}|\{)*>)", re.DOTALL
)
_ATTRIBUTE: Final = re.compile(r'(?<=\s)([\w-]+)="((?:[^"{]|\{\{.*?\}\}|\{%.*?%\}|\{)*)"', re.DOTALL)
_EITHER: Final = re.compile(r"'([^']*)' if (.+?)(?: else '([^']*)')?", re.DOTALL)
_PLURAL: Final = re.compile(r"plural\((.+), '([^']*)', '([^']*)'\)", re.DOTALL)
_PARSER: Final = Environment()  # noqa: S701 - only reads expressions


def speak_template(source: str) -> str:
    """Wrap each text and displayed value in a call of `say` or, in attributes, `say_plain`."""
    return "".join(_walk(source, lambda run, function: _speak(run, function)))


def list_texts(source: str) -> Iterator[str]:
    """All messages of a template: its texts, and strings in expressions that look like text."""
    messages: list[str] = []

    def keep(run: str, function: str) -> str:
        messages.extend(message for message, _ in _variants(_Run(run)))
        return run

    for _ in _walk(source, keep):
        pass
    yield from (m for m in messages if has_words(m))
    tree = _PARSER.parse(source)
    plural_words = {id(word) for call in tree.find_all(nodes.Call) if _is_plural(call) for word in call.args}
    for node in tree.find_all((nodes.Const, nodes.Concat)):
        if id(node) not in plural_words:
            yield from _strings(node)


def _is_plural(call: nodes.Call) -> bool:
    return isinstance(call.node, nodes.Name) and call.node.name == "plural"


class _Run:
    """Alternating text and `{{ expressions }}` between two tags or statements.

    `lead` and `trail` are surrounding white space; `pieces` are text (even) and expressions (odd).
    """

    def __init__(self, run: str) -> None:
        pieces: list[str] = [""]
        for part in re.split(r"(\{\{.*?\}\})", run, flags=re.DOTALL):
            if part.startswith("{{"):
                inner = part[2:-2]
                if inner.startswith("-"):
                    pieces[-1] = pieces[-1].rstrip()
                pieces += [inner.strip("-").strip(), "\0" if inner.endswith("-") else ""]
            else:
                pieces[-1] = part.lstrip() if pieces[-1] == "\0" else part
        pieces = [
            piece if i % 2 else re.sub(r"\s+", " ", piece.strip("\0")) for i, piece in enumerate(pieces)
        ]
        self.lead = " " if pieces[0].startswith(" ") else ""
        self.trail = " " if pieces[-1].endswith(" ") else ""
        pieces[0] = pieces[0].lstrip()
        pieces[-1] = pieces[-1].rstrip()
        self.pieces = pieces


def _walk(source: str, speak: Callable[[str, str], str]) -> Iterator[str]:
    """Yield the source in order, with runs of text and values, including attributes, passed through
    `speak`.
    """
    run = ""
    for part in _TOKEN.split(source):
        if part.startswith("{{") and not _is_markup(part):
            run += part
        elif part.startswith(("{{", "{%", "{#", "<")):
            yield speak(run, "say") if run else ""
            run = ""
            yield _ATTRIBUTE.sub(lambda m: _attribute(m, speak), part) if part.startswith("<") else part
        else:
            run += part
    yield speak(run, "say") if run else ""


def _attribute(match: re.Match[str], speak: Callable[[str, str], str]) -> str:
    name, value = match.groups()
    if name not in READ_ATTRIBUTES:
        return match[0]
    return f'{name}="{"".join(_walk(value, lambda run, _: speak(run, "say_plain")))}"'


def _is_markup(expression: str) -> bool:
    """Whether an expression is a macro call or ready-made HTML rather than part of a sentence."""
    inner = expression[2:-2].strip("-").strip()
    called = re.match(r"(\w+)\(", inner)
    is_macro = called is not None and called[1] != "plural"
    return is_macro or re.search(r"\|\s*(safe|tojson)\s*$", inner) is not None


def _speak(text: str, function: str) -> str:
    run = _Run(text)
    if not any(has_words(piece) for piece in run.pieces[::2]):
        # white space of values alone is preserved
        return re.sub(
            r"\{\{(-?)(.*?)(-?)\}\}",
            lambda m: f"{{{{{m[1]} {function}({m[2].strip()}) {m[3]}}}}}",
            text,
            flags=re.DOTALL,
        )
    (message, call), *variants = _variants(run)
    expression = _call(message, call, function)
    for message_variant, (condition, values) in variants:
        expression = (
            f"{_call(message_variant, (condition, values), function)} if ({condition}) else ({expression})"
        )
    return f"{run.lead}{{{{ {expression} }}}}{run.trail}"


def _call(message: str, call: tuple[str, dict[str, str]], function: str) -> str:
    values = "".join(f", {name}=({value})" for name, value in call[1].items())
    return f"{function}_message({_quote(message)}{values})"


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _variants(run: _Run) -> list[tuple[str, tuple[str, dict[str, str]]]]:
    """Messages of a run with their conditions and values; several if a word depends on a condition.

    The first is for all conditions being false.
    """
    combinations: list[tuple[str, list[str], dict[str, str]]] = [("", [], {})]
    for i, piece in enumerate(run.pieces):
        if i % 2 == 0:
            combinations = [
                (message + piece, conditions, values) for message, conditions, values in combinations
            ]
            continue
        choice = _read_choice(piece)
        grown = []
        if choice:
            true, condition, false = choice
            for message, conditions, values in combinations:
                grown.append((message + false, [*conditions, f"not ({condition})"], values))
            for message, conditions, values in combinations:
                grown.append((message + true, [*conditions, condition], values))
        else:
            for message, conditions, values in combinations:
                name = _name(piece, values)
                grown.append((f"{message}{{{name}}}", conditions, {**values, name: piece}))
        combinations = grown
    return [(" ".join(m.split()), (" and ".join(f"({c})" for c in cs), vs)) for m, cs, vs in combinations]


def _read_choice(expression: str) -> tuple[str, str, str] | None:
    """Text if a condition holds, the condition, and text if it does not."""
    if plural := _PLURAL.fullmatch(expression):
        return plural[2], f"({plural[1]}) == 1", plural[3]
    either = _EITHER.fullmatch(expression)
    return (either[1], either[2], either[3] or "") if either else None


def _name(expression: str, reserved: Container[str]) -> str:
    """Placeholder name of a value: the last component of its path."""
    path = re.match(r"[\w.\[\]']*", expression.lstrip("("))
    words: list[str] = re.findall(r"[A-Za-z_]+", path[0] if path else "") or ["value"]
    name = words[-1]
    n = 2
    while name in reserved:
        name = f"{words[-1]}{n}"
        n += 1
    return name


def _strings(node: nodes.Node) -> Iterator[str]:
    if isinstance(node, nodes.Const):
        if isinstance(node.value, str) and reads_like_text(node.value):
            yield " ".join(node.value.split())
        return
    parts: list[str] = []
    values: set[str] = set()
    for part in node.iter_child_nodes():
        if isinstance(part, nodes.Const):
            parts.append(str(part.value))
        else:
            name = (
                part.attr
                if isinstance(part, nodes.Getattr)
                else part.name
                if isinstance(part, nodes.Name)
                else "value"
            )
            name = _name(name, values)
            values.add(name)
            parts.append(f"{{{name}}}")
    message = "".join(parts)
    if reads_like_text(message):
        yield message


def reads_like_text(text: str) -> bool:
    """Whether a string of a program is user-visible text: it has a capital or a space and is not code."""
    plain = PLACEHOLDER.sub("x", text)
    return (
        re.search(r"[a-z]{2} \w|\w [a-z]{2}|^[A-Z][a-z]", plain) is not None
        and re.search(r"[=<>_\\^$]|^/|/api|^(GET|POST|PUT|PATCH|DELETE)\b|://|-\w+-", plain) is None
    )
