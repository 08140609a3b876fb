"""Column types and constraints: ids, times, JSON, references, stored files, names, enumerations."""

from __future__ import annotations

import datetime as dt
import uuid
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from sqlalchemy import (
    JSON,
    BigInteger,
    CheckConstraint,
    Column,
    DateTime,
    Dialect,
    ForeignKey,
    Integer,
    MetaData,
    Result,
    String,
    Text,
    TypeDecorator,
)

from sagittal.core.user_text import UserText, mark_user_text

Made = TypeVar("Made")

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)

Json = JSON(none_as_null=True)


class UserString(TypeDecorator[str]):
    """Text entered or uploaded by users: loaded as `UserText`, which pages do not translate."""

    impl = String
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        """Pass a plain string to the driver."""
        return None if value is None else str(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> UserText | None:
        """Return user text."""
        return None if value is None else UserText(value)


class UserLines(UserString):
    """User text without a length limit."""

    impl = Text
    cache_ok = True


class UserJson(TypeDecorator[Any]):
    """JSON whose texts are user input, or codes that pages never show: all are loaded as `UserText`."""

    impl = JSON
    cache_ok = True

    def __init__(self) -> None:
        super().__init__(none_as_null=True)

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        """Return the value with every text marked."""
        return mark_user_text(value)


def new_id() -> str:
    """A new random id: 32 hex digits of a uuid4."""
    return uuid.uuid4().hex


def now() -> dt.datetime:
    """Current time as stored in tables: aware, UTC."""
    return dt.datetime.now(dt.UTC)


class Utc(TypeDecorator[dt.datetime]):
    """Aware time, stored as UTC; naive times are rejected."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: dt.datetime | None, dialect: Dialect) -> dt.datetime | None:
        """Reject a naive time, store UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"{value} has no time zone; give an aware time.")
        utc = value.astimezone(dt.UTC)
        return utc.replace(tzinfo=None) if dialect.name == "sqlite" else utc

    def process_result_value(self, value: dt.datetime | None, dialect: Dialect) -> dt.datetime | None:
        """Return an aware UTC time."""
        if value is None:
            return None
        return value.replace(tzinfo=dt.UTC) if value.tzinfo is None else value.astimezone(dt.UTC)


def make_all(kind: Callable[..., Made], result: Result[Any]) -> list[Made]:
    """Convert all rows of a result by passing their columns as keyword arguments."""
    names = tuple(result.keys())
    return [kind(**dict(zip(names, row, strict=True))) for row in result]


def id_column() -> Column[str]:
    """Primary key column."""
    return Column("id", String(32), primary_key=True)


def reference(name: str, target: str, *, nullable: bool = False, index: bool = True) -> Column[str]:
    """Foreign key column; referenced rows cannot be deleted."""
    key = ForeignKey(f"{target}.id", ondelete="RESTRICT")
    return Column(name, String(32), key, nullable=nullable, index=index)


def owner(name: str, target: str) -> Column[str]:
    """Primary key (or part of it) that is the id of the owning row in another table."""
    return Column(name, String(32), ForeignKey(f"{target}.id", ondelete="RESTRICT"), primary_key=True)


def describe_file() -> tuple[Column[int], Column[str], CheckConstraint]:
    """Columns and constraint of a file of storage/blobs.py: size in bytes and SHA-256."""
    return (
        Column("size", Integer().with_variant(BigInteger(), "postgresql"), nullable=False),
        Column("sha256", String(64), nullable=False, index=True),
        CheckConstraint("size >= 0", name="size"),
    )


def one_of(column: str, values: Sequence[str]) -> CheckConstraint:
    """Constraint that a column has one of these values."""
    quoted = ", ".join(f"'{v}'" for v in values)
    return CheckConstraint(f"{column} IN ({quoted})", name=column)
