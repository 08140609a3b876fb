"""Permission table: actions allowed per role. An action without an entry is denied."""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """Role of a user in the clinic."""

    ADMIN = "admin"
    CLINICIAN = "clinician"
    ASSISTANT = "assistant"
    """Uploads recordings and sees their inspection, but no results."""
    VIEWER = "viewer"


class Action(StrEnum):
    """Action performed by a route; every route declares exactly one."""

    SIGN_IN = "sign_in"
    SET_UP = "set_up"
    CHECK_HEALTH = "check_health"
    LOAD_ASSET = "load_asset"
    USE_ACCOUNT = "use_account"
    WATCH_SIGN_IN = "watch_sign_in"
    """Queries the remaining time of the sign-in; the only action that does not prolong it."""
    READ_API = "read_api"
    READ_PATIENT = "read_patient"
    WRITE_PATIENT = "write_patient"
    DELETE_PATIENT = "delete_patient"
    EXPORT_PATIENT = "export_patient"
    """Exports all stored data of a patient."""
    EXPORT_STUDY = "export_study"
    """Exports pseudonymized results of many patients."""
    OPEN_IN_EMERGENCY = "open_in_emergency"
    """Opens a patient of another care team temporarily, with a reason."""
    READ_IDENTITY = "read_identity"
    """Reads and prints the patient's name, date of birth and address."""
    WRITE_IDENTITY = "write_identity"
    READ_SESSION = "read_session"
    CREATE_SESSION = "create_session"
    WRITE_SESSION = "write_session"
    DELETE_SESSION = "delete_session"
    UPLOAD = "upload"
    ANALYSE = "analyse"
    READ_RESULT = "read_result"
    REVIEW = "review"
    """Edits events and excludes or includes strides."""
    SIGN_REPORT = "sign_report"
    """Writes the assessment, signs, reopens, creates and revokes links."""
    READ_SHARED = "read_shared"
    """Reads one signed report, authorized by the token in the URL."""
    RUN_LIVE = "run_live"
    """Opens a live trial, monitors it and gives feedback."""
    PAIR = "pair"
    """Joins a tablet, authorized by the code on the therapist's screen."""
    STREAM = "stream"
    """Streams the samples of one trial, authorized by its token in the first message."""
    READ_JOB = "read_job"
    CANCEL_JOB = "cancel_job"
    READ_DEVICE = "read_device"
    """Views the clinic's sensors, without patient data."""
    MANAGE_USERS = "manage_users"
    READ_AUDIT = "read_audit"
    READ_SYSTEM = "read_system"
    """Views the state of the installation and reads its metrics."""


PUBLIC: frozenset[Action] = frozenset(
    {
        Action.SIGN_IN,
        Action.SET_UP,
        Action.CHECK_HEALTH,
        Action.LOAD_ASSET,
        Action.PAIR,
        Action.STREAM,
        Action.READ_SHARED,
    }
)
"""Actions allowed without a sign-in."""

_ALL = frozenset(Role)
_CLINICAL = frozenset({Role.ADMIN, Role.CLINICIAN})
_UPLOADERS = _CLINICAL | {Role.ASSISTANT}
_READERS = _CLINICAL | {Role.VIEWER}
_ADMIN = frozenset({Role.ADMIN})

POLICY: dict[Action, frozenset[Role]] = {
    Action.USE_ACCOUNT: _ALL,
    Action.WATCH_SIGN_IN: _ALL,
    Action.READ_API: _ALL,
    Action.READ_PATIENT: _ALL,
    Action.WRITE_PATIENT: _CLINICAL,
    Action.DELETE_PATIENT: _CLINICAL,
    Action.EXPORT_PATIENT: _CLINICAL,
    Action.EXPORT_STUDY: _CLINICAL,
    Action.OPEN_IN_EMERGENCY: _CLINICAL,
    Action.READ_IDENTITY: _CLINICAL,
    Action.WRITE_IDENTITY: _CLINICAL,
    Action.READ_SESSION: _ALL,
    Action.CREATE_SESSION: _UPLOADERS,
    Action.WRITE_SESSION: _CLINICAL,
    Action.DELETE_SESSION: _CLINICAL,
    Action.UPLOAD: _UPLOADERS,
    Action.ANALYSE: _CLINICAL,
    Action.READ_RESULT: _READERS,
    Action.REVIEW: _CLINICAL,
    Action.SIGN_REPORT: _CLINICAL,
    Action.RUN_LIVE: _CLINICAL,
    Action.READ_JOB: _ALL,
    Action.CANCEL_JOB: _UPLOADERS,
    Action.READ_DEVICE: _UPLOADERS,
    Action.MANAGE_USERS: _ADMIN,
    Action.READ_AUDIT: _ADMIN,
    Action.READ_SYSTEM: _ADMIN,
}


def is_permitted(role: Role, action: Action) -> bool:
    """Whether this role permits the action for a signed-in user; an action without an entry is denied."""
    return action in PUBLIC or role in POLICY.get(action, frozenset())
