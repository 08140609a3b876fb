"""All pages."""

from __future__ import annotations

from fastapi import APIRouter

from sagittal.server.pages import audit_log, system, texts
from sagittal.server.pages.account import account, sign_in, users
from sagittal.server.pages.clinic import devices, identity, jobs, new_session, patients, programme
from sagittal.server.pages.live_takes import capture, live
from sagittal.server.pages.results import (
    algorithms,
    calibration,
    compare,
    data,
    parameter,
    patient,
    prescription,
    sensitivity,
    session,
    study,
    timeline,
    trends,
)
from sagittal.server.pages.sharing import handouts, report
from sagittal.server.pages.uploads import upload

ROUTERS: tuple[APIRouter, ...] = (
    account.router,
    algorithms.router,
    audit_log.router,
    calibration.router,
    capture.router,
    compare.router,
    data.router,
    devices.router,
    handouts.router,
    identity.router,
    jobs.router,
    live.router,
    new_session.router,
    parameter.router,
    patient.router,
    patients.router,
    prescription.router,
    programme.router,
    report.router,
    sensitivity.router,
    session.router,
    sign_in.router,
    study.router,
    system.router,
    texts.router,
    timeline.router,
    trends.router,
    upload.router,
    users.router,
)
