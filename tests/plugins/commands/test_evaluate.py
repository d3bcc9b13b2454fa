"""The table of rewards: no reason is folded or cut where standard output is no terminal, and a blocked arm is named."""

import json
from pathlib import Path

import pytest
from PIL import Image

from core.errors import UsageError, UserError
from plugins.commands.evaluate import configured, main, show
from tests.core.run_folders import write_run
from tests.support.commands import python_m
from tests.support.text import replaced_all

SOLUTION = Path(__file__).parents[2] / "tasks" / "solutions" / "BringCube.json"
ANCHORED = Path(__file__).parents[2] / "tasks" / "anchored"


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Records and lines of a plan that works, of one that presses the tool into the table, stays, or is out of reach,
    and of a tool that breaks a rule.
    """
    folder = tmp_path_factory.mktemp("evaluated")
    good = json.loads(SOLUTION.read_text())["strategies"][0]
    pressed = [*good["action_sets"][0], [0.255, 0.0, 0.2, 0.0, 0.0, 0.0]]
    plans = [
        *good["action_sets"],
        pressed,
        [[9, 0, 0, 0, 0, 0]],
        [[0.5, 0, 0.5, 0, 0, 0]],
    ]
    off = good | {
        "tool_urdf": replaced_all(
            good["tool_urdf"], ('type="fixed"', 'type="revolute"')
        )
    }
    (folder / "designs.json").write_text(
        json.dumps({"strategies": [good | {"action_sets": plans}, off]})
    )
    words = [
        "task=BringCube",
        "sim=mujoco",
        "designs=designs.json",
        "output=out/rewards.json",
        "executor.workers=1",
    ]
    done = python_m(folder, "core", "evaluate", *words)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(
        (folder / "out/rewards.json").read_text()
    ), done.stdout.splitlines()


@pytest.mark.slow
def test_each_plan_has_a_record_of_what_it_earned(evaluated):
    records, lines = evaluated
    assert [(r["design"], r["plan"]) for r in records] == [
        (0, 0),
        (0, 1),
        (0, 2),
        (0, 3),
        (1, 0),
    ]
    assert [r["status"] for r in records] == ["ok", "ok", "rejected", "ok", "rejected"]
    solved, _, far, idle, loose = records
    assert (
        solved["solved"],
        solved["reason"],
        0.3 < solved["distance_m"] < 1.0,
    ) == (True, "", True)
    assert (idle["reward"] < 0.02, idle["distance_m"] < 1e-4) == (True, True)
    assert (far["reward"], loose["reward"], far["distance_m"]) == (0, 0, None)
    assert "waypoint 1" in far["reason"]
    assert "revolute" in loose["reason"]
    codes = [[found["code"] for found in r["refusals"]] for r in records]
    assert codes == [[], [], ["E_WAYPOINT_RANGE"], [], ["E_JOINT_TYPE"]]
    assert {"design", "reward", "status"} <= set(lines[0].split())


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_the_best_design_is_filmed(tmp_path, capsys):
    words = ["task=BringCube", "sim=mujoco", f"designs={SOLUTION}", "film=true"]
    main([*words, f"output={tmp_path / 'rewards.json'}"])
    film = tmp_path / "BringCube_s0_p0.gif"
    assert f"film: {film}" in capsys.readouterr().out
    with Image.open(film) as frames:
        assert frames.n_frames > 10


@pytest.mark.slow
def test_the_lag_is_shown_and_a_blocked_arm_is_named(evaluated):
    records, lines = evaluated
    free, pressed, far, *_ = records
    assert 0 < free["tracking_error_rad"] < 0.02 < pressed["tracking_error_rad"]
    assert far["tracking_error_rad"] is None
    assert free["warnings"] == []
    assert "; lag 0." in pressed["observed"]
    assert "lag rad" in lines[0]
    assert "torque %" in lines[0]
    assert pressed["torque_joint"].startswith("panda_joint")
    assert lines[2].split() == [
        "0",
        "1",
        f"{pressed['reward']:.3f}",
        f"{100 * pressed['room']:.0f}",
        *lines[2].split()[4:6],
        *lag(pressed),
        "ok",
    ]
    assert f"design 0 plan 1: {pressed['observed']}" in lines
    assert f"design 0 plan 1: least margin: {pressed['least_margin']}" in lines


def lag(record):
    torque = f"{100 * record['torque_share']:.0f}"
    return [f"{record['tracking_error_rad']:.3f}", torque]


@pytest.mark.slow
def test_a_reason_is_one_line(evaluated):
    records, lines = evaluated
    assert len(records[2]["reason"]) > 40
    assert f"design 0 plan 2: {records[2]['reason']}" in lines


def test_a_file_for_another_representation_names_it(tmp_path):
    design = {"tool_components": [], "action_sets": [[[0.5, 0, 0.5, 0, 0, 0]]]}
    file = tmp_path / "boxes.json"
    file.write_text(json.dumps({"strategies": [design]}))
    words = ["task=BringCube", f"designs={file}", "check=true"]
    with pytest.raises(UsageError, match="not written for tool=urdf; say tool=boxes"):
        main(words)


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_where_all_designs_are_rejected_the_command_fails(tmp_path, capsys):
    design = {"tool_urdf": "<link/>", "action_sets": [[[0.5, 0, 0.5, 0, 0, 0]]]}
    file = tmp_path / "rejected.json"
    file.write_text(json.dumps({"strategies": [design]}))
    with pytest.raises(UserError, match="none of 1 plans was tried: all are rejected"):
        main(["task=BringCube", "sim=mujoco", f"designs={file}"])

    assert "design 0 plan 0: " in capsys.readouterr().out


def test_a_terminal_is_shown_no_control_sequences(capsys):
    """A plugin's error may hold what a model wrote."""
    reason = "\x1b]0;owned\x07\x1b[2J[bold]no[/bold] \u202egnp\x00\nnext"
    figures = dict.fromkeys(("design", "plan", "reward"), 0)
    unknown = dict.fromkeys(
        ("distance_m", "ik_error_m", "tracking_error_rad", "torque_share", "room")
    )
    show([figures | unknown | {"status": "failed", "reason": reason, "warnings": []}])
    shown = capsys.readouterr().out
    assert "[bold]no" in shown  # as it stands, not as markup
    assert all(character.isprintable() or character == "\n" for character in shown)


