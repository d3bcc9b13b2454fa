"""What ``vlmgineer export`` writes, read by independent readers."""

import importlib.util
import inspect
import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import create_autospec

import numpy as np
import pytest
import yaml
from markdown_it import MarkdownIt

from core.errors import UserError
from core.robot.kinematics import arm_of
from core.scene import Scene
from plugins.results.workshop.carrying import load_export, play_dry
from plugins.results.workshop.export_command import configured, export, main
from plugins.results.workshop.export_folder import checklist
from plugins.results.workshop.playback import compare_rewards
from plugins.results.workshop.ways import close_ways
from tests.core.run_folders import write_run
from tests.support.exports import ANCHORED, exported
from tests.support.panda import PANDA

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    # Of the paper's material one check fails, the weight.
    return folder, exported(folder, "material=paper")


def test_the_motion_earns_what_was_simulated(made):
    folder, found = made
    assert found.replays["mujoco"].reward > 0.98
    assert found.replays["mujoco"].problems == ()
    for asked, reward, passed in (
        (0.9, 0.8801, True),
        (0.9, 0.8799, False),
        (0.0, 0.0, False),
    ):
        assert compare_rewards("", {"one": reward}, {"one": asked}).passed == passed
    figures = json.loads((folder / "figures.json").read_text())
    assert figures["rewards"] == {"mujoco": found.replays["mujoco"].reward}
    assert 0 < figures["first_contact_s"] < figures["duration_s"]
    assert max(joint["computed_torque_share"] for joint in figures["joints"]) < 1


def test_the_tool_is_written_and_earns_the_same_with_its_mount(made):
    folder, found = made
    assert found.mounted["mujoco"] == pytest.approx(
        found.replays["mujoco"].reward, abs=0.02
    )
    assert found.payload["mass_kg"] == pytest.approx(
        found.printed.printed.mass, abs=1e-5
    )
    assert found.printed.printed.mass == pytest.approx(
        sum(part.mass_g for part in found.printed.parts) / 1000
    )
    assert found.printed.mounted.mass > found.candidate.tool.mass
    names = {file.name for file in (folder / "tool").iterdir()}
    assert names == {"tool.stl", "tool.3mf"}


def test_what_fails_is_said_with_what_to_change_and_is_an_error(
    made, monkeypatch, capsys
):
    _, found = made
    failing = [str(verdict) for verdict in found.verdicts if verdict.passed is False]
    assert [line.partition(":")[0] for line in failing] == ["weight"]
    assert "such as material=pla" in failing[0]
    monkeypatch.setattr(
        "plugins.results.workshop.export_command.export", lambda cfg: [found]
    )
    with pytest.raises(UserError, match=rf"^1 of {len(found.verdicts)} checks failed"):
        main([f"designs={ANCHORED}/OneBook.json", "task=OneBook"])
    assert f"✗ {failing[0]}" in capsys.readouterr().out.splitlines()


def test_the_message_is_one_of_ros(made):
    folder, found = made
    rosbags = pytest.importorskip("rosbags.typesys")
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    types = store.types
    data = yaml.safe_load((folder / "ros2/trajectory.yaml").read_text())
    duration = types["builtin_interfaces/msg/Duration"]
    point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    stamp = types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"]
    points = [
        point(
            **{k: np.array(v) for k, v in of.items() if k != "time_from_start"},
            time_from_start=duration(**at),
        )
        for of in data["points"]
        for at in [of["time_from_start"]]
    ]
    head = header(
        stamp=stamp(**data["header"]["stamp"]), frame_id=data["header"]["frame_id"]
    )
    kind = "trajectory_msgs/msg/JointTrajectory"
    message = types[kind](header=head, joint_names=data["joint_names"], points=points)
    read = store.deserialize_cdr(store.serialize_cdr(message, kind), kind)
    times = [
        of.time_from_start.sec + of.time_from_start.nanosec * 1e-9 for of in read.points
    ]
    assert times[0] == 0
    assert times[-1] == pytest.approx(found.motion.times[-1])
    assert (np.diff(times) > 0).all()
    assert read.joint_names == list(PANDA.arm_joints)
    assert np.allclose(read.points[-1].positions, found.motion.positions[-1], atol=1e-6)


