"""A toe that pulls what a joint holds from behind its face."""

import pytest

from plugins.tasks.file.task import FileTask
from tasks.hardtoolbench.open_latch import OpenLatch
from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief
from tests.support.panda import on_panda

pytestmark = pytest.mark.slow


def test_a_toe_is_for_openings_in_a_face():
    pressed = on_panda(FileTask("tasks/scenes/press_button.yaml"))
    pulled = on_panda(FileTask("tasks/scenes/open_drawer.yaml"))
    assert list_ways(make_brief(pressed)) == {"press"}
    assert list_ways(make_brief(pulled)) == {"pull"}


def test_a_toe_opens_a_latched_door():
    rewards = earn(make_brief(on_panda(OpenLatch())), "pull", 4)
    assert sum(reward > 0.9 for reward in rewards) >= 2
