"""Parts are added to a package that is there, and nothing of it is lost."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from core.errors import UserError
from plugins.new.packages import write
from tests.packages import PYTHON, install

EXAMPLE = Path(__file__).parents[2] / "example_plugin"


def python_m(folder, site, *words):
    environment = PYTHON | {"PYTHONPATH": str(site)}
    return subprocess.run([sys.executable, "-m", *words], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.thorough
def test_a_package_gets_parts_of_several_kinds(tmp_path):
    """Written by this program, then extended: of a kind that it has, and of two that it has not."""
    folder, _ = write("task", "PullIt", tmp_path / "package")
    for kind, name in (("task", "PushIt"), ("fitness", "mean_layouts"), ("listener", "rows")):
        assert write(kind, name, folder)[1].parents[1] == folder / "pull_it"
    done = python_m(folder, install(folder, tmp_path / "site"), "pytest", "-q", "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout + done.stderr
    site = tmp_path / "site/site"
    words = ["task=PushIt", "fitness=mean_layouts", "listener=[rows]", "executor.workers=1", "hydra.run.dir=run"]
    sizes = [f"budget.{key}=1" for key in ("n_agent", "n_tool", "n_action")]
    done = python_m(tmp_path, site, "core.run", *words, *sizes, "budget.n_iteration=0", "film=false")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run/generations.csv").exists()


def test_a_package_of_another_hand_gets_a_part(tmp_path):
    """Its own files stay as they are."""
    folder = shutil.copytree(EXAMPLE, tmp_path / "package", ignore=shutil.ignore_patterns("__pycache__"))
    before = {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    write("task", "PullIt", folder)
    write("fitness", "mean_layouts", folder)
    project = folder / "pyproject.toml"
    assert {file: file.read_bytes() for file in before if file != project} == {
        file: content for file, content in before.items() if file != project
    }
    assert set(before[project].splitlines()) < set(project.read_bytes().splitlines())
    done = python_m(tmp_path, install(folder, tmp_path / "site"), "core", "conformance", "task=PullIt")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "project",
    [
        '[project]\nname = "my-parts"\n',
        '[project]\nname = "my-parts"\n\n[project.scripts]\nsay = "my_parts:say"\n',
        '[project.entry-points.vlmgineer]  # ours\nmine = "my_parts"\n\n[tool.other]\n',
        "[project.entry-points.'vlmgineer']\nmine = 'my_parts.parts'\n",
    ],
)
def test_the_entry_point_is_added(tmp_path, project):
    """In a layout with ``src`` too."""
    for base in ("flat", "nested/src"):
        code = tmp_path / base / "my_parts"
        code.mkdir(parents=True)
        (code / "__init__.py").touch()
        folder = tmp_path / base.partition("/")[0]
        (folder / "pyproject.toml").write_text(project)
        write("task", "PullIt", folder)
        entry_points = tomllib.loads((folder / "pyproject.toml").read_text())["project"]["entry-points"]["vlmgineer"]
        before = tomllib.loads(project).get("project", {}).get("entry-points", {}).get("vlmgineer", {})
        assert entry_points == before | {"pull_it": "my_parts.pull_it"}
        assert (code / "pull_it/conf/task/PullIt.yaml").exists()


WHOLE = {"pyproject.toml": '[project.entry-points.vlmgineer]\nmine = "mine"\n', "mine/__init__.py": ""}


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        (WHOLE | {"pyproject.toml": "[project"}, "pyproject.toml is malformed: Expected"),
        (WHOLE | {"pyproject.toml": '[project]\nname = "other"\n'}, "holds no package 'other' with an __init__.py"),
        (WHOLE | {"pyproject.toml": "project = {name = 'mine'}\n"}, "pyproject.toml can't be extended"),
        (WHOLE | {"mine/pull_it.py": ""}, "pull_it.py is there already; choose another name"),
        (WHOLE | {"tests/test_pull_it.py": ""}, "test_pull_it.py is there already"),
        (WHOLE | {"mine/pull_it/__init__.py": ""}, "pull_it/__init__.py is there already"),
    ],
)
def test_nothing_is_changed_where_something_is_in_the_way(tmp_path, files, reason):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    with pytest.raises(UserError) as error:
        write("task", "PullIt", tmp_path)
    assert reason in str(error.value)
    assert "\n" not in str(error.value)
    left = {str(file.relative_to(tmp_path)): file.read_text() for file in tmp_path.rglob("*") if file.is_file()}
    assert {name.replace(os.sep, "/"): text for name, text in left.items()} == files
