"""The names of this program's packages are common: what stands in their places is said in a line."""

import re
import subprocess
import sys

import pytest

from tests.support.packages import PYTHON
from tests.support.rare import rare

pytestmark = pytest.mark.slow


def python(folder, *words, **environment):
    """Run a process of its own: a warm one has imported what is to be hidden."""
    environment = PYTHON | environment
    command = [sys.executable, *words]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True
    )


FILES = [
    "plugins/__init__.py",
    "tasks/__init__.py",
    "conf/__init__.py",
    "prompts/__init__.py",
    "tasks.py",
]


@pytest.mark.parametrize("file", rare(FILES, FILES[0], FILES[-1]))
def test_what_hides_ours_is_named(tmp_path, file):
    package = re.split("[./]", file)[0]
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).touch()
    done = python(tmp_path, "-m", "core.run", "--help")
    assert done.returncode == 1
    hides = f"error: {tmp_path / file} hides this program's package {package!r}: "
    assert done.stderr.startswith(hides)
    assert len(done.stderr.splitlines()) == 1


def test_a_folder_without_python_hides_nothing(tmp_path):
    (tmp_path / "tasks").mkdir()
    assert python(tmp_path, "-m", "core", "--help").returncode == 0


def test_a_package_that_replaced_ours_is_named(tmp_path):
    """As pip leaves it where two packages bring the same file: the later one's is there."""
    info = tmp_path / "todo_list-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: todo-list\nVersion: 1\n"
    )
    (info / "top_level.txt").write_text("tasks\n")
    code = (
        "import sys, types; sys.modules['tasks.hardtoolbench'] = types.ModuleType('x')\n"
        "from core.plugins import installed; installed()"
    )
    done = python(tmp_path, "-c", code, PYTHONPATH=str(tmp_path))
    assert "the installed package 'todo-list' brings 'tasks', too" in done.stderr
