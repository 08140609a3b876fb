"""neura_walk for tests: the product's chain, and Vicon's strides and sensor headings.

No Vicon data enter an estimate. Body height and sensor positions are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from sagittal.core.angles.measure import measure_angles
from sagittal.core.body import BodyModel
from sagittal.core.body.arms import measure_arms
from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.headings import align_forward_axes
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.poses import ErkfRun, foot_tracks, replace_orientations, run_erkf
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.body.tree import PRESETS
from sagittal.core.calibration import calibrate
from sagittal.core.events.result import StrideFlag
from sagittal.core.frames import SIDES, SUFFIX, Floats, Segment, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import from_matrix, multiply, rotate
from sagittal.core.signals.calibrated import CalibratedRecording
from tests.data import data_folder
from tests.helpers.kept import keep_recorded
from tests.helpers.walks import neura_walk

HEIGHT_M = 1.70
BODY = BodyModel.from_height(HEIGHT_M)
SEGMENTS = PRESETS["lower_body7"]
RATE = 100.0
WALK = slice(1110, 2080)

SHIPPED = PoseParams().erkf
"""The set the pipeline uses."""

TURNING = np.radians(20.0)
"""Turn of the foot from one stance to the next beyond which a stride is a turning one."""

STRAIGHT: frozenset[StrideFlag] = frozenset(("first", "last", "near_turn"))
"""Flags of whole strides ahead: the product hardly counts them, both sides of a comparison walk them."""

MARKERS: dict[Segment, tuple[str, ...]] = {
    "pelvis": ("LPSI", "RPSI"), "thigh_r": ("RTHI",), "shank_r": ("RTIB",), "foot_r": ("RHEE", "RTOE"),
    "thigh_l": ("LTHI",), "shank_l": ("LTIB",), "foot_l": ("LHEE", "LTOE"),
}  # fmt: skip
"""Vicon markers next to each sensor."""


@dataclass(frozen=True, eq=False)
class Chain:
    """The product's seven-sensor chain: refined anterior axes, ErKF and smoother."""

    run: ErkfRun
    calibrated: CalibratedRecording
    orientations: Orientations
    turned: dict[Segment, float]

    @property
    def angles_deg(self) -> dict[str, Floats]:
        """Raw (not zeroed) angles by name in degrees."""
        return angles_deg(self.orientations, self.calibrated)

    def ankle(self, side: Side) -> Floats:
        """Path (n, 3) of the ankle centre, m, as distances are measured on it."""
        return foot_tracks(self.run, self.orientations, BODY).p[side]

    def strides_cm(self) -> dict[Side, Floats]:
        return {s: 100 * stride_errors_m(s, self.ankle(s)) for s in SIDES}

    def residual_mm(self) -> Floats:
        """RMS distance of the two ends of each joint while walking."""
        return np.asarray(1000 * np.sqrt(np.mean(self.run.track.joint_residual[WALK] ** 2, axis=0)))


@keep_recorded
def take() -> tuple[CalibratedRecording, Orientations]:
    """The walk calibrated, and its orientations from six axes."""
    calibrated = calibrate(neura_walk())
    return calibrated, estimate_orientations(calibrated)


def chain(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    params: ErkfParams | None = None,
    agree: bool = True,
    measured: bool = True,
) -> Chain:
    """The product's chain on a calibrated take.

    Parameters
    ----------
    agree : turn forward axes that the joints contradict. measured : places and centres from motion.
    """
    params = params or SHIPPED
    turned: dict[Segment, float] = {}
    if agree:
        calibrated, orientations, turned = align_forward_axes(
            calibrated, orientations, BODY, SEGMENTS, params
        )
    arms = measure_arms(calibrated, orientations, BODY, SEGMENTS) if measured else None
    run = run_erkf(calibrated, orientations, BODY, SEGMENTS, params, arms)
    return Chain(run, calibrated, replace_orientations(run, orientations), turned)


@keep_recorded
def healthy() -> Chain:
    return chain(*take())


