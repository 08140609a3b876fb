"""Parameters of every stage in one frozen record, and their hash."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeVar, get_args

from sagittal.core.activity.params import ActivityParams
from sagittal.core.agreement import AgreementParams
from sagittal.core.body.pose_params import PoseParams
from sagittal.core.calibration import CalibrationParams
from sagittal.core.errors import ParameterError
from sagittal.core.events import FootContactParams, FootPitchParams, FootWayParams, StrideParams
from sagittal.core.events.alternation import AlternationParams
from sagittal.core.events.bouts import BoutParams
from sagittal.core.events.consensus import ConsensusParams
from sagittal.core.events.lumbar import LumbarParams
from sagittal.core.events.turns import TurnParams
from sagittal.core.functional_tests.params import FunctionalTestParams
from sagittal.core.fusion.mahony import MahonyParams
from sagittal.core.message import Message
from sagittal.core.quality import QualityParams
from sagittal.core.quality.stuck import StuckParams
from sagittal.core.setup import SetupParams
from sagittal.core.squat.params import SquatParams
from sagittal.core.timeline import TimelineParams

Settings = TypeVar("Settings")

Detector = Literal["foot_contact", "foot_pitch", "consensus"]
"""Whose contacts count: the refined ones of the feet, the published foot-pitch rule's, or what most detectors
agree on."""

REMOVED: Final = frozenset(
    {
        "config.contacts.stop_share",
        "config.poses.erkf.heading_sd",
        *(
            f"config.activity.steps.{b}"
            for b in ("side_share", "side_steps", "side_rad", "side_reach", "turning_rad_s")
        ),
        *(f"config.activity.steps.bouts.{b}" for b in ("long_s", "stand_s", "near_s")),
        *(f"config.activity.bouts.{b}" for b in ("long_share", "long_s", "stand_s", "near_s")),
        *(
            f"config.{a}.rest.{b}"
            for a in ("quality", "squat.table_top")
            for b in ("drift", "drift_rate", "bias")
        ),
        *(
            f"config.{a}.joints.{b}"
            for a in ("poses.arms", "calibration.joint_turns")
            for b in ("widest_s", "windows", "attitude")
        ),
        *(
            f"config.poses.arms.joints.{b}"
            for b in ("chunk_s", "window_chunks", "least_chunks", "least_power", "place_sd_m", "noise_mps2")
        ),
    }
)
"""What was a parameter and never changed a result: stored settings may name it, and mean the same without."""


@dataclass(frozen=True)
class PipelineConfig:
    """Parameters of every stage; the hash is part of each result's provenance.

    All stage parameters are contained here (tests/core/pipeline/test_config.py).

    Parameters
    ----------
    events : of the foot-pitch rule, which detects contacts. contacts : of their refinement. ways :
        of swings detected from displacement.
    detector : "foot_contact" has the smallest error (validation/accuracy/test_events_references.py);
        "foot_pitch" is the published rule, for comparison; the consensus also uses the shanks and is led by
        "foot_contact".
    bouts : of the feet's contacts; those of a trunk sensor's steps are `lumbar.bouts`.

    Raises
    ------
    ParameterError : `unknown_detector`.
    """

    timeline: TimelineParams = field(default_factory=TimelineParams)
    stuck: StuckParams = field(default_factory=StuckParams)
    setup: SetupParams = field(default_factory=SetupParams)
    agreement: AgreementParams = field(default_factory=AgreementParams)
    quality: QualityParams = field(default_factory=QualityParams)
    calibration: CalibrationParams = field(default_factory=CalibrationParams)
    fusion: MahonyParams = field(default_factory=MahonyParams)
    events: FootPitchParams = field(default_factory=FootPitchParams)
    contacts: FootContactParams = field(default_factory=FootContactParams)
    ways: FootWayParams = field(default_factory=FootWayParams)
    detector: Detector = "foot_contact"
    consensus: ConsensusParams = field(default_factory=ConsensusParams)
    alternation: AlternationParams = field(default_factory=AlternationParams)
    lumbar: LumbarParams = field(default_factory=LumbarParams)
    turns: TurnParams = field(default_factory=TurnParams)
    poses: PoseParams = field(default_factory=PoseParams)
    strides: StrideParams = field(default_factory=StrideParams)
    bouts: BoutParams = field(default_factory=BoutParams)
    squat: SquatParams = field(default_factory=SquatParams)
    functional: FunctionalTestParams = field(default_factory=FunctionalTestParams)
    activity: ActivityParams = field(default_factory=ActivityParams)

    def __post_init__(self) -> None:
        if self.detector not in get_args(Detector):
            raise ParameterError(
                "unknown_detector",
                Message(
                    "Detector '{detector}' is not one of {join}.",
                    detector=self.detector,
                    join=", ".join(get_args(Detector)),
                ),
            )

    @property
    def digest(self) -> str:
        """SHA-256 over all parameters; equal parameters give equal digests."""
        text = json.dumps(self, sort_keys=True, default=_list_fields)
        return hashlib.sha256(text.encode()).hexdigest()


def _list_fields(value: object) -> object:
    """Parameters of a stage by name; types unknown to JSON as text."""
    return vars(value) if dataclasses.is_dataclass(value) else str(value)


def override_config(defaults: Settings, overrides: Mapping[str, Any], path: str = "config") -> Settings:
    """Replace fields of nested frozen dataclasses.

    Parameters
    ----------
    overrides : by stage, {"fusion": {"attitude": {"kp": 0.5}}}; a list for a tuple. Parameters in `REMOVED`
        are ignored.

    Raises
    ------
    ParameterError : `unknown_parameter`, `bad_parameter`; and those of the dataclasses.
    """
    names = {f.name for f in dataclasses.fields(defaults)}  # type: ignore[arg-type] # all are dataclasses
    values: dict[str, Any] = {}
    for name, value in overrides.items():
        if f"{path}.{name}" in REMOVED:
            continue
        if name not in names:
            raise ParameterError(
                "unknown_parameter",
                Message(
                    "There is no {path}.{name}; expected one of {join}.",
                    path=path,
                    name=name,
                    join=", ".join(sorted(names)),
                ),
            )
        default = getattr(defaults, name)
        if dataclasses.is_dataclass(default) and isinstance(value, Mapping):
            values[name] = override_config(default, value, f"{path}.{name}")
        elif _fits(value, default):
            values[name] = tuple(value) if isinstance(default, tuple) else value
        else:
            raise ParameterError(
                "bad_parameter",
                Message(
                    "{path}.{name} is {value}, expected the like of {default}.",
                    path=path,
                    name=name,
                    value=repr(value),
                    default=repr(default),
                ),
            )
    return dataclasses.replace(defaults, **values)  # type: ignore[type-var]


def _fits(value: object, default: object) -> bool:
    if isinstance(default, bool) or isinstance(value, bool):
        return isinstance(default, bool) and isinstance(value, bool)
    if isinstance(default, int | float):
        return isinstance(value, int | float)
    return isinstance(value, list if isinstance(default, tuple) else type(default))
