"""User-entered or uploaded text as a type: pages show it unchanged in every language."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape
from typing import Any, Final


class UserText(str):
    """Text entered or uploaded by a user; never translated, nor are its numbers localised.

    Parts of it, changes of case and sums with other texts are user text too. An f-string, `format` and
    `str.join` return a plain `str`: within a sentence, quote the text with `quote` or pass it to a message as
    a value.

    >>> [type(text).__name__ for text in (UserText("Left knee")[:4], "Of " + UserText("Left"))]
    ['UserText', 'UserText']
    """

    __slots__ = ()

    def __html__(self) -> str:
        """Escape the text; the result is plain markup, which templates can join with their own text."""
        return escape(str(self)).replace("&quot;", "&#34;").replace("&#x27;", "&#39;")

    def __radd__(self, prefix: str) -> UserText:
        """Return user text after concatenation with a preceding text."""
        return UserText(prefix + str(self))


def _keep_type(name: str) -> Callable[..., Any]:
    method = getattr(str, name)

    def keeping(self: UserText, *args: Any, **options: Any) -> Any:
        return mark_user_text(method(self, *args, **options))

    keeping.__name__ = name
    keeping.__doc__ = method.__doc__
    return keeping


_KEEPING: Final = (
    "__add__", "__getitem__", "__mul__", "__rmul__", "capitalize", "casefold", "expandtabs", "lower",
    "lstrip", "partition", "removeprefix", "removesuffix", "replace", "rpartition", "rsplit", "rstrip",
    "split", "splitlines", "strip", "title", "upper",
)  # fmt: skip
for _name in _KEEPING:
    setattr(UserText, _name, _keep_type(_name))


def mark_user_text(value: Any) -> Any:
    """Mark all texts in a value as user text, including lists, mappings and their keys.

    >>> type(mark_user_text({"sensors": ["Left foot"]})["sensors"][0]).__name__
    'UserText'
    """
    if isinstance(value, str):
        return UserText(value)
    if isinstance(value, list | tuple):
        return type(value)(map(mark_user_text, value))
    if isinstance(value, Mapping):
        return {mark_user_text(key): mark_user_text(inner) for key, inner in value.items()}
    return value


def encode_user_text(value: object) -> str:
    """Return user text or a message as a plain string: the `enc_hook` of msgspec, which knows exact types.

    Raises
    ------
    NotImplementedError
        The value is of another type that msgspec does not know.
    """
    if isinstance(value, str):
        return str(value)
    raise NotImplementedError(f"Objects of type {type(value).__name__} cannot be encoded.")


def quote(text: str) -> str:
    """Return user text in quotation marks, which are never translated; other text unchanged.

    >>> quote(UserText("Pain, left knee")), quote("too short")
    ('“Pain, left knee”', 'too short')
    """
    return f"“{text}”" if isinstance(text, UserText) else text
