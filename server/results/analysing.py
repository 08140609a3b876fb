"""Analysis of the files of a trial to result files, as run by command line and worker without a database."""

from __future__ import annotations

import gc
import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from sagittal.core.message import Message
from sagittal.core.signals.memory import give_memory_back
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.provenance import CODE_VERSION

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile
    from sagittal.core.pipeline import Progress, TakeAnalysis


REPAIRED: Final = "repaired.json"
"""Proposed manifest that corrects a setup error; unconfirmed."""


def run(
    files: Sequence[SourceFile],
    manifest: bytes | None,
    config: Mapping[str, Any] | None,
    progress: Progress,
) -> dict[str, bytes]:
    """Analyse the files of one trial and return the result files (server/report/files/exports.py)."""
    from sagittal.core.formats.json_tree import read_json
    from sagittal.server.report.files.exports import analysis_files

    results = [analyse_files(files, manifest, config, progress, resumable=False)]
    setup = results[0].setup
    # without a local name, so that it is released after writing
    result_files = analysis_files(results.pop(), give_memory_back)
    if setup is not None and setup.can_be_applied:
        declared = read_json(manifest) if manifest is not None else {}
        assert isinstance(declared, dict)  # noqa: S101 - `parse_manifest` has read it
        repaired = setup.complete_manifest(declared)
        result_files[REPAIRED] = json.dumps(repaired, ensure_ascii=False, indent=1).encode()
    return result_files


def analyse_files(
    files: Sequence[SourceFile],
    manifest: bytes | None,
    config: Mapping[str, Any] | None,
    progress: Progress,
    *,
    resumable: bool = True,
) -> TakeAnalysis:
    """Run the complete pipeline on the files of one trial; pure except for `progress`.

    Parameters
    ----------
    manifest : JSON text, None = nothing declared.
    config : overrides of PipelineConfig by stage, {"fusion": {"k_acc": 1.0}}; if empty, those of an archive
        of a visit among the files, otherwise the defaults.
    resumable : see `sagittal.core.pipeline.analyse`.

    Raises
    ------
    SagittalError
        nothing can be analysed; code and message give the reason.
    """
    from sagittal.core.formats import read_recording
    from sagittal.core.formats.manifest import parse_manifest
    from sagittal.core.pipeline import PipelineConfig, analyse
    from sagittal.core.pipeline.config import override_config

    def tell(stage: str, share: float) -> None:
        give_memory_back()
        progress(stage, share)

    _keep_libraries()
    tell("reading", 0.0)
    chosen = override_config(PipelineConfig(), choose_config(files, config))
    declared = parse_manifest(manifest) if manifest is not None else None
    # without a local name, so that `analyse` can release parts of it
    return analyse(read_recording(files, declared), chosen, tell, CODE_VERSION, resumable=resumable)


def analyse_again(
    files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt, share: float
) -> TakeAnalysis:
    """Repeat the analysis of a trial that a job is based on, as one stage with `share` of the job's
    progress.
    """
    return analyse_files(
        files,
        dump_manifest(params),
        params["config"],
        lambda _, done: attempt.progress("analysis", share * done),
    )


def dump_manifest(params: Mapping[str, Any]) -> bytes:
    """Manifest of a job, as JSON text."""
    return json.dumps(params["manifest"], ensure_ascii=False).encode()


@cache
def _keep_libraries() -> None:
    """Exclude library objects from garbage collection, which would cost 70 ms per analysis."""
    gc.freeze()


def choose_config(files: Sequence[SourceFile], config: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """The requested settings, otherwise those from an archive of a visit, or none.

    Raises
    ------
    ArchiveError
        the archive is damaged, or its settings are not valid JSON.
    """
    from sagittal.core.errors import ArchiveError
    from sagittal.core.formats.archive import read_episode_config
    from sagittal.core.formats.json_tree import read_json

    if config:
        return config
    archived = read_episode_config(files)
    try:
        settings = {} if archived is None else read_json(archived)
    except ValueError as error:
        raise ArchiveError(
            "zip_bad", Message("The archive's settings are not valid JSON: {error}.", error=error)
        ) from error
    return settings if isinstance(settings, dict) else {}


def inspect(files: Sequence[SourceFile], manifest: Mapping[str, Any] | None, progress: Progress) -> bytes:
    """Describe the content of files as JSON, before any mapping; uses only `sources` of the manifest.

    Raises
    ------
    SagittalError
        the files cannot be read; code and message give the reason.
    """
    from sagittal.core import quality
    from sagittal.core.formats import read_recording
    from sagittal.core.formats.manifest import manifest_of

    progress("reading", 0.0)
    sources = (manifest or {}).get("sources")
    take = read_recording(files, manifest_of({"sources": sources}) if sources else None)
    progress("looking", 0.7)
    return json.dumps(quality.describe(take).to_json(), ensure_ascii=False, allow_nan=False).encode()
