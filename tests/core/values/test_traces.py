"""Traces made by hand; those of engines are in `tests/core/simulation/test_rollout.py`."""

import numpy as np
import pytest

from core.scene import Body, Box, Scene, State, Trace

RED = (1, 0, 0, 1)
SCENE = Scene(
    tuple(
        Body.of(name, Box((0.1, 0.1, 0.1)), (x, 0, 0), mass=mass, color=RED)
        for name, x, mass in (("table", 0, 0), ("tray", 1, 1), ("cube", 2, 1))
    )
)


def flags(*at, count=4):
    found = np.zeros(count, dtype=bool)
    found[list(at)] = True
    return found


ONE = Trace.of(
    *[SCENE.state()] * 4,
    touching={
        ("tool", "blade", "cube"): flags(1, 2),
        ("arm", "link", "tray"): flags(2, 3),
        ("body", "tray", "table"): flags(0, 1),
        ("body", "tray", "cube"): flags(0, 3),
    },
    forces={
        ("tool", "cube"): np.array([0, 2.0, 5.0, 0]),
        ("tray", "cube"): np.array([9.0, 0, 0, 1.0]),
    },
)
NEVER = Trace.of(*[SCENE.state()] * 4, touching={}, forces={})


def both():
    """Two worlds: the one, and one in which nothing touches."""
    empty = {key: np.zeros(4, dtype=bool) for key in ONE.touching}
    still = {key: np.zeros(4) for key in ONE.forces}
    return Trace(
        ONE.times,
        State.stack([ONE.states, NEVER.states]),
        {key: np.stack([ONE.touching[key], empty[key]]) for key in empty},
        {key: np.stack([ONE.forces[key], still[key]]) for key in still},
    )


@pytest.mark.parametrize(
    ("body", "by", "instants"),
    [
        ("cube", None, [0, 1, 2, 3]),
        ("cube", "robot", [1, 2]),
        ("cube", "tool", [1, 2]),
        ("cube", "blade", [1, 2]),
        ("cube", "tray", [0, 3]),
        ("tray", "robot", [2, 3]),
        ("tray", "tool", []),
        ("tray", "link", [2, 3]),
        ("tray", "cube", [0, 3]),
        ("table", "tray", [0, 1]),
        ("table", "robot", []),
    ],
)
def test_what_touches_a_body_and_when(body, by, instants):
    assert np.flatnonzero(ONE.contact(body, by)).tolist() == instants
    assert ONE.touched(body, by) == bool(instants)
    assert ONE.touching_at_end(body, by) == (3 in instants)
    assert ONE.first_s(body, by) == (instants[0] / 25 if instants else np.inf)
    assert not NEVER.touched(body, by)
    many = both()
    assert many.touched(body, by).tolist() == [bool(instants), False]
    assert many.first_s(body, by).shape == many.force_n(body, by).shape == (2,)


def test_a_component_of_the_name_arm_is_no_link_of_it():
    trace = Trace.of(
        *[SCENE.state()] * 4, touching={("tool", "arm", "cube"): flags(1, 2)}
    )
    assert not trace.touched("cube", "arm")
    assert trace.touched("cube", "tool")


def test_what_the_robot_passes_on_through_bodies_presses_too():
    """As much as the weakest contact of a chain bears, without the weight that rests from the start."""
    chain = {
        ("tool", "cube"): [0, 20, 20, 0],
        ("tray", "cube"): [0, 12, 12, 9],
        ("table", "tray"): [3, 3, 18, 12],
    }
    trace = Trace.of(
        *[SCENE.state()] * 4,
        forces={pair: np.array(force, float) for pair, force in chain.items()},
    )
    assert [trace.force_n("table", by) for by in ("robot", "tool", "cube", None)] == [
        12,
        12,
        0,
        18,
    ]
    assert trace.forces_n("table", "robot").tolist() == [0, 0, 12, 0]
    assert trace.force_n("tray", "robot") == 12
    assert trace.force_n("cube", "robot") == 20


def test_the_largest_force_of_one_thing():
    assert (
        ONE.force_n("cube", "robot")
        == ONE.force_n("cube", "tool")
        == ONE.force_n("cube", "blade")
        == 5
    )
    assert ONE.force_n("cube", "other component") == 0
    assert (
        ONE.force_n("cube") == ONE.force_n("tray") == ONE.force_n("cube", "tray") == 9
    )
    assert ONE.force_n("tray", "robot") == 0
    assert both().force_n("cube").tolist() == [9, 0]
    with pytest.raises(ValueError, match="no forces"):
        Trace.of(SCENE.state()).force_n("cube")


def test_held_is_by_the_robot_and_off_all_that_is_fixed():
    # At last by the tray, which the link carries.
    assert np.flatnonzero(ONE.support.held("cube")).tolist() == [1, 2, 3]
    assert np.flatnonzero(ONE.support.held("tray")).tolist() == [2, 3]
    assert both().support.held("cube").tolist() == [
        [False, True, True, True],
        [False] * 4,
    ]


def test_a_body_that_is_not_there():
    for ask in (ONE.touched, ONE.force_n, ONE.support.held):
        with pytest.raises(KeyError, match=r"no body 'dog' .*; there are: tray, cube"):
            ask("dog")


def test_a_component_that_is_called_as_a_body_is_not_the_body():
    pressed = np.array([0, 2.0, 5.0, 0])
    alike = Trace.of(
        *[SCENE.state()] * 4,
        touching={("tool", "table", "cube"): flags(1, 2)},
        forces={("tool", "cube"): pressed},
    )
    assert not alike.touched("cube", by="table")
    assert alike.force_n("cube", by="table") == 0
    assert np.flatnonzero(alike.contact("cube", by="tool")).tolist() == [1, 2]
    assert np.flatnonzero(alike.support.held("cube")).tolist() == [1, 2]
