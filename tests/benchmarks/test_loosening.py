import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules, check_tool
from core.errors import UserError
from core.geometry import Box, Cylinder, Pose
from core.plugins import installed
from tests.benchmarks import measuring
from tests.benchmarks.loosening import loosened


@pytest.mark.parametrize("seed", range(3))
def test_rods_and_a_joint(seed):
    task = installed().create("task", "BringCube")
    spawn = SpawnRules(task, 0)
    solution = read_designs(
        load_designs(measuring.SOLUTIONS / "BringCube.json"), installed().create("tool", "urdf"), spawn
    )
    (candidate,) = loosened(tuple(solution[:1]), spawn, seed)
    check_tool(candidate.tool, task.robot)
    assert any(isinstance(component.shape, Cylinder) for component in candidate.tool.components)
    assert len(candidate.tool.bearers) == 1
    placed, before = candidate.tool.placed(), solution[0].tool.placed()
    for component in solution[0].tool.components:
        np.testing.assert_allclose(placed[component.name][1].position, before[component.name][1].position, atol=1e-9)


def test_what_can_not_be_made_loose():
    spawn = SpawnRules(installed().create("task", "BringCube"), 0)
    stick = Component("stick", "tool_mount", Pose(np.array([0.0, 0.0, -0.05])), Box((0.02, 0.02, 0.1)))
    with pytest.raises(UserError, match="no design may be made loose"):
        loosened((Candidate(Tool((stick,)), np.zeros((1, 6))),), spawn, 0)
