"""The strides of 42 healthy adults that the shipped curves and scores were computed from."""

from __future__ import annotations

import csv
import gzip
from functools import cache

import numpy as np

from sagittal.core.frames import Floats, Side
from sagittal.core.norms.profile import MeanCurves
from tests.data import data_folder

SIDE: dict[str, Side] = {"L": "left", "R": "right"}


@cache
def people() -> tuple[MeanCurves, ...]:
    """One stride per side of every person in degrees; skips where the data folder is absent."""
    result: dict[str, dict[Side, dict[str, Floats]]] = {}
    with gzip.open(data_folder("norms") / "wbds_strides_42subjects.csv.gz", "rt", encoding="utf-8") as lines:
        for r in csv.DictReader(lines):
            curve = np.array([float(r[f"p{i}"]) for i in range(101)])
            result.setdefault(r["subject"], {}).setdefault(SIDE[r["side"]], {})[r["variable"]] = curve
    return tuple(result.values())
