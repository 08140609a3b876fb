"""Parameters of the mounting and pose stages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

from sagittal.core.body.arm_params import ArmParams
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.kinematics import AnchorParams
from sagittal.core.body.l7s.filter import L7sParams
from sagittal.core.errors import ParameterError
from sagittal.core.estimators import AUTO, Requested
from sagittal.core.message import Message


@dataclass(frozen=True)
class PoseParams:
    """Parameters of `mount_sensors` and `estimate_poses`.

    Parameters
    ----------
    estimator : "auto" selects by the available sensors.
    least_valid : minimum fraction of the recording with data from a sensor (our choice).
    arms : of sensor positions and joint centres. anchor : of the poses without a filter.

    Raises
    ------
    ParameterError `unknown_estimator`.
    """

    estimator: Requested = AUTO
    erkf: ErkfParams = field(default_factory=ErkfParams.people)
    arms: ArmParams = field(default_factory=ArmParams)
    l7s: L7sParams = field(default_factory=L7sParams)
    anchor: AnchorParams = field(default_factory=AnchorParams)
    least_valid: float = 0.5

    def __post_init__(self) -> None:
        choices = get_args(Requested)
        if self.estimator not in choices:
            raise ParameterError(
                "unknown_estimator",
                Message(
                    "'{estimator}' is no estimator; expected one of {known}.",
                    estimator=self.estimator,
                    known=", ".join(choices),
                ),
            )
