"""What an export can be, and why another is refused."""

from __future__ import annotations

import pytest

from sagittal.core.errors import FormatError, InputError
from sagittal.server.export.kinds import write_export
from tests.server import analysed
from tests.server.export.opened import open_walk
from tests.server.export.test_sheets import left_out, tables


def test_what_cannot_be_written_says_why() -> None:
    with pytest.raises(InputError, match="choose one of xlsx"):
        write_export("docx", open_walk())
    files = {name: x for name, x in analysed.files().items() if name != "tracks.parquet"}
    edit, _ = left_out()
    with pytest.raises(FormatError, match=r"no tracks\.parquet"):
        open_walk(edit, files=files)
    single = open_walk(files={"analysis.json": analysed.files()["analysis.json"]})
    assert tables(single)["strides_long.csv"] == []
