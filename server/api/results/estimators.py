"""Available pose estimators, with required sensors and references."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from sagittal.core.estimators import ESTIMATORS, PaperReference, PoseEstimator
from sagittal.core.frames import SEGMENTS, Segment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action

router = APIRouter(prefix="/estimators", tags=["analyses"])


@dataclass(frozen=True)
class EstimatorAnswer:
    """A pose estimator; `name` is the value of `poses.estimator` in the settings of an analysis."""

    name: str
    title: str
    needs: Annotated[str, Field(description="sensors on these, in words")]
    sensor_sets: Annotated[
        list[list[Segment]], Field(description="segments that must carry a sensor: any one of these sets")
    ]
    measures_every_joint: Annotated[
        bool, Field(description="false: thighs and shanks carry no sensor, a model of the leg gives them")
    ]
    note: Annotated[str, Field(description="what a reader of its results has to know")]
    paper: Annotated[PaperReference | None, Field(description="where the method comes from; null: our own")]


@router.get("", response_model=list[EstimatorAnswer])
def list_estimators(user: Annotated[Identity, require(Action.READ_API)]) -> list[EstimatorAnswer]:
    """List estimators of this version, the best for all seven sensors first."""
    return [_shown(estimator) for estimator in ESTIMATORS]


def _shown(estimator: PoseEstimator) -> EstimatorAnswer:
    return EstimatorAnswer(
        name=estimator.name,
        title=estimator.choice,
        needs=estimator.needs,
        sensor_sets=[[s for s in SEGMENTS if s in needed] for needed in estimator.sets],
        measures_every_joint=not estimator.leg_model,
        note=estimator.note,
        paper=estimator.paper,
    )
