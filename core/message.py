"""A sentence for people together with the template and the typed values that it was made from.

A `Message` is its English sentence: it is logged, compared, written as JSON and printed like any `str`. Pages
look its template up in the catalogue of their language and put the values in as that language writes them,
so that no text is ever guessed from a finished sentence.
"""

from __future__ import annotations

import datetime as dt
import math
import re
import string
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Final, Self, TypeVar

from sagittal.core.user_text import UserText

Value = str | float | int | bool | dt.date | None
"""What a placeholder may hold: a `Message` is rendered, a number localised, a name of ours looked up."""

PLACEHOLDER: Final = re.compile(r"\{(\w*)\}")

IDENTIFIERS: Final = re.compile(r"(by|column|device|device_id|duplicate_of|file|file_name|ids)\d*")
"""Placeholders of messages that hold what a person typed or uploaded, quoted or not."""

OWN_WORDS: Final = frozenset({"kind", "label", "protocol"})
"""Placeholders that hold words of the product even in quotation marks."""

_FORMATTER: Final = string.Formatter()
_PLAIN: Final = frozenset({str, int, float, bool, type(None)})
_M = TypeVar("_M", bound="Message")


class Message(str):
    """An English sentence that knows how it was made.

    Parameters
    ----------
    template : English with `{placeholders}`, each with the format that its number is written in.
    values : by placeholder: a number, a date, a word of the product, `UserText`, or a message.

    >>> late = Message("The clock of {sensor} is {ms:.0f} ms late.", sensor="foot_l", ms=41.7)
    >>> late, late.identifier, late.values["ms"]
    ('The clock of foot_l is 42 ms late.', 'The clock of {sensor} is {ms} ms late.', 41.7)
    """

    __slots__ = ("template", "values")

    template: str
    values: Mapping[str, Value]

    def __new__(cls, template: str, /, **values: object) -> Self:
        """Fill in the template; what it quotes or names an identifier becomes user text."""
        identifier, formats = parse_template(template)
        typed: dict[str, Value] = {name: _reduce(value) for name, value in values.items()}
        for name in find_verbatim(identifier):
            if not isinstance(typed[name], Message):
                typed[name] = UserText(format(values[name], formats[name]))
        return _make(cls, template.format_map(values), template, typed)

    @property
    def identifier(self) -> str:
        """The template as catalogues list it: its placeholders without their formats."""
        return parse_template(self.template)[0]

    def map_words(self, change: Callable[[str], str]) -> Message:
        """Change the words of the product among the values, and the sentence."""
        values = {name: _map_words(value, change) for name, value in self.values.items()}
        return _make(type(self), change(str(self)), self.template, values)

    def __reduce__(self) -> tuple[object, ...]:
        """Survive the pipe between processes, and a copy."""
        return _make, (type(self), str(self), self.template, dict(self.values))

    def to_json(self) -> dict[str, Any]:
        """Return the template and the values as plain JSON; the sentence itself is written beside them."""
        return {"template": self.template, "values": {n: _encode(v) for n, v in self.values.items()}}


def join_messages(*parts: str, between: str = " ") -> Message:
    """Join sentences into one message whose values they are.

    >>> join_messages("It was lost.", Message("{n} strides are left out.", n=3))
    'It was lost. 3 strides are left out.'
    """
    names = [f"part{i}" for i in range(1, len(parts) + 1)]
    return Message(between.join(f"{{{name}}}" for name in names), **dict(zip(names, parts, strict=True)))


def describe_message(text: str) -> dict[str, Any]:
    """Return the members `message`, and `template` and `values` where they are known, of a JSON object."""
    return {"message": str(text), **(text.to_json() if isinstance(text, Message) else {})}


def read_message(stored: Mapping[str, Any]) -> str:
    """Return the message that `describe_message` wrote; a sentence stored without a template stays a `str`.

    The sentence is the stored one: it does not change when a later version words its template differently.
    """
    if stored.get("template") is None:
        return str(stored["message"])
    values = {name: _decode(value) for name, value in stored["values"].items()}
    return _make(Message, str(stored["message"]), str(stored["template"]), values)


@lru_cache(maxsize=4096)
def parse_template(template: str) -> tuple[str, Mapping[str, str]]:
    """Return the identifier of a template, and the format of each placeholder.

    >>> parse_template("{sensor} lags by {ms:.0f} ms")
    ('{sensor} lags by {ms} ms', {'sensor': '', 'ms': '.0f'})
    """
    text, formats = [], {}
    for literal, name, spec, _ in _FORMATTER.parse(template):
        text.append(literal)
        if name is not None:
            text.append(f"{{{name}}}")
            formats[name] = spec or ""
    return "".join(text), formats


@lru_cache(maxsize=4096)
def find_verbatim(identifier: str) -> frozenset[str]:
    """Placeholders of a message that contain user text: those in quotation marks, and `IDENTIFIERS`.

    >>> sorted(find_verbatim("Sensor {device}: {value} Hz in '{name}' and “{title}”."))
    ['device', 'name', 'title']
    """
    quoted = re.findall(r"'\{(\w+)\}'|“\{(\w+)\}”", identifier)
    names = [name for name in PLACEHOLDER.findall(identifier) if IDENTIFIERS.fullmatch(name)]
    return frozenset([*names, *(one or other for one, other in quoted)]) - OWN_WORDS


def _make(kind: type[_M], sentence: str, template: str, values: Mapping[str, Value]) -> _M:
    made = str.__new__(kind, sentence)
    made.template, made.values = template, values
    return made


def _reduce(value: object) -> Value:
    """Return a value as one of the types that JSON and catalogues know."""
    if type(value) in _PLAIN or isinstance(value, (Message, UserText, dt.date)):
        return value  # type: ignore[return-value]  # just compared
    item = getattr(value, "item", None)
    if item is None or isinstance(value, str):
        return str(value)  # a member of an enumeration, a path, a list
    plain = item()  # a scalar of NumPy; a float32 is the number that it is written as
    return float(str(value)) if isinstance(plain, float) and str(plain) != str(value) else _reduce(plain)


def _map_words(value: Value, change: Callable[[str], str]) -> Value:
    if isinstance(value, Message):
        return value.map_words(change)
    return change(value) if type(value) is str else value


def _encode(value: Value) -> Any:
    if isinstance(value, Message):
        return describe_message(value)
    if isinstance(value, UserText):
        return {"text": str(value)}
    if isinstance(value, dt.date):
        return {"date": value.isoformat()}
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": repr(value)}
    return str(value) if isinstance(value, str) else value


def _decode(value: Any) -> Value:
    if not isinstance(value, Mapping):
        return value  # type: ignore[no-any-return]  # a plain value of JSON
    if "text" in value:
        return UserText(value["text"])
    if "date" in value:
        text = str(value["date"])
        return dt.datetime.fromisoformat(text) if "T" in text else dt.date.fromisoformat(text)
    return float(value["number"]) if "number" in value else read_message(value)
