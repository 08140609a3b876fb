"""Prometheus metrics: request counters, and state collected at scrape time.

No metric identifies a person, a patient or an address; routes are patterns.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import func, select

from sagittal.server.nodes.registry import Nodes
from sagittal.server.safekeeping import backup_schedule
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.high_water import read_newest
from sagittal.server.storage.schema.live_tables import OPEN_TAKE_STATES, live_take
from sagittal.server.storage.schema.tables import JOB_STATES, job, now, session

BUCKETS_S: Final = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""The target for page requests is 0.3 s."""

METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
OTHER_METHOD: Final = "other"


class RequestMetrics:
    """Request metrics since start, with a separate registry for each application."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self._count = Counter(
            "sagittal_requests",
            "Requests that were answered",
            ("method", "route", "status"),
            registry=self.registry,
        )
        self._time = Histogram(
            "sagittal_request_seconds",
            "Time to the end of the answer",
            ("route",),
            buckets=BUCKETS_S,
            registry=self.registry,
        )

    def observe(self, method: str, route: str, status: int, took_s: float) -> None:
        """Count one request; unknown methods share one label, so that clients cannot create series."""
        self._count.labels(method if method in METHODS else OTHER_METHOD, route, str(status)).inc()
        self._time.labels(route).observe(took_s)

    def render(self) -> bytes:
        """All metrics in the Prometheus text format 0.0.4."""
        return generate_latest(self.registry)


class StateCollector(Collector):
    """Metrics collected at each scrape: jobs, live trials, components, disk, backups and audit log.

    Parameters
    ----------
    checks : components of the installation, each "ok" or a description of the fault. nodes : the web servers.
    """

    def __init__(
        self, settings: Settings, db: Database, checks: Callable[[], Mapping[str, str]], nodes: Nodes
    ) -> None:
        self._settings, self._db, self._checks, self._nodes = settings, db, checks, nodes

    def collect(self) -> Iterator[Metric]:
        """Current metrics."""
        with self._db.read() as c:
            counts = c.execute(select(job.c.state, func.count()).group_by(job.c.state)).all()
            jobs = dict.fromkeys(JOB_STATES, 0) | {row[0]: row[1] for row in counts}
            oldest = c.execute(select(func.min(job.c.created_at)).where(job.c.state == "queued")).scalar()
            is_open = live_take.c.state.in_(OPEN_TAKE_STATES)
            takes = c.execute(select(func.count()).where(is_open)).scalar_one()
            sessions = c.execute(select(func.count()).select_from(session)).scalar_one()
            head = read_newest(c)
        family = GaugeMetricFamily("sagittal_jobs", "Jobs by state", labels=("state",))
        for state, number in jobs.items():
            family.add_metric((state,), number)
        yield family
        waited = 0.0 if oldest is None else (now() - oldest).total_seconds()
        yield _gauge("sagittal_oldest_job_wait_seconds", "How long the oldest waiting job has waited", waited)
        yield _gauge("sagittal_live_takes_open", "Live takes that are not over", takes)
        yield _gauge("sagittal_sessions", "Visits stored", sessions)
        yield _gauge("sagittal_audit_rows", "Number of the newest audit row", head.seq if head else 0)
        free = shutil.disk_usage(self._settings.data_dir).free
        yield _gauge("sagittal_disk_free_bytes", "Free space of the data folder", free)
        family = GaugeMetricFamily("sagittal_part_up", "1 = this part works", labels=("part",))
        for part, status in self._checks().items():
            family.add_metric((part,), float(status == "ok"))
        yield family
        if self._nodes.is_one_of_several:
            family = GaugeMetricFamily("sagittal_node_up", "1 = this one is heard of", labels=("node",))
            for node in self._nodes.list_all():
                if node.beat_at is not None:
                    family.add_metric((node.name,), float(self._nodes.is_living(node, now())))
            yield family
        yield from self._backups()

    def _backups(self) -> Iterator[Metric]:
        state = backup_schedule.read_state(self._settings)
        if state.good is not None:
            yield _gauge(
                "sagittal_backup_last_success_timestamp_seconds", "When it ended", state.good.at.timestamp()
            )
            yield _gauge("sagittal_backup_last_size_bytes", "Size of its file", state.good.size)
        if state.test is not None:
            yield _gauge(
                "sagittal_restore_test_timestamp_seconds", "When it ended", state.test.at.timestamp()
            )
            yield _gauge(
                "sagittal_restore_test_good", "1 = it could be restored", float(state.test.ok is True)
            )


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(name, text, value=value)
