"""A plan is played by kinematics: where the robot is then, and what it meets that is fixed or forbidden."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import DesignError
from core.geometry import Box
from core.goals import Away, Untouched
from core.interfaces import RolloutSettings, Waypoints
from core.scene import Body, Scene
from core.simulation.checking import find_problems
from core.simulation.rehearsing import rehearse
from tests.support.faults import Faulty, Slide, candidate
from tests.support.playing import condition

SETTINGS = RolloutSettings(settle_s=0, hold_s=0)
GRAY = (0.5, 0.5, 0.5, 1.0)
ABOVE = [0.5, 0.0, 0.4, 0, 0, 0]


class Walled(Slide):
    """A wall of which the near side stands at x = 0.6, up to a height."""

    goals = (Away(("block",), away=0.1),)
    tall = 0.3

    def scene(self, seed):
        size = (0.02, 0.4, self.tall)
        wall = Body.of("wall", Box(size), (0.61, 0, self.tall / 2), mass=0, color=GRAY)
        return Scene((*super().scene(seed).bodies, wall))


class Forbidden(Walled):
    goals = (*Walled.goals, Untouched(("wall",)))


def plan_to(*points):
    return replace(candidate(0), plan=Waypoints(np.array([ABOVE, *points])))


def rehearsed(task, given):
    return rehearse(condition(task, Faulty(), settings=SETTINGS), given)


def test_a_motion_is_read_at_waypoints_and_instants():
    there = [0.55, 0.1, 0.45, 0, 0, 0]
    rehearsal = rehearsed(Slide(), plan_to(there))
    sample = rehearsal.find_sample(2, None)
    np.testing.assert_allclose(
        rehearsal.place_hand(sample).position, there[:3], atol=1e-3
    )
    assert sample == rehearsal.find_sample(None, None)
    assert rehearsal.find_sample(None, 0.0) == 0
    assert rehearsal.find_waypoint(rehearsal.recording.times[sample]) == 2
    with pytest.raises(DesignError, match="no waypoint 3; the plan has 2"):
        rehearsal.find_sample(3, None)

    (middle,) = rehearsal.place_tool(sample).values()
    (placed,) = rehearsal.planned.job.tool.components
    np.testing.assert_allclose(
        middle, np.add(there[:3], placed.pose.position), atol=1e-3
    )


def test_a_gap_is_measured_at_an_instant():
    rehearsal = rehearsed(Slide(), plan_to([0.5, 0.0, 0.45, 0, 0, 0]))
    gaps = [rehearsal.measure_gaps(rehearsal.find_sample(n, None)) for n in (1, 2)]
    (near, part), (far, _) = (gap["block"] for gap in gaps)
    assert far - near == pytest.approx(0.05, abs=1e-3)
    assert part in rehearsal.planned.job.tool.placed()


@pytest.mark.parametrize("beside", [0.004, -0.004])
def test_what_is_fixed_is_named_where_the_tool_goes_into_it(beside):
    """The rod's tip passes over the wall's top, or through it."""
    (component,) = candidate(0).tool.components
    tip = 0.4 + component.pose.position[2] - component.shape.size[2] / 2

    class Tall(Walled):
        tall = tip - beside

    over = plan_to([0.7, 0.0, 0.4, 0, 0, 0])
    met = rehearsed(Tall(), over).find_meetings()
    assert bool(met) == (beside < 0)
    problems = find_problems(condition(Tall(), Faulty(), settings=SETTINGS), over)
    assert any("into the fixed wall" in problem for problem in problems) == bool(met)


@pytest.mark.parametrize("gap", [0.005, 0.0])
def test_what_must_not_be_touched_is_named_where_it_is(gap):
    half = candidate(0).tool.components[0].shape.size[0] / 2
    to_wall = [0.6 - half - gap, 0.0, 0.4, 0, 0, 0]
    met = rehearsed(Forbidden(), plan_to(to_wall)).find_meetings()
    assert [meeting.text.split()[-2:] for meeting in met] == (
        [] if gap else [["touched", "wall"]]
    )
    assert rehearsed(Walled(), plan_to(to_wall)).find_meetings() == []
