"""Walk as one HTML file, extracted from it again."""

from __future__ import annotations

import base64
import re

import msgspec
import numpy as np
import pytest
import zstandard

from sagittal.core.errors import FormatError
from sagittal.server.export.kinds import write_export
from sagittal.server.viewer.recorded_walk import RATE_HZ, record_walk
from tests.server import walk
from tests.server.export.opened import open_walk


def test_every_moment_of_the_walk_is_in_the_page_and_nothing_is_fetched() -> None:
    duration_s = 2.0
    page = record_walk(walk.poses(duration_s)).decode()
    assert "<title>Sagittal</title>" in page
    assert not re.search(r'(?:src|href)="https?:', page)
    match = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert match is not None
    data = base64.b64decode(match[1])
    inner = zstandard.ZstdDecompressor().decompress(
        data[8:], max_output_size=int.from_bytes(data[:8], "little")
    )
    text = msgspec.msgpack.decode(inner[8 : 8 + int.from_bytes(inner[:8], "little")])
    assert text["durationSeconds"] == pytest.approx(duration_s, abs=2.0 / RATE_HZ)
    kinds = {message["type"] for _, message in text["messages"]}
    assert {"SetCameraPositionMessage", "SetCameraLookAtMessage", "BatchedMeshesMessage"} <= kinds
    moved = {round(t, 3) for t, m in text["messages"] if "batched_wxyzs" in m.get("updates", ())}
    assert sorted(moved) == pytest.approx(np.arange(0.0, duration_s - 0.02, 1.0 / RATE_HZ).tolist())


def test_it_is_an_export_and_needs_a_figure() -> None:
    content = open_walk()
    assert b"__VISER_EMBED_DATA__" in write_export("walk", content)
    without = {name: read() for name, read in content.files.items() if name != "poses.parquet"}
    with pytest.raises(FormatError, match=r"no poses\.parquet"):
        write_export("walk", open_walk(files=without))
