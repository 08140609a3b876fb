"""Parameters of the squat analysis."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from sagittal.core.body.chain.filter import ChainFilterParams
from sagittal.core.calibration.table_top import TableTopParams
from sagittal.core.errors import ParameterError
from sagittal.core.message import Message
from sagittal.core.squat.repetitions import RepetitionParams

SquatMounting = Literal["fixed_offset", "table_top"]


@dataclass(frozen=True)
class SquatParams:
    """Parameters of the sensor alignment, the chain filters and the repetition detection.

    Parameters
    ----------
    mounting : source of the sensor-to-segment alignment: attached as specified by the protocol, or tracked
    from the table within the recording, which must then start with all sensors on the table.

    Raises
    ------
    ParameterError `unknown_mounting`.
    """

    mounting: SquatMounting = "fixed_offset"
    table_top: TableTopParams = field(default_factory=TableTopParams)
    chain: ChainFilterParams = field(default_factory=ChainFilterParams)
    repetitions: RepetitionParams = field(default_factory=RepetitionParams)

    def __post_init__(self) -> None:
        if self.mounting not in get_args(SquatMounting):
            raise ParameterError(
                "unknown_mounting",
                Message(
                    "Mounting '{mounting}' is not one of {join}.",
                    mounting=self.mounting,
                    join=", ".join(get_args(SquatMounting)),
                ),
            )
