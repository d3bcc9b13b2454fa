"""The embedded designer's guided strokes: found by rays, chosen by what holds a body, and useful in an engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.geometry import Pose
from core.plugins import installed
from plugins.vlms.offline.below_roof import goes_below
from plugins.vlms.offline.catching import needs_catcher
from plugins.vlms.offline.clips import find_rims
from plugins.vlms.offline.cups import is_turned_by_walls, suits_cup
from plugins.vlms.offline.detours import find_detour, find_two_pushes, loses_ground
from plugins.vlms.offline.guided import make_guided_head, needs_guided_head
from plugins.vlms.offline.hand_turning import turns_in_hand
from plugins.vlms.offline.hanging import find_way_onto_peg, find_ways, hangs
from plugins.vlms.offline.ladling import find_vessel
from plugins.vlms.offline.reaching_in import find_bow_points
from plugins.vlms.offline.sheltered import find_depth, find_passage, is_sheltered
from tests.benchmarks.measuring import SOLUTIONS
from tests.playing import evaluate_batch
from tests.plugins.vlms.offline.test_designer import analysis, brief, candidates

SCENES = Path(__file__).parent / "guided"
NAMES = sorted(path.stem for path in SCENES.glob("*.yaml"))


def scene(name):
    for file in SCENES.rglob(f"{name}.yaml"):
        return installed().create("task", "file", file=str(file))

    return installed().create("task", name)


def subgoal(task):
    return max(
        analysis(task).draw_subgoals(np.random.default_rng(0)),
        key=lambda one: len(one.solids),
    )


@pytest.mark.parametrize("name", [*NAMES, "InsertPlug"])
def test_every_scene_has_its_stroke(name):
    found = subgoal(scene(name))
    assert needs_guided_head(found)
    assert make_guided_head(found, np.random.default_rng(0)) is not None


@pytest.mark.parametrize("name", sorted(path.stem for path in SOLUTIONS.glob("*.json")))
def test_what_lies_free_needs_none_of_these_strokes(name):
    assert not needs_guided_head(subgoal(installed().create("task", name)))


def test_a_body_is_led_around_a_wall_but_not_out_of_a_closed_one(tmp_path):
    detour = find_detour(subgoal(scene("out_of_u")))
    assert detour is not None
    assert detour[0][1] > 0.12  # out of the opening, which is at the left
    assert detour[-1][:2] == pytest.approx([-0.2, 0.1])

    file = tmp_path / "closed.yaml"
    text = (SCENES / "free" / "out_of_u.yaml").read_text()
    wall = "      - {box: [0.14, 0.02, 0.08], position: [0, -0.13, 0.04]}\n"
    file.write_text(text.replace(wall, wall + wall.replace("-0.13", "0.13")))
    closed = installed().create("task", "file", file=str(file))
    assert find_detour(subgoal(closed)) is None


def test_a_body_is_led_around_a_hole_in_what_it_lies_on(tmp_path):
    found = subgoal(scene("past_hole"))
    assert loses_ground(found)
    detour = find_detour(found)
    assert detour is not None
    assert max(abs(found.center[1] + shift[1]) for shift in detour) > 0.07

    file = tmp_path / "falls.yaml"
    text = (SCENES / "free" / "past_hole.yaml").read_text()
    file.write_text(text.replace('"> 0.05"', "null"))
    falls = installed().create("task", "file", file=str(file))
    assert not loses_ground(subgoal(falls))


def test_a_body_is_pushed_across_and_then_into_a_slot():
    found = subgoal(scene("into_slot"))
    assert find_detour(found) is None
    legs = find_two_pushes(found)
    assert legs is not None
    assert legs[0] == pytest.approx([0.0, 0.09, 0.0])
    assert legs[1] == pytest.approx([0.22, 0.0, 0.0])
    assert find_two_pushes(subgoal(scene("out_of_u"))) is None


def test_what_comes_alone_is_caught():
    assert needs_catcher(subgoal(scene("catch_ball")))
    assert not needs_catcher(subgoal(scene("out_of_u")))  # at rest
    assert not needs_catcher(subgoal(scene("StopCart")))  # others come, too


def test_what_lies_in_a_fixed_vessel_is_ladled_out_but_not_what_has_a_way_out(
    tmp_path,
):
    found = subgoal(scene("ladle_beans"))
    vessel = find_vessel(found)
    assert vessel is not None
    assert vessel.body.name == "dish"

    file = tmp_path / "open.yaml"
    text = (SCENES / "free" / "ladle_beans.yaml").read_text()
    wall = "      - {box: [0.006, 0.16, 0.05], position: [-0.083, 0, 0.025]}\n"
    assert wall in text
    file.write_text(text.replace(wall, ""))
    opened = installed().create("task", "file", file=str(file))
    assert find_vessel(subgoal(opened)) is None


def test_what_hangs_on_a_peg_gets_off_it_and_onto_another_along_it():
    found = subgoal(scene("HangRing"))
    assert hangs(found)
    ways = find_ways(found)
    assert ways is not None
    for way in ways:
        assert way.whole[0] < -0.1  # pegs point toward the robot
        assert abs(way.whole[1]) < 1e-6
        assert way.whole[2] > 0.012  # over the lip

    assert ways.heading == pytest.approx(0.0)
    assert not hangs(subgoal(scene("InsertPlug")))


def test_a_mug_is_turned_and_hung_on_a_peg_by_its_handle(tmp_path):
    found = subgoal(scene("onto_peg"))
    assert abs(found.yaw) == pytest.approx(np.pi / 2, abs=0.3)
    place = found.solids[0].position + found.shift
    assert place[2] > 0.25  # beside the peg
    onto = find_way_onto_peg(found)
    assert onto is not None
    assert onto.aside[0] < -0.1  # it points toward the robot

    # The peg is found by a place near it, too.
    file = tmp_path / "near.yaml"
    text = (SCENES / "free" / "onto_peg.yaml").read_text()
    x, y, z = (place + 0.03).round(3).tolist()
    file.write_text(text.replace('[null, null, "> 0.15"]', f"[{x}, {y}, {z}]"))
    near = subgoal(installed().create("task", "file", file=str(file)))
    assert find_way_onto_peg(near) is not None
    assert near.yaw == pytest.approx(found.yaw)

    file = tmp_path / "no_handle.yaml"
    file.write_text(text.replace("mug: {", "cup: {"))
    cup = installed().create("task", "file", file=str(file))
    assert find_way_onto_peg(subgoal(cup)) is None
    assert subgoal(cup).yaw == 0.0


def test_a_vessel_that_must_not_tilt_hangs_from_a_clip_on_its_rim():
    designs = candidates(brief(scene("upright_mug"), n_tool=4, n_action=1))
    kinds = [design.tool.name.split("_")[-1] for design in designs]
    assert kinds.count("clip") >= 3
    assert "hook" not in kinds


def test_a_body_hangs_from_a_bow_over_its_middle_and_not_from_one_beside_it(tmp_path):
    assert find_bow_points(subgoal(scene("carry_basket")))

    file = tmp_path / "beside.yaml"
    text = (SCENES / "free" / "carry_basket.yaml").read_text()
    for place in ("[0, 0.075, 0.11]", "[0, -0.075, 0.11]", "[0, 0, 0.155]"):
        assert place in text
        text = text.replace(place, place.replace("[0,", "[0.05,"))

    file.write_text(text)
    beside = installed().create("task", "file", file=str(file))
    assert not find_bow_points(subgoal(beside))


def test_a_bow_is_no_rim(tmp_path):
    assert find_rims(subgoal(scene("carry_basket")))  # its walls have one

    file = tmp_path / "lid.yaml"
    lines = (SCENES / "free" / "carry_basket.yaml").read_text().splitlines()
    flat = [line for line in lines if "0.01, 0.06]" not in line]
    assert len(flat) == len(lines) - 2
    file.write_text("\n".join(flat))
    lid = installed().create("task", "file", file=str(file))
    assert find_bow_points(subgoal(lid))
    assert not find_rims(subgoal(lid))


def test_a_cup_gets_between_two_boards_from_before_them(tmp_path):
    found = subgoal(scene("cup_in_shelf"))
    assert is_sheltered(found)
    passage = find_passage(found, 0.0, rises=(0.02,), headroom=0.03)
    assert passage is not None
    assert not passage.off.any()
    assert passage.on[0] < -0.06  # before the boards, with all of the cup
    assert find_passage(found, np.pi / 2, rises=(0.02,), headroom=0.03) is None
    to_edge = find_depth(found, found.center, 0.0, found.shift)
    assert 0.02 < to_edge < 0.07

    file = tmp_path / "open.yaml"
    text = (SCENES / "free" / "cup_in_shelf.yaml").read_text()
    board = "      - {box: [0.16, 0.4, 0.02], position: [0, 0, 0.31]}\n"
    assert board in text
    pea = "  - {name: pea, sphere: 0.01, position: [0.5, -0.1, 0.0142], mass: 0.01}\n"
    text = text.replace(board, "")
    file.write_text(text.replace("  - name: shelf\n", pea + "  - name: shelf\n"))
    opened = installed().create("task", "file", file=str(file))
    assert not is_sheltered(subgoal(opened))  # what is in a cup is not above it


def test_one_rod_turns_by_quarters_from_one_joint_to_one_the_other_way():
    designs = candidates(brief(scene("TwoStations"), n_tool=4, n_action=1))
    kinds = [design.tool.name.split("_")[1:] for design in designs]
    rods = [
        design
        for design, kind in zip(designs, kinds, strict=True)
        if kind == ["rod"]  # and no second head
    ]
    assert len(rods) >= 3

    for design in rods:
        turns = np.unwrap(design.plan.poses[:, 5])
        assert np.ptp(turns) > 3.0
        assert np.abs(np.diff(turns)).max() < 1.7
        assert abs(turns.max() + turns.min()) / 2 < 2.0  # what was drawn, at most


@pytest.mark.slow
def test_beans_are_ladled():
    task = scene("ladle_beans")
    designs = candidates(brief(task, n_tool=4, n_action=2, seed=3))
    sim = installed().create("sim", "mujoco")
    assert max(e.reward for e in evaluate_batch(task, sim, designs)) >= 0.7


def test_what_stands_flat_is_tipped_into_a_cup_unless_it_must_stay_upright(tmp_path):
    assert suits_cup(subgoal(scene("lift_book")))
    assert suits_cup(subgoal(scene("stack_cubes")))

    file = tmp_path / "upright.yaml"
    text = (SCENES / "free" / "lift_book.yaml").read_text()
    file.write_text(
        text
        + "  - {bodies: [book], axis: [0, 0, 1], tolerance_deg: 20, throughout: true}\n"
    )
    upright = installed().create("task", "file", file=str(file))
    assert not suits_cup(subgoal(upright))


@pytest.mark.parametrize(("height", "turns"), [(0.023, True), (0.017, False)])
def test_walls_turn_no_body_that_is_very_flat(tmp_path, height, turns):
    file = tmp_path / "flat.yaml"
    text = (SCENES / "free" / "lift_book.yaml").read_text()
    text = text.replace("0.15, 0.03]", f"0.12, {height}]").replace(
        "0.015]", f"{height / 2}]"
    )
    file.write_text(text)
    flat = installed().create("task", "file", file=str(file))
    assert is_turned_by_walls(subgoal(flat)) == turns


@pytest.mark.parametrize("name", ["brush_in_jar", "turn_cup", "stand_up"])
def test_pads_turn_what_is_to_be_turned_or_to_get_in_by_its_end(name):
    assert turns_in_hand(subgoal(scene(name)))


def test_pads_turn_nothing_that_fits_in_as_it_lies(tmp_path):
    file = tmp_path / "short.yaml"
    text = (SCENES / "free" / "brush_in_jar.yaml").read_text()
    file.write_text(text.replace("0.15, 0.012]", "0.05, 0.012]"))
    short = installed().create("task", "file", file=str(file))
    assert not turns_in_hand(subgoal(short))
    assert not turns_in_hand(subgoal(scene("stack_cubes")))


def test_a_box_is_brought_in_below_a_roof(tmp_path):
    found = subgoal(scene("box_in_shelf"))
    assert goes_below(found)

    # Where it was is no obstacle to it once it is turned.
    by = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    turned = replace(found, solids=[solid.moved_by(by) for solid in found.solids])
    assert turned.others == found.others
    assert not turned.riders

    file = tmp_path / "open.yaml"
    text = (SCENES / "free" / "box_in_shelf.yaml").read_text()
    roof = "      - {box: [0.2, 0.36, 0.015], position: [0, 0, 0.3925]}\n"
    assert roof in text
    file.write_text(text.replace(roof, ""))
    opened = installed().create("task", "file", file=str(file))
    assert not goes_below(subgoal(opened))


@pytest.mark.slow
@pytest.mark.parametrize("gripper", [False, True])
def test_a_box_comes_to_lie_on_a_board_below_a_roof(gripper):
    task = scene("box_in_shelf")
    designs = candidates(brief(task, gripper=gripper, n_tool=4, n_action=1, seed=3))
    sim = installed().create("sim", "mujoco")
    assert max(e.reward for e in evaluate_batch(task, sim, designs)) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("name", ["brush_in_jar", "turn_cup"])
def test_a_gripper_turns_a_body_between_its_pads(name):
    task = scene(name)
    designs = candidates(brief(task, gripper=True, n_tool=4, n_action=1, seed=3))
    sim = installed().create("sim", "mujoco")
    assert max(e.reward for e in evaluate_batch(task, sim, designs)) >= 0.95


@pytest.mark.slow
def test_what_is_flat_is_pushed_below_its_top():
    task = scene("coins_off_counter")
    designs = candidates(brief(task, n_tool=4, n_action=1, seed=5))
    sim = installed().create("sim", "mujoco")
    assert max(e.reward for e in evaluate_batch(task, sim, designs)) >= 0.95


@pytest.mark.slow
def test_a_cup_without_handles_is_poured_from():
    designs = candidates(brief(scene("pour_cup"), n_tool=8, n_action=1, seed=5))
    sim = installed().create("sim", "mujoco")
    tried = evaluate_batch(scene("pour_cup"), sim, designs)
    assert max(evaluation.reward for evaluation in tried) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("ball_in_cup", 0.95),
        ("carry_basket", 0.95),
        ("cup_in_shelf", 0.95),
        ("cup_out_of_shelf", 0.95),
        ("crack_nut", 0.95),
        ("lay_down", 0.95),
        ("lift_book", 0.95),
        ("lift_bucket", 0.95),
        ("lift_plate", 0.95),
        ("open_chest", 0.95),
        ("open_drawer", 0.95),
        ("out_of_u", 0.95),
        ("catch_ball", 0.95),
        ("from_under", 0.95),
        ("into_slot", 0.95),
        ("onto_peg", 0.95),
        ("lift_cloth", 0.95),
        ("past_hole", 0.95),
        ("press_and_let_go", 0.95),
        ("press_plunger", 0.95),
        ("shut_under_shelf", 0.95),
        ("stack_cubes", 0.95),
        ("stand_up", 0.95),
        ("there_and_back", 0.95),
        ("turn_box", 0.95),
        ("turn_plate", 0.95),
        ("two_buttons", 0.95),
        ("upright_mug", 0.95),
        ("wipe_peels", 0.95),
        ("HangRing", 0.95),
        ("InsertPlug", 0.95),
        ("TwoStations", 0.95),
    ],
)
def test_fresh_designs_earn(name, least):
    task = scene(name)
    sim = installed().create("sim", "mujoco")
    designs = candidates(brief(task, n_tool=4, n_action=1, seed=3))
    assert max(e.reward for e in evaluate_batch(task, sim, designs)) >= least
