"""What is possible in a scene file and seldom meant is said once, in a line."""

import pytest

from core.errors import UserError
from core.goals import Away, Kept, Throughout, Turned
from core.search.builder import check_starts
from plugins.new.new_command import write_scene
from plugins.tasks.file.scene_warnings import (
    find_idle_goals,
    find_unrewarded,
    find_warnings,
)
from tests.support.panda import on_panda
from tests.support.scene_files import task_of
from tests.support.text import replaced, replaced_all

BODY = "\n  - {name: tin, cylinder: {radius: 0.03, length: 0.1}, position: [0.7, 0.2, 0.05], mass: 0.2}"


@pytest.fixture
def text(tmp_path):
    return write_scene("PushBlock", tmp_path / "push.yaml").read_text()


def warnings_of(tmp_path, text, body=""):
    task = task_of(tmp_path, replaced(text, ("\nbodies:", f"\nbodies:{body}")), "none")
    return list(find_warnings(task.scene(0)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "mass: 0.2",
            "mass: 250",
            "body tin weighs 250 kg; grams?",
        ),
        ("length: 0.1", "length: 10", "body tin is 10 m long; millimetres?"),
        (
            "0.05]",
            "0.15]",
            "body tin begins in the air: it falls by 100 mm; a position is that of its middle",
        ),
        ("[0.7, 0.2", "[7, 0.2", "body tin begins in the air: "),
    ],
)
def test_units_that_were_mixed_up_and_bodies_in_the_air(tmp_path, text, old, new, said):
    assert warnings_of(tmp_path, text, BODY) == warnings_of(tmp_path, text) == []
    assert any(
        line.startswith(said)
        for line in warnings_of(tmp_path, text, replaced(BODY, (old, new)))
    )


@pytest.mark.parametrize(
    ("description", "goals", "said"),
    [
        ("It must stay upright.", (Away(("tin",), away=0.1),), "says 'upright'"),
        ("Without tipping over.", (Away(("tin",), away=0.1),), "says 'tipping over'"),
        ("It must stay upright.", (Turned(("tin",)),), ""),
        ("Keep it upright.", (Throughout(Turned(("tin",))),), ""),
        ("Keep the glass upright.", (Kept(("glass",)),), ""),
        ("Touch it with the tip.", (Away(("tin",), away=0.1),), ""),
    ],
)
def test_what_is_described_and_earns_nothing(description, goals, said):
    lines = [*find_unrewarded(description, goals)]
    assert len(lines) == bool(said)
    assert all(said in line for line in lines)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[0.7, 0.2, 0.05]", "[1.0, 0.12, 0.05]", "tin and block overlap by 50 mm"),
        ("[0.7, 0.2, 0.05]", "[0.7, 0.25, 0.05]", ""),
    ],
)
def test_a_run_says_at_once_what_overlaps(tmp_path, text, caplog, old, new, said):
    body = replaced_all(BODY, (old, new))
    text = replaced(text, ("\nbodies:", f"\nbodies:{body}"))
    check_starts(on_panda(task_of(tmp_path, text, "none")))
    assert said in caplog.text
    assert ("overlap" in caplog.text) == bool(said)


def test_a_run_says_at_once_what_this_arm_does_not_reach(tmp_path, text, caplog):
    far = replaced(text, ("[1.0, 0.1, 0.04]", "[1.0, 3.5, 0.04]"))
    check_starts(on_panda(task_of(tmp_path, far, "none")))
    assert "block, or where it is to be, is out of reach" in caplog.text


def test_soft_bodies_in_the_air(tmp_path, text):
    elastic = "elastic: {density: 300, young: 1.0e5}"
    cloth = f"\n  - {{name: rag, cloth: {{size: [0.1, 0.1]}}, {elastic}, position: [0.6, 0.3, 0.101]}}"
    assert [line[:43] for line in warnings_of(tmp_path, text, cloth)] == [
        "body rag begins in the air: it falls by 100"
    ]
    assert (
        warnings_of(
            tmp_path, text, replaced_all(cloth, ("position", "pinned: [0], position"))
        )
        == []
    )


def said_of_goals(tmp_path, text, goal):
    task = task_of(
        tmp_path, text.partition("\ngoals:")[0] + f"\ngoals:\n  - {goal}\n", "none"
    )
    return list(find_idle_goals(task.scene(0), task.goals, task.every))


