"""What docs/reference/live-protocol.md shows is what happens."""

from __future__ import annotations

import asyncio
import json
import os
import re
import sys

import numpy as np
import pytest

from sagittal.core.formats.live_log import decode_batch, parse_hello, record
from sagittal.server.live.protocol import FINAL, CloseCode
from sagittal.server.live_takes import live
from tests.data import ROOT
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import new_session

pytestmark = pytest.mark.anyio

TEXT = (ROOT / "docs" / "reference" / "live-protocol.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", TEXT, re.DOTALL)


async def test_the_whole_client_streams_a_take(clinic: Clinic, port: int) -> None:
    (program,) = [body for language, body in BLOCKS if language == "python"]
    session = new_session(clinic)
    with clinic.db.write() as c:
        take, code = live.open_take(c, None, session)
    env = {**os.environ, "SERVER": f"http://127.0.0.1:{port}", "CODE": code}
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        program,
        env=env,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    output, _ = await asyncio.wait_for(process.communicate(), 60)
    assert process.returncode == 0, output.decode()
    with clinic.db.read() as c:
        row = live.get(c, take.id)
    assert (row.state, row.count, row.problem) == ("finished", 100, None)
    assert output.decode().strip() == f"recording {row.recording_id}"


def test_the_bytes_of_the_example_are_a_batch() -> None:
    (view,) = [body for _, body in BLOCKS if body.startswith("53474c31")]
    batch = decode_batch(bytes.fromhex("".join(view.split())))
    assert (batch.stream, batch.seq, batch.t0_us, batch.sent_us) == (0, 0, 1_000_000, 1_012_000)
    np.testing.assert_array_equal(
        batch.samples, np.array([[[0, 0, 9.81, 0, 0, 0.5, np.nan, np.nan, np.nan]]], np.float32)
    )


def test_the_hello_of_the_example_is_one() -> None:
    (view,) = [body for _, body in BLOCKS if '"type": "hello"' in body and body.startswith("{")]
    hello = parse_hello(view)
    assert [s.clock for s in hello.streams] == ["own", "own"]
    assert json.loads(view)["token"]


def test_every_close_code_is_in_the_table_with_whether_to_come_back() -> None:
    table = TEXT.split("## Close codes")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (\d{4}) \| .* \| (no|yes)\b", table, re.MULTILINE)
    message = {int(code): back for code, back in rows}
    assert set(message) == set(CloseCode)
    assert {code for code, back in message.items() if back == "no"} == FINAL | {CloseCode.DONE}


def test_the_log_begins_as_described() -> None:
    one = record("B", b"x")
    assert (int.from_bytes(one[:4], "little"), one[8:]) == (2, b"Bx")
