"""Keep a run in an SQLite file: one writer at a time, any number of readers, and one line for each failure.

No other module knows SQL, or that it is SQLite: they name tables (`core.store.rows.TABLES`) and the values of rows.
"""

from __future__ import annotations

import itertools
import json
import re
import sqlite3
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import UserError
from core.store.rows import MAX_BYTES, TABLES, Row, check_row
from core.support.files import file_mark, unwritable, writing
from core.support.sandbox import isolated
from core.support.secrets import scrub_all
from core.support.text import clean

if TYPE_CHECKING:
    from filelock import FileLock

FILE = "run.sqlite"
LOCK = "run.lock"

SCHEMA_VERSION = 1  # until something is released

# What runs write: files as patterns, and folders with all that is in them.
_FILES = (
    "run.*",
    "result.json*",
    "lessons.json*",
    "scene.png",
    "recording*.rrd",
)
_FOLDERS = (".hydra", "requests", "replies", "best")

_OUR_FAULTS = ("SQLITE_ERROR", "SQLITE_CONSTRAINT", "SQLITE_MISUSE")
_ORDERS = {"evaluations": "generation, agent, design, plan"}  # others: as they came
_PATIENCE_S = 10.0  # with another process that has the file open, as a SQLite shell
_ASKED_S = 0.2  # to wait for a lock that another process holds for an instant
_sound: set[object] = set()  # the states of files that this process has checked

# What others made is read within these bounds. A store takes some 2 kB for a rollout.
MOST_FILE = 4_000_000_000  # bytes
MOST_ROWS = 2_000_000  # of a table
ALONE = 50_000_000  # bytes, from which on it is first read in a process of its own
MOST_S = 600.0  # for a statement
_LOOK = 100_000  # SQLite's steps between two looks at the clock, some milliseconds
_MADE = re.compile(r"CREATE (TABLE|(UNIQUE )?INDEX) ", re.IGNORECASE)
_COMPUTED = (2, 3)  # how SQLite marks generated columns

# What evaluations refer to and is not there, in words.
_LOOSE_ENDS = """
SELECT 'evaluations: ' || candidate || ' has no row in designs' FROM evaluations AS e
WHERE status = 'ok' AND NOT EXISTS (
    SELECT 1 FROM designs AS d WHERE d.generation = e.generation AND d.agent = e.agent AND d.design = e.design
)
UNION ALL
SELECT 'evaluations: trial ' || tried.value || ' of ' || candidate || ' has no row in trials'
FROM evaluations, json_each(json_extract(details, '$.trials', '$.finals')) AS kind, json_each(kind.value) AS tried
WHERE tried.value NOT IN (SELECT number FROM trials)
"""

