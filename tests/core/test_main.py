"""The command ``vlmgineer``: it lists the commands, runs them, and does not import from the working directory."""

import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from core.__main__ import dispatch_words
from core.errors import UserError
from core.plugins import installed
from core.plugins.own_commands import COMMANDS

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCRIPT = [str(Path(sys.executable).with_name("vlmgineer"))]
TINY = [
    *("run", "task=LiftBox", "budget.n_agent=1", "budget.n_tool=1", "budget.n_action=1", "budget.n_iteration=0"),
    *("executor.workers=1", "film=false", "listener=[]"),
]


def call(folder, *words, start=SCRIPT):
    return subprocess.run([*start, *words], cwd=folder, capture_output=True, text=True, timeout=240)


def listed(done):
    """Return the names in the table under the usage."""
    return [line.split()[0] for line in done.stdout.partition("\ncommand ")[2].splitlines()[1:]]


def test_every_command_is_listed_with_a_line(tmp_path):
    done = call(tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert call(tmp_path, "--help").stdout == done.stdout
    assert listed(done) == installed().names("command")
    files = [file for file in (ROOT / "core").rglob("*.py") if "    command(main)\n" in file.read_text()]
    assert set(COMMANDS) == {file.stem if file.stem != "__main__" else file.parent.name for file in files}


def test_a_command_may_end_the_process_and_a_part_that_it_makes_may_not(tmp_path, monkeypatch):
    tasks = """
import core.hooks, tests.faults

class Leaving(tests.faults.Slide):
    def scene(self, seed):
        raise SystemExit(0)

tasks = core.hooks.hookimpl(lambda: {"Leaving": Leaving})
"""
    commands = """
import sys, core.hooks, core.plugins

def leave(words):
    words and core.plugins.installed().create("task", words[0]).scene(0)
    sys.exit(3)

commands = core.hooks.hookimpl(lambda: {"leave": core.hooks.Command("leave", leave)})
"""
    monkeypatch.setattr(installed(), "offers", dict(installed().offers))
    monkeypatch.syspath_prepend(tmp_path)
    for name, text in (("leaving_tasks", tasks), ("leaving_commands", commands)):
        (tmp_path / f"{name}.py").write_text(text)
        installed().register(importlib.import_module(name), name, "leaving-parts")
    with pytest.raises(SystemExit, match="3"):
        dispatch_words(["leave"])
    with pytest.raises(UserError, match="task 'Leaving' of leaving-parts raised SystemExit: 0"):
        dispatch_words(["leave", "Leaving"])


def test_a_run_needs_no_other_command(tmp_path, monkeypatch):
    """Of the plugins only those that the run names; core's own commands are always there."""
    monkeypatch.setenv(
        "VLMGINEER_PLUGINS", "robotoolbench,robots,simulators,vlms,tools,actions,sampling,fitness,executors"
    )
    assert listed(call(tmp_path)) == sorted(COMMANDS)
    done = call(tmp_path, *TINY, "sim=mujoco", "evolution=sampling", "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run" / "result.json").read_text())["task"] == "LiftBox"


def test_an_unknown_command_is_one_line(tmp_path):
    done = call(tmp_path, "rnu")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: no command 'rnu' (did you mean 'run'?); possible: conformance, evaluate, ")


def test_mistakes_have_the_same_line_and_exit_status(tmp_path):
    words = ["run", "task=OneBok"]
    done, other = call(tmp_path, *words), call(tmp_path, *words[1:], start=[sys.executable, "-m", "core.run"])
    assert (done.returncode, done.stderr) == (other.returncode, other.stderr) == (2, other.stderr)


@pytest.mark.parametrize("name", ["tasks.py", "conf.py", "core.py"])
def test_modules_in_the_working_directory_hide_nothing(tmp_path, name):
    (tmp_path / name).write_text("raise SystemExit('the wrong module')")
    assert "BringCube" in call(tmp_path, "plugins").stdout
    if name == "core.py":
        return  # nothing of ours is imported
    done = call(tmp_path, "task=OneBook", start=[sys.executable, "-m", "core.run"])
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: {tmp_path / name} hides VLMgineer's own package {name[:-3]!r}, which is in {ROOT}")
    assert "'vlmgineer NAME ...'" in line


@pytest.mark.thorough
def test_a_run_beside_such_modules(tmp_path):
    """The worker processes import ours as well, and so do the conformance suites."""
    for name in ("tasks", "core", "plugins", "conf", "prompts"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong module')")
    done = call(tmp_path, *TINY, "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run" / "result.json").read_text())["task"] == "LiftBox"
    done = call(tmp_path, "conformance", "tool=none")
    assert (done.returncode, done.stderr) == (0, "")


def test_an_interrupt(tmp_path):
    words = [*TINY, "vlm=mailbox", "hydra.run.dir=run"]
    process = subprocess.Popen([*SCRIPT, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("run/mailbox/*")) and time.monotonic() < deadline:
        time.sleep(0.2)
    process.terminate()
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert err.splitlines()[-1] == f"interrupted; to go on: python -m core.run resume={tmp_path / 'run'}"
