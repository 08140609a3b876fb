"""Field-by-field parsing of a record: absent fields have defaults, invalid ones are rejected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Any, Final, TypeVar

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message

Name = TypeVar("Name")

CODE: Final = "bad_prescription"

_MISSING: Final = object()


class RecordFields:
    """The fields of one object of a record.

    Every reader returns the default if the field is absent, and raises ParameterError bad_prescription with
    the expected and the actual value; `refuse_unknown` rejects fields that were not read.
    """

    def __init__(self, path: str, data: object) -> None:
        if not isinstance(data, Mapping):
            raise ParameterError(
                CODE,
                Message(
                    "{path} is {data}. Expected an object with named fields.", path=path, data=repr(data)
                ),
            )
        self._path = path
        self._data: Mapping[Any, object] = data
        self._read: set[str] = set()

    def part(self, name: str) -> RecordFields:
        """A nested object; absent = all defaults."""
        data = self._take(name, {})
        return RecordFields(name if self._path == "prescription" else f"{self._path}.{name}", data)

    def number(self, name: str, default: float, least: float, most: float) -> float:
        """A finite number within limits."""
        return self._number(name, self._take(name, default), least, most)

    def number_or_none(
        self, name: str, default: float | None, least: float = -inf, most: float = inf
    ) -> float | None:
        """A finite number within limits, or null."""
        value = self._take(name, default)
        return None if value is None else self._number(name, value, least, most)

    def whole(self, name: str, default: int, least: int, most: int) -> int:
        """A whole number within limits."""
        return self._whole(name, self._take(name, default), least, most)

    def whole_or_none(self, name: str, default: int | None, least: int, most: int) -> int | None:
        """A whole number within limits, or null."""
        value = self._take(name, default)
        return None if value is None else self._whole(name, value, least, most)

    def flag(self, name: str, default: bool) -> bool:
        """A boolean."""
        value = self._take(name, default)
        if not isinstance(value, bool):
            raise self._wrong(name, value, "true or false")
        return value

    def choice(self, name: str, allowed: Sequence[Name], default: object = _MISSING) -> Name:
        """One of the allowed values."""
        chosen = self._take(name, default)
        for value in allowed:
            if chosen == value and type(chosen) is type(value):
                return value
        words = ", ".join("null" if a is None else str(a) for a in allowed)
        raise self._wrong(name, None if chosen is _MISSING else chosen, f"one of {words}")

    def choices(self, name: str, allowed: Sequence[Name], default: Sequence[Name]) -> tuple[Name, ...]:
        """At least one of the allowed values."""
        values = self._take(name, default)
        if isinstance(values, list | tuple) and values and all(x in allowed for x in values):
            return tuple(values)
        raise self._wrong(name, values, f"a list of at least one of {', '.join(map(str, allowed))}")

    def percents(self, name: str, default: tuple[int, ...]) -> tuple[int, ...]:
        """A list of whole percentages."""
        values = self._take(name, default)
        if isinstance(values, list | tuple) and 1 <= len(values) <= 20:
            numbers = [x for x in values if isinstance(x, int) and not isinstance(x, bool) and 0 <= x <= 100]
            if len(numbers) == len(values):
                return tuple(numbers)
        raise self._wrong(name, values, "a list of 1 to 20 whole percents from 0 to 100")

    def text(self, name: str, default: str | None) -> str | None:
        """A line of text."""
        value = self._take(name, default)
        if value is None or (isinstance(value, str) and len(value) <= 500):
            return value
        raise self._wrong(name, value, "text of at most 500 characters")

    def refuse_unknown(self) -> None:
        """Reject fields that were not read: a misspelt field must not be silently ignored."""
        unknown = sorted(str(k) for k in self._data.keys() - self._read)
        if unknown:
            raise ParameterError(
                CODE,
                Message(
                    "{path} has {unknown}. Expected only {join}.",
                    path=self._path,
                    unknown=", ".join(unknown),
                    join=", ".join(sorted(self._read)),
                ),
            )

    def _number(self, name: str, value: object, least: float, most: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise self._wrong(name, value, "a number")
        if not least <= value <= most:
            raise self._wrong(name, value, f"a number from {least:g} to {most:g}")
        return float(value)

    def _whole(self, name: str, value: object, least: int, most: int) -> int:
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise self._wrong(name, value, f"a whole number from {least} to {most}")
        return value

    def _take(self, name: str, default: object) -> Any:
        self._read.add(name)
        return self._data.get(name, default)

    def _wrong(self, name: str, value: object, expected: str) -> ParameterError:
        return ParameterError(
            CODE,
            Message(
                "{path}.{name} is {found}. Expected {expected}.",
                path=self._path,
                name=name,
                found=repr(value),
                expected=expected,
            ),
        )
