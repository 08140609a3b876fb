"""`sagittal simulate`: a recording and what really happened, in the files an analysis reads and writes."""

from __future__ import annotations

import json
import math
import sys
from itertools import pairwise
from pathlib import Path

from core.errors import SagittalError
from server.storage import fs


def simulate(out: Path, script: str, seed: int) -> int:
    """Write `recording.parquet` and `truth/` (angles, events, strides) into `out`; 2 = no such script."""
    from core.angles import JointAngles
    from core.formats import write_recording
    from core.simulate import SCRIPTS, event_table, simulate_scenario, stride_table
    from server.report.exports import angles_parquet, write_csv

    try:
        made = simulate_scenario(script, seed)
    except SagittalError as error:
        sys.stderr.write(f"{error.message}\n")
        return 2
    truth = made.truth
    events, strides = event_table(truth), stride_table(truth)
    strides["turn_deg"] = [math.degrees(float(turn or 0.0)) for turn in strides.pop("turn_rad")]
    files = {
        "recording.parquet": write_recording(made.recording),
        "truth/angles.parquet": angles_parquet(JointAngles(truth.t_s, truth.zeroed(), truth.zero_offset)),
        "truth/events.csv": write_csv(tuple(events), list(zip(*events.values(), strict=True))),
        "truth/strides.csv": write_csv(tuple(strides), list(zip(*strides.values(), strict=True))),
        "truth/truth.json": json.dumps(
            {
                "script": script,
                "title": SCRIPTS[script].title,
                "seed": seed,
                "zero_s": truth.zero,
                "stands_s": truth.stands,
                "walks_s": [(a[1], b[0]) for a, b in pairwise(truth.stands)],
            },
            indent=1,
        ).encode(),
    }
    for name, content in files.items():
        fs.make_folder((out / name).parent)
        fs.write_file(out / name, content)
    sys.stdout.write(f"{SCRIPTS[script].title}, {truth.t_s[-1]:.1f} s, seed {seed}, in {out}\n")
    sys.stdout.flush()
    return 0
