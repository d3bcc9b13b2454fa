"""Pictures of tools: colours, edges, and what is in front."""

import numpy as np
import trimesh

from plugins.results.pages.drawing import Painted, draw, painted
from tests.core.run_folders import hook
from tests.panda import PANDA


def test_a_tool_is_drawn_in_its_colours_with_its_edges():
    picture = draw(painted(hook(0.3), PANDA), 240, 180)
    assert picture.shape == (180, 240, 4)
    alpha = picture[..., 3]
    assert alpha[0].max() == alpha[:, 0].max() == alpha[-1].max() == 0  # it fits
    seen = picture[alpha == 255][:, :3].astype(int)
    assert 0.02 < (alpha > 0).mean() < 0.5
    assert (seen[:, 2] > seen[:, 0] + 60).any()  # the blue of a component
    assert (np.ptp(seen, axis=1) < 20).any()  # the grey of the flange
    assert (seen.sum(axis=1) < 150).any()  # edges


def test_what_is_nearer_hides_what_is_behind():
    toward = np.array([0.52, -0.74, 0.42])  # the eye
    red = Painted(trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation(0.2 * toward), (0.9, 0.1, 0.1, 1.0))
    blue = Painted(trimesh.creation.box((0.2, 0.2, 0.2)).apply_translation(-0.2 * toward), (0.1, 0.1, 0.9, 1.0))
    for order in ([red, blue], [blue, red]):
        picture = draw(order, 200, 200).astype(int)
        assert picture[100, 100, 0] > picture[100, 100, 2] + 60  # red, in the middle
        assert (picture[..., 2] > picture[..., 0] + 60).any()
