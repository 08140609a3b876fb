"""Wording that depends on a count."""

from __future__ import annotations


def plural(count: int, one: str, many: str) -> str:
    """Return the wording of one thing, or of any other number of them.

    Both wordings are messages of the catalogues: literal strings, or whole f-strings.

    >>> [f"{n} {plural(n, 'row', 'rows')}" for n in (0, 1, 2)]
    ['0 rows', '1 row', '2 rows']
    """
    return one if count == 1 else many
