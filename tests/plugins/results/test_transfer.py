"""``vlmgineer transfer``; engines are PyBullet, set differently."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load
from core.errors import UserError
from core.plugins import Offer, installed
from core.search.orchestration import run
from core.search.run_settings import stored_config
from plugins.results.chosen import stored_evaluations
from plugins.results.transfer import TransferConfig, configured, transfer
from plugins.robots.arms import panda
from tests.support import toys
from tests.support.commands import python_m

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
SOLUTION = ROOT / "tests" / "tasks" / "solutions" / "BringCube.json"
COARSE = "{name: pybullet, time_step: 0.004}"
SIMS = f"sims=[pybullet,{COARSE}]"


def settings(words):
    return load("transfer", words, TransferConfig)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder of a run, and its result."""
    folder = tmp_path_factory.mktemp("transfer") / "run"
    words = [
        "task=OneBook",
        "seed=3",
        "rollout.hold_s=0.5",
        "film=false",
        "listener=[]",
    ]
    words += [
        "budget.n_agent=1",
        "budget.n_tool=2",
        "budget.n_action=2",
        "budget.n_iteration=1",
    ]
    return folder, run(load("config", words), folder)


# --- a designs file ---------------------------------------------------------------------------------------------


def test_every_design_in_every_engine_with_every_change(tmp_path):
    good = json.loads(SOLUTION.read_text())["strategies"][0]
    plans = [*good["action_sets"], [[0.5, 0, 0.5, 0, 0, 0]], [[9, 0, 0, 0, 0, 0]]]
    (tmp_path / "designs.json").write_text(
        json.dumps({"strategies": [good | {"action_sets": plans}]})
    )
    words = [
        "designs=designs.json",
        SIMS,
        "seeds=[0,4]",
        "perturbation.position=0.01",
        "executor.workers=2",
    ]
    done = python_m(tmp_path, "core", "transfer", *words, "output=out/transfer.json")
    assert done.returncode == 0, done.stderr
    # What takes long is said while it takes; on a busy machine with how many seconds it took.
    assert all(" ..." in line for line in done.stderr.splitlines())
    result = json.loads((tmp_path / "out" / "transfer.json").read_text())
    assert list(result) == [
        "task",
        "seed",
        "seeds",
        "perturbation",
        "robots",
        "engines",
        "designs",
    ]
    assert (result["task"], result["seed"], result["seeds"]) == ("BringCube", 0, [0, 4])
    assert result["perturbation"] == {
        "position": 0.01,
        "yaw": 0.05,
        "mass": 0.1,
        "friction": 0.2,
    }
    assert [engine["time_step"] for engine in result["engines"].values()] == [
        0.002,
        0.004,
    ]
    assert [design["design"] for design in result["designs"]] == [
        "g0-a0-s0-p0",
        "g0-a0-s0-p1",
        "g0-a0-s0-p2",
    ]
    solved, idle, far = result["designs"]
    for design in result["designs"]:
        assert list(design["engines"]) == ["pybullet", "pybullet time_step=0.004"]
        for figures in design["engines"].values():
            assert len(figures["rewards"]) == 2
            assert figures["mean"] == pytest.approx(np.mean(figures["rewards"]))
            assert figures["std"] == pytest.approx(np.std(figures["rewards"]))
        assert design["robust"] == min(
            figures["mean"] for figures in design["engines"].values()
        )
    assert 0.95 <= solved["robust"] < 1
    rewards = [
        r
        for figures in solved["engines"].values()
        for r in (figures["nominal"], *figures["rewards"])
    ]
    assert len(set(rewards)) == 6  # every rollout is another
    assert idle["robust"] < 0.02
    assert (far["status"], far["robust"]) == ("rejected", 0.0)
    assert "waypoint 1" in far["reason"]
    lines = done.stdout.splitlines()
    for design in result["designs"]:  # in a pipe a row is a line, and no figure is cut
        for engine, figures in design["engines"].items():
            row = f"{design['design']} BringCube panda {engine} "
            row += (
                f"{figures['nominal']:.3f} {figures['mean']:.3f} ± {figures['std']:.3f}"
            )
            assert any(" ".join(line.split()).startswith(row) for line in lines), row
    assert f"{far['design']}, BringCube, panda: {far['reason']}" in lines


