"""ipol_walks for tests: walks of healthy adults with lost packets and hand-checked events."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np

from core.events.result import EventKind
from core.formats import SourceFile, parse_manifest, read_recording
from core.frames import Floats, Side
from core.recording import Recording
from tests.data import data_folder

RATE = 100.0
SUBJECTS = ("11", "12", "13", "14")


def ipol_manifest() -> bytes:
    """Manifest of three tab-separated tables with one packet counter: two shoes and the low back."""
    names = {kind: [f"{kind}_{axis}" for axis in "XYZ"] for kind in ("Acc", "Gyr", "Mag")}
    columns = {"acc": names["Acc"], "gyr": names["Gyr"], "mag": names["Mag"]}
    entry = {
        "skip_rows": 1,
        "separator": "\t",
        "counter": {"column": "PacketCounter", "rate_hz": RATE},
        "acc_unit": "m/s2",
        "gyr_unit": "rad/s",
    }
    places = {"*_lf.txt": "foot_l", "*_rf.txt": "foot_r", "*_lb.txt": "pelvis"}
    sources = [{"file": file, "columns": {place: columns}, **entry} for file, place in places.items()]
    return json.dumps({"sources": sources}).encode()


def ipol_trials() -> tuple[str, ...]:
    """All walks, "subject-trial"."""
    return tuple(sorted(path.stem for path in data_folder("ipol_walks").glob("*.json")))


@cache
def ipol_recording(trial: str) -> Recording:
    """A walk as its files say it."""
    folder = data_folder("ipol_walks")
    files = [SourceFile.of_path(path) for path in sorted(folder.glob(f"{trial}_*.txt"))]
    return read_recording(files, parse_manifest(ipol_manifest()))


@cache
def _said(trial: str) -> dict[str, Any]:
    text = (data_folder("ipol_walks") / f"{trial}.json").read_text()
    found: dict[str, Any] = json.loads(text)
    return found


def ipol_events(trial: str, side: Side, kind: EventKind) -> tuple[float, ...]:
    """Hand-checked events of one foot, s: samples of the packet counter, whose first is time 0."""
    pairs: Floats = np.array(_said(trial)[f"{side.capitalize()}FootEvents"], np.float64)
    return tuple((pairs[:, 0 if kind == "tc" else 1] / RATE).tolist())
