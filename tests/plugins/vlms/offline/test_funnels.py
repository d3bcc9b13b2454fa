"""Funnels that the embedded designer sets up where a scene has a place for a fixture."""

from pathlib import Path

import numpy as np
import pytest

from core.plugins import installed
from tests.playing import evaluate_batch
from tests.plugins.vlms.offline.test_designer import brief, candidates

SCENE = Path(__file__).parents[2] / "tasks" / "file" / "scenes" / "UseFunnel.yaml"
PLACE = "fixture: {box: [0.3, 0.3, 0.25], position: [0.75, 0, 0.125]}\n"


def furnished(tmp_path, place):
    """Make the task of three balls and a bottle, with another place for a fixture, or none."""
    text = SCENE.read_text()
    assert PLACE in text
    file = tmp_path / "scene.yaml"
    file.write_text(text.replace(PLACE, place))
    return installed().create("task", "file", file=str(file))


@pytest.mark.slow
def test_a_funnel_is_set_up_over_the_bottle_and_catches_balls(tmp_path):
    task = furnished(tmp_path, PLACE)
    designs = candidates(brief(task))
    assert all(design.problem is None for design in designs)
    for design in designs:
        fixture = design.tool.fixture
        np.testing.assert_allclose(fixture.pose.position[:2], [0.75, 0.0])

    sim = installed().create("sim", "mujoco")
    caught = [tried.reward for tried in evaluate_batch(task, sim, designs)]
    bare = furnished(tmp_path, "")
    alone = candidates(brief(bare))
    missed = [tried.reward for tried in evaluate_batch(bare, sim, alone)]
    assert max(caught) == 1.0
    assert np.mean(caught) > np.mean(missed) + 0.3


@pytest.mark.parametrize(
    ("place", "width"),
    [
        ("fixture: {box: [0.3, 0.3, 0.25], position: [0.75, 0, 0.125]}\n", 0.1),
        ("fixture: {box: [0.1, 0.1, 0.25], position: [0.75, 0, 0.125]}\n", 0.09),
        ("fixture: {box: [0.05, 0.05, 0.25], position: [0.75, 0, 0.125]}\n", None),
        ("fixture: {box: [0.3, 0.3, 0.08], position: [0.75, 0, 0.24]}\n", None),
    ],
    ids=["all of it", "a narrow place", "too narrow", "nothing to stand on"],
)
def test_a_funnel_is_as_wide_as_there_is_room(tmp_path, place, width):
    design, *_ = candidates(brief(furnished(tmp_path, place)))
    fixture = design.tool.fixture
    assert (fixture is None) == (width is None)
    if fixture is not None:
        sides = [component.shape.size[1] for component in fixture.parts.components]
        assert all(side >= width for side in sides)
