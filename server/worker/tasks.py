"""Built-in kinds of jobs.

Inspect a recording, analyse it, run filters on it, tune a filter, estimate the uncertainty of squat angles,
export a file for another program. Kinds that concern one package are that package's `run` and `publish`; the
two defined here combine two packages each.
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
from sagittal.server.storage.files.blobs import Blob
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
    inspection = json.loads(files[FOUND])
    recordings.publish_inspection(c, str(claim.recording_id), claim.params["input_sha256"], inspection)


def _analyse(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    return analysing.run(files, analysing.dump_manifest(params), params["config"], attempt.progress)


def _publish_analysis(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    summary = json.loads(files["analysis.json"])
    analyses.publish(c, claim, blobs, summary["provenance"]["parameters_sha256"])
    devices.keep_checks(c, str(claim.recording_id), summary["devices"])


def _warm() -> None:
    """Import readers and pipeline, and compile the kernels or load them from the cache."""
    import sagittal.server.report.files.exports  # noqa: F401
    from sagittal.core.agreement.slips import compile_agreement_kernels
    from sagittal.core.body import estimate
    from sagittal.core.events import foot_contact, foot_way
    from sagittal.core.fusion import attitude
    from sagittal.server.processes.compiling import OFFLINE, compile_filters_once

    # a first walk does not wait for filters of few sensors or live trials, which the live estimator compiles
    compile_filters_once(OFFLINE)
    attitude.compile_attitude_kernel()
    compile_agreement_kernels()
    foot_contact.compile_foot_contact_kernel()
    foot_way.compile_foot_way_kernel()
    estimate.compile_erkf_kernels()


register(Task(recordings.INSPECT, _inspect, _publish_inspection, keeps_files=False))
register(Task(recordings.ANALYSE, _analyse, _publish_analysis, keeps_files=True, warm=_warm))
register(Task(TUNE, tunings.run, tunings.publish, keeps_files=False))
register(Task(COMPARE_FILTERS, filter_runs.run, filter_runs.publish, keeps_files=True))
register(Task(SENSITIVITY, sensitivities.run, sensitivities.publish, keeps_files=True))
register(Task(EXPORT, exports.run, exports.publish, keeps_files=True))
