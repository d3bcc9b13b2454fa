from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.scene import Trace
from core.simulation.attempt import prepare
from core.solids.contacts import find_contacts, make_trace
from tasks.hardtoolbench.sweep_cards import BY_S, CARDS, PRESS_N, SweepCards
from tests.support.engines import every_simulator, simulator

TASK = SweepCards(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.complete(SCENE.state())
IN_TRAY = SCENE["tray"].pose.apply([0.0, 0.1, 0.012])


def ended(cards, touched=(), press=0.0, seconds=5.0, vase=0.0, gap=0.02):
    """The end where some cards are in the tray from an instant on, and the vase has moved by some metres."""
    positions = START.positions.copy()
    for name in cards:
        positions[START.names.index(name)] = IN_TRAY
    positions[START.names.index("vase"), 0] += vase
    end = replace(START, positions=positions)
    touching = {("tool", "blade", name): np.array([True, False]) for name in touched}
    forces = {("tool", "board"): np.array([press, 0.0])}
    trace = Trace.of(
        START, end, touching=touching, forces=forces, clearances={"vase": np.array(gap)}
    )
    return end, replace(trace, times=np.array([0.0, seconds]))


def earned(cards, **others):
    """The reward of such an end."""
    return float(TASK.reward(START, *ended(cards, **others)))


@pytest.mark.parametrize("count", [0, 1, 6, len(CARDS)])
def test_each_card_in_the_tray_counts_the_same(count):
    assert earned(CARDS[:count]) == pytest.approx(count / len(CARDS))


def test_cards_that_come_too_late_do_not_count():
    assert earned(CARDS, seconds=BY_S + 0.1) == 0.0


def test_the_board_bears_a_touch_but_no_pressure_and_the_vase_not_even_a_touch():
    assert earned(CARDS, touched=["board", *CARDS], press=10.0) == 1.0
    assert earned(CARDS, press=20.0) == 0.0
    assert earned(CARDS, touched=["vase"]) == 0.0
    assert earned(CARDS, vase=0.005) == 1.0
    assert earned(CARDS, vase=0.02) == 0.0


def test_margins_of_the_vase_and_of_the_board():
    margins = TASK.margins(START, *ended(CARDS, press=5.0, vase=0.005, gap=0.01))
    vase, board, moved, turned = (round(margin.margin, 6) for margin in margins)
    assert (vase, board, moved) == (0.5, round(1 - 5.0 / PRESS_N, 6), 0.5)
    assert turned == 1.0
    assert TASK.margins(START, *ended(CARDS, touched=["vase"]))[0].margin == -1


@every_simulator
def test_a_plate_that_presses_the_cards_presses_the_board(engine):
    """It bears on five cards and never touches the board."""
    task = installed().create("task", "SweepCards")
    post = Component(
        "post",
        "tool_mount",
        Pose.xyz_rpy((0.0, 0.0, -0.05)),
        Box((0.02, 0.02, 0.1)),
        0.05,
    )
    plate = Component(
        "plate",
        "post",
        Pose.xyz_rpy((0.0, 0.0, -0.055)),
        Box((0.03, 0.37, 0.01)),
        0.1,
    )
    down = np.array(
        [[0.64, 0.0, height, 0.0, 0.0, 0.0] for height in (0.3, 0.19, 0.166)]
    )
    _, job = prepare(
        task, Candidate(Tool((post, plate)), down), 0, RolloutSettings(), record_hz=25.0
    )
    (outcome,) = simulator(engine).rollout(task, [replace(job, forces=True)])
    scene = task.scene(0)
    contacts = find_contacts(scene, task.robot, job.tool, outcome.recording)
    trace = make_trace(scene, contacts)
    assert not trace.touched("board", "robot")
    assert trace.force_n("board", "robot") > PRESS_N