@pytest.mark.slow
def test_designs_are_tried_in_layouts(tmp_path):
    words = [
        "task.variation=near",
        "fitness=layouts",
        "fitness.layouts=2",
        "sim=mujoco",
        "output=rewards.json",
    ]
    done = python_m(
        tmp_path,
        "core",
        "evaluate",
        f"designs={SOLUTION}",
        *words,
        "executor.workers=1",
    )
    assert done.returncode == 0, done.stderr
    (found,) = json.loads((tmp_path / "rewards.json").read_text())
    trials = found["details"]["trials"]
    rewards = [float(line.split()[0]) for line in trials]
    assert found["reward"] == pytest.approx(sum(rewards) / 2, abs=1e-3)
    assert "; ".join(trials) in done.stdout


@pytest.mark.slow
def test_plans_are_checked_without_playing_them(tmp_path):
    good = json.loads(SOLUTION.read_text())["strategies"][0]
    plans = [
        *good["action_sets"],
        [[0.9, 0.0, 0.2, 0.0, 0.0, 0.0]],
        [[9, 0, 0, 0, 0, 0]],
    ]
    (tmp_path / "designs.json").write_text(
        json.dumps({"strategies": [good | {"action_sets": plans}]})
    )
    words = ["evaluate", "task=BringCube", "sim=mujoco", "designs=designs.json"]
    words.append("check=true")
    done = python_m(tmp_path, "core", *words)
    solved, low, far = done.stdout.splitlines()
    assert (done.returncode, done.stderr, solved) == (
        0,
        "",
        "design 0 plan 0: nothing found",
    )
    assert low.startswith("design 0 plan 1: the arm misses the way to waypoint 1 by ")
    assert far.startswith("design 0 plan 2: ")
    assert "waypoint 1" in far
    layouts = ["task.variation=wide", "fitness=layouts"]
    done = python_m(tmp_path, "core", *words, *layouts)
    assert (
        "design 0 plan 1: 5 times, first layout 0: the arm misses the way to waypoint 1 by "
        in done.stdout
    )


def test_a_run_s_folder_stands_for_its_best_design_and_its_settings(tmp_path):
    folder = write_run(tmp_path / "run", "sim=mujoco", "seed=3", "rollout.speed=0.3")
    cfg = configured([f"designs={folder}"])
    assert (cfg.task.name, cfg.sim.name, cfg.seed) == ("BringCube", "mujoco", 3)
    assert cfg.rollout.speed == 0.3
    assert cfg.designs == str(folder / "best/design.json")

    cfg = configured([f"designs={folder}", "sim=pybullet", "rollout.speed=0.2"])
    assert (cfg.task.name, cfg.sim.name) == ("BringCube", "pybullet")
    assert cfg.rollout.speed == 0.2

    cfg = configured(["task=OneBook", f"designs={SOLUTION}"])
    assert (cfg.task.name, cfg.designs) == ("OneBook", str(SOLUTION))
    with pytest.raises(UserError, match="holds no run"):
        configured([f"designs={tmp_path}"])
