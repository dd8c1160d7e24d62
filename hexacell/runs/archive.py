"""The archive: an index over the run folders of a cell, in SQLite or in a PostgreSQL that cells share.

The folders are the truth. The archive keeps documents that were derived from them, each with the stamp of
its folder then (:mod:`~hexacell.runs.run_folder`); where the folder has another stamp now, the
document counts for nothing. So it may be deleted at any time; a damaged file is replaced.
"""

import os
import socket
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from sqlalchemy import (
    URL,
    Column,
    Connection,
    Engine,
    LargeBinary,
    MetaData,
    String,
    Table,
    bindparam,
    create_engine,
    inspect,
    make_url,
    select,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.pool import NullPool
from sqlalchemy.schema import CreateTable

from hexacell.runs.run_folder import ArchiveUnavailable, DocumentKind, StampedDocument
from hexacell.storage.atomic_files import NOT_FOR_OTHERS

VERSION = 1
"""Version of the documents and their table; a newer program makes a table of its own and fills it anew."""

INDEX = "index.sqlite"
"""The file of a cell's own archive, in the folder of its runs."""

PATIENCE_S = 5
"""Longest wait for a database server or for another process, s."""

Found = TypeVar("Found")

ARCHIVE_TABLE = Table(
    f"hexacell_runs_{VERSION}",
    MetaData(),
    Column("place", String(1024), primary_key=True),
    Column("run", String(255), primary_key=True),
    Column("kind", String(16), primary_key=True),
    Column("cell", String(64), nullable=False),
    Column("stamp", String(255), nullable=False),
    Column("content", LargeBinary, nullable=False),
)

_READ_ONLY_OR_BUSY = frozenset(
    {
        sqlite3.SQLITE_BUSY,
        sqlite3.SQLITE_LOCKED,
        sqlite3.SQLITE_READONLY,
        sqlite3.SQLITE_FULL,
        sqlite3.SQLITE_CANTOPEN,
        sqlite3.SQLITE_PERM,
        sqlite3.SQLITE_AUTH,
    }
)


class Archive:
    """The documents of one cell.

    Args:
        folder: of the cell's runs, which exists.
        cell: its name, for those who read a shared archive.
        url: of a shared PostgreSQL; without one, a file in ``folder``.
    """

    def __init__(self, folder: Path, cell: str, url: str | None = None) -> None:
        self._file = folder / INDEX if url is None else None
        self._cell = cell
        # A folder that is moved or copied takes its own file along, where the place is always the same.
        self._place = "" if url is None else f"{socket.gethostname()}:{folder.absolute()}"
        self._url = URL.create("sqlite", database=str(folder / INDEX)) if url is None else make_url(url)
        self._is_ready = False

    @cached_property
    def _engine(self) -> Engine:
        return open_engine(self._url, ". The runs are read from their folders")

    def documents(self, kind: DocumentKind) -> dict[str, StampedDocument]:
        """All documents of one kind, by the names of their runs; raises ``ArchiveUnavailable``."""
        query = select(ARCHIVE_TABLE.c.run, ARCHIVE_TABLE.c.stamp, ARCHIVE_TABLE.c.content).where(
            ARCHIVE_TABLE.c.place == self._place, ARCHIVE_TABLE.c.kind == kind.value
        )

        rows = self._transact(lambda connection: connection.execute(query).all())
        return {run: StampedDocument(stamp, content) for run, stamp, content in rows}

    def store(self, kind: DocumentKind, documents: Mapping[str, StampedDocument]) -> None:
        """Keep documents, in the place of older ones; raises ``ArchiveUnavailable``."""
        rows = [
            {"place": self._place, "run": run, "kind": kind.value, "cell": self._cell}
            | {"stamp": one.stamp, "content": one.content}
            for run, one in documents.items()
        ]

        # Another process may keep the same document meanwhile.
        insert = (sqlite.insert if self._file is not None else postgresql.insert)(ARCHIVE_TABLE)
        fresh = {name: insert.excluded[name] for name in ("cell", "stamp", "content")}
        upsert = insert.on_conflict_do_update(index_elements=["place", "run", "kind"], set_=fresh)

        if rows:
            self._transact(lambda connection: connection.execute(upsert, rows))

    def forget(self, runs: Sequence[str]) -> None:
        """Drop everything about runs that are gone; raises ``ArchiveUnavailable``."""
        query = ARCHIVE_TABLE.delete().where(
            ARCHIVE_TABLE.c.place == self._place, ARCHIVE_TABLE.c.run == bindparam("of_run")
        )
        if runs:
            self._transact(lambda connection: connection.execute(query, [{"of_run": run} for run in runs]))

    def close(self) -> None:
        """Close all connections."""
        if "_engine" in vars(self):
            self._engine.dispose()

    def _transact(self, act: Callable[[Connection], Found]) -> Found:
        """Do something in one transaction; in a new file where the old one is damaged."""
        try:
            return self._act(act)
        except UnicodeEncodeError as error:  # the name of a run, or of their folder, is no text
            raise self._unavailable(error) from error
        except SQLAlchemyError as error:
            code = getattr(getattr(error, "orig", None), "sqlite_errorcode", None)
            # Any other code is of a file that is no SQLite database, or has other tables than it should.
            if self._file is None or code is None or code & 0xFF in _READ_ONLY_OR_BUSY:
                raise self._unavailable(error) from error
        self._is_ready = False
        for path in (self._file, self._file.with_name(f"{INDEX}-journal")):
            path.unlink(missing_ok=True)
        try:
            return self._act(act)
        except SQLAlchemyError as error:
            raise self._unavailable(error) from error

    def _act(self, act: Callable[[Connection], Found]) -> Found:
        if self._file is not None and not self._is_ready:
            if self._file.is_symlink():  # SQLite would follow it, and make or change another file
                raise ArchiveUnavailable("is a link", subject=self._file, action="Remove it")
            # SQLite would make a file as the umask has it; where it cannot, it says why.
            with suppress(OSError):
                flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY
                os.close(os.open(self._file, flags, 0o666 & ~NOT_FOR_OTHERS))
        with self._engine.begin() as connection:
            if not self._is_ready:
                if not inspect(connection).has_table(ARCHIVE_TABLE.name):
                    # Another process may make it at this moment.
                    connection.execute(CreateTable(ARCHIVE_TABLE, if_not_exists=True))
                self._is_ready = True
            return act(connection)

    def _unavailable(self, error: Exception) -> ArchiveUnavailable:
        where = self._url.render_as_string() if self._file is None else self._file
        return ArchiveUnavailable(
            f"the archive cannot be used ({_reason(error)})",
            subject=where,
            action="The runs are read from their folders, which takes longer",
        )


def open_engine(url: URL, otherwise: str = "") -> Engine:
    """An engine for SQLite or PostgreSQL, not connected yet.

    Raises:
        ArchiveUnavailable: the library for it is not installed; ``otherwise`` is added to what to do.
    """
    if url.drivername == "sqlite":
        return create_engine(url, poolclass=NullPool, connect_args={"timeout": PATIENCE_S})
    with_driver = url.set(drivername="postgresql+psycopg")
    try:
        return create_engine(with_driver, poolclass=NullPool, connect_args={"connect_timeout": PATIENCE_S})
    except ModuleNotFoundError as error:
        action = f"Install hexacell[postgresql]{otherwise}"
        raise ArchiveUnavailable(str(error), subject="PostgreSQL", action=action) from error


def _reason(error: Exception) -> str:
    """What the database said, in one line."""
    return " ".join(str(getattr(error, "orig", None) or error).split())


def shared_documents(url: str, kind: DocumentKind) -> list[tuple[str, str, str, bytes]]:
    """All documents of one kind, sorted: cell, place, run and content; raises ``ArchiveUnavailable``.

    The place is the computer and folder of the runs. Empty where no cell has put anything there.
    """
    columns = ARCHIVE_TABLE.c
    query = (
        select(columns.cell, columns.place, columns.run, columns.content)
        .where(columns.kind == kind.value)
        .order_by(columns.cell, columns.place, columns.run)
    )
    address = make_url(url)
    try:
        with open_engine(address).connect() as connection:
            if not inspect(connection).has_table(ARCHIVE_TABLE.name):
                return []
            return [(cell, place, run, data) for cell, place, run, data in connection.execute(query)]
    except SQLAlchemyError as error:
        raise ArchiveUnavailable(
            f"the archive cannot be read ({_reason(error)})",
            subject=address.render_as_string(),
            action="Check its address, and that the server runs",
        ) from error
