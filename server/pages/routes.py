"""All pages."""

from __future__ import annotations

from fastapi import APIRouter

from server.pages import (
    account,
    algorithms,
    audit_log,
    calibration,
    capture,
    compare,
    data,
    devices,
    jobs,
    live,
    new_session,
    parameter,
    patient,
    patients,
    prescription,
    programme,
    sensitivity,
    session,
    sign_in,
    texts,
    timeline,
    trends,
    upload,
    users,
)

ROUTERS: tuple[APIRouter, ...] = (
    account.router,
    algorithms.router,
    audit_log.router,
    calibration.router,
    capture.router,
    compare.router,
    data.router,
    devices.router,
    jobs.router,
    live.router,
    new_session.router,
    parameter.router,
    patient.router,
    patients.router,
    prescription.router,
    programme.router,
    sensitivity.router,
    session.router,
    sign_in.router,
    texts.router,
    timeline.router,
    trends.router,
    upload.router,
    users.router,
)
