"""The three functions of the package."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sagittal.analysis import Analysis
from sagittal.core.formats import (
    list_source_files,
    manifest_of,
    parse_manifest,
    read_named_file,
    read_recording,
)
from sagittal.core.frames import Segment
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.pipeline import analyse as run_pipeline
from sagittal.core.pipeline.config import override_config
from sagittal.core.pipeline.recipes import say_nothing
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import simulate_scenario
from sagittal.simulated import SimulatedWalk


def read(*paths: str | Path, manifest: Mapping[str, Any] | str | Path | None = None) -> Recording:
    """Read files, folders or zip archives of one recording.

    Parameters
    ----------
    manifest : sensor placement, units, body height (docs/reference/formats.md): a mapping, or the path of a
    JSON file; None if the files contain this information.

    Raises
    ------
    SagittalError `file_not_found`, or the files or the manifest are invalid; the message states the reason.
    """
    declared = None
    if isinstance(manifest, Mapping):
        declared = manifest_of(json.loads(json.dumps(manifest)))
    elif manifest is not None:
        declared = parse_manifest(read_named_file(Path(manifest)))
    return read_recording(list(list_source_files(map(Path, paths))), declared)


def analyse(
    recording: Recording | str | Path,
    *,
    config: Mapping[str, Any] | None = None,
    manifest: Mapping[str, Any] | str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Analysis:
    """Run the complete pipeline on one recording.

    Parameters
    ----------
    recording : from `read` or `simulate`, or a path to be read with `manifest`.
    config : stage parameters that differ from the defaults, in the form used by the API:
        `{"poses": {"least_valid": 0.7}}`.
    progress : called at the start of each stage with its name and the fraction of work completed, 0 to 1.

    Returns
    -------
    Analysis; if a stage failed, `problem` holds the reason and earlier results are available.

    Raises
    ------
    SagittalError No common time axis can be constructed, or a parameter is unknown.
    """
    if not isinstance(recording, Recording):
        recording = read(recording, manifest=manifest)
    chosen = override_config(PipelineConfig(), config or {})
    return Analysis(run_pipeline(recording, chosen, progress or say_nothing))


def simulate(
    script: str = "comfortable",
    *,
    seed: int = 0,
    height_m: float = 1.75,
    rate_hz: float = 100.0,
    segments: Sequence[Segment] | None = None,
) -> SimulatedWalk:
    """Simulate a walk with exact ground truth; equal arguments give bit-identical results.

    Parameters
    ----------
    script : name of a scenario (docs/science/simulation.md).
    segments : segments with a sensor; None = as defined by the scenario, usually all seven.
    """
    worn = None if segments is None else tuple(segments)
    return SimulatedWalk(simulate_scenario(script, seed, height_m, rate_hz, worn))
