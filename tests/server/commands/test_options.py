from __future__ import annotations

import pytest
from cyclopts import Token

from sagittal.server.commands.options import read_seed, read_whole


def test_whole_numbers_are_read_and_nothing_is_rounded() -> None:
    assert read_whole(int, [Token(value="-3")]) == -3
    assert read_seed(int, [Token(value="7")]) == 7
    for read, text in ((read_whole, "1.5"), (read_whole, "x"), (read_seed, "-1"), (read_seed, "²")):
        with pytest.raises(ValueError, match=f"'{text}' is no whole number"):
            read(int, [Token(value=text)])
