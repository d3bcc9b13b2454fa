"""Open a run's SQLite file: one writer at a time, any number of readers, and one line for each failure."""

from __future__ import annotations

import fcntl
import shutil
import sqlite3
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import UserError
from core.store.rows import MAX_BYTES, checksum, damages
from core.support.files import file_mark
from core.support.secrets import scrub
from core.support.text import clean

if TYPE_CHECKING:
    from filelock import FileLock

FILE = "run.sqlite"
LOCK = "run.lock"

SCHEMA_VERSION = 1  # until something is released
_REFUSALS = {
    getattr(sqlite3, f"SQLITE_{name}")
    for name in ("FULL", "IOERR", "READONLY", "CANTOPEN", "PERM", "BUSY", "CORRUPT", "NOTADB")
}
# What runs write, as patterns; a folder comes before what is in it.
_WRITTEN = (
    *("run.sqlite*", "run.lock", "result.json*", "scene.png", "recording*.rrd", "task.*"),
    *(f"{name}{below}" for name in (".hydra", "requests", "replies", "best") for below in ("", "/*", "/*/*", "/*/*/*")),
)
MOST_BYTES = 4_000_000_000  # of a store
_PATIENCE_S = 10.0  # with another process that has the file open, such as a SQLite shell
_ASKED_S = 0.2  # to wait for a lock that another process may hold for an instant, in `is_held`
_sound: set[object] = set()  # the states of files that this process has checked


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn errors of the disk or of SQLite into one line that says why a run's folder can't be written.

    Raises:
        UserError: the disk is full, the folder is read-only...
    """
    try:
        yield
    except OSError as error:
        raise UserError(_refused(folder, error.strerror or str(error))) from error
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF not in _REFUSALS:
            raise
        raise UserError(_refused(folder, str(error))) from error


def _refused(folder: Path, why: str) -> str:
    return f"{folder} can't be written: {why}; what is in it is kept"


def refuse_links(folder: Path) -> None:
    """Check that what a run writes in its folder stays there.

    Raises:
        UserError: one of its files or folders is a link, or something else that is neither.
    """
    for name in _WRITTEN:
        for path in folder.glob(name):
            if path.is_symlink() or not (path.is_file() or path.is_dir()):
                raise UserError(f"{path} is a link or a device, and a run writes only within its folder; remove it")


@contextmanager
def reading(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the store in ``folder`` to read it. A process that writes it goes on, and no file is left beside it.

    All of it is checked first (`core.store.rows`), once for each state of the file.

    Raises:
        UserError: the folder holds no store, or it can't be read or is damaged; raised for the statements within as
            well.
    """
    file, log, index = (folder / name for name in (FILE, f"{FILE}-wal", f"{FILE}-shm"))
    try:
        if not (file.exists() or file.is_symlink()):
            raise UserError(f"{folder} holds no run: there is no {FILE} in it")
        for path in (file, log, index):
            if path.is_symlink() or (path.exists() and not path.is_file()):
                raise UserError(f"{path} is a link or a device, which is not read")
            if (mark := file_mark(path)) is not None and mark.size > MOST_BYTES:
                raise UserError(f"{path} has {mark.size / 1e9:.1f} GB; at most {MOST_BYTES / 1e9:g} GB are read")
        with tempfile.TemporaryDirectory() as scratch:
            at, mode = file, "mode=ro"
            if not log.exists():
                mode = "mode=ro&immutable=1"  # at rest: SQLite needs no lock, nor a folder that can be written
            elif not index.exists():  # no process has it open; SQLite would make an index, or fail where it can't
                at, mode = Path(shutil.copy(file, scratch)), "mode=rw"
                shutil.copy(log, scratch)
            uri = f"{at.resolve().as_uri()}?{mode}"
            with closing(sqlite3.connect(uri, uri=True, timeout=_PATIENCE_S)) as database:
                database.row_factory = sqlite3.Row
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_BYTES)
                database.execute("PRAGMA trusted_schema = OFF")
                _check(database, file, log)
                yield database
    except (sqlite3.Error, OSError) as error:
        raise UserError(f"{file} can't be read: {_why(error)}") from error


