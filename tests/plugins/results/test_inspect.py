"""What is said of a folder of somebody else's before anything that it names is used."""

import json
import sqlite3
from contextlib import closing

import pytest

from core.config.compose import load
from core.errors import UserError
from core.search.orchestration import resume, run
from core.store.database import FILE
from core.support.secrets import is_secret_name
from plugins.results.inspect_command import main as inspect
from plugins.results.pages.runs import LeftOutRun, read_run
from plugins.results.toolbox.toolbox_command import main as toolbox
from tests.core.run_folders import hook, write_run

SMALL = [
    "task=BringCube",
    "sim=mujoco",
    "executor.workers=1",
    "budget=tiny",
    "listener=[]",
    "film=false",
]


@pytest.fixture(autouse=True)
def another_user(tmp_path, monkeypatch):
    """Nobody has typed anything on this machine."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def change(folder, change_config=None, claim=None):
    """Change what a store says of its configuration and its result."""
    with closing(sqlite3.connect(folder / FILE)) as store:
        config, result = store.execute("SELECT config, result FROM run").fetchone()
        config, result = json.loads(config), json.loads(result)
        if change_config is not None:
            config |= change_config
        if claim is not None:
            result["best"]["reward"] = claim
        values = (json.dumps(config), json.dumps(result))
        store.execute("UPDATE run SET config = ?, result = ?", values)
        store.commit()


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "honest"
    result = run(load("config", SMALL), folder)
    assert result.best.reward > 0.9
    return folder


@pytest.mark.thorough
def test_an_honest_claim_replays(honest, capsys):
    assert inspect([str(honest)]) == 0
    said = capsys.readouterr().out
    assert "going on costs nothing" in said
    assert "names nothing outside" in said
    claimed, replayed = said.splitlines()[-1].split(" claims ")[1].split(", replays ")
    assert claimed == replayed


@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
def test_a_false_claim_is_said_and_what_it_replays(tmp_path, capsys):
    folder = write_run(tmp_path / "run", rewards=[[0.99]], tools=[hook(0.2)])
    change(folder, claim=1.0)
    assert inspect([str(folder)]) == 1
    said = capsys.readouterr().out
    assert (
        "its result claims 1.000 for g0-a0-s0-p0, and its evaluation says 0.990" in said
    )
    assert "g0-a0-s0-p0 claims 1.000, replays 0." in said

    with pytest.raises(UserError, match=r"its result claims 1\.000"):
        resume(folder)

    found = read_run(folder)
    assert isinstance(found, LeftOutRun)
    assert "claims 1.000" in found.reason


@pytest.mark.slow
def test_what_goes_beyond_it_is_listed_and_nothing_of_it_used(tmp_path, capsys):
    folder = write_run(tmp_path / "run", rewards=[[0.9]])
    mark = tmp_path / "ran"
    vlm = {
        "name": "command",
        "command": ["touch", str(mark)],
        "environment": ["OPENAI_API_KEY"],
    }
    robot = {"name": "urdf", "path": "/etc/passwd", "base": [0.0, 0.0, 0.0, 0.0]}
    change(folder, {"vlm": vlm, "robot": robot})
    assert inspect([str(folder)]) == 1
    said = capsys.readouterr().out
    for row in (
        f"vlm.command      program     [touch,{mark}]",
        "vlm.environment  keys        [OPENAI_API_KEY]",
        "robot.path       file        /etc/passwd",
    ):
        assert row in said
    assert "going on asks command; " in said
    assert "not played again: " in said
    assert "type it again: robot.path=/etc/passwd" in said
    assert not mark.exists()
    assert is_secret_name("OPENAI_API_KEY")


@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
def test_what_is_typed_once_is_known_from_then_on(tmp_path, capsys):
    folder = write_run(tmp_path / "run", rewards=[[0.9]])
    change(folder, {"vlm": {"name": "command", "command": ["true"]}})
    inspect([str(folder)])
    assert "known here" not in capsys.readouterr().out
    inspect([str(folder), "vlm.command=[true]"])
    assert "it is known here from now on" in capsys.readouterr().out
    inspect([str(folder)])
    assert "names nothing outside" in capsys.readouterr().out


@pytest.mark.slow
def test_what_is_paid_is_said(tmp_path, capsys):
    folder = write_run(tmp_path / "run", rewards=[[0.9]])
    vlm = {"name": "gemini", "model": "gemini/gemini-2.5-pro", "max_cost_usd": None}
    change(folder, {"vlm": vlm, "tool": {"name": "nonesuch"}})
    assert inspect([str(folder)]) == 1
    said = capsys.readouterr().out
    assert "asks gemini/gemini-2.5-pro, which this machine's key pays" in said
    assert "nothing limits it" in said
    assert "not played again: no tool 'nonesuch'" in said


@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
def test_a_library(tmp_path, capsys):
    write_run(tmp_path / "run", "task=MoveBall", rewards=[[0.9]], tools=[hook(0.2)])
    library = tmp_path / "library"
    toolbox(["add", str(tmp_path / "run"), f"output={library}"])
    capsys.readouterr()
    assert inspect([str(library)]) == 1
    assert "MoveBall claims 0.900, replays 0." in capsys.readouterr().out

    (facts,) = library.glob("*/tool.json")
    kept = json.loads(facts.read_text())
    kept["config"]["tool"] = {"name": "known", "file": "/etc/passwd", "of": "boxes"}
    facts.write_text(json.dumps(kept))
    assert inspect([str(library)]) == 1
    said = capsys.readouterr().out
    assert "tool.file  file        /etc/passwd" in said
    assert "type it again: tool.file=/etc/passwd" in said


def test_a_folder_of_nothing(tmp_path):
    with pytest.raises(UserError, match="holds neither a run nor a tool"):
        inspect([str(tmp_path)])
    with pytest.raises(UserError, match="there is no such folder"):
        inspect([str(tmp_path / "none")])
    with pytest.raises(UserError, match="name one folder"):
        inspect([])
