"""External JSON: a single strict reader, and a tree whose nodes know their own path.

`read_json` reads every JSON text from users, devices or files of external origin: request bodies, live
messages, manifests, stored notes.
"""

from __future__ import annotations

import difflib
import json
from collections import Counter
from math import isfinite
from typing import Final

from sagittal.core.errors import ManifestError

MOST_DEPTH: Final = 64
"""Objects and lists inside each other; a manifest has five levels."""
MOST_DIGITS: Final = 308
"""Of a whole number: more do not fit into a double."""
MOST_SHOWN: Final = 40
"""Characters of a key that a sentence quotes."""


def read_json(data: bytes | str, most_bytes: int | None = None) -> object:
    """Parse a JSON text (RFC 8259) strictly.

    UTF-8, with or without a byte order mark; no duplicate keys; every number finite; every text valid
    Unicode, no lone surrogates; at most MOST_DEPTH levels.

    Parameters
    ----------
    most_bytes : maximum number of bytes of `data` (characters of a str); None if the caller has limited it.

    Raises
    ------
    ValueError the reason, worded to complete "The … is not valid JSON: ".
    """
    if most_bytes is not None and len(data) > most_bytes:
        raise ValueError(f"it has {len(data)} bytes, at most {most_bytes} are read")
    try:
        text = data if isinstance(data, str) else data.decode("utf-8-sig")
        root: object = json.loads(
            text, parse_constant=_refuse_constant, parse_int=_read_whole, object_pairs_hook=_make_object
        )
        # what is decoded from UTF-8 has a lone surrogate only where one is escaped
        _check_values(root, has_surrogates=isinstance(data, str) or "\\u" in text)
    except RecursionError:
        raise _too_deep() from None
    except UnicodeError:
        raise ValueError("a text is not valid Unicode (UTF-8, no lone surrogates)") from None
    return root


def _refuse_constant(name: str) -> object:
    raise ValueError(f"{name} is not a number in JSON; use null")


def _read_whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError("a number is too large")
    return int(digits)


def _make_object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise ValueError(f"the key '{_shorten_key(twice)}' is given twice")
    return mapping


def _shorten_key(key: str) -> str:
    """An external key in displayable form: valid Unicode, at most MOST_SHOWN characters."""
    label = key.encode("utf-8", "backslashreplace").decode()
    return label if len(label) <= MOST_SHOWN else f"{label[:MOST_SHOWN]}…"


def _check_values(root: object, *, has_surrogates: bool) -> None:
    """Reject values that Python accepts but JSON does not: numbers out of range, lone surrogates; and
    excessive depth.

    Parameters
    ----------
    has_surrogates : whether the text may contain any.
    """
    level: list[object] = [[root]]
    for _ in range(MOST_DEPTH + 1):
        inner: list[object] = []
        for container in level:
            if isinstance(container, dict):
                if has_surrogates:
                    "".join(container).encode()
                container = container.values()
            for value in container:  # type: ignore[attr-defined]  # a list, or values of an object
                kind = type(value)
                if kind is dict or kind is list:
                    inner.append(value)
                elif kind is float and not isfinite(value):
                    raise ValueError("a number is too large")
                elif has_surrogates and kind is str:
                    value.encode()
        if not inner:
            return
        level = inner
    raise _too_deep()


def _too_deep() -> ValueError:
    return ValueError(f"it has more than {MOST_DEPTH} levels")


class JsonNode:
    """A node of the JSON tree that knows its own path."""

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
        """Reject keys that are not allowed, suggesting the nearest allowed one."""
        for key in self.value:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(allowed)}."
                raise ManifestError("manifest_unknown_key", f"{self.at(key)} is not known; {hint}")

    def child(self, key: str) -> JsonNode:
        """The object under a key, empty if absent."""
        return JsonNode(self.value.get(key), self.at(key))

    def children(self, key: str) -> list[JsonNode]:
        """The objects of a list under a key."""
        value = self.value.get(key)
        if value is not None and not isinstance(value, list):
            raise ManifestError("manifest_bad_value", f"{self.at(key)} is {_kind(value)}; expected a list.")
        return [JsonNode(v, f"{self.at(key)}[{i}]") for i, v in enumerate(value or [])]

    def text(self, key: str) -> str | None:
        """A text, or None."""
        value = self.value.get(key)
        if value is not None and (not isinstance(value, str) or not value.strip()):
            raise self._wrong(key, "a text")
        return value

    def string(self, key: str) -> str:
        """A required text."""
        value = self.text(key)
        if value is None:
            raise self._wrong(key, "a text")
        return value

    def number(self, key: str) -> float | None:
        """A finite number, or None."""
        value = self.value.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e12:
            raise self._wrong(key, "a number")
        return float(value)

    def has(self, key: str) -> bool:
        """Whether a key is there with a value."""
        return self.value.get(key) is not None

    def is_number(self, key: str) -> bool:
        """Whether the value of a key is a number."""
        value = self.value.get(key)
        return isinstance(value, int | float) and not isinstance(value, bool)

    def count(self, key: str, default: int, most: int) -> int:
        """Whole number from 0 to `most`."""
        value = self.value.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
            raise self._wrong(key, f"a whole number from 0 to {most}")
        return value

    def flag(self, key: str) -> bool | None:
        """A boolean, or None."""
        value = self.value.get(key)
        if value is not None and not isinstance(value, bool):
            raise self._wrong(key, "true or false")
        return value

    def choice(self, key: str, allowed: tuple[str, ...], code: str) -> str | None:
        """One of the allowed texts or None; `code` is that of the error."""
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
