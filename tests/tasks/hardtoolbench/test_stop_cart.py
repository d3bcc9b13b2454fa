from dataclasses import replace

import numpy as np
import pytest

from core.scene import Trace
from tasks.hardtoolbench.stop_cart import END, SPEED, TRAY, TRAY_FLOOR, StopCart

TASK = StopCart(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.complete(SCENE.state())
START = replace(
    START, linear_velocities=np.array([body.velocity for body in SCENE.free])
)
IN_TRAY = (sum(TRAY) / 2, 0.0, TRAY_FLOOR + 0.012)
IN_BIN = (0.01, END - 0.1, 0.022)


def earned(touched=(), speed=0.0, slowed=1.0, **places):
    """The reward where carts end at places in the track's frame, the blue one at a speed, red ones as they began."""
    positions = START.positions.copy()
    velocities = slowed * START.linear_velocities
    for name, place in places.items():
        positions[START.names.index(name)] = SCENE["track"].pose.apply(place)
    velocities[START.names.index("cart")] = (0.0, speed, 0.0)
    end = replace(START, positions=positions, linear_velocities=velocities)
    touching = {("tool", "cup", name): np.array([True, False]) for name in touched}
    return float(TASK.reward(START, end, Trace.of(START, end, touching=touching)))


@pytest.mark.parametrize("seed", range(5))
def test_all_carts_have_one_speed_along_the_track(seed):
    scene = TASK.scene(seed)
    along = [
        scene["track"].pose.rotation.inv().apply(body.velocity) for body in scene.free
    ]
    assert np.ptp(along, axis=0) == pytest.approx(0.0, abs=1e-9)
    assert along[0] == pytest.approx([0.0, -SPEED, 0.0], abs=0.08 * SPEED + 1e-9)


def test_only_at_rest_in_the_tray_all_is_earned():
    assert earned(cart=IN_TRAY) == 1.0
    assert earned(cart=IN_TRAY, speed=0.1) == 0.5
    on_the_way = [
        earned(cart=(across, 0.0, 0.072)) for across in (0.0, 0.03, 0.04, 0.05)
    ]
    assert on_the_way[0] == 0.0
    assert on_the_way == sorted(on_the_way)
    assert on_the_way[-1] < 0.5


def test_carts_that_go_on_to_the_bin_or_come_off_on_this_side_earn_nothing():
    assert earned(cart=IN_BIN, red_before=IN_BIN) == 0.0
    assert earned(cart=(-0.1, 0.0, 0.072)) == 0.0


def test_a_red_cart_touched_or_off_the_track_costs_all_that_was_earned():
    assert earned(cart=IN_TRAY, touched=["cart"]) == 1.0
    assert earned(cart=IN_TRAY, touched=["red_before"]) == 0.0
    assert earned(cart=IN_TRAY, red_behind=IN_TRAY) == 0.0


@pytest.mark.parametrize("slowed", [0.0, 0.5, -1.0])
def test_a_red_cart_that_the_blue_one_stopped_or_sent_back_was_not_let_pass(slowed):
    assert earned(cart=IN_TRAY, slowed=slowed) == 0.0
    assert (
        earned(cart=IN_TRAY, slowed=slowed, red_before=IN_BIN, red_behind=IN_BIN) == 1.0
    )
