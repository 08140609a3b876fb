"""Figures of the server, for Prometheus: administrators, or a token with the scope `metrics`."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST

from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.metrics import RequestMetrics

router = APIRouter(include_in_schema=False)


@router.get("/metrics", dependencies=[require(Action.READ_SYSTEM)])
def read_metrics(request: Request) -> Response:
    """Everything in the text format of Prometheus."""
    metrics: RequestMetrics = request.app.state.metrics
    return Response(metrics.render(), media_type=CONTENT_TYPE_LATEST)
