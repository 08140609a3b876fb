"""Run the programs of docs/reference/api.md against a real server and worker."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from sagittal.core.simulate import Stand, Straight, mt_files, simulate
from sagittal.server.processes.supervisor import Workers
from tests.data import ROOT
from tests.helpers.clinic import PASSWORD, open_clinic
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

PROGRAMS = dict(
    re.findall(r"```(bash|python)\n(.*?)```", (ROOT / "docs" / "reference" / "api.md").read_text(), re.DOTALL)
)
RUNNERS = {"bash": ["bash", "-c"], "python": [sys.executable, "-c"]}


@pytest.mark.slow
async def test_the_programs_upload_analyse_and_download(tmp_path: Path) -> None:
    assert set(PROGRAMS) == set(RUNNERS)
    if shutil.which("curl") is None:
        pytest.skip("curl is not installed")
    simulation = simulate((Stand(5.0), Straight(12.8, 0.64, 0.54), Stand(4.0)), seed=5)
    take = tmp_path / "take"
    take.mkdir()
    for name, content in mt_files(simulation.recording, "walk", simulation.first_counter).items():
        (take / name).write_bytes(content)
    (take / "manifest.json").write_text(json.dumps({"sensors": dict(simulation.recording.segments)}))
    async with open_clinic(tmp_path / "data") as clinic, serve(clinic.app) as port:
        clinic.user("clinician")
        workers = Workers(clinic.settings)
        workers.start()
        try:
            for language, program in PROGRAMS.items():
                address = tmp_path / language
                address.mkdir()
                await _run([*RUNNERS[language], program], address, f"http://127.0.0.1:{port}", take)
        finally:
            workers.stop()
    assert "stride_time_s,left" in (tmp_path / "bash" / "parameters.csv").read_text()
    assert '"state":"done"' in (tmp_path / "bash" / "progress.txt").read_text().splitlines()[-2]
    assert json.loads((tmp_path / "python" / "analysis.json").read_text())["parameters"]
    assert (tmp_path / "python" / "angles.parquet").stat().st_size > 1000


async def _run(command: list[str], place: Path, url: str, take: Path) -> None:
    env = {**os.environ, "URL": url, "NAME": "clinician", "PASSWORD": PASSWORD, "FILES": str(take)}
    process = await asyncio.create_subprocess_exec(
        *command, cwd=place, env=env, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    output, _ = await asyncio.wait_for(process.communicate(), 300)
    assert process.returncode == 0, output.decode()
