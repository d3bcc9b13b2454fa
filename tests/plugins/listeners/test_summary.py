"""What is said at the end of a run, and that ``vlmgineer evaluate`` gives its reward again by those words."""

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load
from core.design import Candidate
from core.errors import UserError
from core.events import Generation, Result, Run
from core.interfaces import Reply, Score
from core.plugins import event_hub, installed
from core.scene import Margin
from core.search.orchestration import run, run_and_print
from core.support.text import hydra_word
from core.trial import Evaluation, Making, Tally, Trial, Where
from plugins.commands import evaluate
from plugins.conformance.evaluations import tried_once
from plugins.new.new_command import write_scene
from tests.core.run_folders import hook
from tests.support.outside_arm import write_arm
from tests.support.rare import rare

TESTS = Path(__file__).parents[2]


def summary(
    capsys,
    *rewards,
    replies=(),
    name="hook",
    trials=({},),
    changes=(),
    making=None,
    **settings,
):
    """What is printed of a run with these rewards by generation; ``trials`` are further fields of each trial.

    Candidates earn the rewards ``changes`` where the scene is changed.
    """
    events = event_hub()
    events.register(installed().create("listener", "summary", settings))
    for reply in replies:
        events.hook.reply_received(request=None, reply=reply)
    generations = []
    for index, row in enumerate(rewards):
        evaluations = []
        for i, reward in enumerate(row):
            candidate = Candidate(hook(0.1, name), np.zeros((1, 6)), index, 0, i)
            if reward is None:
                evaluations.append(tried_once(candidate, "rejected", reason="heavy"))
                continue
            tried = [
                Trial(
                    Where("BringCube", "pybullet", layout),
                    candidate.id,
                    reward=reward,
                    solved=reward >= 0.95,
                    measured={"distance_m": 0.5 + i},
                    **fields,
                )
                for layout, fields in enumerate(trials)
            ]
            changed = [
                Trial(Where("BringCube", "pybullet", 0, change), candidate.id, reward=r)
                for change, r in enumerate(changes)
            ]
            finals = Tally.of_trials(changed)
            evaluations.append(
                Evaluation(candidate, tuple(tried), Score(reward), finals)
            )
        generations.append(Generation(index, tuple(evaluations)))
    parts = {"task": "BringCube", "sim": "pybullet", "tool": "urdf"}
    chosen = {
        kind: {"name": name} for kind, name in {**parts, "fitness": "nominal"}.items()
    }
    config = {"listener": {"rerun": {}}, **chosen}
    task = installed().create("task", "BringCube")
    run = Run(
        Path("runs/it's here/x=1"),
        config,
        parts,
        "m",
        task,
        installed().create("tool", "urdf"),
        None,
        3,
        None,
        None,
    )
    events.hook.run_finished(
        run=run, result=Result(tuple(generations), 1.0, making=making)
    )
    return capsys.readouterr().err


def rows(said):
    return [line.split() for line in said.splitlines()]


def commands(said):
    """The commands to type next."""
    lines = [line.strip() for line in said.splitlines()]
    return [line for line in lines if line.startswith(("vlmgineer ", "python -m "))]


@pytest.mark.parametrize("active", [False, True])
def test_an_environment_that_is_not_active_is_to_be_activated_first(
    active, capsys, tmp_path, monkeypatch
):
    activate = tmp_path / "bin" / "activate"
    command = tmp_path / "bin" / "vlmgineer"
    activate.parent.mkdir()
    activate.touch()
    command.touch(mode=0o755)
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path / "bin") if active else "")

    lines = summary(capsys, [0.2]).splitlines()
    after = lines[lines.index("what to type next:") + 1].strip()
    assert after.startswith("vlmgineer " if active else "source ")
    assert after.endswith("/bin/activate") != active


def test_the_best_tools(capsys):
    said = rows(summary(capsys, [0.2, 0.4, None], [0.3, 0.1]))[1:]
    tools = [line for line in said if line[-1:] == ["hook"]]
    assert [line[0] for line in tools] == ["0.400", "0.300", "0.200"]
    assert tools[0] == ["0.400", "1.50", "2", "10", "g0-a0-s1-p0", "hook"]


def test_what_spoke_against_candidates_is_said_by_candidate(capsys):
    said = summary(capsys, [0.2, None, None], [None])
    first, *_ = lines = said.splitlines()
    assert first == (
        "g0-a0-s0-p0: generation 0, agent 0, design 0, plan 0; its designer calls the tool hook"
    )
    heading = lines.index("what failed, and why (3 of 4 candidates):")
    assert heading > lines.index("what to type next:")
    assert lines[heading + 1] == "  3 times, first g0-a0-s1-p0: heavy"


@pytest.mark.parametrize(("reward", "hinted"), [(0.0, True), (0.2, False)])
def test_tools_for_the_gripper_are_named_where_little_was_earned(
    reward, hinted, capsys
):
    hint = "tools for the gripper were not asked for: task.tool_kinds=[rigid,gripper]"
    assert (hint in summary(capsys, [reward]).splitlines()) == hinted


