"""Tables over many takes."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import pyarrow.parquet as pq

from sagittal.core.errors import InputError, SagittalError
from sagittal.server.report.study_tables import FAILURES, PROVENANCE, StudyTables, StudyTake, write_study

STRIDES = (
    b"side,start_s,stride_time_s,excluded_reason\n"
    b"left,1.0,1.1,\n"
    b"right,1.5,,manual: Mrs Smith stumbled\n"
    b"left,2.1,1.2,turn\n"
)
ANALYSIS = {
    "quality": {"level": "good"},
    "estimator": {"name": "l7s", "estimated_angles": ["knee_flexion_l", "hip_flexion_r"]},
    "warnings": [{}, {}],
    "parameters": [
        {"name": "stride_time_s", "side": "left", "mean": 1.15},
        {"name": "gait_speed_mps", "side": None, "mean": None},
    ],
}


def take(
    name: str, error: SagittalError | None = None, strides: bytes | None = STRIDES, **labels: Any
) -> StudyTake:
    def analysis() -> dict[str, Any]:
        assert error is None
        return ANALYSIS

    return StudyTake(name, labels, 2, {"walk.txt": f"hash of {name}"}, error, analysis, lambda: strides)


def rows(result: StudyTables, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(result.files[name].decode())))


REFUSED = InputError("missing_acc", "No acceleration.")
MADE = write_study([take("a", sub="01"), take("b", REFUSED, sub="02")], {"written_by": "1.0"})


def test_a_take_is_a_row_with_its_means_and_a_refused_one_a_row_with_its_code() -> None:
    first, second = rows(MADE, "takes.csv")
    assert first == {
        "take": "a", "sub": "01", "files": "2", "error": "", "quality": "good", "estimator": "l7s",
        "warnings": "2", "estimated_angles": "hip_flexion_r knee_flexion_l", "stride_time_s_left": "1.15",
        "gait_speed_mps": "",
    }  # fmt: skip
    assert (second["take"], second["error"], second["quality"]) == ("b", "missing_acc", "")


def test_strides_have_the_labels_of_their_take_and_the_modelled_angles_of_their_side() -> None:
    result = rows(MADE, "strides.csv")
    assert MADE.strides == len(result) == 3
    assert [(r["take"], r["sub"], r["side"]) for r in result] == [
        ("a", "01", "left"), ("a", "01", "right"), ("a", "01", "left")
    ]  # fmt: skip
    assert [r["estimated_angles"] for r in result] == ["knee_flexion_l", "hip_flexion_r", "knee_flexion_l"]
    assert [r["stride_time_s"] for r in result] == ["1.1", "", "1.2"]


def test_what_a_person_wrote_of_a_stride_stays_in_the_clinic() -> None:
    assert [r["excluded_reason"] for r in rows(MADE, "strides.csv")] == ["", "manual", "turn"]
    assert all(b"Smith" not in content for content in MADE.files.values())


def test_the_parquet_tables_hold_numbers_as_numbers() -> None:
    table = pq.read_table(io.BytesIO(MADE.files["strides.parquet"]))
    assert table["stride_time_s"].to_pylist() == [1.1, None, 1.2]
    assert table["side"].to_pylist() == ["left", "right", "left"]
    takes = pq.read_table(io.BytesIO(MADE.files["takes.parquet"])).to_pylist()
    assert [t["warnings"] for t in takes] == [2, None]


def test_failures_have_their_sentence_and_provenance_the_hash_of_every_file() -> None:
    assert rows(MADE, FAILURES) == [{"take": "b", "code": "missing_acc", "message": "No acceleration."}]
    assert MADE.failed == 1
    document = json.loads(MADE.files[PROVENANCE])
    assert document["written_by"] == "1.0"
    assert document["takes"]["b"] == {"sha256": {"walk.txt": "hash of b"}, "error": "missing_acc"}
    assert set(document["libraries"]) == {"numpy", "scipy", "numba", "pyarrow"}


def test_a_column_of_numbers_and_words_is_one_of_words() -> None:
    study = write_study([take("a", strides=None, age=60), take("b", strides=None, age="old")], {})
    table = pq.read_table(io.BytesIO(study.files["takes.parquet"]))
    assert table["age"].to_pylist() == ["60", "old"]


def test_takes_without_strides_make_an_empty_table() -> None:
    study = write_study([take("a", strides=None)], {})
    assert (study.strides, study.failed) == (0, 0)
    assert rows(study, "strides.csv") == []
    assert pq.read_table(io.BytesIO(study.files["strides.parquet"])).num_rows == 0
