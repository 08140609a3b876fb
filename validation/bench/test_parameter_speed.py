"""All parameters of a ten-minute walk with seven sensors, from the tracks that an analysis leaves."""

from __future__ import annotations

import statistics
import sys
import time
from dataclasses import replace
from math import pi

import numpy as np

from sagittal.core.parameters import take_figures
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.simulate import Arc, Stand, Straight, simulate
from tests.helpers.true_walks import true_tracks

LIMIT_S = 0.06
"""Of all parameters of ten minutes."""
BUSY = 3.0
"""The same code took 0.10 and 0.18 s on one machine within a minute, and takes half of it now: only gross
losses fail."""

RUNS = 9


def test_all_parameters_of_ten_minutes_are_there_at_once() -> None:
    half = (Straight(20.0, 0.64, 0.54), Arc(1.5, pi, 0.52, 0.56))
    truth = simulate((Stand(8.0), *half * 28, Stand(5.0)), seed=3).truth
    assert truth.t_s[-1] >= 600.0
    tracks = true_tracks(truth)
    velocity = np.gradient(truth.p["pelvis"], truth.t_s, axis=0)
    tracks = replace(tracks, trunk={"pelvis": np.gradient(velocity, truth.t_s, axis=0)})
    measured = measure_gait(tracks)
    assert len(measured.strides.select_used()) > 500
    assert sum(p.mean is not None for p in measured.parameters) > 80
    whole, figures = [], []
    for _ in range(RUNS):
        began = time.process_time()
        measure_gait(tracks)
        whole.append(time.process_time() - began)
        began = time.process_time()
        take_figures(measured.strides, tracks.angles, tracks, tracks.feet, tracks.surface, tracks.trunk)
        figures.append(time.process_time() - began)
    result = {"parameters": statistics.median(figures), "with events and strides": statistics.median(whole)}
    sys.stdout.write(f"{len(measured.strides.strides)} strides, CPU s {result}\n")
    assert statistics.median(figures) <= BUSY * LIMIT_S
    assert statistics.median(whole) <= BUSY * LIMIT_S
