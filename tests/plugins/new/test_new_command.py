import os
import re
import subprocess
import sys

import pytest

from core.errors import UsageError, UserError
from plugins.conformance.suites import SUITES
from plugins.new import new_command as new
from tests.support.packages import PYTHON, install

PARTS = {
    "task": "PullBlock",
    "sim": "my_engine",
    "vlm": "parrot",
    "tool": "crates",
    "strategy": "greedy",
}
PARTS |= {
    "robot": "my_arm",
    "executor": "in_turn",
    "listener": "rows",
    "fitness": "mean_layouts",
    "action": "above",
    "command": "tally",
}
RUNS = [
    "task=PullBlock",
    "sim=my_engine",
    "vlm=parrot",
    "tool=crates",
    "evolution=greedy",
    "executor=in_turn",
]
RUNS += ["robot=my_arm", "fitness=mean_layouts"]
SMALL = [
    "budget=tiny",
    "film=false",
]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A package of each kind, in a folder of its kind's name, and an environment in which all are installed."""
    folder = tmp_path_factory.mktemp("new")
    for kind, name in PARTS.items():
        new.write(kind, name, folder / kind)
    sites = [
        str(install([folder / kind], tmp_path_factory.mktemp(kind))) for kind in PARTS
    ]
    return folder, PYTHON | {"PYTHONPATH": os.pathsep.join(sites)}


@pytest.mark.thorough
@pytest.mark.slow
def test_what_is_written_passes_its_own_tests(written):
    """A few of a simulator's many checks: it uses an engine that passes them all in its own tests."""
    folder, environment = written
    some = "not test_my_engine or recordings or pictures or free_bodies"
    words = [
        "pytest",
        "-v",
        "-p",
        "no:cacheprovider",
        *(f"{kind}/tests" for kind in PARTS),
        "-k",
        some,
    ]
    done = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for kind, template in new.TEMPLATES.items():
        checks = (
            3 if kind == "sim" else len(SUITES[template.group]) + (kind == "listener")
        )
        file = "test_pull_block.py" if kind == "task" else f"test_{PARTS[kind]}.py"
        assert len(re.findall(rf"{file}::.* PASSED", done.stdout)) == checks, kind


@pytest.mark.thorough
def test_its_tests_ignore_the_settings_of_a_project_around_it(written, tmp_path):
    """For example a clone of this one, whose settings of pytest need more than the package has."""
    (tmp_path / "pyproject.toml").write_text(
        '[tool.pytest.ini_options]\naddopts = "--no-such-option"\n'
    )
    new.write("listener", PARTS["listener"], tmp_path / "rows")
    words = ["pytest", "-q", "-p", "no:cacheprovider", "rows"]
    done = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=tmp_path,
        env=written[1],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.thorough
@pytest.mark.slow
def test_what_is_written_runs(written, tmp_path):
    words = ["core.run", *RUNS, *SMALL, "listener=[rows]", "hydra.run.dir=run"]
    done = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=tmp_path,
        env=written[1],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run/best/design.json").exists()
    assert len((tmp_path / "run/generations.csv").read_text().splitlines()) == 2
    words = ["core", PARTS["command"], "run"]
    done = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=tmp_path,
        env=written[1],
        capture_output=True,
        text=True,
    )
    assert done.stdout.splitlines()[0].split() == ["status", "candidates"], done.stderr


@pytest.mark.parametrize(
    ("kind", "name", "reason"),
    [
        (
            "taks",
            "Mine",
            r"no kind 'taks' in vlmgineer new \(did you mean 'task'\?\); possible: action, command, exe",
        ),
        (
            "task",
            "my task",
            "'my task' can't be a name: letters, digits and underscores",
        ),
        ("task", "../Mine", "can't be a name"),
        ("task", "9Lives", "a letter first"),
        ("vlm", "class", "can't be a name"),
        (
            "task",
            "BringCube",
            "task 'BringCube' is taken: vlmgineer offers it; choose another name",
        ),
        ("vlm", "numpy", "'numpy' can't be a name: a module 'numpy' is there already"),
    ],
)
def test_names_that_cannot_be_are_refused(tmp_path, kind, name, reason):
    with pytest.raises(UsageError, match=reason):
        new.write(kind, name, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(
        UserError, match=r"is there already; choose another folder with output=DIR"
    ):
        new.write("task", "Mine", tmp_path)


def test_the_command_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    new.main(["strategy", "TopThree"])
    assert capsys.readouterr().out == (
        "top_three/top_three/search.py: a search strategy, ready to be changed\n"
        "  pip install -e 'top_three[test]'\n"
        "  vlmgineer conformance evolution=TopThree\n"
        "  python -m core.run evolution=TopThree\n"
        "  python -m pytest top_three\n"
    )
    assert (
        "class TopThreeStrategy("
        in (tmp_path / "top_three/top_three/search.py").read_text()
    )
    for words in (
        [],
        ["task"],
        ["task", "A", "into=x"],
        ["task", "A", "B"],
        ["-x", "task"],
    ):
        with pytest.raises(UsageError, match="a kind and a name are needed; usage: "):
            new.main(words)
