"""Logging to standard error: text, or one JSON object per line (SAGITTAL_LOG_FORMAT=json).

Lines logged within a request carry its id (`X-Request-ID` of the response). Logs refer to rows by id, never
to patients by name.
"""

from __future__ import annotations

import datetime as dt
import json
import logging
from contextvars import ContextVar
from typing import Final

from sagittal.server.settings import Settings

request_id: ContextVar[str | None] = ContextVar("request_id", default=None)
"""Id of the current request, None outside a request."""

_STANDARD: Final = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "request_id"}


def start_log(settings: Settings, handler: logging.Handler | None = None) -> None:
    """Log to stderr in the configured format: our own messages, and warnings of some libraries."""
    handler = handler or logging.StreamHandler()
    handler.addFilter(_add_request_id)
    handler.setFormatter(JsonLines() if settings.log_format == "json" else _Lines())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    for library in ("alembic", "procrastinate", "weasyprint", "fontTools"):
        logging.getLogger(library).setLevel(logging.WARNING)
    # it warns at every attempt; a missing connection to PostgreSQL is reported once by the code that needs it
    logging.getLogger("psycopg.pool").setLevel(logging.ERROR)


class JsonLines(logging.Formatter):
    """One object per line: time, level, logger, message, request_id, error and the `extra` of the call."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as JSON."""
        time = dt.datetime.fromtimestamp(record.created, dt.UTC)
        line: dict[str, object] = {
            "time": time.isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        current_id = getattr(record, "request_id", None)
        if current_id is not None:
            line["request_id"] = current_id
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        line |= {name: value for name, value in vars(record).items() if name not in _STANDARD}
        return json.dumps(line, ensure_ascii=False, default=str)


class _Lines(logging.Formatter):
    """Plain-text lines that end with the request id."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - the library's name
        line = super().formatMessage(record)
        current_id = getattr(record, "request_id", None)
        return line if current_id is None else f"{line} [{current_id}]"


def _add_request_id(record: logging.LogRecord) -> bool:
    record.request_id = request_id.get()
    return True
