"""The commands of docs/tutorials run as they stand and write what the page says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.data import ROOT

PAGE = (ROOT / "docs" / "tutorials" / "first-walk.md").read_text("utf-8")


@pytest.mark.slow
def test_the_commands_of_the_first_walk_run(tmp_path: Path) -> None:
    commands, demo = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    assert demo == "sagittal demo\n"
    for line in commands.splitlines():
        program, *arguments = line.split()
        assert program == "sagittal"
        made = subprocess.run(
            [sys.executable, "-m", "sagittal.server.main", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert made.returncode == 0, made.stderr
    assert (tmp_path / "walk" / "truth").exists()
    named = set(re.findall(r"`(\w+\.(?:csv|parquet|json))`", PAGE))
    assert len(named) == 4
    assert named <= {p.name for p in (tmp_path / "results").iterdir()}
    assert list((tmp_path / "results").glob("*.xlsx"))
