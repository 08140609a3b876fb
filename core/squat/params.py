"""Parameters of everything that is done with a take of squats."""

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
    """Of the sensors, the chain's filters, and of what counts as a squat.

    Parameters
    ----------
    mounting : how it is known how the sensors sit: put on as agreed, or carried from the table in the take
        itself, which then begins with all of them lying there.

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
