"""Goals: what they may say, what they mean in a layout, and the rewards that follow from them."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.errors import UsageError
from core.geometry import Pose
from core.goals import (
    Away,
    Facing,
    JointAt,
    Kept,
    Measure,
    Placed,
    Reach,
    Span,
    Turned,
    Untouched,
    goals_margins,
    goals_reward,
    goals_shares,
)
from core.scene import (
    State,
    Trace,
)
from core.task import Task, margins_of
from tests.support.goal_scenes import CUBE, SCENE, START


def at(state=START, **positions):
    moved = state.positions.copy()
    for name, position in positions.items():
        moved[..., state.names.index(name), :] = position
    return replace(state, positions=moved)


def turned(name, **carried):
    """The start state with a joint at another position."""
    placed = SCENE.placed_joints[name]
    there = placed.carry(
        np.asarray(carried["to"]), np.zeros(()), START.placement(placed.joint.parent)
    )
    number = START.names.index(placed.joint.body)
    positions, quaternions = START.positions.copy(), START.quaternions.copy()
    positions[number], quaternions[number] = there.position, there.quaternion
    return replace(START, positions=positions, quaternions=quaternions)


def tipped(angle, name="cube"):
    """The start state with a body turned about x, rad."""
    quaternions = START.quaternions.copy()
    number = START.names.index(name)
    quaternions[number] = (np.cos(angle / 2), np.sin(angle / 2), 0, 0)
    return replace(START, quaternions=quaternions)


def reward(goals, end, trace=None, every=False, start=START):
    task = SimpleNamespace(
        goals=goals if isinstance(goals, tuple) else (goals,), every=every
    )
    return np.round(goals_reward(task, start, end, trace), 9)


def shifted(share, name="cube", by=(0.2, 0, 0)):
    return at(**{name: START.position(name) + share * np.array(by)})


THERE = Placed(CUBE, place=(0.7, None, None))
"""The goal of `shifted`: the cube is 0.2 m farther along x."""


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        (lambda: Placed(bodies=CUBE, place=(0, 0, 0), tolerance=-1), "tolerances"),
        (
            lambda: Turned(bodies=CUBE, axis=(0, 0, 1), tolerance_deg=-1),
            "tolerances and ways",
        ),
        (lambda: Away(bodies=CUBE, away=-0.1), "tolerances and ways must be 0 or more"),
        (lambda: Reach(bodies=CUBE, rest=True, weight=0), "weight must be above 0"),
        (lambda: Reach(bodies=CUBE, rest=True, weight=np.inf), "weight must be above"),
        (lambda: Reach(bodies=CUBE, rest=True, by_s=0), "by_s must be above 0"),
        (
            lambda: Reach(bodies=CUBE),
            "must say what is to be reached, or rest, held, released or stands_on",
        ),
        (
            lambda: Away(bodies=CUBE, away=0.1, also=(Reach(bodies=CUBE, held=True),)),
            "rest, held, released and stands_on stand in the goal itself",
        ),
        (lambda: Kept(keep=CUBE, kept_m=0), "kept_m must be above 0"),
        (
            lambda: Untouched(untouched=CUBE, max_force_n=-1),
            "max_force_n must be 0 or more",
        ),
    ],
)
def test_a_goal_that_makes_no_sense_is_refused(make, wrong):
    with pytest.raises(ValueError, match=f"a goal's .*{wrong}"):
        make()


def test_a_goal_to_reach_needs_bodies():
    with pytest.raises(UsageError, match="needs bodies"):
        Away(bodies=(), away=0.1).check_names(SCENE)


def test_an_axis_needs_a_length():
    with pytest.raises(ValueError, match="need a length"):
        Turned(("cube",), axis=(0, 0, 0))


@given(st.floats(0, 1), st.floats(0, 1))
def test_progress_rises_from_the_start_to_the_goal(one, other):
    goal = replace(THERE, tolerance=0.02)
    first, second = (
        reward(goal, shifted(min(one, other))),
        reward(goal, shifted(max(one, other))),
    )
    assert 0 <= first <= second <= 1
    assert reward(goal, START) == 0
    assert reward(goal, shifted(0.9)) == pytest.approx(1)
    assert reward(goal, shifted(0.45)) == pytest.approx(0.5)


def test_rewards_are_of_one_world_or_of_many():
    goals = (
        THERE,
        JointAt(joint="drawer", to=0.2),
        Turned(("other",), axis=(1, 0, 0)),
    )
    ends = [START, shifted(0.5), turned("drawer", to=0.15), at(cube=(9, 9, 9))]
    for every in (False, True):
        each = [float(reward(goals, end, every=every)) for end in ends]
        many = reward(
            goals, State.stack(ends), every=every, start=State.stack([START] * 4)
        )
        assert many == pytest.approx(each)


def test_a_place_is_in_the_frame_of_a_mark():
    goal = Placed(("cube",), place=(0, 0, 0.05), at="mark", tolerance=0.001)
    assert reward(goal, at(cube=(0.5, 0.1, 0.05))) == 1
    assert goal.place_of("cube", START) == pytest.approx([0.5, 0.1, 0.05])
    free = replace(goal, place=(0, None, 0.05)).place_of("cube", START)
    assert np.isnan(free).tolist() == [False, True, False]


def test_a_new_kind_of_goal_is_one_class():
    @dataclass(frozen=True, kw_only=True)
    class Above(Reach):
        height: float

        def measures(self, body, start):
            return [
                Measure(
                    f"height of {body}",
                    lambda state: state.position(body)[..., 2],
                    self.height,
                    slip=0.1,
                    unit="m",
                    at_least=True,
                )
            ]

    goal = Above(("cube",), height=0.25, rest=True)
    half = shifted(0.5, by=(0, 0, 0.2))
    assert reward(goal, half) == pytest.approx(0.5)
    assert margins(goal, end=shifted(1, by=(0, 0, 0.25)))["height of cube"] == (
        0.3,
        0.25,
        0.5,
    )
    goal.check_names(SCENE)
    with pytest.raises(UsageError, match="no body that can move 'cub'"):
        Above(("cub",), height=0.25).check_names(SCENE)


def test_a_joint_is_opened_and_a_designer_sees_a_place():
    goal = JointAt(joint="drawer", to=0.2, tolerance=0.01)
    assert reward(goal, turned("drawer", to=0.095)) == pytest.approx(0.5)
    assert reward(goal, turned("drawer", to=0.2)) == 1
    assert goal.subjects(START) == ("box",)
    assert goal.place_of("box", START) == pytest.approx([0.6, 0, 0.1])
    door = JointAt(joint="door", to=np.pi / 2)
    assert door.place_of("leaf", START) == pytest.approx([0.2, 0.2, 0.2])
    assert reward(
        JointAt(joint="door", to=1.0), turned("door", to=0.5)
    ) == pytest.approx(0.5)


def test_an_axis_must_point_somewhere_and_what_was_right_must_stay_so():
    lying = Pose.xyz_rpy((0, 0, 0), (np.pi / 2, 0, 0)).quaternion
    quaternions = START.quaternions.copy()
    quaternions[START.names.index("cube")] = lying
    tipped = replace(START, quaternions=quaternions)
    upright = Turned(("cube",), axis=(0, 0, 1))
    assert reward(upright, tipped) == 0
    assert reward(upright, START, start=tipped) == pytest.approx(1)
    both = replace(THERE, also=(Turned(axis=(0, 0, 2)),))
    there = shifted(1)
    assert reward(both, there) == pytest.approx(1)
    assert reward(both, replace(there, quaternions=quaternions)) == 0


def test_at_rest():
    goal = replace(THERE, rest=True)
    speeds = np.zeros_like(START.linear_velocities)
    speeds[START.names.index("cube")] = (0, 0, 0.04)
    assert reward(goal, shifted(1)) == 1
    assert reward(goal, replace(shifted(1), linear_velocities=speeds)) == pytest.approx(
        0.5
    )


def test_all_goals_count_by_weight_or_one_is_enough():
    one = replace(THERE, weight=3)
    other = Placed(("other",), place=(0.9, None, None))
    assert reward((one, other), shifted(0.5), every=True) == pytest.approx(0.375)
    assert reward((one, other), shifted(0.5)) == pytest.approx(0.5)
    assert reward(replace(one, bodies=("cube", "other"), any=True), shifted(1)) == 1


def test_a_body_to_keep_must_stay():
    goals = (THERE, Kept(("other",)))
    near, far = (
        at(shifted(1), other=START.position("other") + np.array([0, way, 0]))
        for way in (0.06, 0.2)
    )
    for every in (False, True):
        assert reward(goals, shifted(1), every=every) == 1
        assert reward(goals, near, every=every) == pytest.approx(0.5)
        assert reward(goals, far, every=every) == 0


def film(*states, **touching):
    """A trace, and which of its instants each pair, as ``cube_tool_blade``, touches at."""
    flags = np.zeros(len(states), dtype=bool)
    pairs = {}
    for name, at_ in touching.items():
        other, kind, one = name.split("_")
        pairs[kind, one, other] = flags.copy()
        pairs[kind, one, other][list(at_)] = True
    return Trace.of(
        *states, touching=pairs, forces={("tool", "cube"): np.full(len(states), 3.0)}
    )


def test_goals_that_ask_for_the_past_need_a_trace():
    goal = replace(THERE, by_s=1.0)
    assert goal.needs_trace
    assert not replace(goal, by_s=None).needs_trace
    with pytest.raises(ValueError, match="need a trace"):
        reward(goal, START)


@pytest.mark.parametrize(
    ("touching", "held", "released"),
    [
        ({}, 0, 1),
        ({"cube_tool_blade": [0]}, 0, 1),
        ({"cube_tool_blade": [1]}, 1, 0),
        ({"cube_tool_blade": [1], "case_body_cube": [1]}, 0.5, 0),
        ({"other_body_cube": [1]}, 0, 1),
        ({"other_arm_link": [1], "other_body_cube": [1]}, 1, 0),
        # A tray on a fork leans on a wall: what lies on it is carried all the same.
        (
            {
                "other_tool_fork": [1],
                "other_body_cube": [1],
                "case_body_other": [1],
            },
            0,
            0,
        ),
    ],
)
def test_held_is_borne_by_the_robot_alone_and_released_not_at_all(
    touching, held, released
):
    """A body that is still held above its place is not placed."""
    end = shifted(1, by=(0.2, 0, 0.2))
    trace = film(START, end, **touching)
    goal = replace(THERE, released=True)
    assert goal.needs_trace
    assert reward(goal, end, trace) == released
    assert reward(Reach(("cube",), held=True), end, trace) == held


def test_held_and_released_say_the_opposite():
    with pytest.raises(ValueError, match="say the opposite"):
        Reach(("cube",), held=True, released=True)


def test_a_body_is_kept_at_the_end_or_throughout():
    """One that goes away and comes back was in place at the end alone."""
    away = at(shifted(0.5), other=START.position("other") + np.array([0, 0.06, 0]))
    back = film(START, away, shifted(1))
    at_end, throughout = Kept(("other",)), Kept(("other",), throughout=True)
    assert not at_end.needs_trace
    assert throughout.needs_trace
    assert reward((THERE, at_end), shifted(1), back) == 1
    assert reward((THERE, throughout), shifted(1), back) == pytest.approx(0.5)
    assert reward((THERE, throughout), shifted(1), film(START, shifted(1))) == 1
    margins = goals_margins(
        SimpleNamespace(goals=(throughout,), every=False), START, shifted(1), back
    )
    assert [margin.value for margin in margins] == pytest.approx([0.06, 0])


def toppled(degrees):
    half = np.radians(degrees) / 2
    turn = [np.cos(half), np.sin(half), 0, 0]
    quaternions = START.quaternions.copy()
    quaternions[START.names.index("other")] = turn
    return replace(shifted(1), quaternions=quaternions)


@pytest.mark.parametrize(
    ("degrees", "share"), [(0, 1), (9, 1), (30, 0.5), (51, 0), (90, 0)]
)
def test_what_is_toppled_where_it_stands_is_not_kept(degrees, share):
    kept = Kept(("other",))
    assert reward((THERE, kept), toppled(degrees), None) == pytest.approx(share)

    ball = replace(kept, balls=("other",))
    assert reward((THERE, ball), toppled(degrees), None) == 1


@pytest.mark.parametrize(
    ("speeds", "share"),
    [
        ([0.0] * 12, 1),
        # Too fast 0.28 s before the end, and 0.36 s before it.
        ([0.0] * 4 + [0.04] + [0.0] * 7, 0.5),
        ([0.0] * 2 + [0.04] + [0.0] * 9, 1),
        # A pendulum at its turning point.
        ([0.2] * 11 + [0.0], 0.1),
    ],
)
def test_rest_holds_for_a_while_before_the_end(speeds, share):
    end = shifted(1)
    number = START.names.index("cube")
    states = []

    for speed in speeds:
        velocities = np.zeros_like(START.linear_velocities)
        velocities[number, 0] = speed
        states.append(replace(end, linear_velocities=velocities))

    goal = replace(THERE, rest=True)
    assert goal.needs_trace
    assert reward(goal, end, film(*states)) == pytest.approx(share)
    assert reward(goal, end, None) == 1


def test_in_time_and_at_some_time():
    goal = replace(THERE, by_s=0.05)
    late = film(START, shifted(0.5), START, shifted(1))
    assert reward(goal, shifted(1), late) == pytest.approx(0.5)
    assert reward(goal, shifted(1), film(START, shifted(1), shifted(1))) == 1
    assert reward(goal, START, film(START, shifted(1), START)) == 0
    assert reward(replace(goal, ever=True), START, film(START, shifted(1), START)) == 1


def test_one_after_another():
    opened, put = turned("drawer", to=0.2), shifted(1)
    goals = (
        JointAt(joint="drawer", to=0.2, ever=True, name="open"),
        replace(THERE, after="open"),
    )
    assert reward(goals, put, film(START, opened, put), every=True) == 1
    assert reward(goals, put, film(START, put, put), every=True) == 0
    both = at(opened, cube=put.position("cube"))
    # In the wrong order.
    assert reward(goals, both, film(START, put, both, both), every=True) == 0.5
    closed = (goals[0], JointAt(joint="drawer", to=0.0, after=0))
    assert reward(closed, START, film(START, opened, START), every=True) == 1
    assert reward(closed, START, film(START, START), every=True) == 0
    with pytest.raises(
        ValueError, match="comes after 'shut', which is no goal; there are: open, 1"
    ):
        reward((goals[0], replace(goals[1], after="shut")), put, film(START, put))


@pytest.mark.parametrize("every", [False, True])
def test_what_must_not_be_touched(every):
    goal = Placed(("other",), place=(0.9, None, None))
    end = shifted(1, "other")
    touched = film(START, START, cube_tool_blade=[0])
    assert reward((goal, Untouched(("cube",))), end, film(START, START), every) == 1
    for force, wanted in ((0, 0), (4, 1), (2, 0)):
        untouched = Untouched(("cube",), max_force_n=force)
        assert reward((goal, untouched), end, touched, every) == wanted


def margins(*goals, end, trace=None, every=True):
    found = goals_margins(SimpleNamespace(goals=goals, every=every), START, end, trace)
    return {
        margin.name: (round(margin.value, 6), margin.limit, round(margin.margin, 6))
        for margin in found
    }


def test_margins_say_how_far_the_end_is_from_the_limits_of_goals():
    near = Placed(bodies=("cube",), place=(0.5, -0.3, None), tolerance=0.04)
    end = at(cube=(0.53, -0.3, 0.05), other=(0.7, -0.31, 0.05))
    assert margins(near, Kept(("other",)), end=end) == {
        "other moved": (0.01, 0.02, 0.5),
        "other turned": (0.0, 10.0, 1.0),
        "cube off its place": (0.03, 0.04, 0.25),
    }
    assert margins(
        JointAt(joint="drawer", to=0.2, tolerance=0.02), end=turned("drawer", to=0.19)
    ) == {"drawer off its position": (0.01, 0.02, 0.5)}
    assert margins(
        Away(bodies=("cube",), away=0.1), end=at(cube=(0.65, -0.3, 0.05))
    ) == {"way of cube": (0.15, 0.1, 0.5)}
    upright = Turned(bodies=("cube",), axis=(0, 0, 1), tolerance_deg=10)
    assert margins(upright, end=START)["angle of cube"][2] == 1
    # No tolerance, no room: it is met, or not.
    exact = Placed(bodies=("cube",), place=(0.6, 0, 0))
    assert [*margins(exact, end=START).values()] == [(0.0, 1.0, -1.0)]
    assert margins(exact, end=at(cube=(0.6, 0, 0))) == {}


def test_margins_of_what_must_not_be_touched_or_pressed():
    forces = {("tool", "case"): np.array([0.0, 5.0])}
    gaps = {"other": np.array(0.005)}
    trace = Trace.of(START, START, forces=forces, clearances=gaps)
    press, avoid = (
        Untouched(("case",), max_force_n=20.0),
        Untouched(("other", "cube")),
    )
    assert margins(press, avoid, end=START, trace=trace) == {
        "force on case": (5.0, 20.0, 0.75),
        "clearance to other": (0.005, 0.0, 0.25),
    }
    touched = replace(
        trace, touching={("tool", "blade", "other"): np.array([False, True])}
    )
    assert margins(avoid, end=START, trace=touched) == {
        "clearance to other": (0.0, 0.0, -1.0)
    }


@pytest.mark.parametrize(
    ("reward", "success", "margin"),
    [(0.975, 0.95, 0.5), (0.95, 0.95, 0.0), (0.9, 0.95, -1.0)],
)
def test_without_a_limit_the_margin_is_what_the_reward_exceeds_success_by(
    reward, success, margin
):
    (found,) = margins_of(Untold(success), START, START, None, reward)
    assert (found.name, found.value, found.limit) == ("reward", reward, success)
    assert found.margin == pytest.approx(margin)
    # No room above success.
    assert margins_of(Untold(1.0), START, START, None, reward) == ()


class Untold(Task):
    """A task that says neither goals nor margins."""

    goals = ()

    def __init__(self, success):
        self.success_reward = success

    def scene(self, seed):
        return SCENE

    def reward(self, start, end):
        return end.position("cube")[..., 0]


def test_each_of_several_goals_that_count_has_a_share():
    goals = (
        JointAt(joint="drawer", to=0.2),
        Away(("cube",), away=0.2, name="cube away"),
        Kept(("other",)),
    )
    end = shifted(0.25)
    task = SimpleNamespace(goals=goals, every=True)
    shares = dict(goals_shares(task, START, end, None))
    assert shares == pytest.approx({"joint drawer (goal 0)": 0.0, "cube away": 0.25})
    assert np.mean(list(shares.values())) == pytest.approx(
        goals_reward(task, START, end)
    )
    assert (
        goals_shares(SimpleNamespace(goals=goals, every=False), START, end, None) == ()
    )
    assert (
        goals_shares(SimpleNamespace(goals=goals[1:], every=True), START, end, None)
        == ()
    )


def test_a_coordinate_may_be_a_span_and_count_from_the_start():
    """Each coordinate counts on its own; with numbers alone it is the distance."""
    far = Placed(CUBE, place=(Span(low=0.7), None, None))
    assert reward(far, shifted(0.5)) == 0.5
    assert reward(far, shifted(3.0)) == 1
    assert reward(THERE, shifted(3.0)) == 0
    moved = Placed(CUBE, place=(0.2, None, None), relative=True)
    assert [reward(moved, shifted(share)) for share in (0, 0.5, 1)] == [0, 0.5, 1]
    assert moved.place_of("cube", START) == pytest.approx(
        (0.7, np.nan, np.nan), nan_ok=True
    )

    slid = JointAt(joint="drawer", to=Span(low=0.1), relative=True)
    assert slid.aim(START) == pytest.approx(0.11)
    assert reward(slid, turned("drawer", to=0.05)) == 0.5
    lying = Turned(CUBE, angle_deg=Span(low=60))
    assert reward(lying, START) == 0
    assert reward(lying, tipped(np.pi / 2)) == 1


def test_places_are_one_for_each_body_and_numbers():
    both = ("cube", "other")
    ends = ((0.7, None, None), (0.9, None, None))
    goal = Placed(both, places=ends)
    assert reward(goal, shifted(1)) == 0.5
    for wrong, why in (
        ({"places": ends[:1]}, "one for each of its 2 bodies"),
        ({}, "a goal needs a place, or places"),
        ({"places": ends, "relative": True}, "don't count from the start"),
        ({"places": (ends[0], (Span(low=1), None, None))}, "have numbers"),
    ):
        with pytest.raises(ValueError, match=why):
            Placed(both, **wrong)


def yawed(angle, state=START, name="cube"):
    """A state with a body turned about the vertical, rad."""
    quaternions = state.quaternions.copy()
    quaternions[state.names.index(name)] = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
    return replace(state, quaternions=quaternions)


def test_a_body_faces_another_wherever_both_end():
    """The other cube is straight ahead of the cube's x axis; then it is carried to its left."""
    aside = at(other=(0.5, 0.3, 0.05))
    goal = Facing(CUBE, facing="other", tolerance_deg=0)
    assert reward(goal, START) == 1
    assert reward(goal, aside) == 0
    assert reward(goal, yawed(np.pi / 2, aside)) == 1
    for angle, earned in ((0, 0), (np.pi / 4, 0.5), (np.pi / 2, 1), (-np.pi / 2, 0)):
        assert reward(goal, yawed(angle, aside), start=aside) == earned

    assert reward(replace(goal, axis=(-2, 0, 0)), yawed(np.pi)) == 1
    found = margins(Facing(CUBE, facing="other"), end=yawed(np.pi / 36))
    assert found["angle of cube to other"] == (0.087266, np.radians(10), 0.5)
    # Where both are at one place, nothing is ahead.
    assert reward(goal, at(other=START.position("cube"))) == 0


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"facing": "mark", "axis": (0, 0, 0)}, "axis needs a length"),
        ({"facing": "cube"}, "can't face itself"),
        ({"facing": "mark", "tolerance_deg": -1}, "must be 0 or more"),
    ],
)
def test_what_nothing_can_face_is_refused(given, why):
    with pytest.raises(ValueError, match=why):
        Facing(CUBE, **given)


def test_what_is_to_be_faced_is_in_the_scene():
    with pytest.raises(UsageError, match=r"no body 'makr'.*mark"):
        Facing(CUBE, facing="makr").check_names(SCENE)
