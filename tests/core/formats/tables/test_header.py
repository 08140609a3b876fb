"""Names of columns."""

from __future__ import annotations

import pytest

from sagittal.core.errors import ManifestError
from sagittal.core.formats.source_spec import Channels, SourceSpec
from sagittal.core.formats.tables.header import complete_names, find_titles, list_wanted


def spec(*acc: str) -> SourceSpec:
    return SourceSpec("a.csv", columns={"foot_l": Channels(acc)})


def test_a_title_under_merged_cells_is_that_of_the_neighbour() -> None:
    header = [b"Timestamp,Accelerometer,,,Gyroscope,,", b",X,Y,Z,X,Y,Z"]
    titles = find_titles(header, b"1,2,3,4,5,6,7", b",", spec())
    assert complete_names(spec("Accelerometer/X", "Y", "Z"), titles).columns["foot_l"].acc == (
        "Accelerometer/X",
        "Y#1",
        "Z#1",
    )


def test_a_title_of_several_columns_is_refused_where_nothing_tells_them_apart() -> None:
    titles = ["t", "X", "Y", "Z", "X", "Y", "Z"]
    with pytest.raises(ManifestError) as e:
        list_wanted(complete_names(spec("X", "Y", "Z"), titles), titles, "a.csv")
    assert e.value.code == "ambiguous_column"