def _check(database: sqlite3.Connection, file: Path, log: Path) -> None:
    """Check all that a store holds.

    Raises:
        sqlite3.DatabaseError: it is damaged.
        UserError: another version wrote it.
    """
    state = file.resolve(), file_mark(file), file_mark(log)
    if state in _sound:
        return
    version = _version(database)
    if version is not None:
        if version != SCHEMA_VERSION:
            raise UserError(
                f"{file} was written by another version: its schema version is {version}, this version reads "
                f"{SCHEMA_VERSION}; it is left as it is"
            )
        try:
            for damage in damages(database):
                raise sqlite3.DatabaseError(damage)
        except UnicodeDecodeError as error:  # of a column's name
            raise sqlite3.DatabaseError("a table's definition is no text") from error
    _sound.add(state)


def _why(error: BaseException) -> str:
    why = clean(str(error), 300)  # SQLite quotes a text that it can't decode
    return why if "use a copy" in why else f"{why}; use a copy"


class Database:
    """``run.sqlite``, open for writing by this process alone until `close`.

    Raises:
        UserError: another process writes it; it is damaged, or another version wrote it; the folder can't be written.
            The file is left as it was.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._using = threading.Lock()
        self._files: dict[str, tuple[int, int]] = {}  # as they were after the first transaction
        self._lost: UserError | None = None
        refuse_links(folder)
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(folder / LOCK)
        try:
            self._check(folder / FILE)
            with writing(folder):
                self._connection = sqlite3.connect(
                    folder / FILE, timeout=_PATIENCE_S, isolation_level=None, check_same_thread=False
                )
                self._connection.row_factory = sqlite3.Row
                self._connection.execute("PRAGMA journal_mode=WAL")
        except BaseException:
            self._lock.release()
            raise

    def _check(self, file: Path) -> None:
        """Check the file before anything is written."""
        if not file.exists() or file.stat().st_size == 0:
            return
        try:
            with reading(self.folder):
                pass
        except UserError as error:
            if error.__cause__ is None:
                raise
            why = f"{file} is damaged: {_why(error.__cause__)}"
            raise UserError(f"{why}; it is left as it is, and so are the replies beside it") from error

    def begun(self) -> bool:
        """Say if a run has begun in it."""
        with self._using, writing(self.folder):
            return _version(self._connection) is not None and bool(
                self._connection.execute("SELECT 1 FROM run").fetchone()
            )

    def create(self) -> None:
        """Make the tables, unless they are there; within a `transaction`."""
        if _version(self._connection) is None:
            schema = Path(__file__).with_name("schema.sql").read_text(encoding="utf-8")
            for statement in schema.split(";"):  # executescript would end the transaction
                self._connection.execute(statement)

    @contextmanager
    def transaction(self, *, paid: bool = False) -> Iterator[None]:
        """Write all of what is done within, or nothing.

        It survives the end of the process. With ``paid`` it survives a power cut too, which takes some milliseconds
        more; else a power cut may lose the last few transactions, in order.

        Raises:
            UserError: it can't be written.
        """
        with self._using, writing(self.folder):
            self._check_open()
            self._connection.execute(f"PRAGMA synchronous={'FULL' if paid else 'NORMAL'}")
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise
            self._check_files()

    def _check_files(self) -> None:
        """Check that the store's files are in their place: SQLite would write on to files that have no name.

        Raises:
            UserError: one was deleted or replaced. The connection is closed, and what was stored is in the folder.
        """
        if self._gone() and (lost := self._gone()):  # at a second look those too that went during the first
            happened = f"{', '.join(lost)} in {self.folder} was deleted or replaced while the run was at work"
            try:
                self._lost = UserError(self._rescue(lost, happened))
            except (OSError, sqlite3.Error) as error:  # the folder goes while the store is written again
                self._lost = UserError(f"{happened}; it can't be written again: {error}")
            finally:
                self._connection.close()
            raise self._lost

    def _gone(self) -> list[str]:
        """Return the names of the files that are not those of before; at first what is there is kept as that."""
        names = (FILE, f"{FILE}-wal", f"{FILE}-shm", LOCK)
        found = {name: mark.identity for name in names if (mark := file_mark(self.folder / name)) is not None}
        self._files = self._files or found
        return [name for name in self._files if found.get(name) != self._files[name]]

    def _rescue(self, lost: Sequence[str], happened: str) -> str:
        """Close the connection, and write the store to the folder again if its file is lost; say what happened."""
        if not self.folder.is_dir():
            self._connection.close()
            return f"{self.folder} was deleted or moved while the run was at work; there is no store in its place"
        if FILE not in lost:
            self._connection.close()  # which brings all to the file
            return f"{happened}; {FILE} is whole"
        copy = self.folder / f"{FILE}.part"
        copy.unlink(missing_ok=True)
        with closing(sqlite3.connect(copy)) as database:
            self._connection.backup(database)
        self._connection.close()
        file = self.folder / FILE
        if file.exists():
            kept = copy.replace(self.folder / f"{FILE}.kept")
            return f"{happened}; all that it held is in {kept.name}, to be put in its place"
        for name in (f"{FILE}-wal", f"{FILE}-shm"):
            (self.folder / name).unlink(missing_ok=True)
        copy.replace(file)
        return f"{happened}; it is written again, and whole"

    def insert(self, table: str, *, replacing: bool = False, **values: Any) -> None:
        """Insert a row, within a `transaction`."""
        columns, marks = ", ".join(values), ", ".join("?" * len(values))
        verb = "REPLACE" if replacing else "INSERT"
        added = self._connection.execute(f"{verb} INTO {table} ({columns}) VALUES ({marks})", _scrubbed(values))
        self._seal(table, added.lastrowid)

    def update(self, table: str, candidate: str | None = None, **values: Any) -> None:
        """Update a candidate's row, or the last one of a table, if there is one, within a `transaction`."""
        which, given = (" WHERE candidate = ?", [candidate]) if candidate is not None else ("", [])
        ((last,),) = self._connection.execute(f"SELECT max(rowid) FROM {table}{which}", given).fetchall()  # noqa: S608
        columns = ", ".join(f"{name} = ?" for name in values)
        self._connection.execute(f"UPDATE {table} SET {columns} WHERE rowid = ?", [*_scrubbed(values), last])  # noqa: S608
        self._seal(table, last)

    def delete(self, table: str, **values: Any) -> None:
        """Delete the rows that have these values, within a `transaction`."""
        where = " AND ".join(f"{name} = ?" for name in values)
        self._connection.execute(f"DELETE FROM {table} WHERE {where}", [*values.values()])  # noqa: S608

    def _seal(self, table: str, at: int | None) -> None:
        """Write the checksum of a row, from its values as SQLite holds them."""
        for row in self._connection.execute(f"SELECT * FROM {table} WHERE rowid = ?", [at]).fetchall():  # noqa: S608
            set_checksum = f"UPDATE {table} SET checksum = ? WHERE rowid = ?"  # noqa: S608
            self._connection.execute(set_checksum, [checksum(row), at])

    def _check_open(self) -> None:
        """Raise again what closed the connection: another thread may still write."""
        if self._lost is not None:
            raise self._lost

    def rows(self, query: str) -> list[sqlite3.Row]:
        with self._using, writing(self.folder):
            self._check_open()
            return self._connection.execute(query).fetchall()

    def close(self) -> None:
        with self._using:
            self._connection.close()
            self._lock.release()


def _scrubbed(values: dict[str, Any]) -> list[Any]:
    return [scrub(value) if isinstance(value, str) else value for value in values.values()]


def _lock(file: Path) -> FileLock:
    """Take the lock, which is held until it is released or the process ends in any way."""
    from filelock import FileLock, Timeout

    lock = FileLock(file, timeout=_ASKED_S, thread_local=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise UserError(
            f"another process is at work on the run in {file.parent}; wait for its end, or end it"
        ) from error
    return lock


def is_held(folder: Path) -> bool:
    """Report whether a process is at work on the run in ``folder``; nothing is written."""
    file = folder / LOCK
    if file.is_symlink() or not file.is_file():
        return False
    try:
        with file.open("rb") as opened:
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:  # it is held, or nobody can tell here
        return True
    return False


def _version(database: sqlite3.Connection) -> int | None:
    """Return the schema version; None: the file is empty.

    Raises:
        sqlite3.Error: it is no store.
    """
    if database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0] == 0:
        return None
    row = database.execute("SELECT schema_version FROM run").fetchone()
    if row is None:
        return SCHEMA_VERSION
    if not isinstance(row[0], int):
        raise sqlite3.DatabaseError("its schema version is no number; use a copy")
    return row[0]
