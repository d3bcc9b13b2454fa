"""The wheel is complete: it holds everything that the program reads, and works from there."""

import itertools
import re
import subprocess
import sys
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.support.packages import ONE_CANDIDATE, PYTHON, install

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder into which the wheel is installed."""
    return install([ROOT], tmp_path_factory.mktemp("wheel"))


def files(root, folders):
    return {
        str(file.relative_to(root))
        for folder in folders
        for file in (root / folder).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }


def test_it_holds_every_file_of_the_packages_and_no_other(site):
    there = files(ROOT, PACKAGES)
    assert len(there) > 500
    assert files(site, PACKAGES) == there
    others = {folder.name for folder in site.iterdir()} - {*PACKAGES, "bin"}
    assert all(name.endswith(".dist-info") for name in others)


def test_its_entry_points_lead_into_it(site):
    (found,) = distributions(path=[str(site)])
    points = found.entry_points.select(group="vlmgineer")
    named = PROJECT["project"]["entry-points"]["vlmgineer"]
    assert {point.name: point.value for point in points} == named
    for point in points:
        module = point.module.replace(".", "/")
        places = [site / f"{module}.py", site / module / "__init__.py"]
        assert any(map(Path.exists, places)), point


def test_hints_name_packages_that_pip_finds():
    """This project is on no package index: a hint names another package, in a version that pyproject.toml takes too."""
    project = PROJECT["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    needed = map(Requirement, itertools.chain(*lists))
    taken = {requirement.name: requirement.specifier for requirement in needed}
    code = "".join((ROOT / file).read_text() for file in files(ROOT, PACKAGES))
    lines = re.findall(r"pip install ((?:'[^']+'|[a-z][\w-]*)(?: '[^']+')*)", code)
    hints = [Requirement(word.strip("'")) for word in " ".join(lines).split()]
    assert len(hints) > 5
    for hint in hints:
        assert hint.name != "vlmgineer"
        assert hint.specifier in ("", taken.get(hint.name, "")), hint
    texts = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    words = "".join(file.read_text() for file in texts)
    assert not re.search(r"pip install .?vlmgineer", words)


@pytest.mark.thorough
def test_it_works_from_an_empty_folder(site, tmp_path):
    """Configs, prompts, a task's assets, templates, pages: each command reads some of them."""

    def python(*words):
        command = [sys.executable, *words]
        environment = PYTHON | {"PYTHONPATH": str(site)}  # before an editable install
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    python("-m", "core.run", "task=LiftBox", *ONE_CANDIDATE, "hydra.run.dir=run")
    python("-m", "core", "report", "run", "output=report")
    python("-m", "core", "new", "task", "PullBlock")
    assert {"run", "report", "pull_block"} == {
        entry.name for entry in tmp_path.iterdir()
    }
