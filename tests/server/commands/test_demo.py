"""Messages of `sagittal demo` about its live walk are true when printed."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.commands.demo import _wait_for_live
from sagittal.server.live_takes import live
from tests.helpers.clinic import open_clinic


def helper(seconds: int) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({seconds})"])


@pytest.mark.anyio
async def test_the_walk_is_announced_when_it_streams_and_not_before(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:
        with clinic.db.write() as c:
            patient = patients.create(c, None, code="P-1").id
            take, code = live.open_take(c, None, sessions.create(c, None, patient).id)
            live.pair(c, code)
        with helper(0) as ended:
            assert not _wait_for_live(clinic.settings.database_source, ended)
        with helper(60) as walking, ThreadPoolExecutor(1) as waiting:
            announced = waiting.submit(_wait_for_live, clinic.settings.database_source, walking)
            assert not announced.done()
            with clinic.db.write() as c:
                live.note_start(c, take.id, "replay")
            assert announced.result(timeout=30)
            walking.kill()