def test_a_shorter_way_that_goes_first_is_explained(capsys):
    said = summary(capsys, [0.995, 0.999])
    assert (
        "g0-a0-s1-p0 earned 0.999; rewards within evolution.tie of it count as equal"
        in said
    )
    assert "evolution.tie" not in summary(capsys, [0.9, 0.999])


def test_what_the_best_earned_in_small_changes_of_the_scene_is_said(capsys):
    said = summary(capsys, [0.995, 0.999], changes=[1.0, 0.9, 0.98])
    what = "of the scene, g0-a0-s0-p0 earned 0.960 on average, 0.900 at least"
    assert f"in 3 small changes {what}" in said.splitlines()
    assert "evolution.tie of it count as equal: among those that hold, room" in said
    assert "small change" not in summary(capsys, [0.995])


def test_as_many_tools_as_asked_for(capsys):
    said = rows(summary(capsys, [0.2, 0.4, 0.6], top=1))
    assert [line[0] for line in said[1:] if line[-1:] == ["hook"]] == ["0.600"]


def test_what_the_model_took(capsys):
    replies = [
        Reply("a", "", "m", prompt_tokens=10, completion_tokens=5, cost_usd=0.5),
        Reply("b", "", "m", error="no"),
        Reply("c", "", "m", prompt_tokens=1, cost_usd=0.25),
    ]
    assert "asked for 3 times, 1 without an answer, 16 tokens, 0.75 USD" in summary(
        capsys, [0.5], replies=replies
    )
    assert "asked for 1 time\n" in summary(capsys, [0.5], replies=[Reply("a", "", "m")])


def test_the_least_margin_of_the_best(capsys):
    margins = (Margin.at_most("force on board", 6, 15, "N"),)
    said = summary(capsys, [0.5], trials=[{}, {"margins": margins}])
    assert "least margin of the best 0.60: force on board 6 N, limit 15 N\n" in said
    # Of a task without limits.
    reward = (Margin.at_least("reward", 0.6, 0.95, "", 0.05),)
    assert "least margin" not in summary(capsys, [0.6], trials=[{"margins": reward}])


def test_the_joint_that_used_most_of_its_torque(capsys):
    trials = [{"torques": {"elbow": 0.4}}, {"torques": {"elbow": 0.3, "wrist": 0.52}}]
    said = summary(capsys, [0.5], trials=trials)
    assert (
        "most torque of the best: wrist used 52 % of its torque, as pybullet counts it"
        in said
    )
    assert "most torque" not in summary(capsys, [0.5], trials=[{}])


def test_each_goal_of_several_has_its_score(capsys):
    trials = [
        {"goals": (("door", door), ("can (goal 1)", 0.0))} for door in (0.25, 0.75)
    ]
    said = summary(capsys, [0.5], trials=trials)
    assert (
        "goals, by the best candidate (and the most by any): door 0.500 (0.750), can (goal 1) 0.000 (0.000)\n"
        in said
    )


def test_a_models_words_stay_words(capsys):
    said = summary(capsys, [0.5], name="[red]x[/]\x1b[31m\nevil")
    assert "[red]x[/][31m evil" in said
    assert "\x1b[31m" not in said


def test_nothing_could_be_tried(capsys):
    said = summary(capsys, [None])
    assert "no candidate could be tried: heavy" in said
    assert len(commands(said)) == 1  # no report of nothing


def test_commands_are_quoted(capsys):
    words = [shlex.split(line) for line in commands(summary(capsys, [0.5]))]
    folder = "runs/it's here/x=1"
    assert words == [
        ["vlmgineer", "view", folder],
        ["vlmgineer", "report", folder],
        ["vlmgineer", "evaluate", f"designs={hydra_word(folder)}"],
    ]


