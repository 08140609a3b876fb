"""Report of an analysis: stored files and edits, worded for pages, API and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sagittal.core.change import sort_changes
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.errors import NotFound
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.history.comparison import add_changes, compare_figures
from sagittal.server.report.view.behind import ParameterStrides, open_row
from sagittal.server.report.view.headline import find_changes
from sagittal.server.report.view.level import level_column
from sagittal.server.report.view.model import PreviousVisit, ReportModel, report_model
from sagittal.server.results import analyses, controls, edit_log
from sagittal.server.results.comparisons import pair_norms
from sagittal.server.results.controls import ControlVisit
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses


def read(
    reviewed: ReviewedAnalyses,
    record: analyses.AnalysisRecord,
    edits: edit_log.EditHistory,
    patient: Patient,
    session: Session,
    previous: AnalysedSession | None = None,
    control_visits: Sequence[ControlVisit] = (),
) -> tuple[Bundle, ReportModel]:
    """Describe an analysis with edits for a patient and date; raises IntegrityError.

    Parameters
    ----------
    previous : visit with which the table is compared, None = none.
    control_visits : of the clinic's own controls.
    """
    bundle = reviewed.read_bundle(record, edits)
    age = patient.find_age(session.performed_on)
    height = patient.find_height(session)
    speed = next((p.mean for p in bundle.parameters if p.name == "gait_speed_mps"), None)
    model = report_model(
        bundle,
        age=age,
        sex=patient.sex,
        height_m=height,
        affected=patient.affected_side,
        controls=controls.make_group(reviewed, control_visits, speed),
        treadmill=session.protocol == "treadmill",
    )
    model = replace(model, condition=AnalysedSession(session, record, edits).condition.words)
    if previous is None:
        return bundle, model
    old, new = reviewed.read_numbers(previous.found, previous.edits), reviewed.read_numbers(record, edits)
    norm_pair = pair_norms(patient, (previous.session, old), (session, new))
    changed = compare_figures(old, new, norm_pair, patient.affected_side)
    since = PreviousVisit(previous.session.id, previous.session.performed_on)
    headline = model.headline
    if headline is not None and model.quality.kind != "bad":
        facts = sort_changes(changed)
        headline = replace(headline, changed=find_changes(facts), changes=facts)
    groups = add_changes(model.groups, changed)
    test = None if model.functional is None else model.functional.compare_with(old.parameters)
    return bundle, replace(model, groups=groups, since=since, headline=headline, functional=test)


def behind_number(
    reviewed: ReviewedAnalyses,
    record: analyses.AnalysisRecord,
    edits: edit_log.EditHistory,
    patient: Patient,
    session: Session,
    name: str,
    control_visits: Sequence[ControlVisit] = (),
) -> ParameterStrides:
    """One parameter with its strides; raises NotFound, IntegrityError."""
    bundle, model = read(reviewed, record, edits, patient, session, control_visits=control_visits)
    row = next((r for _, rows in model.groups for r in rows if r.name == name), None)
    if row is None:
        raise NotFound("parameter", name)
    columns = reviewed.read_columns(record, edits)
    standing = {} if bundle.angles is None else bundle.angles.standing_deg
    column = columns.get(name) or level_column(name, bundle.strides, columns, standing)
    return open_row(row, bundle.strides, column, model.duration_s)
