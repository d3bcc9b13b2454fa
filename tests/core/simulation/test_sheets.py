"""Thin, square-edged sheets that are swung at what lies flat, in real engines: the thing ends on top of them."""

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from tests.support.engines import simulator
from tests.support.playing import evaluate_batch

pytestmark = pytest.mark.slow

POST = 0.2
# The sheet's length and width, which end of the post bears it, and the plan.
SWINGS = {
    "ElevatePlate": (
        (0.4067, 0.0869),
        -1,
        [
            [0.4011, -0.2189, 0.45, -0.007, 0.0034, -0.4995],
            [0.4011, -0.2189, 0.201, -0.007, 0.0034, -0.4995],
            [0.4529, 0.0604, 0.201, -0.007, 0.0034, 0.1326],
            [0.4562, 0.0258, 0.6009, -0.007, 0.0034, 0.0566],
        ],
    ),
    "BringCube": (
        (0.455, 0.1204),
        -1,
        [
            [0.5673, -0.3174, 0.45, -0.0048, 0.0042, -0.5101],
            [0.5673, -0.3174, 0.2004, -0.0048, 0.0042, -0.5101],
            [0.6427, 0.0971, 0.2004, -0.0048, 0.0042, 0.15],
            [0.6427, 0.0971, 0.2057, -0.0048, 0.0042, 0.15],
            [0.2439, 0.0207, 0.2031, -0.0048, 0.0042, 0.0848],
        ],
    ),
}
# What earned 0.84 and more as long as it was not found; in the other engines the swing pushes the thing aside.
PAID = [
    *(("ElevatePlate", "mujoco", mm) for mm in (0.5, 1)),
    ("ElevatePlate", "pybullet", 0.5),
    *(("BringCube", "mujoco", mm) for mm in (0.5, 1, 2)),
    *(("BringCube", "sapien", mm) for mm in (0.5, 1, 2)),
    *(("BringCube", "pybullet", mm) for mm in (0.5, 1)),
]
UNPAID = [("ElevatePlate", "mujoco", 2)]


def swing(name, engine, mm):
    (length, width), end, plan = SWINGS[name]
    sheet = Pose.xyz_rpy((0.01 + length / 2, 0.0, end * POST + mm / 2000))
    post = Pose.xyz_rpy((0.0, 0.0, end * POST / 2))
    tool = Tool(
        (
            Component("post", "tool_mount", post, Box((0.03, 0.03, POST)), mass=0.1),
            Component(
                "sheet", "tool_mount", sheet, Box((length, width, mm / 1000)), mass=0.1
            ),
        )
    )
    task = installed().create("task", name)
    settings = RolloutSettings(penetration="warn")
    (evaluation,) = evaluate_batch(
        task, simulator(engine), [Candidate(tool, np.array(plan))], settings=settings
    )
    return evaluation


@pytest.mark.parametrize(("name", "engine", "mm"), [*PAID, *UNPAID])
def test_a_sheet_that_cuts_through_is_found(name, engine, mm):
    evaluation = swing(name, engine, mm)
    assert evaluation.status == "ok"
    found = any(
        warning.startswith("'sheet' cut into") for warning in evaluation.warnings
    )
    # Where nothing is paid, the swing may push the thing aside instead: rounding, and so the processor, decides.
    assert found or ((name, engine, mm) in UNPAID and evaluation.reward < 0.3)
    assert evaluation.reward > (0.84 if (name, engine, mm) in PAID else -1.0)
