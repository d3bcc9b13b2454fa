import pytest

from core.plugins import Offer
from core.plugins.blame import culprit, describe_failure
from tests.faults import Faulty


def test_the_plugin_deepest_in_the_traceback_is_named(found):
    plugins = found
    plugins.offers = {
        ("sim", "a"): Offer("sim", "a", "a", "dist-a", "tests.faults:Faulty"),
        ("listener", "b"): Offer("listener", "b", "b", "dist-b", "somewhere.else:Listener"),
    }
    with pytest.raises(ArithmeticError) as caught:
        Faulty().break_down("raise")
    assert culprit(caught.value, plugins).distribution == "dist-a"
    assert describe_failure(caught.value, plugins) == "sim 'a' of dist-a raised ArithmeticError: the solver gave up"
    with pytest.raises(ValueError, match="invalid literal") as caught:
        int("ours")
    plugins.extensions = {("level", "c"): plugins.offers.pop(("sim", "a"))}
    with pytest.raises(ArithmeticError) as broken:
        Faulty().break_down("raise")
    assert culprit(broken.value, plugins).distribution == "dist-a"
    plugins.extensions.clear()
    assert culprit(caught.value, plugins) is None
    assert describe_failure(caught.value, plugins) is None
