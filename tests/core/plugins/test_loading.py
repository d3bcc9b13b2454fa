"""Plugins that hang, end or take over every command as they are loaded: each is named, and left out."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from core.hooks import Command, hookimpl
from core.plugins import Plugins
from core.plugins.loading import Contained, contained
from core.support.interrupts import was_interrupted

ROOT = Path(__file__).parents[3]
HOOK = "from core.hooks import hookimpl\n@hookimpl\n"
CODES = {
    "base": "raise BaseException('x')",
    "generator": "raise GeneratorExit",
    "interrupt": "raise KeyboardInterrupt",
    "exit": "import sys; sys.exit(0)",
    "leave": "import os; os._exit(0)",
    "abort": "import os; os.abort()",
    "unprintable": "class E(Exception):\n  def __str__(s): raise ValueError('str')\nraise E()",
    "stdout": "import sys; sys.stdout.close()",
    "path": "import sys; sys.path.clear()",
    "hook_interrupt": HOOK + "def tasks(): raise KeyboardInterrupt",
    "hook_leave": HOOK + "def tasks():\n  import os; os._exit(0)",
    "hook_names": HOOK + "def tasks(): return {'A': None, 3: 4, '../x': str}",
    "hook_generator": HOOK + "def tasks():\n  yield 1",
    "hook_command": HOOK + "def commands(): return {'bad': 5}",
}
HANGS = {
    "hang": "import time; time.sleep(3600)",
    "hook_hang": HOOK + "def tasks():\n  import time; time.sleep(3600)",
}


def install(folder, code):
    """Write a plugin package, as pip leaves it, and return the environment in which it is installed."""
    folder.mkdir()
    (folder / "shoddy.py").write_text(f"{code}\n")
    notes = folder / "shoddy_parts-1.0.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: shoddy-parts\nVersion: 1.0\n"
    )
    (notes / "entry_points.txt").write_text("[vlmgineer]\nshoddy = shoddy\n")
    return os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}


def start(environment, *words):
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.thorough
@pytest.mark.parametrize("code", CODES.values(), ids=CODES)
def test_what_would_end_every_command_is_named_and_left_out(tmp_path, code):
    process = start(install(tmp_path / "p", code), "core.plugins")
    said, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    (line,) = [line for line in said.splitlines() if line.startswith("failed ")]
    assert line.startswith("failed shoddy (shoddy-parts): ")
    assert "BringCube" in said


@pytest.mark.thorough
@pytest.mark.parametrize("code", HANGS.values(), ids=HANGS)
def test_what_hangs_is_named_while_it_does_and_an_interrupt_ends_it(tmp_path, code):
    process = start(install(tmp_path / "p", code), "core.plugins")
    line = process.stderr.readline()
    assert line.startswith(("loading the plugin shoddy", "asking the plugin shoddy"))
    time.sleep(0.1)
    process.send_signal(signal.SIGTERM)
    assert process.wait(120) == 130


def test_what_is_no_exception_becomes_one_and_the_process_lives():
    for ends in (lambda: os._exit(0), lambda: os.abort()):
        with pytest.raises(Contained, match="it ends the program"), contained():
            ends()
    with pytest.raises(Contained, match="GeneratorExit"), contained():
        raise GeneratorExit


def test_folders_come_back_that_a_plugin_takes_from_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", ["one", "two"])
    with contained():
        sys.path[:] = ["its own"]
    assert sys.path == ["its own", "one", "two"]


def test_an_interrupt_of_the_user_stays_one():
    assert was_interrupted()  # nobody listens here: it may have come
    with pytest.raises(KeyboardInterrupt), contained():
        raise KeyboardInterrupt


def test_a_process_that_a_plugin_starts_may_end(tmp_path):
    with contained():
        child = os.fork()
        if child == 0:
            os._exit(7)
        _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 1


@pytest.mark.parametrize(
    ("offered", "reason"),
    [
        ({"A": None}, "'A' is neither callable"),
        ({3: str}, "3 is no name"),
        ({"../x": str}, "is no name"),
        ({"-x": str}, "is no name"),
    ],
)
def test_what_is_offered_has_names_and_can_be_made(offered, reason):
    class Shoddy:
        @hookimpl
        def tasks(self):
            return offered

    plugins = Plugins()
    before = len(plugins.failures)
    plugins.register(Shoddy(), "shoddy", "shoddy-parts")
    (failure,) = plugins.failures[before:]
    assert reason in failure.reason
    assert failure.entry_point == "shoddy"


def test_commands_are_commands():
    class Shoddy:
        @hookimpl
        def commands(self):
            return {"good": Command("x", print), "bad": 5}

    plugins = Plugins()
    plugins.register(Shoddy(), "shoddy", "shoddy-parts")
    assert "'bad' is no core.hooks.Command" in plugins.failures[-1].reason
