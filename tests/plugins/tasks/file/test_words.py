"""What a scene file can ask for, by what is earned where bodies end; and what it can say of many bodies."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.errors import UserError
from core.geometry import Pose
from core.goals import goals_margins, goals_reward
from core.scene import Trace
from plugins.tasks.file.task import FileTask
from tests.support.text import replaced_all

WORDS = (Path(__file__).parent / "words.yaml").read_text()
GOAL = "{bodies: [cup], away: 0.1}"


@pytest.fixture
def read(tmp_path):
    def task_of(goal, text=WORDS):
        file = tmp_path / "scene.yaml"
        file.write_text(text.replace(GOAL, goal))
        return FileTask(str(file))

    return task_of


def ended(start, places):
    """The state in which bodies are at x, y, z, and roll, pitch, yaw in degrees if given."""
    positions = start.positions.copy()
    quaternions = start.quaternions.copy()
    for name, place in places.items():
        number = start.names.index(name)
        pose = Pose.xyz_rpy(place[:3], np.radians(place[3:] or (0, 0, 0)))
        positions[number] = pose.position
        quaternions[number] = pose.quaternion
    return replace(start, positions=positions, quaternions=quaternions)


FEW = {f"grain_{n}": (0.6, 0.3, 0.05) for n in range(12)}
STACKED = {"cup": (0.3, 0.3, 0), "peg_0": (0.3, 0.3, 1)}
# A goal, where bodies end, and what they earn.
CASES = [
    # At least, at most, between; in the world, a frame, or from the start.
    ("{bodies: [cup], place: [null, null, '> 0.3']}", {"cup": (0, 0, 0.3)}, 1),
    ("{bodies: [cup], place: [null, null, '>= 0.3']}", {"cup": (0, 0, 0.9)}, 1),
    ("{bodies: [cup], place: [null, null, '> 0.3']}", {"cup": (0.5, 0, 0.175)}, 0.5),
    ("{bodies: [cup], place: ['< 0.3', null, null]}", {"cup": (-3, 0, 0)}, 1),
    ("{bodies: [cup], place: [[0.6, 0.7], null, null]}", {"cup": (0.65, 0, 0)}, 1),
    ("{bodies: [cup], place: [[0.6, 0.7], null, null]}", {"cup": (0.9, 0, 0)}, 0),
    ("{bodies: [cup], place: [[0.6, null], 0.1, null]}", {"cup": (0.9, 0.1, 0)}, 1),
    ("{bodies: [cup], place: [[0.6, null], 0.1, null]}", {"cup": (0.9, 0, 0)}, 10 / 19),
    ("{bodies: [cup], at: post, place: ['> 0.3', null, 0]}", {"cup": (9, 0.25, 0.05)}, 1),
    ("{bodies: [cup, peg_0], at: disc, tolerance: 0.01, places: [[0, 0, 0], [0, 0, 1]]}", STACKED, 1),
    ("{bodies: [cup], raised: 0.1}", {"cup": (0.5, 0, 0.15)}, 1),
    ("{bodies: [cup], raised: 0.1}", {"cup": (0.5, 0, 0.1)}, 0.5),
    ("{bodies: [cup], raised: [0.1, 0.2]}", {"cup": (0.5, 0, 0.31)}, 0.4),
    ("{bodies: [cup], moved: ['> 0.2', 0, null]}", {"cup": (0.7, 0, 0)}, 1),
    ("{bodies: [cup], moved: [0.2, null, null], tolerance: 0.05}", {"cup": (0.6, 0, 0)}, 2 / 3),
    ("{joint: runner, to: '> 0.14'}", {"drawer": (0.85, 0.3, 0.025)}, 1),
    ("{joint: runner, to: '> 0.14'}", {"drawer": (0.95, 0.3, 0.025)}, 0.5),
    ("{joint: runner, change: '> 0.1'}", {"drawer": (0.85, 0.3, 0.025)}, 1),
    ("{joint: runner, change: 0.1, tolerance: 0.01}", {"drawer": (0.9, 0.3, 0.025)}, 1),
    ("{bodies: [cup], angle_deg: '> 60'}", {"cup": (0, 0, 0, 90, 0, 0)}, 1),
    ("{bodies: [cup], angle_deg: '> 60'}", {"cup": (0, 0, 0, 30, 0, 0)}, 0.5),
    ("{bodies: [cup], turned_deg: [80, 100]}", {"cup": (0, 0, 0, 0, 0, -90)}, 1),
    ("{bodies: [cup], facing: peg_0, axis: [0, 1, 0]}", {"peg_0": (0.5, 0.5, 0.05)}, 1),
    ("{bodies: [cup], facing: zone}", {"cup": (0.5, 0.3, 0.05, 0, 0, 180)}, 1),
    ("{bodies: [cup, drawer], apart: 0.9}", {"cup": (0.05, 0.3, 0.025)}, 1),
    # Inside: see also `WAYS_IN`.
    ("{bodies: [peg_0], inside: bottle}", {"peg_0": (0.6, 0.3, 0.05)}, 1),
    ("{bodies: [peg_0], inside: bottle}", {"peg_0": (0.6, 0.3, 0.28)}, 1),
    ("{bodies: ['grain*'], inside: bottle}", FEW, 0.5),
    ("{bodies: ['grain*'], inside: bottle, enough: 0.5}", FEW, 1),
    ("{bodies: ['grain*'], inside: bottle, enough: 16}", FEW, 0.75),
    ("{bodies: [cup], place: [0.6, 0.1, null]}", {"cup": (0.609, 0.1, 0)}, 1),
    ("{bodies: [cup], moved: ['> 0.1', 0, null]}", {"cup": (0.7, 0.009, 0)}, 1),
    ("{bodies: [peg_0], inside: over}", {"cup": (0.5, 0.5, 0), "peg_0": (0.55, 0.5, 0)}, 1),
    ("{bodies: [brick_0], inside: arch}", {"brick_0": (0.9, 0.6, 0.03)}, 1),
    ("{bodies: ['grain*'], inside: bottle, any: true}", FEW, 1),
    ("{bodies: ['grain*'], inside: cup}", {"cup": (0.9, 0, 0.05)}, 0),
    ("{bodies: [brick_0], inside: niche}", {"brick_0": (0.75, -0.3, 0.02)}, 1),
    ("{bodies: [cup], inside: zone}", {"cup": (0.22, 0.38, 0.01)}, 1),
    ("{bodies: [cup], inside: disc}", {"cup": (0.36, 0.36, 0.05)}, 1),
    ("{bodies: [cup], inside: disc}", {"cup": (0.36, 0.36, 0.09)}, 1),
    ("{bodies: ['grain*'], inside: bottle, enough: 1.0}", FEW, 0.5),
    ("{bodies: ['grain*'], inside: bottle, enough: 1}", FEW, 1),
]  # fmt: skip
ALMOST = [
    ("{bodies: [peg_0], inside: bottle}", {"peg_0": (0.6, 0.3, 0.33)}),
    ("{bodies: [peg_0], inside: bottle}", {"peg_0": (0.66, 0.3, 0.02)}),
    ("{bodies: [peg_0], inside: over}", {"cup": (0.5, 0.5, 0, 0, 0, 90), "peg_0": (0.55, 0.5, 0)}),
    ("{bodies: [brick_0], inside: arch}", {"brick_0": (0.82, 0.6, 0.03)}),
    ("{bodies: [brick_0], inside: niche}", {"brick_0": (0.67, -0.3, 0.02)}),
    ("{bodies: [cup], inside: zone}", {"cup": (0.3, 0.3, 0.12)}),
    ("{bodies: [cup], inside: disc}", {"cup": (0.38, 0.38, 0.05)}),
    ("{bodies: [cup], inside: disc}", {"cup": (0.36, 0.36, 0.12)}),
]  # fmt: skip
# What is to be inside, of what, and places on the way in: around walls, and through the opening.
WAYS_IN = [
    ("peg_0", "bottle", [(0.66, 0.3, 0.02), (0.66, 0.3, 0.2), (0.66, 0.3, 0.36), (0.6, 0.3, 0.36), (0.6, 0.3, 0.33)]),
    ("brick_0", "niche", [(0.93, -0.3, 0.02), (0.8, -0.3, 0.25), (0.67, -0.3, 0.25), (0.69, -0.3, 0.1)]),
    ("cup", "zone", [(0.5, 0.1, 0.05), (0.45, 0.2, 0.05), (0.3, 0.3, 0.12)]),
]  # fmt: skip


@pytest.mark.parametrize(("goal", "places", "earned"), CASES)
def test_a_goal_earns_what_it_says(read, goal, places, earned):
    task = read(goal)
    start = task.scene(0).state()
    end = ended(start, places)
    assert goals_reward(task, start, start) == (1 if "inside: cup" in goal else 0)
    assert goals_reward(task, start, end) == pytest.approx(earned)
    margins = [margin.margin for margin in goals_margins(task, start, end)]
    assert (min(margins) >= -1e-9) == (earned == 1)
    place = task.goals[0].place_of(task.goals[0].subjects(start)[0], start)
    if earned == 1 and "[cup]" in goal and place is not None:  # what a program aims for
        free = np.where(np.isnan(place), start.position("cup"), place)
        assert goals_reward(task, start, ended(start, {"cup": tuple(free)})) == 1


def test_what_holds_throughout_is_lost_on_the_way(read):
    task = read("{bodies: [cup], axis: [0, 0, 1], throughout: true}\n  - " + GOAL)
    start = task.scene(0).state()
    end = ended(start, {"cup": (0.7, 0, 0.05)})
    tipped = ended(start, {"cup": (0.6, 0, 0.05, 90, 0, 0)})
    for between, earned in ((start, 1), (tipped, 0)):
        film = Trace.of(start, between, end)
        assert goals_reward(task, start, end, film) == earned
    (margin,) = goals_margins(task, start, end, film)[:1]
    assert margin.value == pytest.approx(np.pi / 2)


def test_many_bodies_are_said_once(read):
    task = read(GOAL)
    scene = task.scene(0)
    kinds = Counter(body.name.partition("_")[0] for body in scene.free)
    assert kinds == {"cup": 1, "grain": 24, "peg": 6, "brick": 12, "drawer": 1}
    grains = [body.pose.position for body in scene.free if "grain" in body.name]
    gaps = [np.linalg.norm(a - b) for n, a in enumerate(grains) for b in grains[:n]]
    assert min(gaps) >= 0.0139
    assert np.hypot(*(np.array(grains)[:, :2] - [0.5, 0]).T).max() <= 0.024
    assert scene["grain_3"].visuals[0].color == scene["grain_4"].visuals[0].color
    assert scene["brick_1"].visuals[0].color != scene["brick_11"].visuals[0].color
    assert scene["wall"].fixed
    assert scene.gravity == (0, 0, -3.7)
    assert task.tool_kinds == ("gripper",)


MISTAKES = [
    (GOAL, "{bodies: [cup], place: [0, 0, '>> 3']}", r'place\[2\]: must be a number, "> 0.3", "< 0.3", or'),
    (GOAL, "{bodies: [cup], place: [0, 0, [3, 2]]}", "write the lower number first"),
    (GOAL, "{bodies: ['gran*'], away: 0.1}", r"no name like 'gran\*' \(did you mean 'grain_"),
    (GOAL, "{bodies: [cup], inside: post}", "'post' has no hollow with walls all around; give marks"),
    (GOAL, "{bodies: [cup], inside: jar}", "no body 'jar'"),
    (GOAL, "{bodies: [cup], places: [[0, 0, 0], [0, 0, 0]]}", "one for each of its 1 bodies"),
    (GOAL, "{bodies: [cup], facing: jar}", "no body 'jar'"),
    (GOAL, "{bodies: [cup], facing: cup}", "can't face itself"),
    (GOAL, "{bodies: [cup], facing: zone, angle: 3}", "angle"),
    (GOAL, "{bodies: [cup], apart: 0.1}", "apart needs two bodies"),
    (GOAL, "{joint: runner, to: 0.1, change: 0.1}", "a joint has to"),
    (GOAL, "{bodies: [cup], enough: 0, away: 0.1}", "enough: must be greater than 0"),
    (GOAL, "{bodies: [cup, peg_0], enough: 3, away: 0.1}", "enough: 3 is a number of bodies, and these are 2"),
    (GOAL, "{bodies: [cup, peg_0], enough: 1, any: true, away: 0.1}", "any and enough both say how many"),
    (GOAL, "{bodies: [cup], raised: 0.1, throughout: true}", "throughout means from the start on, and at"),
    (GOAL, "{bodies: [cup], held: true, throughout: true}", "from the start on"),
    (GOAL, "{bodies: [cup], axis: [0, 0, 1], throughout: true}", "goals: they only say what must not happen"),
    (GOAL, "{keep: [cup]}", "nothing can be earned; add what is to be reached"),
    (GOAL, "{bodies: [cup, peg_0], enough: '80 %', away: 0.1}", "enough: must be a whole number of bodies such as 3"),
    (GOAL, "{joint: runner, to: 0.26}", "joint runner starts at 0.04 and goes from 0 to 0.24 m, and never"),
    (GOAL, "{joint: runner, change: '< -0.05'}", "joint runner starts at 0.04 and goes from 0 to 0.24 m, and never"),
    (GOAL, "{joint: runner, to: 0.3, tolerance: 0.05}", "joint runner starts at"),
    (GOAL, "{bodies: [cup], angle_deg: '> 181'}", "an angle goes from 0 to 180 degrees"),
    (GOAL, "{bodies: [cup], turned_deg: '< -1'}", "an angle goes from 0 to 180 degrees"),
    (GOAL, "{bodies: [cup], place: [null, null, null]}", "null for all of x, y and z asks nothing"),
    (GOAL, "{bodies: [cup], moved: [null, null, null], rest: true}", "null for all of x, y and z asks nothing"),
    (GOAL, "{bodies: [cup], inside: cup}", "cup can't be inside itself"),
    (GOAL, "{bodies: [cup], away: 0.1, after: 0}", r"goals\[0\].after: it must be fulfilled before itself"),
    (GOAL, "{bodies: [cup], away: 0.1, after: b}\n  - {bodies: [cup], raised: 1, name: b, after: 0}", "before itself"),
    (GOAL, "{bodies: [cup], held: true, untouched: [cup]}", "cup must be held, and must not be touched by the robot"),
    (GOAL, "{bodies: [cup], away: 0.1, keep: [cup]}", "cup must get 0.1 m from where it starts, and is to be kept"),
    (GOAL, GOAL + "\n  - {keep: ['*'], kept_m: 0.09}", "cup must get 0.1 m from where it starts, and is to be kept"),
    (GOAL, "{bodies: [cup], moved: [0.2, null, null]}\n  - {keep: [cup]}", "cup must get 0.19 m from where it starts"),
    (GOAL, GOAL + "\n  - {untouched: [zone]}", "no body that can be touched 'zone'"),
    (GOAL, GOAL + "\n  - {untouched: [wall], by: [disc]}", "no body that can be touched 'disc'"),
    (GOAL, "{bodies: [cup], place: [0.6, 0, 0], tolerance: 0}", "tolerance: must be greater than 0"),
    (GOAL, "{bodies: [cup], axis: [0, 0, 1], points: [1, 0, 0], tolerance_deg: 0}", "tolerance_deg: must be greater"),
    (GOAL, "{bodies: [cup], raised: [0.1, 0.1]}", r"nothing gets to \[0.1, 0.1\] exactly; write 0.1, which has"),
    ('"brick_?"', '"brik"', r"colors: no body 'brik'"),
    ("wall: 0.004},", "wall: 0.004, handle: 0.03},", "cup.handle: no key 'handle'"),
    ("cup: {radius: 0.042,", "tube: {radius: 0.042, floor: 0.01,", "tube.floor: no key 'floor'"),
    ("tool_kinds: [gripper]", "tool_kinds: [griper]", r"tool_kinds\[0\]: must be 'rigid' or 'gripper', got 'griper'"),
    ("ground: {", "floor: false\nground: {", "ground says nothing where floor is false"),
    ("heap: 24", "heap: 240", "repeat.heap: must be less than or equal to 200"),
    ("heap: 24", "heap: 180", "a scene can have 200 bodies, not 204"),
    ("heap: 24", "heap: 24, spacing: [0.02, 0, 0.02]", "needs a spacing above 0 along y"),
    ("heap: 24", "ring: 3, heap: 2", "needs one of grid, ring, heap"),
    ("{ring: 6, radius: 0.05}", "{ring: 6}", "a ring and a heap need a radius"),
    ("size: [4, 3], ", "", "a wall needs a size"),
    ('"brick_?"', '"bri?"', r"colors: no name like 'bri\?'"),
    ("neck: 0.03", "neck: 0.06", "bottle: the neck must be wider than the wall"),
    ("neck_length: 0.1", "neck_length: 0.3", "bottle: the neck and shoulder must be shorter"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "name", "value", "left_out"),
    [
        ("tool_in_place: true", "tool_in_place", True, False),
        ("success_reward: 0.6", "success_reward", 0.6, 1.0),
        ("in_words: A cup  and grains.", "in_words", "A cup and grains.", ""),
        ("hold_s: 2.5", "hold_s", 2.5, 0.0),
        ("noise_m: 0.01", "noise_m", 0.01, 0.0),
        ("every: true", "every", True, False),
        ("payload_kg: 0.12", "payload_kg", 0.12, None),
    ],
)
def test_what_a_file_says_of_the_whole_task_is_the_tasks(
    read, line, name, value, left_out
):
    assert getattr(read(GOAL, f"{line}\n{WORDS}"), name) == value
    assert getattr(read(GOAL), name) == left_out


# Goals that look as if they could not be met, and can.
MEETABLE = [
    "{joint: runner, to: 0.245}",
    "{joint: runner, change: '< -0.03'}",
    "{bodies: [cup], raised: 0.1, ever: true, keep: [cup]}",
    "{bodies: [cup], away: 0.1, keep: [cup], kept_m: 0.11}",
    "{bodies: [cup, peg_0], away: 0.1, any: true, keep: [cup]}",
    "{bodies: [cup, peg_0], away: 0.1, enough: 1, keep: [cup]}",
    "{bodies: [cup], axis: [0, 0, 1], points: [1, 0, 0], keep: [cup]}",
    "{bodies: [cup], held: true, untouched: [cup], max_force_n: 3}",
    "{bodies: [cup], held: true, untouched: [cup], by: [peg_0]}",
    "{bodies: [cup], away: 0.1, untouched: [cup]}",
    "{bodies: [cup], away: 0.1, untouched: ['*'], by: ['brick*'], max_force_n: 3}",
    "{bodies: [cup], away: 0.1, name: a}\n  - {bodies: [cup], raised: 1, after: a}",
]  # fmt: skip


@pytest.mark.parametrize("goal", MEETABLE)
def test_a_goal_that_can_be_met_is_read(read, goal):
    task = read(goal)
    assert "over" not in getattr(task.goals[-1], "untouched", ())  # a mark


@pytest.mark.parametrize(("old", "new", "why"), MISTAKES)
def test_what_can_not_be_is_refused(read, old, new, why):
    with pytest.raises(UserError, match=why):
        read(GOAL, replaced_all(WORDS, (old, new)))


def test_a_mark_has_no_place_at_what_is_soft(read):
    cloth = "{size: [0.1, 0.1]}, elastic: {density: 300, young: 1.0e5}"
    rag = f"  - {{name: rag, cloth: {cloth}, position: [1, 0, 0.1]}}\njoints:"
    text = replaced_all(
        replaced_all(WORDS, ("at: cup, box", "at: rag, box")), ("joints:", rag)
    )
    with pytest.raises(UserError, match="'rag' is soft, and has no frame that a mark"):
        read(GOAL, text)


def test_a_mark_goes_along_with_what_it_is_at(read):
    task = read(GOAL)
    start = task.scene(0).state()
    end = ended(start, {"cup": (0.7, 0.1, 0.2, 0, 0, 90)})
    assert end.position("over") == pytest.approx(end.position("cup"))
    assert end.quaternion("over") == pytest.approx(end.quaternion("cup"))
    assert task.scene(0)["over"].visuals == ()  # the cup draws it


@pytest.mark.parametrize(
    ("space", "body", "rests_at"),
    [
        ("bottle", "peg_0", (0.6, 0.3, 0.035)),  # on its floor, 0.01 m thick
        ("arch", "brick_0", (0.895, 0.6, 0.01)),  # on the table
        ("zone", "brick_0", (0.3, 0.3, 0.01)),
        ("over", "peg_0", (0.5, 0, 0.065)),  # it stands in what is thinner than it
    ],
)
def test_what_is_to_be_inside_is_aimed_at_where_it_rests(read, space, body, rests_at):
    task = read(f"{{bodies: [{body}], inside: {space}}}")
    place = task.goals[0].place_of(body, task.scene(0).state())
    assert place == pytest.approx(rests_at, abs=0.005)


def test_where_gravity_draws_upward_it_rests_at_the_top(read):
    text = replaced_all(WORDS, ("[0, 0, -3.7]", "[0, 0, 3.7]"))
    task = read("{bodies: [brick_0], inside: niche}", text)
    place = task.goals[0].place_of("brick_0", task.scene(0).state())
    assert place == pytest.approx((0.795, -0.3, 0.18), abs=0.006)


VARIED = """
variations:
  wide: {RANGES}
