"""The commands as a user runs them."""

import csv
import json
import sqlite3
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from PIL import Image

from tests.conftest import PYBULLET
from tests.support.commands import python_m
from tests.support.rare import rare

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
SOLUTION = ROOT / "tests" / "tasks" / "solutions" / "BringCube.json"
TINY = [
    "task=BringCube",
    "budget=tiny",
    "budget.n_tool=2",
    "budget.n_action=2",
    "budget.n_iteration=1",
]
TINY += ["film=false", "seed=5"]


def call(folder, command, *words):
    return python_m(folder, "core", command, *words)


# --- mistakes ---------------------------------------------------------------------------------------------------

MISTAKES = [
    (
        "run",
        ["task=OneBok"],
        "no task 'OneBok' (did you mean 'OneBook'?); possible: AroundCorner, ",
    ),
    (
        "run",
        ["task.tool_kinds=[rigd]"],
        "no tool kind 'rigd' in task.tool_kinds (did you mean 'rigid'?); possible: ",
    ),
    (
        "run",
        ["budget.n_agnet=3"],
        "no key 'n_agnet' in budget (did you mean 'n_agent'?); possible: ",
    ),
    (
        "run",
        ["budget.n_agent=two"],
        "Value 'two' of type 'str' could not be converted to Integer",
    ),
    ("run", ["budget.n_agent=0"], "budget.n_agent must be at least 1, got 0"),
    (
        "run",
        ["sim=mujoco", "sim.time_step=a"],
        "sim=mujoco: setting 'time_step' can't be 'a': ",
    ),
    (
        "run",
        ["+robto=ur5"],
        "no key 'robto' in the configuration (did you mean 'robot'?); possible: action, ",
    ),
    ("run", ["robot=ur15"], "no robot 'ur15' (did you mean 'ur5'?); possible: fr3, "),
    (
        "run",
        ["robot.base=[9,0,0,0]"],
        "robot panda can't reach the task's home (0.5, 0, 0.5), by ",
    ),
    ("run", ["seed=-1"], "seed"),
    ("run", ["prompt.dir=no_such_folder"], "no_such_folder"),
    ("run", ["hydra.run.dir=/proc/run"], "can't write /proc/run: "),
    ("run", ["resume=nowhere"], "nowhere holds no run"),
    (
        "run",
        ["resume=nowhere", "resume=elsewhere"],
        "resume=RUN_DIR goes on with one run",
    ),
    (
        "run",
        ["-m", "resume=nowhere"],
        "-m resume=nowhere: resume=RUN_DIR goes on with one run, such as a sweep's",
    ),
    ("evaluate", [], "no designs file given; usage: "),
    ("evaluate", ["--designs", "x"], "can't read '--designs'; usage: "),
    (
        "evaluate",
        ["designs=missing.json"],
        "designs file missing.json: there is no such file",
    ),
    (
        "evaluate",
        ["designs=malformed.json"],
        "malformed.json: the reply is malformed JSON at line 2, column 3",
    ),
    ("evaluate", [f"designs={SOLUTION}", "sim=mujoco", "output=."], "can't write"),
    (
        "evaluate",
        [f"designs={SOLUTION}", "sim=mujoco", "rollout.segment_s=0"],
        "segment_s",
    ),
    (
        "evaluate",
        [f"designs={SOLUTION}", "sim=mujoco", "rollout.hold_s=-1"],
        "hold_s",
    ),
    (
        "render",
        [f"designs={SOLUTION}", "sim=mujoco", "strategy=1"],
        "has 1 designs; there is no strategy=1",
    ),
    ("render", ["width=0"], "width"),
]


@pytest.mark.parametrize(
    ("command", "words", "said"),
    rare(MISTAKES, *MISTAKES[::4]),
    ids=[" ".join([c, *w[-1:]]) for c, w, _ in MISTAKES],
)
def test_a_mistake_is_one_line_that_says_what_is_wrong(tmp_path, command, words, said):
    (tmp_path / "malformed.json").write_text('{"strategies": [\n  oh no]}')
    done = call(tmp_path, command, *words)
    assert done.returncode in (1, 2)
    assert "Traceback" not in done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert not done.stdout


# --- vlmgineer render -------------------------------------------------------------------------------------------


def test_render_writes_a_picture_of_the_size_asked_for(tmp_path):
    done = call(
        tmp_path,
        "render",
        "task=OneBook",
        "width=120",
        "height=90",
        "output=pictures/plain.png",
    )
    assert done.returncode == 0, done.stderr
    tool = [f"designs={ROOT / 'tests/tasks/solutions/OneBook.json'}", "output=tool.png"]
    assert (
        call(
            tmp_path, "render", "task=OneBook", "width=120", "height=90", *tool
        ).returncode
        == 0
    )
    plain, mounted = (
        np.asarray(Image.open(tmp_path / name))
        for name in ("pictures/plain.png", "tool.png")
    )
    assert plain.shape == mounted.shape == (90, 120, 3)
    assert (plain != mounted).any()


