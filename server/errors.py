"""Errors of use cases, in addition to those of core; `status` is the corresponding HTTP status.

403 not_yours 404 not_found · 409 code_taken, name_taken, no_files, not_confirmed · 413 file_too_large,
set_too_large, too_many_files · 422 bad_value · 503 node_away, blob_damaged, blob_missing · 507 disk_full
"""

from __future__ import annotations

from sagittal.core.errors import SagittalError
from sagittal.core.message import Message


class ServiceError(SagittalError):
    """A use case cannot be carried out as requested."""

    status = 422


class NotFound(ServiceError):  # noqa: N818 - the name of the HTTP status
    """The requested resource does not exist or has been deleted."""

    status = 404

    def __init__(self, kind: str, identity: str) -> None:
        super().__init__(
            "not_found",
            Message("There is no {kind} '{identity}', or it has been deleted.", kind=kind, identity=identity),
        )


class NotAllowed(ServiceError):  # noqa: N818 - the name of the HTTP status
    """The role permits the action, but not on this resource."""

    status = 403


class Conflict(ServiceError):  # noqa: N818 - the name of the HTTP status
    """The current state does not allow the action; the message explains what to do first."""

    status = 409


NODE_AWAY = "node_away"
"""Also the problem code of a trial whose web server is or was unavailable."""


class NodeAway(ServiceError):  # noqa: N818 - what the person reads
    """The web server that runs a live trial is unavailable."""

    status = 503

    def __init__(self, name: str | None) -> None:
        super().__init__(
            NODE_AWAY,
            Message(
                "This live recording runs on server '{name}', which is unavailable. Try again in a moment.",
                name=name,
            ),
        )


class TooLarge(ServiceError):  # noqa: N818 - the name of the HTTP status
    """A limit of the settings is exceeded."""

    status = 413
