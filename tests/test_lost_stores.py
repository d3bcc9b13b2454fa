"""A store that is deleted, moved or replaced while a run is at work: the run ends with a line, and nothing is lost."""

import shutil
import sqlite3
from pathlib import Path

import pytest

from core.errors import UserError
from core.search.orchestration import resume, run
from core.store.database import FILE, LOCK
from tests import toys
from tests.test_resume import assert_same_run, toy, whole  # noqa: F401  # fixtures


def delete(folder):
    (folder / FILE).unlink()


def delete_all(folder):
    others = [file for file in folder.glob("run.*") if file.name != FILE]
    (folder / FILE).unlink()  # first: a reply may be stored meanwhile, and then finds the store gone, not its log
    for file in others:
        file.unlink(missing_ok=True)


def move(folder):
    (folder / FILE).rename(folder.parent / "moved.sqlite")


def delete_log(folder):
    (folder / f"{FILE}-wal").unlink()


def delete_lock(folder):
    (folder / LOCK).unlink()


def replace(folder):
    (folder / FILE).unlink()
    sqlite3.connect(folder / FILE).execute("CREATE TABLE other (number)").connection.close()


def cut_short(folder, act, monkeypatch, notes, at):
    """Run until rollout number ``at``, when something happens to the folder."""
    rollout, count = toys.ToyEngine.rollout, []

    def rolled(self, task, jobs):
        count.append(jobs)
        if len(count) == at:
            act(folder)
        return rollout(self, task, jobs)

    with monkeypatch.context() as patched:
        patched.setattr(toys.ToyEngine, "rollout", rolled)
        with pytest.raises(UserError) as caught:
            run(toys.config(notes.file), folder)
    assert len(count) >= at
    return str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("at", [2, *(pytest.param(at, marks=pytest.mark.thorough) for at in (1, 4))])
@pytest.mark.parametrize("act", [delete, delete_all, move, delete_log, delete_lock])
def test_a_store_that_is_gone_is_written_again(act, at, toy, whole, tmp_path, monkeypatch):  # noqa: F811
    folder = tmp_path / "run"
    line = cut_short(folder, act, monkeypatch, toy, at)
    assert f"in {folder} was deleted or replaced while the run was at work; " in line
    assert line.endswith(f"to go on: python -m core.run resume={folder}")
    assert {file.name for file in folder.glob("run.*")} <= {FILE, LOCK}
    with sqlite3.connect(folder / FILE) as database:  # a reply that arrives later is not in it
        stored = {name for (name,) in database.execute("SELECT request_id FROM replies")}
    asked = toy.lines("asked")
    resume(folder)
    assert_same_run(folder, whole)
    assert not stored & set(toy.lines("asked")[len(asked) :])  # nothing that is stored is paid twice


def test_a_store_that_is_replaced_is_kept_beside(toy, tmp_path, monkeypatch):  # noqa: F811
    folder = tmp_path / "run"
    line = cut_short(folder, replace, monkeypatch, toy, 3)
    assert f"all that it held is in {FILE}.kept, to be put in its place" in line
    assert sqlite3.connect(folder / FILE).execute("SELECT name FROM sqlite_master").fetchall() == [("other",)]
    (folder / f"{FILE}.kept").replace(folder / FILE)
    resume(folder)


def test_a_folder_that_is_gone_is_not_made_again(toy, tmp_path, monkeypatch):  # noqa: F811
    folder = tmp_path / "run"

    def delete(folder):
        while folder.exists():  # the run may write in it meanwhile
            shutil.rmtree(folder, ignore_errors=True)

    said = cut_short(folder, delete, monkeypatch, toy, 3)  # a thread may store a reply while files are deleted
    assert f"{folder} was deleted or " in said
    assert not folder.exists()


def test_a_folder_that_goes_while_the_store_is_written_again_is_one_line(toy, tmp_path, monkeypatch):  # noqa: F811
    """Another thread that writes later hears the same, and not of a closed connection."""
    replaced = Path.replace

    def gone(path, target):
        if path.name == f"{FILE}.part":
            shutil.rmtree(path.parent)
        return replaced(path, target)

    monkeypatch.setattr(Path, "replace", gone)
    assert "was deleted or replaced while the run was at work; it can't be written again: " in cut_short(
        tmp_path / "run", delete_all, monkeypatch, toy, 3
    )


def test_a_folder_that_is_moved_goes_on_where_it_is(toy, whole, tmp_path, monkeypatch):  # noqa: F811
    folder, new = tmp_path / "run", tmp_path / "new"
    assert f"{folder} was deleted or moved" in cut_short(folder, lambda old: old.rename(new), monkeypatch, toy, 3)
    resume(new)
    assert_same_run(new, whole)
