"""The packages of ``examples/`` work beside a wheel of this project, in an environment of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.packages import ONE_CANDIDATE, PYTHON, install

pytestmark = [pytest.mark.slow, pytest.mark.thorough]

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted(file.parent for file in (ROOT / "examples").glob("*/pyproject.toml"))


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """The interpreter of an environment with the wheels, and this environment's packages beside them."""
    folder = tmp_path_factory.mktemp("examples")
    words = [sys.executable, "-m", "venv", "--without-pip", folder / "environment"]
    subprocess.run(words, check=True, env=PYTHON)
    site = install([ROOT, *EXAMPLES], folder / "packages")
    (own,) = (folder / "environment").glob("lib/python*/site-packages")
    # Its own packages come first. Of others, no .pth file is read: one leads to this repository.
    paths = [site, *package_folders()]
    (own / "here.pth").write_text("".join(f"{path}\n" for path in paths))
    return folder / "environment" / "bin" / "python"


def package_folders():
    """Where this environment finds packages: its own folder and those that .pth files lead to."""
    return [path for path in sys.path if path.endswith("-packages")]


def run(python, folder, *words):
    done = subprocess.run(
        [python, "-m", *words], cwd=folder, capture_output=True, text=True, env=PYTHON
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_program_is_the_wheels(python, tmp_path):
    code = "import core, plugins, tasks; print(core.__file__)"
    done = subprocess.run(
        [python, "-c", code], cwd=tmp_path, capture_output=True, text=True, env=PYTHON
    )
    assert done.returncode == 0, done.stderr
    assert not Path(done.stdout.strip()).is_relative_to(ROOT)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_its_own_tests_pass(python, tmp_path, example):
    tests = str(example / "tests")
    out = run(python, tmp_path, "pytest", "-q", "-p", "no:cacheprovider", tests)
    assert " passed" in out.splitlines()[-1]


def test_its_commands_run(python, tmp_path):
    """As ``examples/README.md`` shows them."""
    run(python, tmp_path, "core.run", "sim=toy", *ONE_CANDIDATE, "hydra.run.dir=toy")
    words = ["task=PushButton", "evolution=restarts", *ONE_CANDIDATE]
    run(python, tmp_path, "core.run", *words, "hydra.run.dir=button")
    assert (tmp_path / "toy/result.json").exists()
    assert (tmp_path / "button/result.json").exists()
