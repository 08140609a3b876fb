"""How columns are written: in groups of rows, as one table would be."""

from __future__ import annotations

import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from server.report import columns
from server.report.columns import parquet_file, read_table, repeat_words, single_precision


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
