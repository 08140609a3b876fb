"""Tunings: filter gains fitted to trials of a session, by command line and worker alike.

Trials are files of the session's recording (.npz, docs/science/filters.md). One tuning takes minutes to
hours: it stores a checkpoint after every iteration and resumes from it (server/worker/task.py).
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection, insert, select

from sagittal.core.errors import ParameterError
from sagittal.core.fusion.algorithms.choice import require_tunable
from sagittal.core.fusion.algorithms.schemes import Scheme as Scheme
from sagittal.core.fusion.algorithms.swarm import MOST_OF_SWARM as MOST_OF_SWARM
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import Conflict, NotFound
from sagittal.server.jobs.queue import TUNE, Claim, JobQueue, JobView, Priority
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.results.analyses import digest_json
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.storage.schema.tables import new_id, now, recording, tuning
from sagittal.server.uploads import recordings

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile
    from sagittal.core.fusion.algorithms.swarm import Swarm
    from sagittal.core.fusion.algorithms.tuning import GainTuner, Keep, TuningResult
    from sagittal.server.jobs.attempt import Attempt

RESULT: Final = "tuning.json"
TRIAL: Final = ".npz"
BEHIND: Final = 10
"""Increment of the nice value of each search thread (per thread on Linux)."""
SWARM: Final = ("particles", "iterations", "rounds", "random_rounds")


@dataclass(frozen=True)
class TuningOrder:
    """Parameters of a tuning.

    Parameters
    ----------
    validation : names of validation trials. scheme : adaptation of gains to the motion, None = default.
    magnetometer : None = if the algorithm supports it. particles … random_rounds : of the swarm, None = as in
        the thesis.
    """

    algorithm: str
    validation: tuple[str, ...]
    scheme: Scheme | None = None
    magnetometer: bool | None = None
    seed: int = 0
    particles: int | None = None
    iterations: int | None = None
    rounds: int | None = None
    random_rounds: int | None = None


@dataclass(frozen=True)
class StoredTuning:
    """A finished tuning: inputs, version and result.

    See sagittal.core.fusion.algorithms.tuning.
    """

    id: str
    recording_id: str
    session_id: str
    job_id: str
    input_sha256: str
    code_version: str
    result: Mapping[str, Any]
    created_at: dt.datetime


def prepare(files: Sequence[SourceFile], order: TuningOrder) -> GainTuner:
    """Read the trials among the files and validate everything before the long search.

    Raises
    ------
    SagittalError : trials cannot be read or split, or the algorithm is unknown; the message contains a
        remedy.
    """
    from sagittal.core.fusion.algorithms.benchmark import read_trial
    from sagittal.core.fusion.algorithms.swarm import SwarmRules
    from sagittal.core.fusion.algorithms.tuning import GainTuner, TrialSplit

    paths = [(PurePosixPath(f.name), f) for f in files]
    trials = [read_trial(path.stem, f.read()) for path, f in paths if path.suffix == TRIAL]
    return GainTuner(
        order.algorithm,
        TrialSplit.by_name(trials, order.validation),
        scheme=order.scheme,
        magnetometer=order.magnetometer,
        seed=order.seed,
        rules=SwarmRules(**{name: n for name in SWARM if (n := getattr(order, name)) is not None}),
        code_version=CODE_VERSION,
    )


def search(tuner: GainTuner, keep: Keep, swarm: Swarm | None) -> TuningResult:
    """Search with one thread per core, each at low priority."""
    with ThreadPoolExecutor(os.cpu_count(), initializer=os.nice, initargs=(BEHIND,)) as pool:
        return tuner.run(keep, swarm, pool.map)


def run(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    """Tune, resuming from a checkpoint of the same version; return the result as JSON.

    Parameters
    ----------
    params : of the job, with `order` as fields of TuningOrder.

    Raises
    ------
    SagittalError : see `prepare`.
    """
    attempt.progress("reading", 0.0)
    tuner = prepare(files, TuningOrder(**params["order"]))
    swarm = None
    if attempt.checkpoint is not None:
        with contextlib.suppress(ParameterError):
            swarm = tuner.read_checkpoint(attempt.checkpoint)

    def keep(content: bytes, share: float, message: str) -> None:
        attempt.keep(content)
        attempt.progress("searching", share, message)

    result = search(tuner, keep, swarm).to_json()
    return {RESULT: json.dumps(result, ensure_ascii=False, allow_nan=False).encode()}


def submit(
    c: Connection, queue: JobQueue, actor: audit.Actor | None, session_id: str, order: TuningOrder
) -> JobView:
    """Request a tuning on the trials of the current recording; idempotent.

    Raises
    ------
    Conflict : no_files, no_such_trial. NotFound : the session. ParameterError : see `require_tunable`.
    """
    require_tunable(order.algorithm)
    this = recordings.require_current(c, session_id)
    trials = {path.stem for f in this.files if (path := PurePosixPath(f.name)).suffix == TRIAL}
    if unknown := sorted(set(order.validation) - trials):
        raise Conflict(
            "no_such_trial",
            Message("There is no trial “{unknown}” among the visit's files.", unknown="”, “".join(unknown)),
        )
    params = {**recordings.job_inputs(this), "order": asdict(order)}
    view = queue.submit(
        c,
        key=f"{this.id}:{TUNE}:{digest_json(params)}:{CODE_VERSION}",
        kind=TUNE,
        params=params,
        recording_id=this.id,
        requested_by=actor.user_id if actor else None,
        priority=Priority.BEHIND,
    )
    audit.record(c, actor, "tuning.requested", "session", session_id, {"job_id": view.id})
    return view


def publish(c: Connection, claim: Claim, files: Mapping[str, bytes], stored: Mapping[str, Blob]) -> None:
    """Store the row of a result, in the transaction that marks its job done."""
    row = {
        "id": new_id(),
        "recording_id": claim.recording_id,
        "job_id": claim.job_id,
        "input_sha256": claim.params["input_sha256"],
        "code_version": CODE_VERSION,
        "result": json.loads(files[RESULT]),
        "created_at": now(),
    }
    c.execute(insert(tuning).values(row))


def get(c: Connection, tuning_id: str) -> StoredTuning:
    """One tuning; raises NotFound."""
    row = c.execute(_QUERY.where(tuning.c.id == tuning_id)).first()
    if row is None:
        raise NotFound("tuning", tuning_id)
    return StoredTuning(**row._asdict())


def of_session(c: Connection, session_id: str) -> list[StoredTuning]:
    """Finished tunings of a session, newest first; raises NotFound for the session."""
    sessions.get(c, session_id)
    rows = c.execute(
        _QUERY.where(recording.c.session_id == session_id).order_by(tuning.c.created_at.desc(), tuning.c.id)
    )
    return [StoredTuning(**row._asdict()) for row in rows]


_QUERY = select(tuning, recording.c.session_id).join(recording, recording.c.id == tuning.c.recording_id)
