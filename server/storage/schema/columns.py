"""What tables are made of: ids, times, JSON, references, stored files, names, the rule of a few values."""

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
    """Text that a person entered or uploaded: rows give it as `UserText`, which no page translates."""

    impl = String
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        """Hand the driver a plain string."""
        return None if value is None else str(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> UserText | None:
        """Give back user text."""
        return None if value is None else UserText(value)


class UserLines(UserString):
    """The same without a limit of its length."""

    impl = Text
    cache_ok = True


class UserJson(TypeDecorator[Any]):
    """JSON whose texts were entered or uploaded, or are codes that no page shows: all of them `UserText`."""

    impl = JSON
    cache_ok = True

    def __init__(self) -> None:
        super().__init__(none_as_null=True)

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        """Give back the value with every text marked."""
        return mark_user_text(value)


def new_id() -> str:
    """A fresh random id: 32 hex digits of a uuid4."""
    return uuid.uuid4().hex


def now() -> dt.datetime:
    """The time as tables keep it: aware, UTC."""
    return dt.datetime.now(dt.UTC)


class Utc(TypeDecorator[dt.datetime]):
    """An aware time, stored as UTC; naive times are refused."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: dt.datetime | None, dialect: Dialect) -> dt.datetime | None:
        """Refuse a naive time, store UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"{value} has no time zone; give an aware time.")
        utc = value.astimezone(dt.UTC)
        return utc.replace(tzinfo=None) if dialect.name == "sqlite" else utc

    def process_result_value(self, value: dt.datetime | None, dialect: Dialect) -> dt.datetime | None:
        """Give back an aware UTC time."""
        if value is None:
            return None
        return value.replace(tzinfo=dt.UTC) if value.tzinfo is None else value.astimezone(dt.UTC)


def make_all(kind: Callable[..., Made], result: Result[Any]) -> list[Made]:
    """Make of every row of a result what takes its columns by their names."""
    names = tuple(result.keys())
    return [kind(**dict(zip(names, row, strict=True))) for row in result]


def id_column() -> Column[str]:
    """The column of a table's own id."""
    return Column("id", String(32), primary_key=True)


def reference(name: str, target: str, *, nullable: bool = False, index: bool = True) -> Column[str]:
    """A column of ids of another table, whose rows cannot go while this one refers to them."""
    key = ForeignKey(f"{target}.id", ondelete="RESTRICT")
    return Column(name, String(32), key, nullable=nullable, index=index)


def owner(name: str, target: str) -> Column[str]:
    """The primary key, or a part of it, of rows that belong to a row of another table: that row's id."""
    return Column(name, String(32), ForeignKey(f"{target}.id", ondelete="RESTRICT"), primary_key=True)


def describe_file() -> tuple[Column[int], Column[str], CheckConstraint]:
    """The columns of a file of storage/blobs.py, size in bytes and SHA-256, and their rule."""
    return (
        Column("size", Integer().with_variant(BigInteger(), "postgresql"), nullable=False),
        Column("sha256", String(64), nullable=False, index=True),
        CheckConstraint("size >= 0", name="size"),
    )


def one_of(column: str, values: Sequence[str]) -> CheckConstraint:
    """The rule that a column holds one of these values."""
    quoted = ", ".join(f"'{v}'" for v in values)
    return CheckConstraint(f"{column} IN ({quoted})", name=column)
