"""The ledger of a run: what each design changed, and what came of it."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool, Varied
from core.geometry import Box, Pose
from core.trial import Evaluation, Score, Trial, Where
from core.values.margins import Margin
from plugins.vlms.context.changes import describe_change
from plugins.vlms.context.feedback import ALL
from plugins.vlms.context.ledger import MOST, ledger_lines

ROD = Component(
    "rod", "tool_mount", Pose.xyz_rpy((0.0, 0.0, -0.1)), Box((0.02, 0.02, 0.2))
)
FIRST = Candidate(Tool((ROD,)), np.zeros((2, 6)), design_name="push")


def changed(rod=ROD, *more, plan=FIRST.plan):
    return replace(FIRST, tool=Tool((rod, *more)), plan=plan)


def tried(reward, room, **given):
    candidate = replace(FIRST, **given)
    margins = (Margin("offset", 1 - room, 1.0, "m", room),)
    trial = Trial(Where("Slide", "mujoco", 0), reward=reward, margins=margins)
    return Evaluation(candidate, (trial,), Score(reward))


@pytest.mark.parametrize(
    ("child", "said"),
    [
        (changed(), "same tool; same plan"),
        (
            changed(replace(ROD, shape=Box((0.02, 0.02, 0.25)))),
            "rod size 0.02 0.02 0.2 -> 0.02 0.02 0.25; same plan",
        ),
        (
            changed(replace(ROD, pose=Pose.xyz_rpy((0, 0, -0.1), (0, 0, 0.384)))),
            "rod rpy 0 0 0 -> 0 0 0.384; same plan",
        ),
        (changed(ROD, replace(ROD, name="lip")), "new lip; same plan"),
        (
            changed(plan=np.array([[0.0] * 6, [0.1, 0, 0, 0, 0, 0]])),
            "same tool; 1 of 2 steps of the plan differ, the first "
            "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0] -> [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]",
        ),
    ],
)
def test_a_change_is_told_by_component_and_step(child, said):
    assert describe_change(FIRST, child) == said


def test_a_line_says_idea_change_and_effect():
    first = tried(0.0, -0.5)
    name = first.candidate.id
    better = tried(
        1.0, 0.27, generation=1, parents=(name,), design_description="Turn 22 deg."
    )
    assert ledger_lines([better, first], ALL) == [
        f'- {name} "push":  | 0.000, room -50 %',
        f'- g1-a0-s0-p0 "push" from {name}: Turn 22 deg. | same tool; same plan | '
        "0.000, room -50 % -> 1.000, room 27 %",
    ]


def test_the_best_plan_stands_for_a_design_and_a_rejected_design_has_its_reason():
    plans = [tried(0.2, 0.0), tried(0.9, 0.1, action=1)]
    refused = Evaluation(replace(FIRST, design=1, problem="too heavy", tool=None))
    lines = ledger_lines([*plans, refused], ALL)
    assert [line.split("|")[1].strip() for line in lines] == [
        "0.900, room 10 %",
        "rejected: too heavy",
    ]


def test_the_ledger_is_bounded_and_keeps_the_best():
    many = [tried(n / 200, 0.0, design=n, design_name="x" * 60) for n in range(200)]
    lines = ledger_lines(many, ALL)
    assert sum(map(len, lines)) <= MOST + 40
    assert "0.995" in lines[-2]
    assert lines[-1].endswith("more designs earned less")


def test_a_curve_is_told_in_the_order_of_what_was_added():
    base = tried(0.2, 0.0)
    curve = [
        tried(
            reward,
            room,
            design=number + 1,
            varied=Varied(FIRST.id, ("waypoints all yaw",), (added,)),
        )
        for number, (added, reward, room) in enumerate(
            [(0.2, 0.4, 0.0), (-0.2, 0.1, 0.0), (0.1, 1.0, 0.3)]
        )
    ]
    (line,) = ledger_lines([base, *curve], ALL)
    assert line.startswith("- g0-a0-s3-p0")  # the best of it stands for all
    assert line.endswith(
        "1.000, room 30 % | curve, added to waypoints all yaw: -0.2: 0.100, room 0 %; 0.1: 1.000, room 30 %; "
        "0.2: 0.400, room 0 %"
    )
