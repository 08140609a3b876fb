"""The two kinds of job of this version: look into a recording, and analyse it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection

from server.jobs.queue import Claim
from server.services import analyses, recordings
from server.storage.blobs import Blob
from server.worker.task import Task, register

if TYPE_CHECKING:
    from core.formats.source import SourceFile
    from core.pipeline import Progress

FOUND = "inspection.json"


def _inspect(files: Sequence[SourceFile], params: Mapping[str, Any], progress: Progress) -> dict[str, bytes]:
    return {FOUND: analyses.inspect(files, params["manifest"], progress)}


def _publish_inspection(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    found = json.loads(files[FOUND])
    recordings.publish_inspection(c, str(claim.recording_id), claim.params["input_sha256"], found)


def _analyse(files: Sequence[SourceFile], params: Mapping[str, Any], progress: Progress) -> dict[str, bytes]:
    manifest = json.dumps(params["manifest"], ensure_ascii=False).encode()
    return analyses.run(files, manifest, params["config"], progress)


def _publish_analysis(
    c: Connection, claim: Claim, files: Mapping[str, bytes], blobs: Mapping[str, Blob]
) -> None:
    provenance = json.loads(files["analysis.json"])["provenance"]
    analyses.publish(c, claim, blobs, provenance["parameters_sha256"])


def _warm() -> None:
    """Import readers and pipeline, compile the kernels or load them from the cache."""
    import server.report.exports  # noqa: F401
    from core.body import estimate
    from core.events import foot_contact
    from core.fusion import attitude

    attitude.compile_attitude_kernel()
    foot_contact.compile_foot_contact_kernel()
    estimate.compile_pose_kernels()


register(Task(recordings.INSPECT, _inspect, _publish_inspection, keeps_files=False))
register(Task(recordings.ANALYSE, _analyse, _publish_analysis, keeps_files=True, warm=_warm))
