"""With an untested version of Numba the filter uses scalar code with identical bits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

RUN = """
import hashlib, sys
import numba

numba.__version__ = sys.argv[1] or numba.__version__
from sagittal.core.body.erkf import lanes
from sagittal.core.body.erkf.params import ErkfParams
from tests.core.body.erkf.walks import MIXED, smoothed, take_of
from sagittal.core.simulate import RecordingSetup, Stand, simulate

take = take_of(simulate((*MIXED[:2], Stand(4.0)), seed=2, setup=RecordingSetup()))
bits = hashlib.sha256()
for params in (ErkfParams.offline(), ErkfParams.live()):
    track = smoothed(take, params)
    for x in (track.p, track.q, track.heading_sd, track.joint_residual):
        for part in x if isinstance(x, tuple) else (x,):
            bits.update(part.tobytes())
print(lanes.STEP, bits.hexdigest())
"""


@pytest.mark.sweep
def test_untested_versions_of_the_compiler_give_the_same_bits(tmp_path: Path) -> None:
    reference, unknown = (
        subprocess.run(
            [sys.executable, "-c", RUN, version],
            env={"PATH": "", "PYTHONPATH": ".", **cache},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for version, cache in (("", {}), ("0.999.0", {"NUMBA_CACHE_DIR": str(tmp_path)}))
    )
    assert (reference[0], unknown[0]) == ("8", "1")
    assert reference[1] == unknown[1]
