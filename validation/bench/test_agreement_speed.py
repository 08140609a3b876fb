"""What comparing the sensors costs, against laying the orientations of the same take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sagittal.core.agreement import check_agreement
from sagittal.core.calibration import calibrate
from sagittal.core.frames import Floats
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from tests.helpers.pairs import in_pairs
from tests.helpers.perturbations import delay_sensor
from tests.helpers.walks import only, simulated

MOST = {"clean": 1.6, "late": 1.8}
"""CPU of exchange, lags, drifts and slips over that of calibration and orientation."""


def ten_minutes() -> UniformRecording:
    """Five minutes with seven sensors, twice."""
    simulation = simulated("five_minutes", 0)[0]
    single = only(simulation, *(s for s in simulation.sensors if s != "chest"))

    def twice(x: Floats) -> Floats:
        return np.concatenate((x, x))

    def both(x: SensorSignals) -> SensorSignals:
        second_concatenates = (np.concatenate((v, v)) for v in (x.valid, x.interpolated))
        return SensorSignals(x.device_id, twice(x.acc), twice(x.gyr), None, *second_concatenates)

    t_s = np.arange(2 * len(single.t_s)) / single.rate_hz
    return replace(single, t_s=t_s, sensors={s: both(x) for s, x in single.sensors.items()})


def test_comparing_ten_minutes_of_seven_sensors_costs_a_few_orientations() -> None:
    take = ten_minutes()
    takes = {"clean": take, "late": delay_sensor(take, "shank_r", 0.04)}
    for name, recording in takes.items():
        check_agreement(recording)
        ours, remaining, ratio = in_pairs(
            lambda recording=recording: check_agreement(recording),  # type: ignore[misc]
            lambda: estimate_orientations(calibrate(take)),
            times=3,
        )
        print(f"{name}: {ours:.2f} s, calibration and orientation {remaining:.2f} s, ratio {ratio:.2f}")
        assert ratio < MOST[name]
