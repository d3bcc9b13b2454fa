"""Reading a store that another process writes, that a killed process left, or that can't be written."""

import os
import shutil

import pytest

from core.errors import UserError
from core.interfaces import Reply
from core.plugins import installed
from core.search.run_settings import stored_config
from core.store.database import FILE, Database, reading
from core.store.recorder import RunStore
from plugins.results.pages.runs import read_run
from plugins.results.transfer import configured
from tests.core.run_folders import write_run


@pytest.fixture
def unfinished(tmp_path):
    """A run's folder as it is while a process writes it: part of it is in the write-ahead log."""
    folder = write_run(tmp_path / "run", rewards=[[0.3]], finish=False)
    assert (folder / f"{FILE}-wal").stat().st_size > 0
    return folder


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def rewards(folder):
    with reading(folder) as database:
        return [
            row["reward"] for row in database.execute("SELECT reward FROM evaluations")
        ]


def test_a_log_in_a_folder_that_cannot_be_written(unfinished, sealed):
    """Through every door: the report's, transfer's and the replaying model's."""
    folder = sealed(unfinished, None)
    with pytest.raises(OSError, match=r"Read-only|Permission"):
        (folder / "new").touch()
    before = files(folder)
    assert rewards(folder) == [0.3]
    assert read_run(folder).reason.startswith("1 candidates done, in generation 0")
    assert (
        configured([f"designs={folder}"]).task.name
        == stored_config(folder)["task"]["name"]
        == "BringCube"
    )
    assert (
        installed()
        .create("vlm", "replay", {"run": str(folder)})
        .model.startswith("replay of ")
    )
    assert files(folder) == before


def test_a_killed_run_that_was_copied_without_its_index(unfinished, tmp_path):
    folder = shutil.copytree(
        unfinished,
        tmp_path / "copy",
        ignore=shutil.ignore_patterns("*-shm", "run.lock"),
    )
    assert rewards(folder) == [0.3]


def test_reading_neither_waits_for_a_writer_nor_stops_it(tmp_path):
    writer = Database(tmp_path)
    with writer.transaction():
        writer.create()
        writer.add("replies", **vars(Reply("g0-a0", "", "m")))
    query = "SELECT request_id FROM replies"
    with reading(tmp_path) as database:
        with writer.transaction():
            writer.add("replies", **vars(Reply("g0-a1", "", "m")))
            assert [row[0] for row in database.execute(query)] == ["g0-a0"]
        assert [row[0] for row in database.execute(query)] == ["g0-a0", "g0-a1"]
    writer.close()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "holds no run: there is no run.sqlite in it"),
        (
            b"no database at all, only text " * 50,
            "can't be read: file is not a database",
        ),
        (b"SQLite format 3\0" + bytes(9000), "can't be read: "),
    ],
)
def test_what_cannot_be_read_is_one_line(tmp_path, content, said):
    if content is not None:
        (tmp_path / FILE).write_bytes(content)
    for read in (rewards, stored_config):
        with pytest.raises(UserError) as error:
            read(tmp_path)
        assert said in str(error.value)
        assert "\n" not in str(error.value)


def test_a_statement_that_fails_is_one_line_too(tmp_path):
    folder = write_run(tmp_path / "run")
    with (
        pytest.raises(UserError, match=r"can't be read: no such table: songs"),
        reading(folder) as database,
    ):
        database.execute("SELECT * FROM songs")


@pytest.mark.parametrize("name", [FILE, "replies/g0-a0.txt"])
def test_a_pipe_in_a_run_folder_is_not_waited_for_on_resume(tmp_path, name):
    """Whoever opened it would wait without end."""
    folder = write_run(tmp_path / "run")
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    with pytest.raises(UserError, match=f"{name} is a link or a device"):
        RunStore.open(folder)