@pytest.mark.thorough
def test_the_nominal_reward_is_what_evaluate_says_and_workers_change_nothing(tmp_path):
    words = [f"designs={SOLUTION}", SIMS, "seeds=[1,2]"]
    results = [transfer(settings([*words, f"executor.workers={n}"])) for n in (1, 2)]
    assert results[0] == results[1]
    assert (
        python_m(
            tmp_path, "core", "evaluate", f"designs={SOLUTION}", "output=plain.json"
        ).returncode
        == 0
    )
    (plain,) = json.loads((tmp_path / "plain.json").read_text())
    assert results[0]["designs"][0]["engines"]["pybullet"]["nominal"] == plain["reward"]


# --- several robots ---------------------------------------------------------------------------------------------


@pytest.fixture
def arms(monkeypatch, tmp_path):
    """Offer two arms beside the Panda, and an engine and an executor of this process; gives the words that use them."""
    arm = panda().description
    fixed = {
        child: replace(arm.joints[child], kind="fixed")
        for child in panda().gripper.links
    }
    stiff = replace(arm, joints=arm.joints | fixed)
    robots = {
        "weak": lambda: replace(panda(), name="weak", payload_kg=0.002),
        "stiff": lambda: replace(
            panda(), name="stiff", title="Stiff", gripper=None, description=stiff
        ),
        "foreign": lambda: replace(panda(), name="foreign", aliases=()),
    }
    offers = {
        ("robot", name): Offer("robot", name, "arms", "tests", make)
        for name, make in robots.items()
    }
    monkeypatch.setattr(
        installed(), "offers", installed().offers | toys.offered() | offers
    )
    return [
        "sims=[toy]",
        "seeds=[1]",
        "executor=here",
        f"executor.notes={tmp_path / 'notes'}",
    ]


def on(arms, robots, *words):
    """Tell each arm's entry by its name."""
    result = transfer(
        settings([f"designs={SOLUTION}", *arms, f"robots=[{robots}]", *words])
    )
    assert list(result["robots"]) == [design["robot"] for design in result["designs"]]
    assert len({design["design"] for design in result["designs"]}) == 1
    return {design["robot"]: design for design in result["designs"]}


def test_an_arm_that_cannot_do_it_is_a_row_with_the_reason(arms):
    far = "panda base=[3, 0, 0, 0]"
    found = on(arms, "weak,panda,{name: panda, base: [3, 0, 0, 0]},foreign")
    assert {
        robot for robot, design in found.items() if design["status"] == "rejected"
    } == {"weak", far}
    assert "the arm carries at most 0.002 kg" in found["weak"]["reason"]
    assert found[far]["reason"].startswith(
        "robot panda can't reach the task's home (0.5, 0, 0.5), by "
    )
    assert found["weak"]["robust"] == found[far]["robust"] == 0
    assert found["weak"]["ik_error_m"] is None
    # The same tool and plan, also by the paper's names.
    assert found["panda"] | {"robot": "foreign"} == found["foreign"]
    assert found["panda"]["ik_error_m"] < 1e-3


def test_attachments_for_fingers_need_a_gripper(arms):
    file = SOLUTION.with_name("SnatchCookie.json")
    words = ["task=SnatchCookie", f"designs={file}", "material=paper"]
    found = on(arms, "stiff,panda", *words)
    assert found["stiff"]["reason"].startswith("Stiff has no gripper")
    assert found["panda"]["status"] != "rejected"


def test_no_arm_that_can_do_it_is_an_error(arms):
    with pytest.raises(
        UserError,
        match=r"robot panda can't reach .* by 1.* robot panda can't reach .* by 2",
    ):
        on(arms, "{name: panda, base: [3, 0, 0, 0]},{name: panda, base: [4, 0, 0, 0]}")


def test_an_arm_that_stands_elsewhere(tmp_path):
    words = ["sims=[pybullet]", "seeds=[1]", "output=out.json"]
    robots = "robots=[panda,{name: panda, base: [0.05, 0, 0, 0]}]"
    done = python_m(tmp_path, "core", "transfer", f"designs={SOLUTION}", *words, robots)
    assert done.returncode == 0, done.stderr
    here, there = json.loads((tmp_path / "out.json").read_text())["designs"]
    assert (here["robot"], there["robot"]) == ("panda", "panda base=[0.05, 0, 0, 0]")
    assert here["robust"] != there["robust"] == pytest.approx(here["robust"], abs=0.02)
    assert any(
        line.split()[2:7] == ["panda", "base=[0.05,", "0,", "0,", "0]"]
        for line in done.stdout.splitlines()
    )


