"""Undescribed tables: guess, preview, description, and reuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sagittal.core.formats import SourceFile, manifest_of, read_recording
from sagittal.core.frames import GRAVITY
from tests.core.formats.making import signals
from tests.helpers.clinic import Clinic
from tests.server.api.uploads.test_files import API, new_session

pytestmark = pytest.mark.anyio

ACC, GYR = signals(1500, still=300)


def table(header: str = "n;acc_x;acc_y;acc_z;gyr_x;gyr_y;gyr_z") -> bytes:
    rows = np.hstack([np.arange(len(ACC))[:, None], ACC / GRAVITY, np.degrees(GYR)])
    return (header + "\n" + "\n".join(";".join(f"{v:.5f}" for v in row) for row in rows)).encode()


async def uploaded(clinic: Clinic, code: str, files: dict[str, bytes]) -> str:
    session = await new_session(clinic, code)
    async with clinic.client("clinician") as client:
        for name, data in files.items():
            assert (await client.put(f"{API}/sessions/{session}/files/{name}", content=data)).is_success
    return f"{API}/sessions/{session}"


@pytest.mark.slow
async def test_a_table_is_described_once_and_its_shape_is_known_from_then_on(clinic: Clinic) -> None:
    files = {"one_lf.csv": table(), "two_rf.csv": table()}
    position = await uploaded(clinic, "TABLES-1", {**files, "notes.txt": b"no table"})
    async with clinic.client("clinician") as client:
        (shape,) = (await client.get(f"{position}/tables")).json()
        assert shape["files"] == list(files)
        assert shape["basis"] == "guessed"
        assert (shape["source"]["acc_unit"], shape["source"]["gyr_unit"]) == ("g", "deg/s")
        ask: dict[str, Any] = {"file": "one_lf.csv", "source": shape["source"]}
        refused = await client.post(f"{position}/tables/checks", json=ask)
        assert (refused.status_code, refused.json()["code"]) == (422, "rate_missing")
        source = shape["source"] | {"rate_hz": 100}
        (check,) = (await client.post(f"{position}/tables/checks", json=ask | {"source": source})).json()
        assert check["sensor"] == "foot_l"
        assert check["rate_hz"] == 100.0
        assert check["at_rest_mps2"] == pytest.approx(GRAVITY, abs=0.1)
        assert check["problems"] == []
        wrong = source | {"acc_unit": "m/s2", "gyr_unit": "rad/s"}
        (check,) = (await client.post(f"{position}/tables/checks", json=ask | {"source": wrong})).json()
        assert len(check["problems"]) == 2

        answer = await client.put(f"{position}/tables", json={"files": list(files), "source": source})
        manifest = answer.json()["manifest"]
        inputs = [SourceFile.of_bytes(name, data) for name, data in files.items()]
        assert list(read_recording(inputs, manifest_of(manifest)).streams) == ["foot_l", "foot_r"]
        (shape,) = (await client.get(f"{position}/tables")).json()
        assert (shape["basis"], list(shape["source"]["columns"])) == ("said", ["*"])

        second = await uploaded(
            clinic, "TABLES-2", {"three.csv": table(), "other.csv": table("n;a;b;c;d;e;f")}
        )
        assert (await client.post(f"{second}/inspections")).status_code == 202
        manifest = (await client.get(f"{second}/recording")).json()["manifest"]
        assert [(s["file"], s["rate_hz"], list(s["columns"])) for s in manifest["sources"]] == [
            ("three.csv", 100, ["three"])
        ]

        # what does not come out right is not taken over
        broken = await uploaded(clinic, "TABLES-3", {"four.csv": table().replace(b";0.", b";7.")})
        assert (await client.post(f"{broken}/inspections")).status_code == 202
        assert (await client.get(f"{broken}/recording")).json()["manifest"] is None


async def test_what_is_no_file_or_no_entry_is_refused(clinic: Clinic) -> None:
    position = await uploaded(clinic, "TABLES-4", {"one.csv": table()})
    async with clinic.client("clinician") as client:
        for files, source, code in (
            (["two.csv"], {"columns": {}}, "not_found"),
            (["one.csv"], {"columns": {"*": {}}, "speed": 1}, "manifest_unknown_key"),
            (["one.csv"], {"columns": {}}, "manifest_bad_value"),
        ):
            refused = await client.put(f"{position}/tables", json={"files": files, "source": source})
            assert (refused.status_code in (404, 422), refused.json()["code"]) == (True, code)
    async with clinic.client("viewer") as client:
        assert (await client.get(f"{position}/tables")).status_code == 403
