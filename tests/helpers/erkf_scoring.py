"""How far an ErKF run on a simulated walk is from the truth: angles, headings, strides."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from sagittal.core.body.erkf.filter import ErkfTrack
from sagittal.core.frames import FOOT, Floats
from sagittal.core.rotation import yaw
from tests.core.body.erkf.walks import SEGMENTS, Take, angles_of

JOINTS = {
    "hip": ("hip_flexion", "hip_adduction", "hip_rotation"),
    "knee": ("knee_flexion", "knee_adduction", "knee_rotation"),
    "ankle": ("ankle_dorsiflexion", "ankle_inversion", "ankle_rotation"),
}

FLAT_S = 0.22
"""From an initial contact to the middle of flat foot."""


@dataclass(frozen=True, eq=False)
class Score:
    """Root mean squares, the worse side.

    Parameters
    ----------
    hip, knee, ankle : (3,) flexion, adduction, rotation in degrees, not zeroed.
    heading : per sensor against the pelvis, degrees. drift : pelvis heading, end minus start, degrees.
    stride_bias, stride, width : mean, RMS and RMS in mm. residual : largest joint residual, mm.
    """

    hip: Floats
    knee: Floats
    ankle: Floats
    heading: float
    stride_bias: float
    stride: float
    width: float
    drift: float
    residual: float

    def row(self) -> list[str]:
        """Cells of `HEADER`."""
        angles = [" ".join(f"{x:.2f}" for x in getattr(self, joint)) for joint in JOINTS]
        strides = f"{self.stride_bias:+.1f} / {self.stride:.1f}"
        return [
            *angles,
            f"{self.heading:.2f}",
            strides,
            f"{self.width:.1f}",
            f"{self.drift:+.1f}",
            f"{self.residual:.1f}",
        ]


HEADER = [
    "hip flex add rot °", "knee °", "ankle °", "relative heading °", "stride bias / RMS mm", "width mm",
    "pelvis drift °", "joints apart mm",
]  # fmt: skip


def score(take: Take, track: ErkfTrack, from_s: float = 12.0) -> Score:
    """Compare from a time on; `from_s` leaves out the standing start, where headings are not yet found."""
    final_window, n = slice(round(from_s * take.rate_hz), None), len(track.q)
    result = angles_of(take, track, zeroed=False)

    def worst(name: str) -> float:
        pair = [
            result[f"{name}_{e}"][final_window] - take.truth.angles[f"{name}_{e}"][:n][final_window]
            for e in "rl"
        ]
        return max(rms(np.degrees(_wrap(e))) for e in pair)

    q = take.tree.segment_q(track.q)
    off = np.stack([_wrap(yaw(q[:, i]) - yaw(take.truth.q[s][:n])) for i, s in enumerate(SEGMENTS)])
    strides, widths = steps(take, track, from_s)
    angles = {joint: np.array([worst(name) for name in names]) for joint, names in JOINTS.items()}
    pelvis = np.degrees(np.unwrap(off[0])[final_window])
    return Score(
        hip=angles["hip"],
        knee=angles["knee"],
        ankle=angles["ankle"],
        heading=rms(np.degrees(_wrap(off[1:] - off[0])[:, final_window])),
        stride_bias=float(1e3 * strides.mean()),
        stride=1e3 * rms(strides),
        width=1e3 * rms(widths),
        drift=float(pelvis[-1] - pelvis[0]),
        residual=1e3 * max(rms(x) for x in track.joint_residual[final_window].T),
    )


def steps(take: Take, track: ErkfTrack, from_s: float) -> tuple[Floats, Floats]:
    """Found minus true length of each stride, and width between it and the other foot's stance in it, m."""
    origin = take.tree.segment_origin(track.p, track.q)
    lengths, widths = [], []
    stances = {s: np.array([x.start_s for x in take.truth.strides if x.side == s]) for s in FOOT}
    for stride in take.truth.strides:
        other_item = next(s for s in FOOT if s != stride.side)
        inside = stances[other_item][
            (stances[other_item] > stride.start_s) & (stances[other_item] < stride.end_s)
        ]
        times = np.array([stride.start_s, stride.end_s, *inside[:1]]) + FLAT_S
        k = np.round(times * take.rate_hz).astype(int)
        if stride.start_s < from_s or k.max() >= len(origin):
            continue
        place, target = FOOT[stride.side], FOOT[other_item]
        true = [
            take.truth.p[place][k[0]],
            take.truth.p[place][k[1]],
            *(take.truth.p[target][x] for x in k[2:]),
        ]
        i, j = SEGMENTS.index(place), SEGMENTS.index(target)
        ours = [origin[k[0], i], origin[k[1], i], *(origin[x, j] for x in k[2:])]
        lengths.append(_length(ours) - _length(true))
        if len(inside):
            widths.append(_width(ours) - _width(true))
    return np.array(lengths), np.array(widths)


def largest(scores: list[Score]) -> Score:
    """Largest of each figure over several runs."""

    def of(name: str) -> Floats:
        values = np.array([getattr(s, name) for s in scores])
        return np.asarray(np.take_along_axis(values, np.abs(values).argmax(axis=0)[None], axis=0)[0])

    single_by_name = {f.name: float(of(f.name)) for f in fields(Score) if f.name not in JOINTS}
    return Score(of("hip"), of("knee"), of("ankle"), **single_by_name)


def rms(x: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def _length(p: list[Floats]) -> float:
    return float(np.linalg.norm((p[1] - p[0])[:2]))


def _width(p: list[Floats]) -> float:
    """Distance of the third place from the line through the first two, seen from above."""
    along, out = (p[1] - p[0])[:2], (p[2] - p[0])[:2]
    return float(abs(along[0] * out[1] - along[1] * out[0]) / np.linalg.norm(along))


def _wrap(x: Floats) -> Floats:
    return np.asarray((x + np.pi) % (2.0 * np.pi) - np.pi)
