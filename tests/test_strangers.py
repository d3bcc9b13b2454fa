"""Folders that a stranger made: what each door of the program does with them."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from core.config.compose import load, task_part, tool_part
from core.designs.reading import load_designs
from core.errors import UserError
from core.plugins import installed
from core.search.orchestration import resume, run
from core.store.database import FILE
from core.store.library import read_facts
from plugins.results.chosen import DesignsConfig
from plugins.results.report.entries import read_entry
from plugins.results.report.report_command import main as report
from plugins.results.study.study_command import main as run_study
from plugins.results.study.study_files import read_study
from plugins.results.toolbox.toolbox_command import main as toolbox
from plugins.results.transfer import configured
from plugins.tasks.file.task import FileTask
from plugins.vlms.context.examples import read_winner
from plugins.vlms.context.lessons import read_lessons
from tests.core.run_folders import hook, write_run

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def another_user(tmp_path, monkeypatch):
    """Nobody has typed anything on this machine."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("OPENAI_API_KEY", "sk-proj-canary0123456789")


@pytest.fixture
def folder(tmp_path):
    return write_run(tmp_path / "theirs", rewards=[[0.5]], tools=[hook(0.2)])


def change(folder, ended=True, **sections):
    with closing(sqlite3.connect(folder / FILE)) as store:
        (config,) = store.execute("SELECT config FROM run").fetchone()
        changed = json.loads(config) | sections
        if not ended:
            changed["budget"]["n_iteration"] = 5
            store.execute("UPDATE run SET result = NULL")
        store.execute("UPDATE run SET config = ?", (json.dumps(changed),))
        store.commit()
    return changed


def programs(mark):
    command = {
        "name": "command",
        "command": ["sh", "-c", f"env > {mark}"],
        "environment": ["OPENAI_API_KEY"],
    }
    return {
        "alone": command,
        "in an ensemble": {"name": "ensemble", "members": [command, "gemini"]},
    }


@pytest.mark.parametrize("way", programs(""))
def test_a_strangers_program_is_not_run(folder, tmp_path, way):
    mark = tmp_path / "ran"
    change(folder, ended=False, vlm=programs(mark)[way])
    with pytest.raises(UserError, match="was not begun by you on this machine") as said:
        resume(folder, ["vlm.timeout_s=5"])
    assert "vlm." in str(said.value).partition("type it again: ")[2]
    assert not mark.exists()


@pytest.mark.thorough
def test_an_agents_server_does_not_run_it_either(folder, tmp_path):
    mark = tmp_path / "ran"
    change(folder, ended=False, vlm=programs(mark)["alone"])
    words = ["-m", "core", "mcp", f"resume={folder}"]
    done = subprocess.run(
        [sys.executable, *words], stdin=subprocess.DEVNULL, capture_output=True
    )
    assert done.returncode == 1
    assert b"was not begun by you on this machine" in done.stderr
    assert not mark.exists()


FILES = {
    "an arm": {"robot": {"name": "urdf", "path": "/etc/hostname", "base": [0.0] * 4}},
    "a scene": {"task": {"name": "file", "file": "/etc/hostname"}},
    "a tool": {"tool": {"name": "known", "file": "/etc/hostname", "of": "boxes"}},
}


@pytest.mark.parametrize("sections", FILES.values(), ids=FILES)
def test_its_designs_are_used_without_the_files_that_it_names(folder, sections, capsys):
    change(folder, **sections)
    with pytest.raises(UserError, match=r"type it again: .*=/etc/hostname"):
        configured([f"designs={folder}"])
    with pytest.raises(UserError, match="type it again: vlmgineer inspect"):
        toolbox(["add", str(folder), f"output={folder.parent / 'library'}"])

    # Figures are shown all the same.
    report([str(folder), f"output={folder.parent / 'report'}"])
    assert "0.500" in capsys.readouterr().out


def test_what_is_typed_again_is_used(folder, tmp_path):
    """A file that lies elsewhere here is typed with its place here."""
    assert DesignsConfig.task
    change(folder, task={"name": "file", "file": "/theirs/scene.yaml"})
    cfg = configured([f"designs={folder}", f"task.file={tmp_path / 'scene.yaml'}"])
    assert (cfg.task.name, cfg.task.file) == ("file", str(tmp_path / "scene.yaml"))


def test_an_example_names_no_file(folder):
    change(folder, task={"name": "file", "file": "/etc/hostname"})
    tools = tool_part(load("config", ["task=BringCube"])).create()
    with pytest.raises(UserError, match=r"prompt.examples: .*type it again: vlmgineer"):
        read_winner(str(folder), tools)