"""


@pytest.mark.parametrize(("goal", "places"), ALMOST)
def test_what_is_almost_inside_earns_less_than_half(read, goal, places):
    task = read(goal)
    start = task.scene(0).state()
    end = ended(start, places)
    assert 0 < goals_reward(task, start, end) < 0.5
    assert min(margin.margin for margin in goals_margins(task, start, end)) < 0


@pytest.mark.parametrize(("body", "space", "places"), WAYS_IN)
def test_the_way_in_is_climbed(read, body, space, places):
    task = read(f"{{bodies: [{body}], inside: {space}}}")
    start = task.scene(0).state()
    on_the_way = [goals_reward(task, start, ended(start, {body: p})) for p in places]
    gained = np.diff([0, *on_the_way])
    assert (gained > 0.005).all(), on_the_way


def varied(tmp_path, ranges):
    file = tmp_path / "varied.yaml"
    file.write_text(WORDS + replaced_all(VARIED, ("RANGES", ranges)))
    return FileTask(str(file), "wide")


def test_copies_differ_by_what_is_drawn_for_each(tmp_path):
    whole = FileTask(str(Path(__file__).parent / "words.yaml")).scene(0)
    ranges = (
        '"bodies.brick_*.position.x": "+-0.004", bodies.grain_3.mass: [0.003, 0.004]'
    )
    task = varied(tmp_path, ranges)
    scene = task.scene(1)
    shifts = [
        scene[name].pose.position - whole[name].pose.position
        for name in (f"brick_{number}" for number in range(12))
    ]
    assert np.ptp(shifts, axis=0) == pytest.approx([0.006, 0, 0], abs=0.002)
    assert np.abs(shifts).max() <= 0.004
    assert 0.003 <= scene["grain_3"].mass <= 0.004
    assert scene["grain_4"].mass == whole["grain_4"].mass
    for name in ("grain_17", "peg_4"):
        assert scene[name].pose.position == pytest.approx(whole[name].pose.position)


@pytest.mark.parametrize(
    ("ranges", "why"),
    [
        ("bodies.brick_12.mass: [1, 2]", "there is no such number; .*bodies.ball_3.mass"),
        ('"bodies.stone_*.mass": [1, 2]', "there is no such number"),
        ('"bodies.brick_*.mass": -0.1', "how far it may be off"),
        ('"bodies.brick_*.mass": "+-0.02"', "can't be"),
        ('"goals*.tolerance": "+-0.1"', "only numbers of bodies"),
    ],
)  # fmt: skip
def test_copies_that_can_not_differ_so_are_refused(tmp_path, ranges, why):
    with pytest.raises(UserError, match=why):
        varied(tmp_path, ranges)


TOUCHING = """
name: Touching
description: A ball lies on a plate, and another one hangs above it; neither may touch the plate.
bodies:
  - {name: plate, box: [0.2, 0.2, 0.02], position: [0.6, 0, 0.01], fixed: true}
  - {name: lies, sphere: 0.02, position: [0.6, 0, 0.0402], mass: 0.1}
  - {name: hangs, sphere: 0.02, position: [0.6, 0, 0.3], mass: 0.1}
goals:
  - {bodies: [lies], raised: 0.1}
  - {untouched: [plate], by: [BALL]}
"""


def test_bodies_that_must_not_touch_and_begin_so_are_refused(read):
    with pytest.raises(UserError) as error:
        read(GOAL, replaced_all(TOUCHING, ("BALL", "lies")))

    problem = "lies must not touch plate, and begins at it: nothing could be earned"
    assert problem in str(error.value)


@pytest.mark.parametrize(
    ("limit", "height"),
    [("hangs", 0.0402), ("lies], max_force_n: [2", 0.0402), ("lies", 0.0408)],
)
def test_bodies_that_do_not_touch_at_the_start_may_be_kept_apart(read, limit, height):
    """A force of what touches at the start can be limited, and 0.8 mm are no contact."""
    text = replaced_all(
        replaced_all(TOUCHING, ("0.0402", str(height))), ("BALL", limit)
    )
    text = text.replace("max_force_n: [2]", "max_force_n: 2")  # which one has
    assert len(read(GOAL, text).goals) == 2
