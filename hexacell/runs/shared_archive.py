"""What all cells of a shared archive have put there, on whatever computers they are; only read."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import inspect, make_url, select
from sqlalchemy.exc import SQLAlchemyError

from hexacell.runs.archive import ARCHIVE_TABLE, open_engine
from hexacell.runs.archived_documents import ArchiveUnavailable, DocumentKind


@dataclass(frozen=True, slots=True)
class SharedDocument:
    """A document of one cell; ``place`` is the computer and folder of its runs."""

    place: str
    cell: str
    run: str
    content: bytes


def shared_documents(url: str, kind: DocumentKind) -> tuple[SharedDocument, ...]:
    """All documents of one kind, by cell, place and run; none where no cell has put anything there.

    Raises:
        ArchiveUnavailable: it cannot be read.
    """
    columns = ARCHIVE_TABLE.c
    query = (
        select(columns.place, columns.cell, columns.run, columns.content)
        .where(columns.kind == kind.value)
        .order_by(columns.cell, columns.place, columns.run)
    )
    address = make_url(url)
    try:
        engine = open_engine(address)
        with engine.connect() as connection:
            if not inspect(connection).has_table(ARCHIVE_TABLE.name):
                return ()
            return tuple(SharedDocument(*row) for row in connection.execute(query))
    except ModuleNotFoundError as error:
        action = "Install hexacell[postgresql]"
        raise ArchiveUnavailable(str(error), subject="PostgreSQL", action=action) from error
    except SQLAlchemyError as error:
        reason = " ".join(str(getattr(error, "orig", None) or error).split())
        raise ArchiveUnavailable(
            f"the archive cannot be read ({reason})",
            subject=address.render_as_string(),
            action="Check its address, and that the server runs",
        ) from error
