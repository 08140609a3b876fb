"""The clinic's sensors by serial number: quality checks from their trials, and their last placement.

Rows are written with the analysis they come from and deleted with its recording (services/erasure.py). They
identify no patient and no visit, only days, so reading them is not audited.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, Select, delete, func, insert, select

from sagittal.core.quality.device_course import DeviceCourse, follow_device
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.errors import NotFound
from sagittal.server.storage.schema.tables import device_check, now, recording, session

LISTED: Final = 200
"""Devices in a list, and in the data sent to a tablet."""

FOLLOWED: Final = 50
"""Latest checks of a device that are displayed and compared."""

REMEMBERED_DAYS: Final = 365
"""How long a placement is suggested again (our choice)."""


@dataclass(frozen=True, eq=False)
class DatedCheck:
    """Check of a device in one trial, with its placement."""

    day: dt.date
    segment: str
    check: DeviceCheck


@dataclass(frozen=True, eq=False)
class KnownDevice:
    """A device with its latest checks, oldest first, and their summary; `takes` counts all trials."""

    device_id: str
    takes: int
    checks: tuple[DatedCheck, ...]
    course: DeviceCourse

    @property
    def last(self) -> DatedCheck:
        """The latest trial with the device."""
        return self.checks[-1]


@dataclass(frozen=True)
class LastPlaces:
    """Placement of devices in the clinic's latest trials: serial number → segment, each segment once."""

    segments: Mapping[str, str]
    day: dt.date | None
    """Date of the latest of these trials; None = unknown."""


NO_PLACES: Final = LastPlaces({}, None)


def keep_checks(c: Connection, recording_id: str, checks: Sequence[Mapping[str, Any]]) -> None:
    """Store the device checks of an analysis, in the transaction that publishes it.

    Replaces the checks of earlier analyses of the session, which cover the same samples or are superseded.

    Parameters
    ----------
    checks : `devices` of analysis.json.
    """
    own = select(recording.c.session_id).where(recording.c.id == recording_id).scalar_subquery()
    siblings = select(recording.c.id).where(recording.c.session_id == own).scalar_subquery()
    c.execute(delete(device_check).where(device_check.c.recording_id.in_(siblings)))
    for one in checks:
        content = {name: one[name] for name in DeviceCheck.__dataclass_fields__}
        row = {name: one[name] for name in ("device_id", "segment", "exchanged")}
        c.execute(insert(device_check).values(**row, recording_id=recording_id, content=content, at=now()))


def list_devices(c: Connection) -> list[KnownDevice]:
    """All devices of the clinic, most recently used first."""
    rows = c.execute(_newest_of_each(FOLLOWED)).all()
    grouped: dict[str, list[Any]] = {}
    for row in rows:
        grouped.setdefault(row.device_id, []).append(row)
    devices = [_known(checks) for checks in grouped.values()]
    devices.sort(key=lambda d: d.device_id)
    devices.sort(key=lambda d: d.last.day, reverse=True)
    return devices[:LISTED]


def get(c: Connection, device_id: str) -> KnownDevice:
    """One device; raises NotFound."""
    rows = c.execute(_newest_of_each(FOLLOWED, [device_id])).all()
    if not rows:
        raise NotFound("sensor", device_id)
    return _known(rows)


def recall_places(
    c: Connection, device_ids: Collection[str] | None = None, *, but: str | None = None
) -> LastPlaces:
    """Placement of devices in the clinic's latest trial with each.

    If two devices claim the same segment, the more recently used one takes it. Trials with swapped sensors
    and those older than `REMEMBERED_DAYS` are ignored.

    Parameters
    ----------
    device_ids : None = all of the clinic, at most `LISTED`. but : a session to exclude.
    """
    since = now().date() - dt.timedelta(days=REMEMBERED_DAYS)
    query = _placed(device_ids).where(~device_check.c.exchanged, session.c.performed_on >= since)
    if but is not None:
        query = query.where(session.c.id != but)
    last = query.subquery()
    newest = (
        select(last)
        .where(last.c.place == 1)
        .order_by(last.c.day.desc(), last.c.began.desc(), last.c.device_id)
    )
    segments: dict[str, str] = {}
    days = []
    for row in c.execute(newest.limit(LISTED)):
        if row.segment not in segments.values() or device_ids is None:
            segments[row.device_id] = row.segment
            days.append(row.day)
    return LastPlaces(segments, max(days, default=None))


def _placed(device_ids: Collection[str] | None) -> Select[Any]:
    """Checks with the day of their trial; the latest of each device has place 1."""
    newest_first = (session.c.performed_on.desc(), recording.c.created_at.desc())
    query = (
        select(
            device_check.c.device_id,
            device_check.c.segment,
            device_check.c.content,
            session.c.performed_on.label("day"),
            recording.c.created_at.label("began"),
            func.row_number()
            .over(partition_by=device_check.c.device_id, order_by=newest_first)
            .label("place"),
            func.count().over(partition_by=device_check.c.device_id).label("takes"),
        )
        .join(recording, recording.c.id == device_check.c.recording_id)
        .join(session, session.c.id == recording.c.session_id)
    )
    return query if device_ids is None else query.where(device_check.c.device_id.in_(device_ids))


def _newest_of_each(most: int, device_ids: Collection[str] | None = None) -> Select[Any]:
    ranked = _placed(device_ids).subquery()
    return select(ranked).where(ranked.c.place <= most).order_by(ranked.c.device_id, ranked.c.place.desc())


def _known(rows: Sequence[Any]) -> KnownDevice:
    checks = tuple(DatedCheck(row.day, row.segment, DeviceCheck.from_json(row.content)) for row in rows)
    return KnownDevice(rows[0].device_id, rows[0].takes, checks, follow_device([x.check for x in checks]))
