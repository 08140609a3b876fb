"""How columns are written: in groups of rows, as one table would be; and how text and JSON are."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sagittal.server.report.files import columns
from sagittal.server.report.files.columns import (
    parquet_file,
    read_table,
    repeat_words,
    single_precision,
    write_csv,
    write_json,
)


def test_rows_are_written_in_groups_and_read_as_one_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "GROUP", 40)
    t_s, q = np.arange(100) / 100.0, np.random.default_rng(1).normal(size=(100, 2))
    q[7, 0] = np.nan
    data = parquet_file(
        t_s,
        {"a": single_precision(q, 0), "b": single_precision(q, 1), "good": q[:, 1] > 0.0,
         "word": repeat_words(["x", "y"], 50)},
        {"schema": 1},
    )  # fmt: skip
    assert pq.ParquetFile(pa.BufferReader(data)).num_row_groups == 3
    table, meta = read_table(data)
    assert meta == {"schema": 1}
    assert table["t_s"].to_pylist() == t_s.tolist()
    assert table["a"].null_count == 1
    assert table["b"].to_pylist() == q[:, 1].astype(np.float32).tolist()
    assert table["good"].to_pylist() == (q[:, 1] > 0.0).tolist()
    assert table["word"].to_pylist() == ["x"] * 50 + ["y"] * 50


@pytest.mark.parametrize("rows", [0, 5])
def test_a_short_file_is_what_a_table_at_once_gives(rows: int) -> None:
    t_s, x = np.arange(rows) / 100.0, np.arange(rows, dtype=np.float32)
    sink = io.BytesIO()
    table = pa.table({"t_s": t_s, "x": pa.array(x, from_pandas=True)})
    table = table.replace_schema_metadata({"sagittal": "{}"})
    pq.write_table(table, sink, compression="zstd", use_dictionary=False, use_byte_stream_split=["t_s", "x"])  # type: ignore[arg-type]
    assert parquet_file(t_s, {"x": x}, {}) == sink.getvalue()


@given(st.lists(st.none() | st.floats()), st.lists(st.integers(-(10**9), 10**9)))
@example([-0.0, -1e-9, 2.5e-6, 1.7e308, math.nan, math.inf, None, 0.1 + 0.2], [5, 15, 25])
def test_numbers_of_a_table_are_rounded_as_each_alone(values: list[float | None], halves: list[int]) -> None:
    column = [*values, *(1e-7 * half for half in halves)]
    cells = ["" if x is None or not math.isfinite(x) else repr(round(x, 6) + 0.0) for x in column]
    text = write_csv(("a", "b"), ((x, "word") for x in column)).decode()
    assert text.splitlines() == ["a,b", *(f"{cell},word" for cell in cells)]


def test_words_numbers_and_formulas_may_stand_in_one_column() -> None:
    cells = ["=1+1", 1, True, np.float32(0.5), None, "a,b", np.int64(3)]
    text = write_csv(("a", "b"), [(x, x if isinstance(x, str) else None) for x in cells]).decode()
    assert text.splitlines()[1:] == [
        "'=1+1,'=1+1", "1,", "True,", "0.5,", ",", '"a,b","a,b"', "3,"
    ]  # fmt: skip


words = st.text(st.characters(exclude_categories=["Cs"]))
numbers = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
plain = st.none() | st.booleans() | numbers | words


@pytest.mark.slow
@given(st.recursive(plain, lambda x: st.lists(x) | st.dictionaries(words, x)))
@example({"a": [], "b": {}, "c": [[], [1.5, None]], "d": (1, {"e": "ü\n"}), "f": [1, True]})
def test_json_is_that_of_python(value: object) -> None:
    assert write_json(value) == json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1).encode()


@pytest.mark.parametrize("key", [None, True, 1, 1.5])
def test_a_key_that_is_no_text_makes_no_file_that_nobody_reads(key: object) -> None:
    with pytest.raises(ValueError, match="key"):
        write_json({key: {"a": [1]}})


@pytest.mark.parametrize("value", [math.nan, [1.0, math.inf], {"a": {"b": [math.nan]}}])
def test_json_knows_finite_numbers_alone(value: object) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_json(value)
