"""Third-party packages, installed by pip, are found at once and work with every built-in part."""

import csv
import json
import re
from itertools import product
from pathlib import Path

import pytest
import yaml

from tests.support import commands
from tests.support.packages import install
from tests.support.rare import mostly

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
EXAMPLES = [HERE.parent / "examples" / name for name in ("toy_engine", "push_button")]
SMALL = [
    "budget=tiny",
    "budget.n_action=2",
    "budget.n_iteration=1",
    "film=false",
]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder that they are installed in."""
    packages = [HERE / "example_plugin", *EXAMPLES]
    return install(packages, tmp_path_factory.mktemp("site"))


def python_m(site, folder, *words):
    return commands.python_m(folder, *words, PYTHONPATH=str(site))


def test_all_its_parts_together_right_after_its_installation(site, tmp_path):
    parts = ["sim=toy", "task=PushButton", "tool=numbers", "evolution=restarts"]
    parts += [
        "vlm=echo",
        "executor=here",
        "fitness=thrifty",
        "listener=[csv]",
        "listener.csv.delimiter=';'",
    ]
    done = python_m(site, tmp_path, "core.run", *parts, *SMALL, "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("best reward 0.")
    rows = list(csv.DictReader((tmp_path / "run/candidates.csv").open(), delimiter=";"))
    assert [row["candidate"] for row in rows] == [
        f"g{g}-a0-s0-p{p}" for g in (0, 1) for p in (0, 1)
    ]
    assert {row["status"] for row in rows} == {"ok"}
    assert float(rows[0]["reward"]) < float(rows[1]["reward"])
    assert json.loads((tmp_path / "run/best/design.json").read_text())["strategies"][0][
        "boxes"
    ]


@pytest.mark.weekly
def test_every_combination_with_what_is_built_in(site, tmp_path):
    """In one multirun, each for one candidate."""
    choices = {
        "sim": ("toy", "pybullet"),
        "task": ("PushButton", "BringCube"),
        "vlm": ("echo", "offline"),
        "tool": ("numbers", "urdf"),
    }
    sweep = [f"{kind}={','.join(names)}" for kind, names in choices.items()]
    fixed = [
        *SMALL,
        "budget.n_iteration=0",
        "budget.n_action=1",
        "evolution=restarts",
        "executor=here",
        "listener=[csv]",
    ]
    done = python_m(
        site, tmp_path, "core.run", "-m", *sweep, *fixed, "hydra.sweep.dir=sweep"
    )
    assert done.returncode == 0, done.stderr
    tables = list((tmp_path / "sweep").glob("*/candidates.csv"))
    assert len(tables) == len(list(product(*choices.values())))
    assert (tmp_path / "sweep/0_PushButton_numbers_restarts_seed0").is_dir()
    for table in tables:
        (row,) = csv.DictReader(table.open())
        assert row["status"] == "ok", table


@pytest.mark.thorough
@pytest.mark.parametrize(
    "part",
    [
        "sim=toy",
        "vlm=echo",
        "task=PushButton tool=numbers",
        "evolution=restarts",
        "fitness=thrifty",
    ],
)
def test_its_parts_travel_to_our_workers(site, tmp_path, part):
    run = ["executor.workers=1", "listener=[csv,progress]", "hydra.run.dir=run"]
    done = python_m(site, tmp_path, "core.run", *part.split(), *run, *SMALL)
    assert done.returncode == 0, done.stderr
    assert "ok" in {
        row["status"]
        for row in csv.DictReader((tmp_path / "run/candidates.csv").open())
    }


@pytest.mark.weekly
def test_runs_side_by_side(site, tmp_path):
    """In joblib's processes, with workers of their own."""
    sweep = [
        "-m",
        "hydra/launcher=joblib",
        "hydra.launcher.n_jobs=2",
        "hydra.sweep.dir=sweep",
        "seed=0,1",
    ]
    parts = [
        "sim=toy",
        "task=PushButton",
        "tool=numbers",
        "vlm=echo",
        "executor.workers=1",
        "listener=[csv]",
    ]
    done = python_m(
        site, tmp_path, "core.run", *sweep, *parts, *SMALL, "budget.n_iteration=0"
    )
    assert done.returncode == 0, done.stderr
    results = [
        json.loads(file.read_text())
        for file in (tmp_path / "sweep").glob("*/result.json")
    ]
    assert sorted(result["seed"] for result in results) == [0, 1]
    assert all(result["best"]["reward"] > 0 for result in results)


@pytest.mark.thorough
def test_a_sweeper_gets_the_best_reward_of_each_run(site, tmp_path):
    """Optuna's, which tries numbers of plans; none at all is refused."""
    words = [
        *("-m", "hydra/sweeper=optuna", "hydra.sweep.dir=sweep"),
        *("hydra.sweeper.sampler.seed=1", "hydra.sweeper.n_trials=4"),
        "budget.n_action=choice(0,1,2)",
        *("sim=toy", "task=PushButton", "tool=numbers", "vlm=echo"),
        *("executor.workers=1", "listener=[csv]", "budget.n_iteration=0"),
    ]
    fixed = [word for word in SMALL if not word.startswith("budget.n_action")]
    done = python_m(site, tmp_path, "core.run", *fixed, *words)
    assert "error: budget.n_action must be at least 1, got 0" in done.stderr
    runs = [
        json.loads(file.read_text())
        for file in (tmp_path / "sweep").glob("*/result.json")
    ]
    assert 1 <= len(runs) < 4
    best = yaml.safe_load((tmp_path / "sweep/optimization_results.yaml").read_text())
    assert best["best_value"] == max(run["best"]["reward"] for run in runs)
    assert best["best_params"]["budget.n_action"] == 2  # its second plan is better


PARTS = [
    *("task=PushButton", "tool=numbers", "evolution=restarts", "fitness=thrifty"),
    *("vlm=echo", "executor=here", "listener=csv"),
]


@pytest.mark.parametrize("part", mostly(PARTS, "executor=here"))
def test_its_parts_conform(site, tmp_path, part):
    """All but the simulator, which has no physics."""
    done = python_m(site, tmp_path, "core", "conformance", part)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.thorough
def test_what_it_offers_is_listed_with_its_name(site, tmp_path):
    out = python_m(site, tmp_path, "core.plugins").stdout
    offered = {
        line.split()[0]: line.split()[1]
        for line in out.splitlines()
        if any(name in line for name in ("toybench", "toy-engine", "push-button"))
    }
    assert offered == {
        "task": "PushButton",
        "sim": "toy",
        "vlm": "echo",
        "tool": "numbers",
        "evolution": "restarts",
        "fitness": "thrifty",
        "executor": "here",
        "listener": "csv",
    }
    help_text = python_m(site, tmp_path, "core.run", "--help").stdout
    assert re.search(r"^sim: .*\btoy\b", help_text, re.MULTILINE)


def test_a_mistake_in_its_settings_is_one_line(site, tmp_path):
    done = python_m(site, tmp_path, "core.run", "sim=toy", "sim.radios=1")
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        done.stderr
        == "error: no key 'radios' in sim (did you mean 'radius'?); possible: name, radius, time_step\n"
    )


def test_no_built_in_module_imports_it():
    for folder in ("core", "plugins", "tasks"):
        for file in (HERE.parent / folder).rglob("*.py"):
            assert "toybench" not in file.read_text(), file
