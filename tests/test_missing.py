"""A first run and its report work where a package that is not needed for them is missing, or has no wheel."""

from pathlib import Path

import pytest

from tests.support.packages import ONE_CANDIDATE, without
from tests.support.rare import rare

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
SAPIEN = ("sapien", ["sim=sapien"], "sim=sapien needs SAPIEN: pip install 'sapien")
LITELLM = ("litellm", ["vlm=openai"], "needs LiteLLM: pip install 'litellm")


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["sapien", "pybullet", "litellm", "rerun"])
def test_a_run_in_mujoco_and_its_report_do_without(package, tmp_path):
    is_default = package == "pybullet"
    engine = [] if is_default else ["sim=mujoco"]
    words = ["core.run", *engine, *ONE_CANDIDATE, "hydra.run.dir=run"]
    done = without([package], words, tmp_path)
    assert done.returncode == 0, done.stderr
    line = "sim=mujoco, since sim=pybullet needs PyBullet: "
    assert (line in done.stderr) == is_default
    assert (tmp_path / "run/result.json").exists()
    done = without([package], ["core", "report", "run", "output=report"], tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("package", "words", "line"),
    [
        ("pybullet", ["sim=pybullet"], "sim=pybullet needs PyBullet: pip install"),
        *rare([SAPIEN, LITELLM]),
    ],
)
def test_what_needs_it_says_what_to_install(package, words, line, tmp_path):
    done = without([package], ["core.run", *words], tmp_path, OPENAI_API_KEY="test")
    assert done.returncode != 0
    assert line in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("missing", "engine"),
    [(["pybullet"], "mujoco"), *rare([(["pybullet", "mujoco"], "sapien")])],
)
def test_the_engine_is_the_first_that_is_installed(missing, engine, tmp_path):
    done = without(missing, ["core.run", "--cfg", "job", "--package", "sim"], tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"name: {engine}\n" in done.stdout


@pytest.mark.thorough
def test_a_plan_with_a_tempo_is_rejected_where_toppra_is_missing(tmp_path):
    design = ROOT / "tests/tasks/hardtoolbench/StopCart.json"
    words = ["core", "evaluate", "task=StopCart", f"designs={design}", "sim=mujoco"]
    words += ["tool=boxes"]
    done = without(["toppra"], words, tmp_path)
    assert done.returncode == 1, done.stderr  # all are rejected
    assert "pip install toppra" in " ".join(done.stdout.split())
