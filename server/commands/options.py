"""Shared option types: parsing, name and help text of arguments used by several commands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token


def read_whole(_: object, tokens: Sequence[Token]) -> int:
    """Parse a whole number; cyclopts itself rounds 1.5 to 2.

    Raises
    ------
    ValueError
        the text is not a whole number.
    """
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"'{tokens[0].value}' is no whole number") from None


def read_seed(_: object, tokens: Sequence[Token]) -> int:
    """Parse a seed, which must not be negative.

    Raises
    ------
    ValueError
        the text is not a whole number of 0 or more.
    """
    text = tokens[0].value
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"'{text}' is no whole number of 0 or more")
    return int(text)


Whole = Annotated[int, Parameter(converter=read_whole)]
Seed = Annotated[int, Parameter(converter=read_seed)]
DataDir = Annotated[
    Path | None,
    Parameter(name="--data", metavar="DIR", help="data folder (default: SAGITTAL_HOME, else ~/.sagittal)"),
]
Take = Annotated[list[Path], Parameter(metavar="PATH ...", help="files, folders or zips of one take")]
Manifest = Annotated[
    Path | None,
    Parameter(metavar="JSON", help="which sensor sits where, units (docs/reference/formats.md)"),
]
