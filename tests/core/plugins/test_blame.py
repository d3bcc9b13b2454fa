import pytest

from core.plugins import Offer, blame, describe_failure
from tests.support.faults import Faulty


def test_the_plugin_deepest_in_the_traceback_is_named(found, monkeypatch):
    monkeypatch.setattr(blame, "installed", lambda: found)
    found.offers = {
        ("sim", "a"): Offer("sim", "a", "a", "dist-a", "tests.support.faults:Faulty"),
        ("listener", "b"): Offer(
            "listener", "b", "b", "dist-b", "somewhere.else:Listener"
        ),
    }
    with pytest.raises(ArithmeticError) as caught:
        Faulty().break_down("raise")
    assert (
        describe_failure(caught.value)
        == "sim 'a' of dist-a raised ArithmeticError: the solver gave up"
    )
    with pytest.raises(ValueError, match="invalid literal") as ours:
        int("ours")
    assert describe_failure(ours.value) is None
