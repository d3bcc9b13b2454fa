"""The wheel is complete: it holds everything that the program reads, and works from there."""

import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.packages import PYTHON

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
PIP = [sys.executable, "-m", "pip"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built as pip builds it, with what is installed here, so that no network is needed."""
    folder = tmp_path_factory.mktemp("wheel")
    words = [
        "wheel",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "-w",
        str(folder),
        str(ROOT),
    ]
    done = subprocess.run([*PIP, *words], capture_output=True, text=True, env=PYTHON)
    assert done.returncode == 0, done.stderr
    (file,) = folder.glob("*.whl")
    return file


def test_it_holds_every_file_of_the_packages_and_no_other(wheel):
    there = {
        str(file.relative_to(ROOT))
        for package in PACKAGES
        for file in (ROOT / package).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert {Path(file).suffix for file in there} > {
        ".py",
        ".yaml",
        ".jinja",
        ".j2",
        ".js",
        ".css",
    }
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == there


def test_its_entry_points_lead_into_it(wheel):
    named = PROJECT["project"]["entry-points"]["vlmgineer"]
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
        (text,) = (
            archive.read(name).decode()
            for name in held
            if name.endswith(".dist-info/entry_points.txt")
        )
    listed = dict(line.split(" = ") for line in text.splitlines() if " = " in line)
    assert listed == named
    for name, value in named.items():
        module = EntryPoint(name, value, "vlmgineer").module.replace(".", "/")
        assert {f"{module}.py", f"{module}/__init__.py"} & held, value


def test_hints_name_packages_that_pip_finds():
    """This project is on no package index: a hint names another package, in a version that pyproject.toml takes too."""
    lists = [
        PROJECT["project"]["dependencies"],
        *PROJECT["project"]["optional-dependencies"].values(),
    ]
    taken = {
        needed.name: needed.specifier
        for listed in lists
        for needed in map(Requirement, listed)
    }
    hints = [
        Requirement(word.strip("'"))
        for file in (
            file
            for folder in ("core", "plugins", "tasks")
            for file in (ROOT / folder).rglob("*.py")
        )
        for words in re.findall(
            r"pip install ((?:'[^']+'|[a-z][\w-]*)(?: '[^']+')*)", file.read_text()
        )
        for word in words.split()
    ]
    assert len(hints) > 5
    for hint in hints:
        assert hint.name != "vlmgineer"
        assert hint.specifier in ("", taken.get(hint.name, "")), hint
    texts = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    assert not [
        file
        for file in texts
        if re.search(r"pip install .?vlmgineer", file.read_text())
    ]


@pytest.mark.thorough
def test_it_works_from_an_empty_folder(wheel, tmp_path):
    """Configs, prompts, a task's assets, templates, pages: each command reads some of them."""
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    words = [
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        "--target",
        str(site),
        str(wheel),
    ]
    done = subprocess.run([*PIP, *words], capture_output=True, text=True, env=PYTHON)
    assert done.returncode == 0, done.stderr

    def python(*words):
        env = PYTHON | {"PYTHONPATH": str(site)}
        done = subprocess.run(
            [sys.executable, *words], cwd=empty, env=env, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert Path(
        python("-c", "import core; print(core.__file__)").strip()
    ).is_relative_to(site)
    small = [
        "budget.n_agent=1",
        "budget.n_tool=1",
        "budget.n_action=1",
        "budget.n_iteration=0",
        "executor.workers=1",
    ]
    python("-m", "core.run", "task=LiftBox", *small, "film=false", "hydra.run.dir=run")
    python("-m", "core", "report", "run", "output=report")
    python("-m", "core", "new", "task", "PullBlock")
    assert {"run", "report", "pull_block"} == {entry.name for entry in empty.iterdir()}
