"""What a plan shows before it is played: what stands in the way in, and turns that dip."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.designs.feedback import foreseen_lines
from core.designs.planning import parse_plan
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.scene import Body, Drive, Goal, Joint, Scene
from core.simulation.rollout import check, evaluate_batch
from tests import solutions
from tests.engines import simulator
from tests.faults import Slide
from tests.panda import on_panda
from tests.rare import rare

SETTINGS = RolloutSettings()
ROD = Tool((Component("rod", "tool_mount", Pose(np.array([0.0, 0.0, -0.1])), Box((0.02, 0.02, 0.2))),))
ABOVE, THERE, PAST = (0.4, 0, 0.5, 0, 0, 0), (0.4, 0, 0.25, 0, 0, 0), (0.6, 0, 0.25, 0, 0, 0)
INTO = (0.5, 0, 0.25, 0, 0, 0)  # the middle of the block


class Blocks(Slide):
    """A block 0.45 to 0.55 m ahead and up to 0.1 m high; with it, perhaps, others."""

    others: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()

    def scene(self, seed):
        return Scene((*super().scene(seed).bodies, *self.others), self.joints)


def block(name, x, mass=0.0, **given):
    return Body.of(name, Box((0.1, 0.1, 0.1)), (x, 0, 0.05), mass=mass, color=(0.5, 0.5, 0.5, 1.0), **given)


def shown(*waypoints, tool=ROD, others=(), joints=(), goals=None, plan=None):
    task = Blocks()
    task.others, task.joints, task.goals = others, joints, goals or task.goals
    trial = check(task, Candidate(tool, np.array(waypoints) if plan is None else plan), 0, SETTINGS)
    assert trial.reason == ""
    return foreseen_lines([trial])


def test_work_begins_at_a_body_that_can_move_after_the_first_waypoint():
    assert shown(ABOVE, THERE, PAST) == []
    assert shown(INTO) == shown(INTO, PAST) == ["on the way to waypoint 1 rod meets block 50 mm deep"]


def test_what_stands_in_the_way_to_work_is_met_and_what_comes_after_is_not():
    wall, cart = block("wall", 0.3), block("cart", 0.3, mass=1.0)
    through = (0.2, 0, 0.5, 0, 0, 0), (0.2, 0, 0.25, 0, 0, 0), THERE, PAST
    (line,) = shown(*through, others=(wall,))
    assert line.startswith("on the way to waypoint 3 rod meets wall ")
    assert shown(*through, others=(cart,)) == []  # perhaps it is meant to be moved
    assert shown(*through, others=(cart,), goals=(Goal(("block",), away=0.1, untouched=("cart",)),))
    assert shown(ABOVE, THERE, PAST, (0.8, 0, 0.25, 0, 0, 0), others=(block("wall", 0.8),)) == []


def test_what_moves_by_itself_is_left_out():
    down, cart = (0.3, 0, 0.25, 0, 0, 0), block("cart", 0.3, mass=1.0)
    assert shown(down, others=(cart,)) != []
    assert shown(down, others=(replace(cart, velocity=(0.5, 0, 0)),)) == []
    slide = Joint("slide", "slider", "cart", None, axis=(1, 0, 0), drive=Drive((0.0, 1.0), (0.0, 0.1), 50.0))
    assert shown(down, others=(cart,), joints=(slide,)) == []


def test_a_guard_ends_it():
    wall, actions = block("wall", 0.3), installed().create("action", "anchored", guards=True)
    steps = [{"anchor": "world", "offset": [x, 0, z]} for x, z in ((0.2, 0.5), (0.2, 0.25), (0.4, 0.25))]
    assert shown(plan=parse_plan(actions, steps, False), others=(wall,)) != []
    steps[-1]["until"] = "touch"
    assert shown(plan=parse_plan(actions, steps, False), others=(wall,)) == []


def test_a_turn_that_dips_near_a_body_is_named_with_how_far():
    wall = block("wall", 0.3)
    wanted = 1000 * (np.hypot(0.2, 0.01) - 0.2 * np.cos(0.5) - 0.01 * np.sin(0.5))  # of its corners
    turned = [(0.3, 0, 0.303, 0, pitch, 0) for pitch in (-0.5, 0.5)]
    (line,) = shown(*turned, others=(wall,))
    said, _, rest = line.removeprefix("on the way to waypoint 2 the lowest point of the tool dips ").partition(" ")
    assert rest == "mm below both ends, near wall"
    assert float(said) == pytest.approx(wanted, abs=1.0)
    assert shown(*[(*pose[:2], 0.33, *pose[3:]) for pose in turned], others=(wall,)) == []  # it is far away


def test_of_several_layouts_their_number_is_said_and_the_deepest():
    trials = [check(on_panda(Slide()), Candidate(ROD, np.array([INTO])), seed, SETTINGS) for seed in (0, 1)]
    clear = check(on_panda(Slide()), Candidate(ROD, np.array([ABOVE])), 2, SETTINGS)
    assert foreseen_lines([*trials, clear]) == ["on the way to waypoint 1 rod meets block 50 mm deep in 2 of 3 layouts"]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(solutions.FILES))
def test_of_reference_solutions_nothing_is_said_that_is_not_so(name):
    task, solution = installed().create("task", name, variation="wide"), solutions.anchored(name)
    said = foreseen_lines([check(task, solution, seed, SETTINGS) for seed in range(5)])
    if name == "TurkeyLegs":  # 1.6 mm above the table
        (line,) = said
        assert line.startswith("on the way to waypoint 1 the lowest point of the tool dips ")
    else:
        assert said == []


@pytest.mark.slow
@pytest.mark.parametrize("engine", rare(["mujoco", "pybullet", "sapien"], "mujoco"))
def test_what_is_said_of_shifted_solutions_happens_when_they_are_played(engine):
    shifts = {"PourGrains": (0, 0.02, -0.05), "SweepCards": (0, 0, -0.012), "PastGlasses": (0, 0.025, 0)}
    for name, shift in shifts.items():
        solution, task = solutions.anchored(name), installed().create("task", name)
        steps = [replace(s, offset=tuple(float(x) for x in np.add(s.offset, shift))) for s in solution.plan.steps]
        shifted = replace(solution, plan=replace(solution.plan, steps=tuple(steps)))
        (evaluation,) = evaluate_batch(task, simulator(engine), [shifted], 0, RolloutSettings(observe=True))
        (trial,) = evaluation.trials
        met = [what.split() for what, _, how in trial.foreseen if how == "deep"]
        assert met, name
        for *_, waypoint, part, _, body in met:
            seen = [c for c in trial.observation.contacts if (c.one, c.other) == (part, body)]
            assert seen, (name, part, body)
            assert seen[0].first_s <= trial.observation.arrivals[int(waypoint) - 1] + 0.1
