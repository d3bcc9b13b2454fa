"""An arm without a gripper is asked for rigid tools alone."""

from dataclasses import replace

import pytest

from core.errors import UserError
from core.plugins import installed
from core.search.assignment import borne_kinds

PANDA = installed().create("robot", "panda")
BARE = replace(PANDA, name="bare", gripper=None)


@pytest.mark.parametrize(
    "kinds", [["rigid"], ["gripper"], ["rigid", "gripper"], ["gripper", "gripper"]]
)
def test_an_arm_with_a_gripper_bears_every_kind(kinds):
    assert borne_kinds(kinds, PANDA) == kinds


def test_an_arm_without_one_bears_rigid_tools():
    assert borne_kinds(["rigid", "gripper"], BARE) == ["rigid"]
    with pytest.raises(
        UserError, match=r"robot bare has no gripper.*set task\.tool_kinds=\[rigid\]"
    ) as refused:
        borne_kinds(["gripper"], BARE)
    assert "\n" not in str(refused.value)