# --- python -m core.run -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """A run folder, and what the command said."""
    folder = tmp_path_factory.mktemp("tiny") / "run"
    done = call(
        folder.parent, "run", *TINY, f"hydra.run.dir={folder}", "executor.workers=2"
    )
    assert done.returncode == 0, done.stderr
    return folder, done


def result_of(folder):
    return json.loads((folder / "result.json").read_text())


def test_a_run_says_what_it_came_to(tiny):
    folder, done = tiny
    best = result_of(folder)["best"]
    said, where = done.stdout.splitlines()
    assert f"{best['reward']:.3f}" in said
    assert best["candidate"] in said
    assert where == str(folder / "best")
    assert "Traceback" not in done.stderr


def test_the_result(tiny):
    result = result_of(tiny[0])
    sim = "pybullet" if PYBULLET else "mujoco"
    assert list(result) == [
        *(
            "name",
            "task",
            "robot",
            "sim",
            "vlm",
            "tool",
            "action",
            "evolution",
            "fitness",
            "material",
            "budget",
            "seed",
            "best",
            "unseen",
            "effort",
            "finalists",
            "held",
            "perturbed",
            "tie",
            "stopped",
        ),
        *(
            "generations",
            "n_evaluations",
            "rollouts",
            "wall_time_s",
            "rollouts_per_s",
            "versions",
        ),
    ]
    assert [
        result[key]
        for key in (
            "task",
            "robot",
            "sim",
            "vlm",
            "tool",
            "evolution",
            "budget",
            "seed",
        )
    ] == [*("BringCube", "panda", sim, "offline", "urdf", "vlmgineer", "tiny", 5)]
    assert set(result["best"]) == {
        "reward",
        "margin",
        "measured",
        "generation",
        "candidate",
        "reason",
        "solved",
        "second_engine",
        "torque",
        "making",
        "makeable",
    }
    assert 0 <= result["best"]["reward"] <= 1
    assert result["best"]["measured"]["distance_m"] >= 0
    assert result["best"]["candidate"].startswith(
        f"g{result['best']['generation']}-a0-s"
    )
    figures = (
        "index",
        "best_reward",
        "mean_reward",
        "n_candidates",
        "n_rejected",
        "n_failed",
    )
    assert [tuple(generation) for generation in result["generations"]] == [figures] * 2
    assert [generation["index"] for generation in result["generations"]] == [0, 1]
    highest = max(generation["best_reward"] for generation in result["generations"])
    assert highest - result["tie"] <= result["best"]["reward"] <= highest
    assert result["tie"] == 0.005
    assert all(generation["n_candidates"] == 4 for generation in result["generations"])
    tried = sum(
        generation["n_candidates"] - generation["n_rejected"]
        for generation in result["generations"]
    )
    assert result["n_evaluations"] == tried
    assert 0 < result["rollouts"] <= tried
    assert result["rollouts_per_s"] == pytest.approx(
        result["rollouts"] / result["wall_time_s"], rel=0.01
    )
    assert {"python", "vlmgineer", sim, "numpy"} <= set(result["versions"])


def test_the_run_folder(tiny):
    folder, _ = tiny
    assert {path.name for path in (folder / ".hydra").iterdir()} == {
        "config.yaml",
        "hydra.yaml",
        "overrides.yaml",
    }
    assert Image.open(folder / "scene.png").format == "PNG"
    for generation in (0, 1):
        reply = (folder / "replies" / f"g{generation}-a0.txt").read_text()
        assert len(json.loads(reply)["strategies"]) == 2
        assert "BringCube" in (folder / "requests" / f"g{generation}-a0.md").read_text()
    assert not (folder / "best" / "rollout.gif").exists()
    with sqlite3.connect(folder / "run.sqlite") as database:
        rows = database.execute(
            "SELECT status, reward, distance_m, candidate FROM evaluations"
        ).fetchall()
    assert len(rows) == 8
    best = min(
        (-reward, distance, candidate)
        for status, reward, distance, candidate in rows
        if status == "ok"
    )
    assert best[2] == result_of(folder)["best"]["candidate"]


