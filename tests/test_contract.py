"""No public name, key, part, setting or column comes or goes unnoticed."""

import importlib.util

import pytest

from tests.contract import current, kinds, stored, unnamed

needs_pybullet = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None, reason="needs PyBullet"
)


@needs_pybullet
def test_what_is_new_is_in_the_list():
    assert not current() - stored() - kinds(), "python -m tests.contract"


@needs_pybullet
def test_what_is_gone_has_a_line_in_the_changelog():
    assert not unnamed(stored() - current())


def test_a_name_that_goes_without_a_line_is_noticed():
    assert unnamed({"name core.task.NoSuchName"}) == {"name core.task.NoSuchName"}