def angles_deg(orientations: Orientations, calibrated: CalibratedRecording) -> dict[str, Floats]:
    """Raw (not zeroed) angles by name in degrees."""
    angles = measure_angles(orientations, calibrated.calibration.zero)
    return {name: np.degrees(x + angles.zero_offset[name]) for name, x in angles.angles.items()}


@cache
def true_strides(side: Side) -> tuple[tuple[int, int, float], ...]:
    """Straight strides of one foot: middles of two reviewed still phases (samples), Vicon's length, m."""
    folder = data_folder("neura_walk")
    (flags_file,) = (folder / "rawstep-detect").glob("*.csv")
    flags = np.genfromtxt(flags_file, delimiter=",", names=True)[f"step{side[0].upper()}"]
    table = np.genfromtxt(folder / "reference_angles.csv", delimiter=",", names=True)
    ankle, heel = (
        np.stack([table[f"{point}_{axis}_{SUFFIX[side]}_m"] for axis in "xy"], axis=1)
        for point in ("ankle", "heel")
    )
    along = ankle - heel
    heading = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    edges = np.diff(np.concatenate(([0], flags.astype(int), [0])))
    result = []
    for (a, b), (c, d) in pairwise(zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)):
        first, last = int(a + b) // 2, int(c + d) // 2
        length = float(np.linalg.norm(ankle[last] - ankle[first]))
        if length > 0.3 and abs(heading[last] - heading[first]) < TURNING:
            result.append((first, last, length))
    return tuple(result)


def stride_errors_m(side: Side, ankle: Floats) -> Floats:
    """Estimated minus Vicon length of the straight strides of one foot."""
    return np.array(
        [np.linalg.norm((ankle[b] - ankle[a])[:2]) - length for a, b, length in true_strides(side)]
    )


def sensor_q(calibrated: CalibratedRecording, orientations: Orientations) -> Floats:
    """Orientations (n, 7, 4) of the sensors in W."""
    mounts = {s: calibrated.calibration.segments[s].R_segment_sensor for s in SEGMENTS}
    return np.stack([multiply(orientations.q[s], from_matrix(mounts[s])) for s in SEGMENTS], axis=1)


def heading_against_vicon_deg(q: Floats) -> Floats:
    """Heading errors (7,) of the sensors relative to the pelvis', degrees, left positive.

    The turn about the vertical that lays a sensor's horizontal acceleration upon that of the markers next to
    it, both below 3 Hz, over the whole walk, lag −2 to +6 samples
    (docs/science/real-recordings.md, "Heading"). On the left this reference and the joints contradict each
    other by 7°, on the right they agree.
    """
    from scipy.io import loadmat
    from scipy.signal import butter, sosfiltfilt

    sos = butter(2, 3.0 / (RATE / 2), output="sos")
    vicon = loadmat(str(data_folder("neura_walk") / "rawvicon" / "S02-Trial-Walk-1.mat"), squeeze_me=True)
    acc, _, _ = correct_signals(take()[0], SEGMENTS)
    off = []
    for i, segment in enumerate(SEGMENTS):
        p = np.mean([vicon[m] for m in MARKERS[segment]], axis=0) / 1000.0
        true = np.gradient(np.gradient(p, 1 / RATE, axis=0), 1 / RATE, axis=0)
        ours = rotate(q[:, i], acc[:, i])
        a, b = (sosfiltfilt(sos, x[:, :2], axis=0) @ np.array([1.0, 1.0j]) for x in (ours, true))
        best = min(
            (float(np.mean(np.abs(x * np.exp(1j * turn) - b[WALK]) ** 2)), turn)
            for lag in range(-2, 7)
            for x in [np.roll(a, -lag)[WALK]]
            for turn in [float(np.angle(np.vdot(x, b[WALK])))]
        )
        off.append(-best[1])
    return np.asarray(np.degrees(np.angle(np.exp(1j * (np.array(off) - off[0])))))
