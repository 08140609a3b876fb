"""The order of the stages, and the loop that runs them.

A recipe is a tuple of stages. It is selected by the protocol and by the working sensors, once the signals
have been judged; other kinds of movement are added as further tuples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

from sagittal.core.errors import Notice, ParameterError, SagittalError
from sagittal.core.events.lumbar import TRUNK
from sagittal.core.message import Message
from sagittal.core.pipeline.activity_stages import ACTIVITY_MONITOR, ACTIVITY_QUALITY
from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.functional_stages import TRUNK_TEST, WALK_TEST
from sagittal.core.pipeline.squat_stages import SQUAT_ANGLES, SQUAT_CALIBRATION, SQUAT_LEG, SQUAT_PARAMETERS
from sagittal.core.pipeline.stages import (
    AGREEMENT,
    ANGLES,
    CALIBRATION,
    EVENTS,
    MOUNTING,
    ORIENTATION,
    PARAMETERS,
    POSES,
    QUALITY,
    TIMELINE,
    TRUNK_EVENTS,
    TRUNK_PARAMETERS,
    PipelineStage,
)
from sagittal.core.quality.stuck import drop_stuck_sensors
from sagittal.core.signals.recording import Recording

Progress = Callable[[str, float], None]
"""Called with the stage that starts and the share of the work done before it, 0 to 1."""

SIGNALS: Final = (TIMELINE, AGREEMENT, QUALITY)
"""What every recipe begins with: afterwards it is known which sensors work."""

WALK: Final = (*SIGNALS, CALIBRATION, ORIENTATION, EVENTS, MOUNTING, POSES, ANGLES, PARAMETERS)
"""Walking with sensors on the legs, or on legs and trunk."""

TRUNK_ONLY: Final = (*SIGNALS, TRUNK_EVENTS, TRUNK_PARAMETERS)
"""Walking with sensors on the trunk alone: steps, bouts and turns, no angles."""

SQUAT: Final = (*SIGNALS, SQUAT_CALIBRATION, SQUAT_LEG, SQUAT_ANGLES, SQUAT_PARAMETERS)
"""Squats with sensors on the pelvis and on shank and thigh of one leg or both: no walking, no strides."""

BY_TRUNK: Final = (*SIGNALS, TRUNK_TEST)
"""A functional test that one sensor on the trunk tells: no calibration, no strides."""

TRUNK_TESTS: Final = ("tug", "five_sit_to_stand", "standing_eyes_open", "standing_eyes_closed")
WALK_TESTS: Final = ("walk_10m", "walk_6min")
"""Protocols of functional tests by what tells them: the trunk, or the strides of a walk."""


ACTIVITY: Final = (ACTIVITY_MONITOR, ACTIVITY_QUALITY)
"""Daily life: hours to days of one sensor of the trunk, read block by block; nothing is laid beside it."""


def say_nothing(stage: str, share: float) -> None:
    """Progress callback that does nothing."""


def analyse(
    recording: Recording,
    config: PipelineConfig | None = None,
    progress: Progress = say_nothing,
    version: str = "",
    *,
    resumable: bool = True,
) -> TakeAnalysis:
    """Run all stages on one recording.

    Parameters
    ----------
    recording : streams with their segments, as read by sagittal.core.formats.
    config : parameters of the stages; None = the defaults.
    progress : called before each stage.
    version : of the code, for the provenance. resumable : False releases data used only by earlier stages,
        which `resume` and a comparison of filters would need; results are the same.

    Raises
    ------
    SagittalError If not even a common time axis can be constructed. Later stages never raise: their error is
        `TakeAnalysis.problem`.
    """
    begun = [TakeAnalysis(recording, config or PipelineConfig(), version)]
    # what a stage lets go of is freed only where nobody here holds the take as it was
    del recording
    return _run_from(begun.pop(), 0, progress, resumable=resumable)


def choose_recipe(analysis: TakeAnalysis) -> tuple[PipelineStage, ...]:
    """The recipe for the protocol and the working sensors; requires timeline and quality."""
    if analysis.source.protocol == "activity":
        return ACTIVITY
    if analysis.source.protocol == "squat":
        return SQUAT
    if analysis.source.protocol in TRUNK_TESTS:
        return BY_TRUNK
    trunk_only = all(s in TRUNK for s in drop_stuck_sensors(analysis.recording).sensors)
    walk = TRUNK_ONLY if trunk_only else WALK
    return (*walk, WALK_TEST) if analysis.source.protocol in WALK_TESTS else walk


def run_stages(
    analysis: TakeAnalysis, stages: Sequence[PipelineStage], progress: Progress, *, resumable: bool = True
) -> TakeAnalysis:
    """Run stages in order; after a problem only those that can use partial results.

    Raises
    ------
    SagittalError of the first stage, without whose result there is nothing to return.
    """
    for i, stage in enumerate(stages):
        if analysis.problem is not None and not stage.runs_after_problem:
            continue
        progress(stage.name, stage.share)
        end = stages[i + 1].share if i + 1 < len(stages) else 1.0
        previous = analysis.problem
        try:
            if stage.tells_share:
                analysis = stage.run(analysis, analysis.config, _tell_within(stage, end, progress))
            else:
                analysis = stage.run(analysis, analysis.config)
            if stage.let_go is not None and not resumable:
                analysis = stage.let_go(analysis)
        except SagittalError as error:
            if analysis.uniform is None and analysis.report is None:
                raise
            problem = Notice(error.code, error.message, error.sensor, error.t_s, severity="error")
            analysis = replace(analysis, problem=problem)
        if analysis.problem is not previous and analysis.problem is not None:
            analysis = replace(analysis, stopped_at=stage.name)
    return analysis


def _tell_within(stage: PipelineStage, end: float, progress: Progress) -> Callable[[float], None]:
    """Convert progress within a stage to overall progress, which is `end` when the stage is done."""
    return lambda own: progress(stage.name, stage.share + own * (end - stage.share))


def resume(
    analysis: TakeAnalysis,
    stage: str,
    config: PipelineConfig | None = None,
    progress: Progress = say_nothing,
) -> TakeAnalysis:
    """Run an analysis again from one stage on; earlier results are reused.

    Parameters
    ----------
    stage : name of the first stage that runs again.
    config : new parameters for it and later stages; None = unchanged.

    Returns
    -------
    The result of `analyse` with that config, bit for bit.

    Raises
    ------
    ParameterError : `unknown_stage`; `stage_not_reached` if an earlier stage has no result;
        `earlier_parameters` if the config changes an earlier stage.
    """
    config = config or analysis.config
    recipe = choose_recipe(analysis)
    names = [s.name for s in recipe]
    if stage not in names:
        raise ParameterError(
            "unknown_stage",
            Message("No stage '{stage}'; expected one of {names}.", stage=stage, names=", ".join(names)),
        )
    first = names.index(stage)
    earlier, repeated = recipe[:first], recipe[first:]
    missing = [s.name for s in earlier if any(getattr(analysis, name) is None for name in s.results)]
    if missing and not repeated[0].runs_after_problem:
        raise ParameterError(
            "stage_not_reached",
            Message(
                "The analysis cannot go on at '{stage}': {missing} gave no result. Resume from there.",
                stage=stage,
                missing=missing[0],
            ),
        )
    changed = [
        name for s in earlier for name in s.reads if getattr(config, name) != getattr(analysis.config, name)
    ]
    if changed:
        raise ParameterError(
            "earlier_parameters",
            Message(
                "{changed} belong to stages before '{stage}'. Resume from an earlier one.",
                changed=", ".join(changed),
                stage=stage,
            ),
        )
    forgotten: dict[str, Any] = dict.fromkeys(name for s in repeated for name in s.results)
    if analysis.stopped_at in names[first:]:
        forgotten |= {"problem": None, "stopped_at": None}
    return _run_from(replace(analysis, config=config, **forgotten), first, progress)


def _run_from(
    analysis: TakeAnalysis, first: int, progress: Progress, *, resumable: bool = True
) -> TakeAnalysis:
    """Run the stages from this position on; the recipe is selected by the first stages."""
    if analysis.source.protocol == "activity":
        analysis = run_stages(analysis, ACTIVITY[first:], progress)
    else:
        analysis = run_stages(analysis, SIGNALS[first:], progress, resumable=resumable)
        remaining = choose_recipe(analysis)[max(first, len(SIGNALS)) :]
        analysis = run_stages(analysis, remaining, progress, resumable=resumable)
    progress("done", 1.0)
    return analysis
