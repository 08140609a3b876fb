"""Alembic environment; run by server/storage/migrate.py, which says where the database is.

All steps are one transaction with the row of the revision (measured: Alembic's default on SQLite left half a
migration behind that failed for ever; this leaves exactly the old revision). A second program that migrates
waits at the first statement, and finds it done.
"""

from alembic import context

from sagittal.server.storage.db import engine_of
from sagittal.server.storage.schema.columns import UserJson, UserString
from sagittal.server.storage.schema.tables import Utc, metadata


def render(kind: str, item: object, _: object) -> str | bool:
    # a revision is history: it names plain types, not classes that may change
    if kind == "type" and isinstance(item, UserString | UserJson):
        return f"sa.{item.impl_instance!r}"
    return "sa.DateTime(timezone=True)" if kind == "type" and isinstance(item, Utc) else False


if context.is_offline_mode():
    raise SystemExit("Migrations are checked against the data; run them online.")

kind = engine_of(context.config.attributes["database"])
engine = kind.migrator()
try:
    with engine.connect() as connection:
        context.configure(
            connection=connection,
            target_metadata=metadata,
            transactional_ddl=True,
            render_as_batch=True,
            render_item=render,
            compare_type=True,
            compare_server_default=True,
        )
        with context.begin_transaction():
            context.run_migrations()
            violations = kind.dangling(connection)
            if violations:
                raise RuntimeError(
                    f"The migration would leave {len(violations)} dangling rows: {violations[0]}."
                )
finally:
    engine.dispose()