DRAWER = """name: Drawer
description: A drawer is held by a slider and a bond, and a wall stands on the table.
bodies:
  - {name: drawer, box: [0.1, 0.1, 0.04], position: [0.7, 0, 0.021], mass: 0.2}
  - {name: ball, sphere: 0.02, position: [0.5, 0.2, 0.02], mass: 0.1}
  - {name: wall, box: [0.02, 0.4, 0.2], position: [0.9, 0, 0.1], fixed: true}
joints:
  - {name: runner, kind: slider, body: drawer, axis: [-1, 0, 0], lower: 0, upper: 0.2, stiffness: 5, rest: 0.1,
     latches: [{at: 0.2, force: 1, width: 0.01}]}
bonds:
  - {name: seal, body: drawer, origin: [0.05, 0, 0], breaks_n: 5}
goals:
  - {bodies: [drawer], place: [0.55, 0, null]}
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[0.05, 0, 0], b", "[0.7, 0, 0], b", "bond seal holds drawer by a point 650 mm from it"),
        ("[0.55, 0,", "[0.45, 0,", "joint runner brings drawer no nearer than 40 mm"),
        ("place: [0.55, 0, null]", "raised: 0.1", "joint runner brings drawer no nearer than 100 mm"),
    ],
)  # fmt: skip
def test_what_joints_and_bonds_do_not_do(tmp_path, caplog, old, new, said):
    task_of(tmp_path, DRAWER, "none")
    assert caplog.text == ""
    task_of(tmp_path, replaced_all(DRAWER, (old, new)), "none")
    assert said in caplog.text
    assert len(caplog.records) == 1


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("[0.6, 0.2, 0.02]", ""),
        ("[0.6, 0.2, 0.011]", ""),  # within the tolerance
        ("[0.6, 0.2, 0]", "ball is to end 20 mm inside table; a place is that of its middle"),
        ("[0.9, 0, 0.1]", "ball is to end 30 mm inside wall"),
    ],
)  # fmt: skip
def test_a_place_inside_of_what_is_fixed(tmp_path, place, said):
    goal = f"{{bodies: [ball], place: {place}}}"
    text = replaced_all(DRAWER, ("{bodies: [drawer], place: [0.55, 0, null]}", goal))
    found = list(on_panda(task_of(tmp_path, text, "none")).find_warnings())
    assert [line[: len(said)] for line in found] == [said] * bool(said)


BUTTON = """name: Button
description: A button sits on a post. Press it.
bodies:
  - {name: post, box: [0.05, 0.05, 0.06], position: [0.72, 0.1, 0.03], fixed: true}
  - {name: button, cylinder: {radius: 0.015, length: 0.02}, position: [0.72, 0.1, 0.0725], mass: 0.05}
joints:
  - {name: press, kind: slider, body: button, axis: [0, 0, -1], lower: 0, upper: 0.01}
goals:
  - {joint: press, to: "> 0.008"}
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("", "", "joint press (goal 0): button meets post where joint press is at"),
        ("0.0725]", "0.0805]", ""),  # it has 10 mm of way
        ('"> 0.008"', '"> 0.003"', ""),  # less is asked than 2.5 mm and what engines give
        ("body: button, axis", "body: button, parent: post, axis", ""),  # these never collide
    ],
)  # fmt: skip
def test_a_joint_that_something_fixed_stops_before_its_goal(tmp_path, old, new, said):
    text = replaced_all(BUTTON, (old, new)) if old else BUTTON
    found = list(on_panda(task_of(tmp_path, text, "none")).find_warnings())
    assert [line[: len(said)] for line in found] == [said] * bool(said)


