"""The pose estimators: the single list used by pipeline, report, forms, avatar and documentation.

An estimator computes a model of seven segments from the available sensors (docs/reference/estimators.md).
Estimator names are defined here and nowhere else in the source (tests/core/test_estimators.py).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Segment
from sagittal.core.message import Message

Estimator = Literal["erkf", "l7s_3i", "l7s_2i", "stance_foot_anchor"]
Requested = Literal["auto", "erkf", "l7s_3i", "l7s_2i", "stance_foot_anchor"]
"""What can be asked for; auto: the best one that the working sensors allow."""

LiveMethod = Estimator | Literal["none"]
"""Estimator of the live figure; none: the worn sensors allow no figure while they stream."""

AUTO: Final = "auto"
NO_FIGURE: Final = "none"
"""`Poses.method` where no estimator could run."""

NO_FIGURE_LABEL: Final = "No figure"
NO_FIGURE_NOTE: Final = "These sensors do not allow an avatar; their own measurements are shown."

LINKED_PATHS: Final = "erkf_smoothed"
"""`FootTracks.source` of feet that hang on one chain."""

SINGLE_PATHS: Final = "erkf_feet"
"""`FootTracks.source` of feet that each have a filter of their own."""

LIVE_LINKED_PATHS: Final = "erkf_live"
LIVE_SINGLE_PATHS: Final = "erkf_feet_live"
"""The same two while the sensors stream: filtered, not smoothed."""


@dataclass(frozen=True)
class PaperReference:
    """Publication of a method; doi without "https://doi.org/", empty if it has none."""

    citation: str
    doi: str

    @property
    def line(self) -> str:
        """Citation with its DOI, or a remark that there is none."""
        return (
            f"{self.citation}. doi:{self.doi}"
            if self.doi
            else Message("{citation}. No DOI found.", citation=self.citation)
        )


@dataclass(frozen=True, kw_only=True)
class PoseMethod:
    """How poses are estimated.

    Parameters
    ----------
    method : `Poses.method` of the result. label : display name of the method.
    needs : required sensors in words, completing "sensors on". sets : alternative sets of segments whose
    sensors are required.
    sensors : all sensors used when the method is selected by name; None = every available sensor.
    leg_model : thighs and shanks carry no sensor; a leg model estimates them. fixed : variables held constant
    by this model, which are therefore not results of a recording.
    in_room : positions are valid in the world frame; otherwise the model is for visualisation only.
    note : remark for readers of the report.
    paper : None = developed for Sagittal. science : the page with its equations.
    """

    method: str
    label: str
    needs: str
    sets: tuple[frozenset[Segment], ...]
    sensors: tuple[Segment, ...] | None
    leg_model: bool
    in_room: bool
    note: str
    paper: PaperReference | None
    science: str
    fixed: tuple[str, ...] = ()

    def runs_on(self, segments: Iterable[Segment]) -> bool:
        """Whether sensors on these segments are sufficient."""
        worn = set(segments)
        return any(needed <= worn for needed in self.sets)


@dataclass(frozen=True, kw_only=True)
class PoseEstimator(PoseMethod):
    """A selectable estimator for walking.

    Parameters
    ----------
    name : identifier in configuration, API and command line. choice : label in forms.
    """

    name: Estimator
    choice: str


ONE_LEG: Final[tuple[frozenset[Segment], ...]] = tuple(
    frozenset[Segment](("pelvis", THIGH[s], SHANK[s], FOOT[s])) for s in SIDES
)
"""The pelvis and a whole leg, of either side."""

HINGES: Final = ("knee_adduction", "knee_rotation", "ankle_inversion", "ankle_rotation")
"""Variables of a leg whose knee and ankle are hinges: they turn about one axis."""

LEVEL_PELVIS: Final = ("pelvis_tilt", "pelvis_obliquity")
"""Variables of a pelvis that is taken to be level."""

SY_2021: Final = PaperReference(
    "Sy LW, Lovell NH, Redmond SJ 2021. Estimating lower body kinematics using a Lie group constrained "
    "extended Kalman filter and reduced IMU count. IEEE Sensors J.",
    "10.1109/JSEN.2021.3096078",
)

ERKF: Final = PoseEstimator(
    name="erkf",
    method="erkf_smoothed",
    label="ErKF, smoothed",
    choice="ErKF with smoother",
    needs="the pelvis and a whole leg (thigh, shank, foot)",
    sets=ONE_LEG,
    sensors=None,
    leg_model=False,
    in_room=True,
    note=(
        "An error-state Kalman filter links all sensors at the joints, fixes each foot during foot-flat, "
        "and runs forwards and backwards over the trial (Potter). Each angle is measured by two sensors; "
        "in a healthy walk flexion and hip and knee adduction were within 2 to 4° of optical motion "
        "capture, and stride lengths within 2 cm."
    ),
    paper=PaperReference(
        "Potter MV, Cain SM, Ojeda LV, Gurchiek RD, McGinnis RS, Perkins NC 2021. Error-state Kalman filter "
        "for lower-limb kinematic estimation: evaluation on a 3-body model. PLoS ONE 16(4): e0249577.",
        "10.1371/journal.pone.0249577",
    ),
    science="docs/science/erkf.md",
)

L7S_3I: Final = PoseEstimator(
    name="l7s_3i",
    method="l7s_3i",
    label="L7S-3I",
    choice="L7S-3I: pelvis and feet",
    needs="the pelvis and both feet",
    sets=(frozenset[Segment](("pelvis", "foot_r", "foot_l")),),
    sensors=("pelvis", "foot_r", "foot_l"),
    leg_model=True,
    in_room=True,
    note=(
        "Thighs and shanks have no sensor: they are derived from the pelvis, the feet and leg length, "
        "with knees and ankles as hinges (Sy). In a healthy walk estimated flexion differed by 4 to 7° "
        "from optical motion capture (live 7 to 11°), so the curves show the pattern but not small "
        "changes."
    ),
    paper=SY_2021,
    science="docs/science/l7s.md",
    fixed=HINGES,
)

L7S_2I: Final = PoseEstimator(
    name="l7s_2i",
    method="l7s_2i",
    label="L7S-2I",
    choice="L7S-2I: feet only",
    needs="both feet",
    sets=(frozenset[Segment](("foot_r", "foot_l")),),
    sensors=("foot_r", "foot_l"),
    leg_model=True,
    in_room=True,
    note=(
        "Only the feet have sensors: pelvis, thighs and shanks are estimated from them and leg length "
        "(Sy). In a healthy walk estimated flexion differed by 5 to 9° from optical motion capture (live "
        "8 to 11°); the pelvis is assumed to be level and to face midway between the feet."
    ),
    paper=SY_2021,
    science="docs/science/l7s.md",
    fixed=(*HINGES, *LEVEL_PELVIS),
)

ORIENTATIONS_ONLY: Final = PoseEstimator(
    name="stance_foot_anchor",
    method="stance_foot_anchor",
    label="Orientations only",
    choice="Orientations only",
    needs="the pelvis and a whole leg (thigh, shank, foot)",
    sets=ONE_LEG,
    sensors=None,
    leg_model=False,
    in_room=False,
    note=(
        "Each sensor's orientation is estimated separately, without joint constraints; the avatar is "
        "placed on the stance foot. Flexion angles are still measured; frontal and transverse angles "
        "drift with each sensor's heading."
    ),
    paper=None,
    science="docs/science/body-model.md",
)

ESTIMATORS: Final = (ERKF, L7S_3I, L7S_2I, ORIENTATIONS_ONLY)
"""All, as docs/reference/estimators.md lists them."""

SQUAT_CHAIN: Final = PoseMethod(
    method="squat_chain",
    label="Chain of the squatting leg",
    needs="the pelvis, and the shank and thigh of each squatting leg",
    sets=tuple(frozenset[Segment](("pelvis", THIGH[s], SHANK[s])) for s in SIDES),
    sensors=("pelvis", *(x for s in SIDES for x in (THIGH[s], SHANK[s]))),
    leg_model=False,
    in_room=False,
    note=(
        "Seven hinges from the stationary foot to the pelvis, estimated with one filter per sensor "
        "(Kianifar). The foot has no sensor: it is assumed flat, and a lifted foot is drawn at a right "
        "angle to the shank."
    ),
    paper=PaperReference(
        "Kianifar R, Joukov V, Lee A, Raina S, Kulić D 2019. Inertial measurement unit-based pose "
        "estimation: analyzing and reducing sensitivity to sensor placement and body measures. J. Rehabil. "
        "Assist. Technol. Eng. 6.",
        "10.1177/2055668318813455",
    ),
    science="docs/science/squat.md",
)
"""Runs on squats and on nothing else: nobody asks for it, the protocol does."""

BY_NAME: Final[dict[str, PoseEstimator]] = {e.name: e for e in ESTIMATORS}
BY_METHOD: Final[dict[str, PoseMethod]] = {e.method: e for e in (*ESTIMATORS, SQUAT_CHAIN)}
"""`Poses.method` → what is known of it; `NO_FIGURE` has none."""