def test_the_best_design_can_be_taken_away(tiny):
    best = tiny[0] / "best"
    names = {path.name for path in best.iterdir()}
    assert names == {
        "tool.urdf",
        "robot.urdf",
        "tool.stl",
        "waypoints.csv",
        "design.json",
        "meshes",
    }
    (strategy,) = json.loads((best / "design.json").read_text())["strategies"]
    with (best / "waypoints.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert [*header[:6], header[-1]] == [
        "x_m",
        "y_m",
        "z_m",
        "roll_rad",
        "pitch_rad",
        "yaw_rad",
        "arrival_s",
    ]
    assert [[float(x) for x in row[:-1]] for row in rows] == strategy["action_sets"][0]
    assert all(float(a[-1]) < float(b[-1]) for a, b in pairwise(rows))
    pin.buildModelFromUrdf(str(best / "tool.urdf"))
    printed = trimesh.load_mesh(best / "tool.stl")
    assert printed.is_watertight
    assert printed.body_count == 1
    assert 20 < printed.extents.max() < 2000  # millimetres


@pytest.mark.thorough
def test_the_best_robot_can_be_loaded_from_anywhere(tiny, tmp_path):
    """Meshes are named relative to the file, so that the folder can travel."""
    folder = (tiny[0] / "best").rename(tmp_path / "moved")
    try:
        text = (folder / "robot.urdf").read_text()
        assert str(tiny[0]) not in text
        assert 'filename="/' not in text
        model = pin.buildModelFromUrdf(str(folder / "robot.urdf"))
        assert model.nq in (7, 9)
        for kind in (pin.GeometryType.COLLISION, pin.GeometryType.VISUAL):
            shapes = pin.buildGeomFromUrdf(
                model, str(folder / "robot.urdf"), kind, package_dirs=str(folder)
            )
            assert len(shapes.geometryObjects) > 8
        bullet = pytest.importorskip("pybullet")
        client = bullet.connect(bullet.DIRECT)
        robot = bullet.loadURDF(
            str(folder / "robot.urdf"), useFixedBase=True, physicsClientId=client
        )
        shapes = [
            bullet.getCollisionShapeData(robot, i, physicsClientId=client)
            for i in range(-1, 7)
        ]
        assert all(shapes)
        bullet.disconnect(client)
    finally:
        folder.rename(tiny[0] / "best")


def test_the_best_design_earns_the_same_again(tiny, tmp_path):
    words = [
        "task=BringCube",
        "seed=5",
        f"designs={tiny[0] / 'best' / 'design.json'}",
        "output=again.json",
    ]
    assert call(tmp_path, "evaluate", *words).returncode == 0
    (again,) = json.loads((tmp_path / "again.json").read_text())
    best = result_of(tiny[0])["best"]
    assert again["reward"] == pytest.approx(best["reward"], abs=1e-9)
    for name, value in best["measured"].items():
        assert again[name] == pytest.approx(value, abs=1e-9)


def test_the_same_seed_gives_the_same_result_whatever_the_number_of_workers(
    tiny, tmp_path
):
    folder = tmp_path / "run"
    done = call(tmp_path, "run", *TINY, f"hydra.run.dir={folder}", "executor.workers=1")
    assert done.returncode == 0, done.stderr
    one, other = result_of(tiny[0]), result_of(folder)
    for result in (one, other):
        del result["wall_time_s"], result["rollouts_per_s"]
    assert one == other
    assert (folder / "best" / "design.json").read_bytes() == (
        tiny[0] / "best" / "design.json"
    ).read_bytes()


@pytest.mark.thorough
def test_an_output_that_is_full_is_no_fault_of_the_folder(tmp_path):
    folder = tmp_path / "run"
    words = [*TINY, "sim=mujoco", f"hydra.run.dir={folder}", "executor.workers=1"]
    command = [sys.executable, "-u", "-m", "core.run", *words]  # unbuffered
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 1
    wrong = "the output can't be written: No space left on device"
    hint = f"to go on: python -m core.run resume={folder}"
    assert done.stderr.splitlines()[-1] == f"error: {wrong}; {hint}"
    assert (folder / "result.json").exists()


@pytest.mark.thorough
def test_a_folder_with_a_run_is_not_written_over(tiny):
    folder, _ = tiny
    files = [folder / "result.json", *(folder / ".hydra").iterdir()]
    before = [file.read_bytes() for file in files]
    run = call(folder.parent, "run", *TINY, "name=other", f"hydra.run.dir={folder}")
    into = ("hydra.sweep.dir=.", f"hydra.sweep.subdir={folder.name}")
    sweep = call(folder.parent, "run", "-m", *TINY, "name=other", *into)
    for done in (run, sweep):
        assert done.returncode in (1, 2)
        assert "holds a run" in done.stderr
        assert [file.read_bytes() for file in files] == before
