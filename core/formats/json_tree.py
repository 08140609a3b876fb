"""A JSON tree whose nodes know their own path, so that a mistake can name its place."""

from __future__ import annotations

import difflib
import json

from core.errors import ManifestError


class Node:
    """One place in the JSON tree that knows its own path."""

    def __init__(self, value: object, path: str) -> None:
        if value is not None and not isinstance(value, dict):
            raise ManifestError(
                "manifest_bad_value", f"{path or 'The manifest'} is {_kind(value)}; expected an object."
            )
        self.value: dict[str, object] = value or {}
        self.path = path

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the object."""
        return tuple(self.value)

    def at(self, key: str) -> str:
        """Path of a key."""
        return f"{self.path}.{key}" if self.path else key

    def only(self, *allowed: str) -> None:
        """Refuse keys that are not allowed, with the nearest that is."""
        for key in self.value:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(allowed)}."
                raise ManifestError("manifest_unknown_key", f"{self.at(key)} is not known; {hint}")

    def child(self, key: str) -> Node:
        """The object under a key, empty if absent."""
        return Node(self.value.get(key), self.at(key))

    def children(self, key: str) -> list[Node]:
        """The objects of a list under a key."""
        value = self.value.get(key)
        if value is not None and not isinstance(value, list):
            raise ManifestError("manifest_bad_value", f"{self.at(key)} is {_kind(value)}; expected a list.")
        return [Node(v, f"{self.at(key)}[{i}]") for i, v in enumerate(value or [])]

    def text(self, key: str) -> str | None:
        """Text or None."""
        value = self.value.get(key)
        if value is not None and (not isinstance(value, str) or not value.strip()):
            raise self._wrong(key, "a text")
        return value

    def string(self, key: str) -> str:
        """Text that must be there."""
        value = self.text(key)
        if value is None:
            raise self._wrong(key, "a text")
        return value

    def number(self, key: str) -> float | None:
        """Finite number or None."""
        value = self.value.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e12:
            raise self._wrong(key, "a number")
        return float(value)

    def count(self, key: str, default: int, most: int) -> int:
        """Whole number from 0 to `most`."""
        value = self.value.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
            raise self._wrong(key, f"a whole number from 0 to {most}")
        return value

    def flag(self, key: str) -> bool | None:
        """True, false or None."""
        value = self.value.get(key)
        if value is not None and not isinstance(value, bool):
            raise self._wrong(key, "true or false")
        return value

    def choice(self, key: str, allowed: tuple[str, ...], code: str) -> str | None:
        """One of the allowed texts or None; `code` names the mistake."""
        value = self.value.get(key)
        if value is not None and not isinstance(value, str):
            raise self._wrong(key, "a text")
        if value is not None and value not in allowed:
            options = ", ".join(repr(a) for a in allowed)
            raise ManifestError(code, f"{self.at(key)} is {value!r}; expected one of {options}.")
        return value

    def names(self, key: str, n: int) -> tuple[str, ...] | None:
        """List of n different names or None."""
        value = self.value.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != n or not all(isinstance(v, str) and v for v in value):
            raise self._wrong(key, f"a list of {n} column names")
        if len(set(value)) != n:
            raise self._wrong(key, f"a list of {n} different column names")
        return tuple(value)

    def _wrong(self, key: str, expected: str) -> ManifestError:
        return ManifestError(
            "manifest_bad_value", f"{self.at(key)} is {_kind(self.value.get(key))}; expected {expected}."
        )


def _kind(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 40 else text[:37] + "..."


def no_constant(name: str) -> object:
    """Refuse NaN and Infinity, which JSON does not have."""
    raise ValueError(f"{name} is not a number in JSON; use null")


def unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Refuse a key that is given twice."""
    out: dict[str, object] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"the key '{key}' is given twice")
        out[key] = value
    return out
