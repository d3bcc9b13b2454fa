import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import (
    GRIPPER_MOUNTS,
    RIGID_MOUNT,
    Component,
    DesignError,
    Tool,
)
from core.geometry import Box, Pose
from core.trial import best_first
from plugins.conformance.evaluations import tried_once
from tests.support.evaluations import candidate, ok

LEFT, RIGHT = GRIPPER_MOUNTS


def box(name, parent=RIGID_MOUNT, at=(0, 0, 0), rpy=(0, 0, 0), mass=0.005):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box((0.1, 0.1, 0.1)), mass)


# --- tools ------------------------------------------------------------------------------------------------------


def test_placed_follows_the_chain_of_parents():
    a, b, c = (
        box("a", at=(0.1, 0, 0), rpy=(0, 0, 1)),
        box("b", "a", (0, 0.2, 0), (0.5, 0, 0)),
        box("c", "b", (0, 0, 0.3)),
    )
    placed = Tool((a, b, c)).placed()
    assert list(placed) == ["a", "b", "c"]
    assert {mount for mount, _ in placed.values()} == {RIGID_MOUNT}
    np.testing.assert_allclose(
        placed["c"][1].matrix, a.pose.matrix @ b.pose.matrix @ c.pose.matrix, atol=1e-12
    )


@pytest.mark.parametrize(
    ("components", "gripper", "reason"),
    [
        ([box("a"), box("a")], False, "two parts of the tool are named 'a'"),
        ([box(RIGID_MOUNT)], False, "two parts of the tool are named 'tool_mount'"),
        (
            [box("a", "b"), box("b")],
            False,
            "'a' hangs from 'b', which is neither a component before it",
        ),
        ([box("a", "a")], False, "'a' hangs from 'a'"),
        (
            [box("a", "panda_link8")],
            False,
            r"'a' hangs from 'panda_link8'.*the mount \(tool_mount\)",
        ),
        ([box("a", LEFT)], False, r"'a' hangs from 'left_finger'.*\(tool_mount\)"),
        (
            [box("a")],
            True,
            r"'a' hangs from 'tool_mount'.*\(left_finger or right_finger\)",
        ),
    ],
)
def test_what_is_no_tool(components, gripper, reason):
    with pytest.raises(DesignError, match=reason):
        Tool(tuple(components), gripper)


# --- candidates -------------------------------------------------------------------------------------------------


def test_ids_tell_generation_agent_strategy_and_plan():
    assert candidate(0, 3, 1, 7).id == "g0-a3-s1-p7"
    assert candidate(0, 3, 1, 7).key == (0, 3, 1, 7)


keys = st.tuples(*[st.integers(0, 200)] * 4)


def test_best_first_by_reward_then_distance_then_key_where_there_are_no_ties():
    order = [
        ok(0.9, 3.0, (1, 0, 0, 0)),
        ok(0.5, 0.1, (2, 0, 0, 0)),
        ok(0.5, 0.2, (0, 1, 9, 9)),
        ok(0.5, 0.2, (0, 2, 0, 0)),
        ok(0.5, 0.2, (0, 10, 0, 0)),  # keys are numbers, not texts
        ok(0.5, math.nan, (0, 0, 0, 0)),
        ok(0.0, 0.0, (0, 0, 0, 1)),
    ]
    for seed in range(20):
        shuffled = [
            order[i] for i in np.random.default_rng(seed).permutation(len(order))
        ]
        assert best_first(shuffled, tie=0.0) == order


def test_what_was_not_tried_is_not_among_the_best():
    rejected = tried_once(candidate(0, 0, 0, 0), "rejected", reason="a rule")
    failed = tried_once(candidate(0, 0, 0, 1), "failed", reward=1.0, reason="it broke")
    good = ok(0.1, 1.0, (0, 0, 0, 2))
    assert best_first([rejected, failed, good]) == [good]
    assert best_first([rejected]) == []


rewards = st.floats(0, 1)
distances = st.one_of(st.just(math.nan), st.floats(0, 10))


@given(
    st.lists(st.tuples(rewards, distances, keys), unique_by=lambda e: e[2], max_size=8),
    st.randoms(),
    st.sampled_from([0.0, 0.005, 0.3]),
)
def test_the_order_does_not_depend_on_arrival(entries, random, tie):
    evaluations = [ok(*entry) for entry in entries]
    shuffled = random.sample(evaluations, len(evaluations))
    found = best_first(shuffled, tie)
    assert found == best_first(evaluations, tie)
    while found:
        highest = max(e.reward for e in found)
        equal = [e for e in found if highest - e.reward <= tie]
        assert found[: len(equal)] == equal  # they go first...
        lengths = [
            math.inf if math.isnan(e.distance_m) else e.distance_m for e in equal
        ]
        # ...the shorter ones before the longer ones...
        assert lengths == sorted(lengths)
        found = found[len(equal) :]  # ...and the same holds for the rest


def test_rewards_within_the_tie_of_the_best_count_as_equal():
    best, shorter, worse = (
        ok(0.9990, 1.0),
        ok(0.9941, 0.5, (0, 0, 0, 1)),
        ok(0.9939, 0.1, (0, 0, 0, 2)),
    )
    assert best_first([best, shorter, worse]) == [shorter, best, worse]
    assert best_first([best, shorter, worse], tie=0.006) == [worse, shorter, best]
    assert best_first([best, shorter, worse], tie=0.0) == [best, shorter, worse]
    assert best_first([worse, shorter]) == [worse, shorter]  # the best is another one


def test_of_equal_distances_the_higher_reward_goes_first_and_none_is_the_longest():
    figures = [(0.5, math.nan), (0.501, 1.0), (0.502, 1.0), (0.503, math.nan)]
    found = [ok(*figure, (0, 0, 0, n)) for n, figure in enumerate(figures)]
    assert best_first(found) == [found[2], found[1], found[3], found[0]]
