"""The command ``vlmgineer``: it lists the commands, runs them, and does not import from the working directory."""

import json
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import pytest

from core.plugins import installed
from core.plugins.own_commands import COMMANDS

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCRIPT = [str(Path(sys.executable).with_name("vlmgineer"))]
TINY = [
    *(
        "run",
        "task=LiftBox",
        "sim=mujoco",
        "budget=tiny",
    ),
    *("executor.workers=1", "film=false", "listener=[]"),
]


def call(folder, *words, start=SCRIPT):
    return subprocess.run(
        [*start, *words], cwd=folder, capture_output=True, text=True, timeout=240
    )


def listed(done):
    """Return the names in the table under the usage."""
    return [
        line.split()[0]
        for line in done.stdout.partition("\ncommand ")[2].splitlines()[1:]
    ]


def test_every_command_is_listed_with_a_line(tmp_path):
    done = call(tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert call(tmp_path, "--help").stdout == done.stdout
    assert listed(done) == installed().names("command")
    files = [
        file
        for file in (ROOT / "core").rglob("*.py")
        if "    command(main)\n" in file.read_text()
    ]
    assert set(COMMANDS) == {
        file.stem if file.stem != "__main__" else file.parent.name for file in files
    }


def test_an_unknown_command_is_one_line(tmp_path):
    done = call(tmp_path, "rnu")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(
        "error: no command 'rnu' (did you mean 'run'?); possible: conformance, evaluate, "
    )


def test_mistakes_have_the_same_line_and_exit_status(tmp_path):
    words = ["run", "task=OneBok"]
    done, other = (
        call(tmp_path, *words),
        call(tmp_path, *words[1:], start=[sys.executable, "-m", "core.run"]),
    )
    assert (
        (done.returncode, done.stderr)
        == (other.returncode, other.stderr)
        == (2, other.stderr)
    )


@pytest.mark.parametrize("name", ["tasks.py", "conf.py", "core.py"])
def test_modules_in_the_working_directory_hide_nothing(tmp_path, name):
    (tmp_path / name).write_text("raise SystemExit('the wrong module')")
    assert "BringCube" in call(tmp_path, "plugins").stdout


@pytest.mark.thorough
def test_a_run_beside_such_modules(tmp_path):
    """The worker processes import ours as well, and so do the conformance suites."""
    for name in ("tasks", "core", "plugins", "conf", "prompts"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong module')")
    done = call(tmp_path, *TINY, "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    assert (
        json.loads((tmp_path / "run" / "result.json").read_text())["task"] == "LiftBox"
    )
    done = call(tmp_path, "conformance", "tool=none")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.thorough
def test_an_interrupt(tmp_path):
    words = [*TINY, "vlm=mailbox", "hydra.run.dir=run"]
    process = subprocess.Popen(
        [*SCRIPT, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("run/mailbox/*")) and time.monotonic() < deadline:
        time.sleep(0.2)
    process.terminate()
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert (
        err.splitlines()[-1]
        == f"interrupted; to go on: python -m core.run resume={tmp_path / 'run'}"
    )


@pytest.mark.parametrize("name", ["evaluate", "prompt"])
def test_a_command_by_the_name_of_its_module(name):
    words = [sys.executable, "-m", f"core.{name}", "--help"]
    found = subprocess.run(words, capture_output=True, text=True, check=True)
    assert found.stdout.startswith(f"usage: vlmgineer {name} ")


def test_the_version_of_the_program_and_of_python(tmp_path):
    python = ".".join(map(str, sys.version_info[:3]))
    said = f"vlmgineer {metadata.version('vlmgineer')} (Python {python})\n"
    assert call(tmp_path, "--version").stdout == said
    start = [sys.executable, "-m", "core.run"]
    assert call(tmp_path, "--version", start=start).stdout == said


QUICK = """
import sys
from core.__main__ import main
sys.argv[1:] = {words}
try:
    main()
finally:
    found = {slow} & sys.modules.keys()
    print(*sorted(found), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("words", "slow"),
    [
        (["--help"], {"scipy", "pinocchio", "hydra", "litellm"}),
        (["evaluate", "--help"], {"scipy", "pinocchio", "hydra", "litellm"}),
        (["run", "--help"], {"trimesh", "litellm", "mujoco", "sapien"}),
        (["run", "vlm=gemini", "--help"], {"trimesh", "litellm", "mujoco"}),
    ],
    ids=lambda value: " ".join(sorted(value)),  # workers must agree on the order
)
def test_what_takes_long_is_not_imported_before_it_is_used(tmp_path, words, slow):
    script = QUICK.format(words=words, slow=slow)
    done = call(tmp_path, start=[sys.executable, "-c", script])
    assert done.returncode == 0
    assert done.stderr == "\n"
    assert "usage: " in done.stdout


def test_the_help_of_a_run_lists_groups_and_keys(tmp_path):
    start = [sys.executable, "-m", "core.run"]
    done = call(tmp_path, "--help", "sim=sapien", start=start)
    assert "\nbudget: paper, quick, tiny\n" in done.stdout
    assert "\nsim:\n  name: sapien\n" in done.stdout
    assert not list(tmp_path.iterdir())