def test_the_scene_is_that_of_the_task(made):
    folder, found = made
    data = yaml.safe_load((folder / "ros2/scene.yaml").read_text())
    objects = {of["id"]: of for of in data["world"]["collision_objects"]}
    scene: Scene = found.task.scene(0)
    assert set(objects) == {body.name for body in scene.bodies}
    for body in scene.bodies:
        of = objects[body.name]
        parts = body.collisions
        assert len(of.get("primitives", [])) + len(of.get("meshes", [])) == len(parts)
        assert list(of["pose"]["position"].values()) == pytest.approx(
            body.pose.position, abs=1e-6
        )
        assert of["header"]["frame_id"] == "panda_link0"


def test_the_program_for_franky_plays_the_samples(made, monkeypatch):
    franky = pytest.importorskip("franky")
    folder, found = made
    robot = create_autospec(franky.Robot, instance=True)
    robot.current_joint_positions = found.motion.positions[0] + 0.04
    tracker = create_autospec(franky.JointImpedanceTracker)
    entered = tracker.return_value.__enter__.return_value
    monkeypatch.setattr(
        franky, "Robot", lambda host: robot if host == "172.16.0.2" else None
    )
    monkeypatch.setattr(franky, "JointImpedanceTracker", tracker)
    monkeypatch.setattr(sys, "argv", ["run_franky.py", "172.16.0.2", "trajectory"])
    spec = importlib.util.spec_from_file_location(
        "run_franky", folder / "programs/run_franky.py"
    )
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    program.main()
    (load,) = robot.set_load.call_args_list
    assert (load.args[0], len(load.args[1]), len(load.args[2])) == (
        found.payload["mass_kg"],
        3,
        9,
    )
    targets = [
        inspect.signature(franky.JointImpedanceTracker.set_target)
        .bind(None, *of.args, **of.kwargs)
        .args
        for of in entered.set_target.call_args_list
    ]
    assert np.allclose([of[1] for of in targets], found.motion.positions, atol=1e-6)
    robot.reset_mock()
    robot.current_joint_positions = found.motion.positions[0] - 0.06
    with pytest.raises(SystemExit, match=r"joint \d is 0.06 rad from where .* by hand"):
        program.main()
    assert robot.method_calls == []
    monkeypatch.setattr(sys, "argv", ["run_franky.py"])
    with pytest.raises(SystemExit):
        program.main()


@pytest.mark.thorough
def test_a_program_in_urscript_has_the_motion_at_both_speeds(tmp_path):
    found = exported(tmp_path, "robot=ur10", task="MoveBall")
    arm = arm_of(found.task.robot)
    text = (tmp_path / "programs" / "run.script").read_text()
    blocks = text.split("else:")
    for block, slower in zip(blocks, (5.0, 1.0), strict=True):
        rows = re.findall(
            r"servoj\(\[(.*?)\], t=([\d.]+), lookahead_time=([\d.]+), gain=(\d+)\)",
            block,
        )
        joints = np.array([[float(x) for x in row[0].split(",")] for row in rows])
        assert joints.shape[1] == 6
        assert (joints >= arm.lower).all()
        assert (joints <= arm.upper).all()
        assert np.allclose(joints[-1], found.motion.positions[-1], atol=1e-5)
        lasts = sum(float(row[1]) for row in rows)
        assert lasts == pytest.approx(slower * found.motion.times[-1], rel=0.1)
        assert 0.03 <= float(rows[0][2]) <= 0.2
        assert 100 <= int(rows[0][3]) <= 2000
    ends = len(re.findall(r"^\s*end$", text, re.MULTILINE))
    assert ends == len(
        re.findall(r"^(?:def .*|\s*(?:if|while) .*):$", text, re.MULTILINE)
    )
    payload = re.search(r"set_target_payload\(([\d.]+),", text)
    assert float(payload.group(1)) == found.payload["mass_kg"]


def test_before_contact_nothing_is_touched(made):
    folder, found = made
    file = folder / "motion/trajectory_before_contact.csv"
    last = np.loadtxt(file, delimiter=",", skiprows=1)[-1]
    assert last[0] / 5 < found.contact_s
    assert np.abs(last[8:15]).max() == 0


