"""Prometheus metrics, for administrators or tokens with the scope `metrics`."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST

from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.context import state_of

router = APIRouter(include_in_schema=False)


@router.get("/metrics", dependencies=[require(Action.READ_SYSTEM)])
def read_metrics(request: Request) -> Response:
    """All metrics in the Prometheus text format."""
    return Response(state_of(request).metrics.render(), media_type=CONTENT_TYPE_LATEST)
