"""`sagittal simulate`: write a simulated recording with its ground truth in the usual file formats."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sagittal.server.commands.options import Seed
from sagittal.server.storage import fs

if TYPE_CHECKING:
    from sagittal.core.simulate import ChestTruth, FunctionalTruth, SquatTruth, WalkTruth
    from sagittal.core.simulate.tug import ChairTruth


ACTIVITY: Final = "activity"
"""Script name for hours of daily life."""


def simulate(*, out: Path, script: str = "comfortable", seed: Seed = 1, hours: float = 24.0) -> int:
    """Write `recording.parquet` and `truth/` into `out`; 2 = unknown script.

    Ground truth of a walk: angles, events, strides; of squats, leg swings and bows: angles, phases; of a
    chest sensor: trunk, phases; of a test that begins on a chair: trunk, segments, scripted changes; of daily
    life: phases and steps.

    Parameters
    ----------
    out
        folder for recording and ground truth
    script
        comfortable, fast_with_turns, hemiparetic, squats, postures, activity … (docs/science/simulation.md)
    hours
        duration of daily life, --script activity (default 24)
    """
    from sagittal.core.formats import write_recording
    from sagittal.core.simulate import (
        IMPAIRED_WALKS,
        MOVEMENTS,
        SCRIPTS,
        Simulation,
        simulate_movement,
        simulate_scenario,
    )
    from sagittal.core.simulate.functional import FunctionalSimulation
    from sagittal.core.simulate.squat import SquatSimulation
    from sagittal.core.simulate.tug import ChairSimulation

    if script == ACTIVITY:
        return _simulate_activity(out, seed, hours)
    walks = {**SCRIPTS, **IMPAIRED_WALKS}
    if script not in walks and script not in MOVEMENTS:
        names = ", ".join((*walks, *MOVEMENTS, ACTIVITY))
        sys.stderr.write(f"No script '{script}'; expected one of {names}.\n")
        return 2
    simulation = simulate_scenario(script, seed) if script in walks else simulate_movement(script, seed)
    if isinstance(simulation, Simulation):
        files, facts = _walk(simulation.truth)
    elif isinstance(simulation, SquatSimulation):
        files, facts = _squats(simulation.truth)
    elif isinstance(simulation, FunctionalSimulation):
        files, facts = _functional(simulation.truth)
    elif isinstance(simulation, ChairSimulation):
        files, facts = _chair(simulation.truth)
    else:
        files, facts = _chest(simulation.truth)
    title = (walks[script] if script in walks else MOVEMENTS[script]).title
    truth = {"script": script, "title": title, "seed": seed, **facts}
    files |= {
        "recording.parquet": write_recording(simulation.recording),
        "truth/truth.json": json.dumps(truth, indent=1).encode(),
    }
    _write_files(out, files)
    sys.stdout.write(f"{title}, {simulation.truth.t_s[-1]:.1f} s, seed {seed}, in {out}\n")
    sys.stdout.flush()
    return 0


def _simulate_activity(out: Path, seed: int, hours: float) -> int:
    """Write hours of daily life of one chest sensor."""
    from sagittal.core.errors import ParameterError
    from sagittal.core.formats import write_recording
    from sagittal.core.simulate import phase_table
    from sagittal.core.simulate.daily import plan_daily_life, record_daily_life, simulate_daily_life

    try:
        simulation = simulate_daily_life(plan_daily_life(hours, seed), seed=seed)
    except ParameterError as error:
        sys.stderr.write(f"{error.message}\n")
        return 2
    truth = {"script": ACTIVITY, "title": "Daily life", "seed": seed, "steps_s": simulation.steps_s.tolist()}
    files = {
        "recording.parquet": write_recording(record_daily_life(simulation)),
        "truth/phases.csv": _csv(phase_table(simulation.phases)),
        "truth/truth.json": json.dumps(truth, indent=1).encode(),
    }
    _write_files(out, files)
    sys.stdout.write(f"Daily life, {simulation.stream.duration_s / 3600:.1f} h, seed {seed}, in {out}\n")
    sys.stdout.flush()
    return 0


def _write_files(out: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        fs.make_folder((out / name).parent)
        fs.write_file(out / name, content)


Made = tuple[dict[str, bytes], dict[str, object]]


def _walk(truth: WalkTruth) -> Made:
    from sagittal.core.angles import JointAngles
    from sagittal.core.simulate import event_table, stride_table
    from sagittal.server.report.files.exports import angles_parquet

    strides: dict[str, Sequence[object]] = dict(stride_table(truth))
    del strides["turn_rad"]
    strides["turn_deg"] = [math.degrees(s.turn_rad) for s in truth.strides]
    files = {
        "truth/angles.parquet": angles_parquet(
            JointAngles(truth.t_s, truth.subtract_standing(), truth.zero_offset)
        ),
        "truth/events.csv": _csv(event_table(truth)),
        "truth/strides.csv": _csv(strides),
    }
    walks = [(a[1], b[0]) for a, b in pairwise(truth.stands)]
    return files, {"zero_s": truth.zero, "stands_s": truth.stands, "walks_s": walks}


def _squats(truth: SquatTruth) -> Made:
    from sagittal.core.angles import JointAngles
    from sagittal.core.simulate import phase_table
    from sagittal.server.report.files.exports import angles_parquet

    files = {
        "truth/angles.parquet": angles_parquet(
            JointAngles(truth.t_s, truth.subtract_standing(), truth.zero_offset)
        ),
        "truth/phases.csv": _csv(phase_table(truth.phases)),
    }
    return files, {"depths_deg": [math.degrees(depth) for depth in truth.depths_rad]}


def _functional(truth: FunctionalTruth) -> Made:
    from sagittal.core.angles import JointAngles
    from sagittal.core.simulate import phase_table
    from sagittal.server.report.files.exports import angles_parquet

    zero = {name: float(values[0]) for name, values in truth.angles.items()}
    from_standing = {name: values - zero[name] for name, values in truth.angles.items()}
    files = {
        "truth/angles.parquet": angles_parquet(JointAngles(truth.t_s, from_standing, zero)),
        "truth/phases.csv": _csv(phase_table(truth.phases)),
    }
    return files, {}


def _chair(truth: ChairTruth) -> Made:
    from sagittal.core.simulate import phase_table

    trunk = {
        "t_s": truth.t_s.tolist(),
        "trunk_lean_deg": [math.degrees(lean) for lean in truth.chest_rad.tolist()],
        "hip_height_m": truth.height_m.tolist(),
        "heading_deg": [math.degrees(heading) for heading in truth.heading_rad.tolist()],
    }
    parts = truth.segments or truth.changes
    files = {
        "truth/trunk.csv": _csv(trunk),
        "truth/segments.csv": _csv(phase_table(parts)),
        "truth/scripted.csv": _csv(phase_table(truth.scripted)),
    }
    return files, {"duration_s": truth.duration_s, "contacts_s": list(truth.contacts_s)}


def _chest(truth: ChestTruth) -> Made:
    from sagittal.core.simulate import phase_table

    trunk = {
        "t_s": truth.t_s.tolist(),
        "trunk_pitch_deg": [math.degrees(pitch) for pitch in truth.pitch_rad.tolist()],
        "height_m": truth.height_m.tolist(),
        "forward_m": truth.forward_m.tolist(),
    }
    files = {"truth/trunk.csv": _csv(trunk), "truth/phases.csv": _csv(phase_table(truth.phases))}
    return files, {"steps_s": truth.steps_s.tolist()}


def _csv(columns: Mapping[str, Sequence[object]]) -> bytes:
    from sagittal.server.report.files.columns import write_csv

    return write_csv(tuple(columns), list(zip(*columns.values(), strict=True)))