def test_a_library_reads_its_own_files_alone(tmp_path, folder):
    library = tmp_path / "library"
    toolbox(["add", str(folder), f"output={library}"])
    cfg = load("config", ["task=BringCube", "tool=known", f"tool.library={library}"])

    def kept():
        return tool_part(cfg).create().kept(task_part(cfg).create())

    assert len(kept()) == 1
    (facts,) = library.glob("*/tool.json")
    before = facts.read_text()
    document = json.loads(before)
    document["config"]["tool"] = {"name": "known", "file": "/dev/zero", "of": "boxes"}
    facts.write_text(json.dumps(document))
    with pytest.raises(UserError, match=r"type it again: .*tool\.file=/dev/zero"):
        kept()

    facts.write_text(before)
    design = facts.with_name("design.json")
    shutil.move(design, tmp_path / "design.json")
    design.symlink_to(tmp_path / "design.json")
    with pytest.raises(UserError, match="is a link that leads out of"):
        kept()

    design.unlink()
    os.mkfifo(design)
    with pytest.raises(UserError, match="is no regular file"):
        kept()


@pytest.mark.parametrize("kind", ["pipe", "device", "huge", "link"])
def test_lessons_are_a_small_file_of_their_folder(tmp_path, kind):
    folder = tmp_path / "lessons"
    folder.mkdir()
    file = folder / "lessons.json"
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "huge":
        with file.open("wb") as stream:
            stream.truncate(50_000_000_000)
    else:
        (tmp_path / "mine.json").write_text('{"lessons": []}')
        file.symlink_to(tmp_path / "mine.json")
    with pytest.raises(UserError, match=r"regular file|at most 1 MB|leads out"):
        read_lessons(folder)


DOORS = {
    "designs": load_designs,
    "a library's tool": lambda file: read_facts(file.parent),
    "a study": read_study,
    "a scene": lambda file: FileTask(str(file)),
    "an arm": lambda file: installed().create("robot", "urdf", {"path": str(file)}),
    "results of others": read_entry,
}
"""What reads a file of somebody else."""


def make_strange(file, kind):
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "folder":
        file.mkdir()
    else:
        with file.open("wb") as stream:
            stream.truncate(50_000_000_000)


@pytest.mark.parametrize("kind", ["pipe", "device", "huge", "folder"])
@pytest.mark.parametrize("door", DOORS)
def test_each_door_takes_small_regular_files_alone(tmp_path, door, kind):
    file = tmp_path / ("tool.json" if "library" in door else "theirs.yaml")
    make_strange(file, kind)
    with pytest.raises(
        UserError, match=r"regular file|at most [\d.]+ MB|directory|a link|folder"
    ):
        DOORS[door](file)


@pytest.mark.thorough
def test_a_study_goes_on_with_no_program_of_a_stranger(tmp_path):
    """Its folder may be somebody else's: it holds a run that has not ended, whose configuration names a program."""
    settings = ["film=false", "sim=mujoco", "listener=[]", "prompt.picture=false"]
    study = {
        "about": "One method.",
        "tasks": ["BringCube"],
        "seeds": 1,
        "settings": settings,
        "budgets": {"tiny": ["budget.n_agent=1", "budget.n_tool=1"]},
        "methods": [{"name": "first", "settings": ["budget.n_iteration=1"]}],
    }
    file = tmp_path / "small.yaml"
    file.write_text(json.dumps(study))
    done = tmp_path / "done"
    with pytest.raises(UserError, match="runs failed"):
        run_study([str(file), f"folder={done}", "launch=false"])

    mark = tmp_path / "ran"
    (log,) = done.glob("*/*/*.log")
    theirs = write_run(log.with_suffix(""), rewards=[[0.5]], tools=[hook(0.2)])
    change(theirs, ended=False, vlm=programs(mark)["alone"])
    with pytest.raises(UserError, match="was not begun by you on this machine"):
        run_study([str(file), f"folder={done}"])

    assert not mark.exists()


@pytest.mark.thorough
def test_what_this_user_began_goes_on_without_a_word(tmp_path, monkeypatch):
    """A program of one's own, and a scene in a file of one's own; elsewhere both are typed again."""
    answer = ROOT / "tests/tasks/solutions/BringCube.json"
    words = [
        "task=BringCube",
        "sim=mujoco",
        "vlm=command",
        f"vlm.command=[cat,{answer}]",
        "prompt.repair=0",
        "prompt.picture=false",
        "budget=tiny",
        "listener=[]",
        "film=false",
    ]
    folder = tmp_path / "run"
    run(load("config", words), folder)
    with monkeypatch.context() as elsewhere:
        elsewhere.setenv("XDG_STATE_HOME", str(tmp_path / "elsewhere"))
        with pytest.raises(UserError, match=r"type it again: 'vlm\.command=\[cat,"):
            resume(folder, ["budget.n_iteration=1"])
        again = [f"vlm.command=[cat,{answer}]"]
        resume(folder, ["budget.n_iteration=1", *again])
        resume(folder, ["budget.n_iteration=2"])  # which is known there from then on

    shutil.move(folder, tmp_path / "moved")
    with pytest.raises(UserError, match=r"type it again: 'vlm\.command="):
        resume(tmp_path / "moved", ["budget.n_iteration=3"])  # of another place
