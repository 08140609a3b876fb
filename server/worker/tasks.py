"""The kinds of job of this version.

Look into a recording, analyse it, run filters on it, tune one, see how sure the angles of squats are, write
a file for another program.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection

from sagittal.server.clinic import devices
from sagittal.server.downloads import exports
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import COMPARE_FILTERS, EXPORT, SENSITIVITY, TUNE, Claim
from sagittal.server.results import analyses, analysing, filter_runs, sensitivities, tunings
from sagittal.server.storage.blobs import Blob
from sagittal.server.uploads import recordings
from sagittal.server.worker.task import Task, register

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile

FOUND = "inspection.json"


def _inspect(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    return {FOUND: analysing.inspect(files, params["manifest"], attempt.progress)}


def _publish_inspection(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    found = json.loads(files[FOUND])
    recordings.publish_inspection(c, str(claim.recording_id), claim.params["input_sha256"], found)


def _analyse(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    manifest = json.dumps(params["manifest"], ensure_ascii=False).encode()
    return analysing.run(files, manifest, params["config"], attempt.progress)


def _publish_analysis(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    found = json.loads(files["analysis.json"])
    analyses.publish(c, claim, blobs, found["provenance"]["parameters_sha256"])
    devices.keep_checks(c, str(claim.recording_id), found["devices"])


def _tune(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    return {tunings.RESULT: tunings.run(files, params["order"], attempt)}


def _publish_tuning(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    tunings.publish(c, claim, files[tunings.RESULT])


def _compare_filters(
    files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt
) -> dict[str, bytes]:
    return filter_runs.run(files, params, attempt.progress)


def _publish_filters(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    filter_runs.publish(c, claim, blobs)


def _analyse_sensitivity(
    files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt
) -> dict[str, bytes]:
    return sensitivities.run(files, params, attempt.progress)


def _publish_sensitivity(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    sensitivities.publish(c, claim, blobs)


def _export(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    return exports.run(files, params)


def _publish_export(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    exports.publish(c, claim, blobs)


def _warm() -> None:
    """Import readers and pipeline, compile the kernels or load them from the cache."""
    import sagittal.server.report.files.exports  # noqa: F401
    from sagittal.core.agreement.slips import compile_agreement_kernels
    from sagittal.core.body import estimate
    from sagittal.core.events import foot_contact
    from sagittal.core.fusion import attitude
    from sagittal.server.processes.compiling import OFFLINE, compile_filters_once

    # a first walk waits for no filter of few sensors or of live takes: the live estimator compiles those
    compile_filters_once(OFFLINE)
    attitude.compile_attitude_kernel()
    compile_agreement_kernels()
    foot_contact.compile_foot_contact_kernel()
    estimate.compile_erkf_kernels()


register(Task(recordings.INSPECT, _inspect, _publish_inspection, keeps_files=False))
register(Task(recordings.ANALYSE, _analyse, _publish_analysis, keeps_files=True, warm=_warm))
register(Task(TUNE, _tune, _publish_tuning, keeps_files=False))
register(Task(COMPARE_FILTERS, _compare_filters, _publish_filters, keeps_files=True))
register(Task(SENSITIVITY, _analyse_sensitivity, _publish_sensitivity, keeps_files=True))
register(Task(EXPORT, _export, _publish_export, keeps_files=True))