_dump = partial(json.dumps, default=float)  # an engine's numbers may be numpy's


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn errors of the disk and of SQLite into one line that says why a run's folder can't be written.

    Raises:
        UserError: see `writing`.
    """
    try:
        with writing(folder):
            yield
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorname", "SQLITE_MISUSE").startswith(_OUR_FAULTS):
            raise
        raise unwritable(folder, error) from error


def refuse_links(folder: Path) -> None:
    """Check that what a run writes in its folder stays there.

    Raises:
        UserError: one of its files or folders is a link, or something else that is neither.
    """
    patterns = [*_FILES, *_FOLDERS, *(f"{name}/**/*" for name in _FOLDERS)]
    for path in itertools.chain(*map(folder.glob, patterns)):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise UserError(
                f"{path} is a link or a device, and a run writes only within its folder; remove it"
            )


@contextmanager
def reading(folder: Path, *, check: bool = True) -> Iterator[sqlite3.Connection]:
    """Open the store in ``folder`` to read it; a process that writes it goes on.

    All of it is checked first (`core.store.rows`), once for each state of the file, unless ``check`` is false.

    Raises:
        UserError: the folder holds no store, or it can't be read or is damaged; raised for the statements within as
            well.
    """
    file = folder / FILE
    log = folder / f"{FILE}-wal"

    try:
        if not file.exists():
            raise UserError(f"{folder} holds no run: there is no {FILE} in it")
        for path in folder.glob(f"{FILE}*"):
            # Opening a pipe would wait without end, and a link leads out of the folder.
            if path.is_symlink() or not path.is_file():
                raise UserError(f"{path} is no regular file")
            if path.stat().st_size > MOST_FILE:
                raise UserError(f"{path} has more than {MOST_FILE / 1e9:g} GB")

        # Without a log it is at rest: SQLite needs no lock, nor a folder that can be written.
        mode = "mode=ro" if log.exists() else "mode=ro&immutable=1"
        address = f"{file.resolve().as_uri()}?{mode}"
        connection = sqlite3.connect(address, uri=True, timeout=_PATIENCE_S)
        with closing(connection) as database:
            database.row_factory = sqlite3.Row
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_BYTES)
            database.execute("PRAGMA trusted_schema = OFF")
            _limit_time(database)
            state = (file.resolve(), file_mark(file), file_mark(log))
            if check and state not in _sound:
                if file.stat().st_size > ALONE:
                    isolated(check_alone, str(file), b"", str(folder.resolve()))
                _check(database, file)
                _sound.add(state)

            yield database
    except (sqlite3.Error, OSError) as error:
        why = clean(str(error), 300)  # SQLite quotes a text that it can't decode
        raise UserError(f"{file} can't be read: {why}; use a copy") from error


def check_alone(_: bytes, folder: str) -> bytes:
    """Check a store whole in a process of its own that has limits.

    Raises:
        UserError: a table can't be read, or not within these.
    """
    with reading(Path(folder), check=False) as database:
        _check(database, Path(folder) / FILE)

    return b"sound"


def _limit_time(database: sqlite3.Connection) -> None:
    """End a statement that takes too long, and let a signal end it before: SQLite looks at no signal."""
    until = time.monotonic() + MOST_S
    database.set_progress_handler(lambda: time.monotonic() > until, _LOOK)


def _refuse_programs(database: sqlite3.Connection) -> None:
    """Check that all tables hold what stands in them: a view or a generated column computes it, maybe without end.

    Raises:
        sqlite3.DatabaseError: one does not.
    """
    for (made,) in database.execute("SELECT sql FROM sqlite_master WHERE sql NOTNULL"):
        if not _MADE.match(str(made)):
            raise sqlite3.DatabaseError(f"it holds more than tables: {made}")

    for table in TABLES:
        columns = database.execute(
            "SELECT name, hidden FROM pragma_table_xinfo(?)", (table,)
        )
        for name, hidden in columns:
            if hidden in _COMPUTED:
                raise sqlite3.DatabaseError(f"its column {table}.{name} is computed")


def _check(database: sqlite3.Connection, file: Path) -> None:
    """Check all that a store holds; a file without tables is one of a run that was killed at once.

    Raises:
        sqlite3.Error: it is damaged.
        UserError: another version wrote it.
    """
    if not _has_tables(database):
        return
    _refuse_programs(database)
    for row in database.execute("SELECT schema_version FROM run"):
        if row["schema_version"] != SCHEMA_VERSION:
            raise UserError(
                f"{file} was written by another version of this program; it is left as it is"
            )

    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise sqlite3.DatabaseError(found)

    for table in TABLES:
        for row in _rows(database, table):
            try:
                check_row(table, row)
            except ValueError as error:
                fault = f"row {row['row_number']} of {table}: {error}"
                raise sqlite3.DatabaseError(fault) from error

    for (fault,) in database.execute(_LOOSE_ENDS):
        raise sqlite3.DatabaseError(fault)


def _rows(database: sqlite3.Connection, table: str) -> Iterator[Row]:
    """Yield the rows of a table in their order, each with its ``row_number``."""
    order = _ORDERS.get(table, "rowid")
    rows = database.execute(
        f"SELECT rowid AS row_number, * FROM {table} ORDER BY {order}"  # noqa: S608
    )
    for count, row in enumerate(rows):
        if count == MOST_ROWS:
            raise sqlite3.DatabaseError(f"{table} has more than {MOST_ROWS:,} rows")
        yield row


def read_table(folder: Path, table: str) -> list[Row]:
    """Return the rows of a table, in their order.

    Raises:
        UserError: see `reading`.
    """
    with reading(folder) as database:
        return list(_rows(database, table))


def _has_tables(database: sqlite3.Connection) -> bool:
    return database.execute("SELECT 1 FROM sqlite_master").fetchone() is not None


class Database:
    """``run.sqlite``, open for writing by this process alone until `close`.

    Threads may share it: a `transaction` or a query waits for the one that is under way. Any number of processes may
    read it meanwhile (`reading`).

    Raises:
        UserError: another process writes it; it is damaged, or another version wrote it; the folder can't be written.
            The file is left as it was.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._using = threading.Lock()
        refuse_links(folder)

        with _writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(folder / LOCK)

        try:
            file = folder / FILE
            if file.exists() and file.stat().st_size > 0:
                with reading(folder):  # which checks it
                    pass

            with _writing(folder):
                self._connection = sqlite3.connect(
                    file,
                    timeout=_PATIENCE_S,
                    isolation_level=None,
                    check_same_thread=False,
                )
                self._connection.row_factory = sqlite3.Row
                self._connection.execute("PRAGMA journal_mode=WAL")
        except BaseException:
            self._lock.release()
            raise

    def begun(self) -> bool:
        """Say if a run has begun in it."""
        return _has_tables(self._connection) and bool(self.table("run"))

    def create(self) -> None:
        """Make the tables, unless they are there; within a `transaction`."""
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
        with self._using, _writing(self.folder):
            level = "FULL" if paid else "NORMAL"
            self._connection.execute(f"PRAGMA synchronous={level}")
            self._connection.execute("BEGIN IMMEDIATE")

            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def add(self, table: str, **values: Any) -> None:
        """Add a row, within a `transaction`; lists, tuples and mappings are written as JSON, and keys are left out.

        Raises:
            UserError: no reader would take it.
        """
        self._write("INSERT", table, values)

    def put(self, table: str, **values: Any) -> None:
        """Add a row, in the place of one with the same key if there is one; see `add`."""
        self._write("REPLACE", table, values)

    def put_run(self, **values: Any) -> None:
        """Write the one row of the run itself in place of the one that is there; see `add`."""
        self._execute("DELETE FROM run")
        self.add("run", **values)

    def forget_reply(self, request: str, generation: int, agent: int) -> None:
        """Delete a reply, and the rejections that came of it, within a `transaction`."""
        self._execute("DELETE FROM replies WHERE request_id = ?", request)
        self._execute(
            "DELETE FROM evaluations WHERE generation = ? AND agent = ? AND status = 'rejected'",
            generation,
            agent,
        )

    def note_seconds(self, seconds: float) -> None:
        """Note how long the last session has taken, within a `transaction`."""
        self._execute(
            "UPDATE sessions SET seconds = ? WHERE number = (SELECT max(number) FROM sessions)",
            seconds,
        )

    def table(self, name: str) -> list[Row]:
        """Return all rows of a table, in their order."""
        with self._using, _writing(self.folder):
            return list(_rows(self._connection, name))

    def _write(self, verb: str, table: str, values: Mapping[str, Any]) -> None:
        row = {
            name: _dump(value) if isinstance(value, list | tuple | dict) else value
            for name, value in values.items()
        }
        try:
            check_row(table, row)
        except ValueError as error:
            raise UserError(f"{table} can't be stored: {error}") from error

        columns = ", ".join(row)
        marks = ", ".join("?" * len(row))
        self._execute(
            f"{verb} INTO {table} ({columns}) VALUES ({marks})", *row.values()
        )

    def _execute(self, statement: str, *values: Any) -> None:
        scrubbed = iter(scrub_all(value for value in values if isinstance(value, str)))
        kept = [next(scrubbed) if isinstance(value, str) else value for value in values]
        self._connection.execute(statement, kept)

    def close(self) -> None:
        with self._using:
            self._connection.close()
            self._lock.release()


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