PUSHED_AWAY = [
    [0.5, 0, 0.5, 0, 0, 0],
    [0.5, 0, 0.345, 0, 0, 0],
    [0.72, 0, 0.345, 0, 0, 0],
]
INTO_ITSELF = [
    [0.4, 0, 0.5, 0, 0, 0],
    [0.2, 0, 0.2, 0, 0, 3.1],
    [-0.4, 0, 0.5, 0, 0, 0],
]
NOTHING_EARNED = {  # a file of designs, the strategy, another plan, further words, and the cause
    "never touched": ("BringCube", 0, None, "", "never touched"),
    "unreachable": ("BringCube", 2, None, "", "unreachable waypoint 2"),
    "missed": ("BringCube", 1, PUSHED_AWAY, "", "missed"),
    "stuck": ("HighObject", 0, None, "", "stuck shelf"),
    "dropped": ("ElevatePlate", 0, None, "", "dropped plate"),
    "tipped": ("LiftBox", 1, None, "", "tipped box"),
    "forbidden": (
        *("OneBook", 0, None, "task.variation=wide seed=1"),
        "forbidden book_4 moved by",
    ),
    "into itself": ("BringCube", 1, INTO_ITSELF, "", "the arm's 'panda_link1' is"),
    "too long": (
        *("BringCube", 0, None, "rollout.max_motion_s=1"),
        "the motion takes 2.1 s under the arm's limits",
    ),
    "no answer": ("BringCube", None, None, "", "the model gave no answer: skipped"),
}


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("kind", rare(NOTHING_EARNED, "missed", "no answer"))
def test_the_first_line_of_a_run_without_a_reward_names_the_cause(
    kind, tmp_path, capsys
):
    task, strategy, plan, words, cause = NOTHING_EARNED[kind]
    folder = "tasks/solutions" if kind == "forbidden" else "failures"
    document = json.loads((TESTS / folder / f"{task}.json").read_text())
    letter = tmp_path / "box/g0-a0"
    letter.mkdir(parents=True)
    if strategy is None:
        (letter / "skip").touch()
    else:
        design = document["strategies"][strategy]
        design["action_sets"] = [plan] if plan else design["action_sets"]
        (letter / "reply.json").write_text(json.dumps({"strategies": [design]}))

    sizes = "n_agent=1 n_tool=1 n_action=1 n_iteration=0"
    settings = [f"budget.{size}" for size in sizes.split()] + words.split()
    settings += ["sim=mujoco", "film=false", "prompt.picture=false", "vlm.poll_s=0.02"]
    settings += ["vlm=mailbox", f"vlm.folder={tmp_path / 'box'}", "listener=[summary]"]
    settings += ["material=paper"]  # of which the designs are
    try:
        run_and_print(load("config", [f"task={task}", *settings]), tmp_path / "run")
        shown = capsys.readouterr()
        first = shown.out.splitlines()[0]
        assert first.startswith(f"best reward 0.000 ({cause}")
        why = shown.err.partition("why nothing was earned: ")[2]
        assert why.replace(" at ", " ").replace(": ", " ").startswith(cause)
    except UserError as error:
        first = str(error)
        assert f"no candidate could be tried; the first reason: {cause}" in first
        said = capsys.readouterr().err
        assert f"no candidate could be tried: {cause}" in said


KINDS = {
    "nominal": "sim.time_step=0.004 material=pla material.infill=0.5 rollout.segment_s=0.7",
    "robust": "fitness=robust fitness.sims=[{name:mujoco,time_step:0.004}] fitness.seeds=[1,2]",
    "layouts": "fitness=layouts fitness.layouts=2 fitness.combine=worst fitness.unseen=1 task.variation=wide "
    "action=anchored rollout.perception.position=0.01 budget.n_tool=1 budget.final_s=1",
    "buildable": "task=OneBook fitness=buildable printer.plate_mm=[400,400,400]",
    "lean": "protocol=lean fitness.layouts=2 fitness.unseen=0 budget.final_s=1 "
    "fitness.references.BringCube=[4,0.5,null]",
    "another arm": "robot=ur5 robot.base=[-0.1,0,0,0.2] material=steel evolution.refine=2",
    "own arm": "robot=urdf robot.path=outside_arm/urdf/arm.urdf robot.flange=tool0 robot.home=[0,0.35,1.5,0,1.29,0]",
    "joints": "tool=boxes tool.joints=true",
    "solids": "tool=solids task=OneBook",
    "given tool": "tool=none",
    "scene file": "task=file task.file=scene.yaml",
}


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("kind", KINDS)
def test_the_reward_above_is_that_of_the_command(kind, tmp_path, monkeypatch, capsys):
    """To the last bit, whatever is not as it usually is."""
    monkeypatch.chdir(tmp_path)
    if kind == "scene file":
        write_scene("PushBlock", Path("scene.yaml"))
    if kind == "own arm":
        write_arm(Path())
    sizes = [
        "budget=tiny",
        "budget.n_tool=3",
    ]
    others = [
        "listener=[summary]",
        "film=false",
        "prompt.picture=false",
        "sim=mujoco",
        "seed=1",
    ]
    result = run(
        load("config", [*sizes, *others, *KINDS[kind].split()]), tmp_path / "run"
    )
    said = capsys.readouterr().err
    assert ("in pybullet it earns " in said) == (result.best.reward > 0)
    *_, line = commands(said)
    _, command, *words = shlex.split(line)
    assert command == "evaluate"
    evaluate.main([*words, "output=rewards.json"])
    (tried,) = json.loads(Path("rewards.json").read_text())
    assert tried["reward"] == result.best.reward
    assert tried["distance_m"] == result.best.distance_m


def test_the_last_line_says_in_short_what_was_found(capsys):
    making = Making(True, "printable: yes, in 2 pieces, about 5 hours, 112 g of pla")
    short = summary(capsys, [0.995], making=making).splitlines()[-1]
    assert short.startswith(
        "in short: hook of 10 g solves the task, to bring cube to its place"
    )
    assert short.endswith(f": reward 0.995; {making.words}")

    half = summary(capsys, [0.4]).splitlines()[-1]
    assert "hook of 10 g solves the task in part" in half
    nothing = summary(capsys, [0.0]).splitlines()[-1]
    assert "hook of 10 g does not solve the task" in nothing
    assert "in short" not in summary(capsys, [None])