# --- a run's folder ---------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_the_best_of_a_run_under_the_runs_own_conditions(ran):
    folder, result = ran
    tried = result.ranking
    cfg = configured(
        [
            f"designs={folder}",
            "sims=[pybullet]",
            "seeds=[0]",
            "top=3",
            "executor.workers=1",
        ]
    )
    assert (cfg.task.name, cfg.tool.name, cfg.seed, cfg.rollout.hold_s) == (
        "OneBook",
        "urdf",
        3,
        0.5,
    )
    found = transfer(cfg)["designs"]
    assert [design["design"] for design in found] == [e.candidate.id for e in tried[:3]]
    assert [design["engines"]["pybullet"]["nominal"] for design in found] == [
        e.reward for e in tried[:3]
    ]


def test_an_engine_that_is_not_installed_is_left_out_unless_it_is_named(
    monkeypatch, capsys
):
    offers = installed().offers
    missing = replace(offers["sim", "pybullet"], factory="no_such_package:Engine")
    monkeypatch.setitem(offers, ("sim", "pybullet"), missing)
    assert configured(["designs=x.json"]).sims == ["sapien"]
    assert capsys.readouterr().err.startswith("left out: ")
    assert configured(["designs=x.json", "sims=[pybullet]"]).sims == ["pybullet"]


@pytest.mark.thorough
def test_all_that_was_tried_can_be_read_back(ran):
    folder, result = ran
    task = installed().create("task", "OneBook")
    again = stored_evaluations(folder, installed().create("tool", "urdf"), task)
    tried = [e for g in result.generations for e in g.evaluations if e.status == "ok"]
    assert [e.candidate.id for e in again] == [e.candidate.id for e in tried]
    for one, other in zip(again, tried, strict=True):
        assert (one.reward, one.distance_m) == (other.reward, other.distance_m)
        assert one.candidate.plan.poses.tolist() == other.candidate.plan.poses.tolist()
        assert one.candidate.design_name == other.candidate.design_name
        assert one.candidate.parents == other.candidate.parents
        assert len(one.candidate.tool.components) == len(
            other.candidate.tool.components
        )
    tools = {e.candidate.key[:3]: e.candidate.tool for e in again}
    assert all(e.candidate.tool is tools[e.candidate.key[:3]] for e in again)
    assert {e.candidate.generation for e in again if e.candidate.parents} == {1}
    assert stored_config(folder)["seed"] == 3


@pytest.mark.thorough
def test_a_run_with_a_given_tool_can_be_read_back(tmp_path):
    words = [
        "task=BringCube",
        "tool=none",
        "film=false",
        "listener=[]",
        "executor.workers=1",
    ]
    words += ["budget=tiny", "budget.n_action=2"]
    result = run(load("config", words), tmp_path / "run")
    again = transfer(
        configured(
            [
                f"designs={tmp_path / 'run'}",
                "sims=[pybullet]",
                "seeds=[0]",
                "executor.workers=1",
            ]
        )
    )
    assert again["designs"][0]["engines"]["pybullet"]["nominal"] == result.best.reward


# --- mistakes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no designs given; usage: "),
        (["designs=missing.json"], "designs file missing.json: there is no such file"),
        (
            ["designs=runs/missing"],
            "runs/missing: there is no such folder of a run, and no designs file",
        ),
        ([f"designs={ROOT / 'docs'}"], "holds no run: there is no run.sqlite in it"),
        (
            [f"designs={SOLUTION}", "sims=[pybullet,bullet]"],
            r"no sim 'bullet' \(did you mean 'pybullet'\?\)",
        ),
        (
            [f"designs={SOLUTION}", "robots=[panda,pandas]"],
            r"no robot 'pandas' \(did you mean 'panda'\?\)",
        ),
        (
            [f"designs={SOLUTION}", "robots=[panda,panda]"],
            "robot: 'panda' is repeated; name each robot once",
        ),
        (
            [f"designs={SOLUTION}", "robots=[{base: [0, 0, 0, 0]}]"],
            "names no robot; give a name, or {name: NAME",
        ),
        (
            [f"designs={SOLUTION}", "robots=[{name: panda, base: [1]}]"],
            "robot.base must be four numbers",
        ),
        ([f"designs={SOLUTION}", "seeds=[]"], "setting 'seeds' can't be"),
        ([f"designs={SOLUTION}", "perturbation.mass=1.5"], "mass: must be"),
        (
            [f"designs={SOLUTION}", "perturbation.weight=1"],
            "no key 'weight' in perturbation",
        ),
        (
            [f"designs={SOLUTION}", "seed=-1"],
            "seed must be from 0 to 9007199254740992, got -1",
        ),
    ],
)
def test_mistakes(words, said):
    with pytest.raises(UserError, match=said):
        transfer(configured(["sims=[mujoco]", *words]))