def test_a_way_that_is_not_free_is_left_out(made):
    _, found = made
    assert "approach" in found.moves
    through = replace(found.motion, positions=found.motion.positions[::-1])
    low = replace(through, positions=through.positions - 0.3 * np.eye(7)[3])
    moves = dict(found.moves) | {"approach": low, "retreat": found.motion}
    closed = close_ways(replace(found, moves=moves))
    assert "approach" not in closed.moves
    said = {check.name: check for check in closed.checks}["approach"]
    assert said.passed is None
    assert "bring the arm by hand" in said.found


def test_a_run_s_best_is_exported(tmp_path):
    run = write_run(tmp_path / "run", "task=MoveBall", rewards=[[0.2, 0.6]])
    (found,) = export(
        configured([f"designs={run}", f"output={tmp_path / 'out'}", "sims=[mujoco]"])
    )
    assert found.candidate.id == "g0-a0-s1-p0"
    assert found.task.name == "MoveBall"
    (verdict,) = (verdict for verdict in found.verdicts if verdict.name == "motion")
    assert verdict.passed is False
    assert verdict.found == (
        "as exported it earns 0.000 for 0.600 in mujoco; played as it was searched it earns 0.000 too: the run was "
        "played with other settings"
    )
    assert (
        f"Not to be run as it is:\n\n- {verdict}\n"
        in (tmp_path / "out" / "CHECKLIST.md").read_text()
    )


@pytest.mark.thorough
def test_a_plan_that_feels_and_looks_is_exported_as_it_is(tmp_path):
    document = json.loads(Path(f"{ANCHORED}/OneBook.json").read_text())
    steps = document["strategies"][0]["action_sets"][0]
    steps[1] |= {"until": "force", "newtons": 50.0, "speed": 0.2}
    steps.insert(1, {"look": True})
    (tmp_path / "looks.json").write_text(json.dumps(document))
    folder = tmp_path / "out"
    found = exported(folder, f"designs={tmp_path}/looks.json", "material=pla")
    failing = [str(verdict) for verdict in found.verdicts if verdict.passed is False]
    assert failing == []
    assert "1 look in mujoco" in "".join(map(str, found.verdicts))
    assert not (folder / "programs").exists()
    assert not (folder / "ros2" / "trajectory.yaml").exists()
    text = (folder / "CHECKLIST.md").read_text()
    assert "run_plan.py" in text
    assert "Run `motion/trajectory.csv`" not in text
    again = play_dry(load_export(folder / "plan"), "mujoco")
    assert again.reward == found.replays["mujoco"].reward


def test_a_folder_that_has_something_is_refused_before_anything_is_played(tmp_path):
    (tmp_path / "out" / "programs").mkdir(parents=True)
    with pytest.raises(
        UserError, match="out has files in it already; choose another output="
    ):
        exported(tmp_path / "out", "sims=[]")
    assert [file.name for file in tmp_path.rglob("*")] == ["out", "programs"]


def test_what_a_model_named_is_no_markup(made):
    _, found = made
    name = "<img src=x onerror=alert(1)> [a](javascript:b) `c` **d** | https://e.org\n\n# F\x1b[31m"
    tool = replace(found.candidate.tool, name=name)
    moves = {"approach": found.motion, "trajectory": found.motion}
    candidate = replace(found.candidate, tool=tool)
    replays = {name: found.replays["mujoco"]}
    text = checklist(replace(found, candidate=candidate, replays=replays, moves=moves))
    html = MarkdownIt("gfm-like", {"linkify": False}).render(text)
    assert not re.findall(r"<(?:img|a|strong|table)\b", html)
    assert (html.count("<h1>"), html.count("alert(1)"), html.count("<code>")) == (
        1,
        3,
        8,
    )
    assert "\x1b" not in text
    assert "https\\://e.org" in text  # which GitHub would make a link


def test_a_design_that_earned_nothing_before_its_export_is_said_to(tmp_path):
    words = [
        "designs=tests/failures/BringCube.json",
        "task=BringCube",
        "tool=urdf",
        "sims=[mujoco]",
        f"output={tmp_path / 'export'}",
    ]
    (found,) = export(configured(words))
    (check,) = (check for check in found.checks if check.name == "motion")
    assert check.passed is False
    assert "before its export it earned nothing in mujoco" in check.found
    assert "its path loses it" not in check.found
