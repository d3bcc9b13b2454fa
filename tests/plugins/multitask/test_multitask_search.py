"""A search for one tool for several tasks, by the doors of users: with toys for what interrupts it, and with MuJoCo."""

import json

import pytest
from omegaconf import OmegaConf

from core import Experiment
from core.config.compose import load
from core.search.orchestration import run
from core.store.reader import StoredRun
from plugins.commands.evaluate import evaluate
from plugins.commands.prompt import PromptConfig, main, requests
from plugins.results.transfer import configured as transfer_settings
from plugins.results.transfer import transfer
from plugins.results.workshop.export_command import configured, export
from tests.support import toys
from tests.support.executors import evaluate_here

pytestmark = pytest.mark.slow

TOYS = (
    "task=multitask",
    "task.of=[BringCube,ElevatePlate]",
    "budget.n_agent=2",
    "budget.n_action=2",
)
NAMES = ["BringCube", "HighObject"]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Two generations of one agent, each with two tools and a plan for each task."""
    folder = tmp_path_factory.mktemp("several") / "run"
    sizes = [
        "budget=tiny",
        "budget.n_tool=2",
        "budget.n_iteration=1",
    ]
    words = [
        *sizes,
        "budget.reward_save=0",
        "rollout.hold_s=0.2",
        "film=false",
    ]
    of = f"task.of=[{','.join(NAMES)}]"
    experiment = Experiment(
        "task=multitask", of, *words, sim="mujoco", listener=["rerun"]
    )
    with pytest.MonkeyPatch.context() as patch:
        evaluate_here(patch)
        result = experiment.run(folder)

    return folder, result


# --- with MuJoCo --------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_tools_are_asked_for_first_and_then_plans_for_each_tool_and_task(found):
    folder, result = found
    tools = ["g0-a0", "g0-a0-s0-t0", "g0-a0-s0-t1", "g0-a0-s1-t0", "g0-a0-s1-t1"]
    asked = [request.id for request in StoredRun(folder).requests()]
    assert sorted(name for name in asked if name.startswith("g0")) == tools
    assert "g1-a0" not in asked  # every second generation keeps the elites' tools
    rollouts = sum(e.rollouts for g in result.generations for e in g.evaluations)
    assert rollouts <= 2 * 2 * len(NAMES)  # no more than a run for each task has
    assert [t.task for t in result.best.trials] == NAMES


def test_the_embedded_designers_tools_are_made_for_one_task_after_the_other(found):
    """First for the first task, and then for the next."""
    made_for = {}
    for evaluation in found[1].generations[0].evaluations:
        name = evaluation.candidate.design_name
        made_for[evaluation.candidate.design] = name.partition(" ")[0]

    assert made_for[0] in ("push", "cage", "hook")
    assert made_for[1] in ("drop", "scoop")


@pytest.mark.thorough
def test_the_best_design_earns_the_same_again_together_and_in_each_task(found):
    folder, result = found
    same = ["sim=mujoco", "rollout.hold_s=0.2", "executor.workers=1"]
    of = [
        "task=multitask",
        f"task.of=[{','.join(NAMES)}]",
        f"designs={folder / 'best' / 'design.json'}",
    ]
    (again,) = evaluate(load("evaluate", [*of, *same]))
    assert (again.reward, again.figures) == (result.best.reward, result.best.figures)
    for name in NAMES:
        (alone,) = evaluate(
            load(
                "evaluate",
                [
                    f"task={name}",
                    f"designs={folder / 'best' / name / 'design.json'}",
                    *same,
                ],
            )
        )
        assert alone.reward == result.best.figures[name]


def test_there_is_a_recording_for_each_task(found):
    folder, _ = found
    assert sorted(file.name for file in folder.glob("*.rrd")) == [
        f"recording_{name}.rrd" for name in NAMES
    ]


@pytest.mark.thorough
def test_transfer_tries_each_task(found):
    folder, result = found
    words = [f"designs={folder}", "sims=[mujoco]", "seeds=[0]", "executor.workers=1"]
    designs = transfer(transfer_settings(words))["designs"]
    assert {
        of["task"]: of["engines"]["mujoco"]["nominal"] for of in designs
    } == result.best.figures


@pytest.mark.thorough
def test_export_writes_one_tool_and_a_motion_for_each_task(found, tmp_path):
    folder, _ = found
    made = export(
        configured([f"designs={folder}", f"output={tmp_path / 'out'}", "sims=[mujoco]"])
    )
    assert [one.task.name for one in made] == NAMES
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [
        *NAMES,
        "tool",
    ]
    for one in made:
        figures = json.loads(
            (tmp_path / "out" / one.task.name / "figures.json").read_text()
        )
        assert figures["rewards"] == {"mujoco": one.replays["mujoco"].reward}
        assert (tmp_path / "out" / one.task.name / "motion" / "trajectory.csv").exists()
        checks = [check.part for check in one.verdicts if check.name == "motion"]
        assert checks == [one.task.name]


# --- with toys ----------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_replay_tries_the_same_designs(toy, tmp_path):
    # Some joined plans follow ones that failed.
    first = run(toys.several(toy.file, *TOYS[:2]), tmp_path / "run")
    cfg = toys.config(toy.file, *TOYS[:2])
    OmegaConf.update(
        cfg, "vlm", {"name": "replay", "run": str(tmp_path / "run")}, merge=False
    )
    again = run(cfg, tmp_path / "again")
    assert rewards(again) == rewards(first)
    # Distances of joined plans are not known.
    assert "NaN" not in (tmp_path / "run" / "result.json").read_text()
    assert max(reward for _, reward, _ in rewards(first).values()) > 0.1


def rewards(result):
    return {
        e.candidate.id: (e.status, e.reward, dict(e.figures))
        for g in result.generations
        for e in g.evaluations
    }


@pytest.mark.thorough
def test_all_requests_are_counted_beforehand(tmp_path, capsys):
    from core.config.compose import load

    words = [
        *TOYS[:2],
        "sim=mujoco",
        "vlm=offline",
        "budget.n_agent=3",
        "budget.n_tool=2",
    ]
    first, *plans = requests(load("prompt", words, PromptConfig))
    assert [of.brief.task.name for of in plans] == ["BringCube", "ElevatePlate"]
    assert (first.brief.n_action, plans[0].brief.n_tool, plans[0].brief.n_action) == (
        0,
        1,
        4,
    )
    main([*words, f"output={tmp_path}"])
    first_line, second, _ = capsys.readouterr().out.splitlines()
    tokens = int(first_line.partition(" ")[0])
    assert (
        json.loads((tmp_path / "request.json").read_text())["estimate"]["prompt_tokens"]
        == tokens
    )
    assert second.startswith("a generation has at most 15 requests with some ")
    whole = int(second.partition("some ")[2].partition(" ")[0])
    assert whole > 3 * tokens + 12 * 2000