def test_many_bodies_that_overlap_are_said_in_few_lines(tmp_path):
    ball = "{name: ball, sphere: 0.02, position: [0.5, 0.2, 0.02], mass: 0.1"
    text = DRAWER.replace(ball, f"{ball}, repeat: {{ring: 30, radius: 0.05}}")
    *named, last = on_panda(task_of(tmp_path, text, "none")).find_warnings()
    assert len(named) == 5
    assert last == "85 more pairs of bodies overlap"


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("breaks_n: 0.97", "body ball weighs 0.981 N, and breaks at 0.97 N where it lies"),
        ("breaks_n: 0.99", ""),
        ("velocity: [0.1, 0, 0]", "ball is to be kept, and begins to move"),
    ],
)  # fmt: skip
def test_what_is_lost_before_the_robot_moves(tmp_path, caplog, key, said):
    ball = "{name: ball, sphere: 0.02,"
    text = replaced_all(
        DRAWER.replace(ball, f"{ball} {key},"), ("null]}", "null], keep: [ball]}")
    )
    task_of(tmp_path, text, "none")
    assert said in caplog.text
    assert len(caplog.records) == bool(said)


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ("[0, 0, 1.57]", "body ball has rpy_deg 1.57, which are degrees: 90 degrees are 1.57"),
        ("[-0.785, 0, 0]", "body ball has rpy_deg -0.785, which are degrees: 45 degrees"),
        ("[0, 3.14159, 0]", "body ball has rpy_deg 3.14159, which are degrees: 180 degrees"),
        ("[0, 1.5, 0]", ""),
        ("[0, 0, 90]", ""),
    ],
)  # fmt: skip
def test_degrees_that_look_like_radians(tmp_path, caplog, angles, said):
    ball = "{name: ball, sphere: 0.02,"
    task_of(tmp_path, DRAWER.replace(ball, f"{ball} rpy_deg: {angles},"), "none")
    assert said in caplog.text
    assert len(caplog.records) == bool(said)


UP = """name: Up
description: Everything floats upward here. A bar rests under the ceiling.
table: false
gravity: [0, 0, 9.81]
bodies:
  - {name: ceiling, box: [2, 2, 0.02], position: [0.5, 0, 1.01], fixed: true}
  - {name: bar, box: [0.02, 0.4, 0.02], position: [0.5, 0, 0.99], mass: 0.1}
goals:
  - {bodies: [bar], place: [null, null, "< 0.7"], held: true}
"""


def test_in_the_air_is_looked_for_where_gravity_draws(tmp_path):
    assert list(find_warnings(task_of(tmp_path, UP, "none").scene(0))) == []
    for change, said in (
        (("0.99]", "0.9]"), ["it falls by 90 mm"]),
        (("0, 9.81]", "0, -9.81]"), ["it falls by 1.6e+03 mm"]),
        (("[0, 0, 9.81]", "[9.81, 0, 0]"), ["nothing stops it where gravity draws it"]),
        (("[0, 0, 9.81]", "[0, 0, 0]"), []),
    ):
        found = find_warnings(task_of(tmp_path, UP.replace(*change), "none").scene(0))
        assert [line.split(": ")[1].split(";")[0] for line in found] == said


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("{bodies: [block], raised: 0.1}", ""),
        ("{bodies: [block], raised: '> -0.1'}", "is met at the start: doing nothing earns 1"),
        ("{bodies: [block], raised: '> -0.1', held: true}", ""),
        ("{bodies: [block], place: [2.6, 0, null]}", "is 2.6 m from the robot: few arms"),
        ("{bodies: [block, tin], raised: 0.1, enough: 1}", "has enough: 1, which is one body of 2;"),
        ("{bodies: [block], place: [0, 0, 0.2], at: tin}", "is given at tin where that begins, and stays there"),
    ],
)  # fmt: skip
def test_goals_that_are_seldom_meant(tmp_path, text, goal, said):
    lines = said_of_goals(
        tmp_path, replaced(text, ("\nbodies:", f"\nbodies:{BODY}")), goal
    )
    assert len(lines) == bool(said)
    assert said in "".join(lines)


def test_they_are_said_once_for_a_file(tmp_path, text, caplog):
    heavy = replaced_all(BODY, ("mass: 0.2", "mass: 250"))
    for _ in range(2):
        task_of(tmp_path, replaced(text, ("\nbodies:", f"\nbodies:{heavy}")))
    assert [record.message.partition(": ")[2] for record in caplog.records] == [
        "body tin weighs 250 kg; grams?",
        "body tin has 8.84e+05 kg/m^3; kilograms and metres are read",
    ]


@pytest.mark.parametrize(
    ("goal", "refused"),
    [
        ("{joint: press, to: '> 0.003', held: true}", True),
        ("{bodies: [button], held: true}", True),
        ("{joint: press, to: '> 0.003', released: true}", False),
    ],
)
def test_what_a_joint_bears_is_never_held(tmp_path, goal, refused):
    text = replaced_all(BUTTON, ('{joint: press, to: "> 0.008"}', goal))
    if not refused:
        task_of(tmp_path, text, "none")
        return

    with pytest.raises(UserError, match=r"button hangs .* by the joint press, and can"):
        task_of(tmp_path, text, "none")
