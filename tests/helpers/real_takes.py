"""Real recordings by name, whole or cut, and their analyses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.io import loadmat

from sagittal.core.frames import Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import ImuStream, Recording
from tests.data import data_folder
from tests.helpers.gaitmap import RATE, analysed, recording_of, signals
from tests.helpers.ipol import WALKS, ipol_analysis, ipol_recording
from tests.helpers.walks import neura_analysis, neura_recording

UNCUT = ("neura_walk", "gaitmap_foot", "qmt_fullbody")
NAMES = (*UNCUT, *WALKS)
QMT: Mapping[str, Segment] = {
    "foot_left": "foot_l", "foot_right": "foot_r", "lower_leg_left": "shank_l", "lower_leg_right": "shank_r",
    "upper_leg_left": "thigh_l", "upper_leg_right": "thigh_r", "hip": "pelvis",
}  # fmt: skip


def _qmt() -> Recording:
    data = loadmat(
        data_folder("qmt_fullbody") / "full_body_example_data.mat", squeeze_me=True, struct_as_record=False
    )
    streams = {}
    for name in QMT:
        acc, gyr = (np.array(getattr(data[name], k), np.float64) for k in ("acc", "gyr"))
        t = np.arange(len(acc)) / 100.0
        streams[name] = ImuStream(name, "full_body", t, acc, gyr, None, None, 100.0, "counter", name)
    return Recording(streams, dict(QMT))


def read_take(name: str) -> Recording:
    if name == "neura_walk":
        return neura_recording()
    if name == "gaitmap_foot":
        return recording_of(signals("imu_sample.csv"), RATE)
    if name == "qmt_fullbody":
        return _qmt()
    return ipol_recording(name)


def analyse_take(name: str) -> TakeAnalysis:
    if name == "neura_walk":
        return neura_analysis()
    if name == "gaitmap_foot":
        return analysed()
    return analyse(_qmt()) if name == "qmt_fullbody" else ipol_analysis(name)


def cut_recording(recording: Recording, start_s: float, end_s: float) -> Recording:
    """Samples of [start, end) of every stream, time from zero again."""
    streams = {}
    for device, s in recording.streams.items():
        k = (s.t_s >= start_s) & (s.t_s < end_s)
        streams[device] = replace(
            s,
            t_s=s.t_s[k] - start_s,
            acc=s.acc[k].copy(),
            gyr=None if s.gyr is None else s.gyr[k].copy(),
            mag=None,
            quat=None,
            digest=f"{s.digest} from {start_s}",
        )
    return replace(recording, streams=streams)
