"""What a scene itself prevents is said: a lid that a bolt blocks wherever it stands, a force that moves nothing."""

import pytest

from core.solids.hindrances import find_hindrances
from plugins.conformance.suites import examine
from plugins.tasks.file.task import FileTask
from tests.support.panda import on_panda
from tests.support.text import replaced_all

SLIDE = "  - {name: slide, kind: slider, body: lid, parent: chest, axis: [0, 1, 0], lower: 0, upper: 0.25}\n"
CHEST = replaced_all(
    """
name: Chest
description: A chest with a sliding lid, which a bolt holds shut, has a ball in it; bring that onto the table.
bodies:
  - name: chest
    fixed: true
    position: [0.5, 0, 0]
    parts:
      - {box: [0.2, 0.01, 0.1], position: [0, 0.095, 0.05]}
      - {box: [0.2, 0.01, 0.1], position: [0, -0.095, 0.05]}
      - {box: [0.01, 0.2, 0.1], position: [0.095, 0, 0.05]}
      - {box: [0.01, 0.2, 0.1], position: [-0.095, 0, 0.05]}
  - {name: lid, at: chest, position: [0, 0, 0.106], box: [0.2, 0.2, 0.01], mass: 0.3}
  - {name: bolt, at: chest, position: [0.05, 0.125, 0.106], box: [0.03, 0.03, 0.008], mass: 0.1}
  - {name: ball, at: chest, position: [0, 0, 0.03], sphere: 0.03, mass: 0.1}
joints:
SLIDE_HERE  - {name: latch, kind: slider, body: bolt, parent: chest, axis: [1, 0, 0], lower: 0, upper: 0.06}
goals:
  - {bodies: [ball], place: [0.5, -0.3, null], tolerance: 0.05}
""",
    ("SLIDE_HERE", SLIDE),
)
PUSH = """
name: Push
description: A block of 1 kg stands on the table; push it to the left, and press it no harder than is allowed.
bodies:
  - {name: block, box: [0.1, 0.1, 0.1], position: [0.5, 0, 0.05], mass: 1.0, friction: 0.5}
goals:
  - {bodies: [block], place: [0.5, 0.2, null], tolerance: 0.02}
  - {untouched: [block], max_force_n: 4.0}
"""


@pytest.fixture
def hindrances(tmp_path):
    def find(text):
        file = tmp_path / "scene.yaml"
        file.write_text(text)
        task = on_panda(FileTask(str(file)))
        return task, list(find_hindrances(task.goals, task.scene(0)))

    return find


@pytest.mark.thorough
def test_a_lid_that_a_bolt_blocks_wherever_it_stands_is_named(hindrances):
    task, (line,) = hindrances(CHEST)
    for word in ("ball", "slide", "lid meets bolt", "wherever"):
        assert word in line

    verdicts = {v.check: v.problem for v in examine("task", task)}
    assert line in str(verdicts["nothing in the scene prevents its goals"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("upper: 0.06", "upper: 0.2"),  # the bolt leaves the lid's way
        ("[0.05, 0.125, 0.106]", "[0.05, 0.125, 0.12]"),  # it is above
        ("axis: [0, 1, 0], lower: 0", "axis: [0, 1, 0], lower: -0.25"),  # other side
        (SLIDE, ""),  # the lid lies loose
        ("place: [0.5, -0.3, null]", "place: [0.5, 0.0, null]"),  # it may stay
    ],
)
def test_a_way_out_is_a_way_out(hindrances, before, after):
    assert before in CHEST
    assert hindrances(CHEST.replace(before, after))[1] == []


@pytest.mark.parametrize(("allowed", "count"), [(4.7, 1), (5.0, 0)])
def test_a_force_that_moves_nothing_is_named(hindrances, allowed, count):
    _, lines = hindrances(replaced_all(PUSH, ("4.0", str(allowed))))
    assert len(lines) == count
    for line in lines:
        assert "block weighs 9.81 N" in line
        assert "4.7 N" in line


def test_a_limit_on_another_body_is_none_on_this_one(hindrances):
    text = replaced_all(PUSH, ("max_force_n: 4.0", "max_force_n: 4.0, by: [block]"))
    _, lines = hindrances(
        replaced_all(text, ("untouched: [block]", "untouched: [table]"))
    )
    assert lines == []


GATE = """
name: Gate
description: A bolt on a gate stands behind a post. Draw it back, and open the gate.
bodies:
  - {name: post, box: [0.03, 0.05, 0.3], position: [0.63, -0.32, 0.15], fixed: true}
  - {name: gate, box: [0.02, 0.3, 0.2], position: [0.6, -0.1, 0.15], mass: 0.5}
  - {name: bolt, box: [0.01, 0.1, 0.01], position: [0.585, -0.26, 0.15], mass: 0.1}
  - {name: catch, box: [0.03, 0.05, 0.3], position: [0.56, -0.3, 0.15], fixed: true}
joints:
  - {name: swing, kind: hinge, body: gate, axis: [0, 0, -1], origin: [0, 0.15, 0], lower: 0, upper: 1.4}
  - {name: slide, kind: slider, body: bolt, parent: gate, axis: [0, 1, 0], lower: 0, upper: 0.1}
goals:
  - {name: opened, joint: swing, to: "> 1"}
"""
SHORT = {
    "lower: 0, upper: 0.1}": "lower: 0, upper: 0.01}"
}  # the bolt stays behind the catch
FIXED = "fixed: true}\njoints:\n"
FRAME = "  - {name: frame, box: [0.02, 0.02, 0.02], position: [0.6, 0.2, 0.01], mass: 0.1}\n"
HUNG = "  - {name: hook, kind: hinge, body: catch, parent: frame, axis: [1, 0, 0], lower: 0, upper: 0.001}\n"
PINNED = HUNG.replace("parent: frame, ", "")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ""),
        (SHORT, "opened: bolt meets catch where joint swing is at"),
        ({**SHORT, FIXED: "mass: 0.2}\njoints:\n"}, ""),  # it is pushed over
        ({**SHORT, FIXED: f"mass: 0.2}}\n{FRAME}joints:\n{HUNG}"}, ""),  # with its frame
        ({**SHORT, FIXED: f"mass: 0.2}}\njoints:\n{PINNED}"}, "opened: bolt meets catch"),
        ({'joint: swing, to: "> 1"': 'bodies: [gate], turned_deg: "> 60"'}, ""),
        ({**SHORT, 'joint: swing, to: "> 1"': 'bodies: [gate], turned_deg: "> 60"'}, "opened: bolt meets catch"),
        ({"parent: gate, axis": "axis"}, "opened: gate meets bolt"),
    ],
)  # fmt: skip
def test_what_a_joint_meets_may_be_moved_out_of_its_way(hindrances, changes, said):
    text = GATE
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)

    task, lines = hindrances(text)
    assert [line[: len(said)] for line in lines] == [said] * bool(said)
    assert bool(task.scene(0).hindered) == bool(said)
