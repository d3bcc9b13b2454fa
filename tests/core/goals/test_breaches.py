"""The worst beyond its own limit is named first."""

import numpy as np
import pytest

from core.goals import Breach, Evidence, Kept
from core.scene import Body, Box, Scene, Trace

RED = (1.0, 0.0, 0.0, 1.0)
SCENE = Scene(
    tuple(
        Body.of(name, Box((0.1, 0.1, 0.1)), (x, 0, 0), mass=1.0, color=RED)
        for x, name in enumerate(("first", "second"))
    )
)


def breaches(first, second, **given):
    start = SCENE.state()
    end = start.each(np.copy)
    end.positions[:, 1] += [first, second]
    evidence = Evidence(start, end, Trace.of(start, end))
    return [*Kept(("first", "second"), **given).breaches(evidence)]


@pytest.mark.parametrize(
    ("ways", "named"),
    [
        ((0.0, 0.0), []),
        ((0.007, 0.0099), []),
        ((0.007, 0.116), [("second", 11.6)]),
        ((0.011, 0.116), [("first", 1.1), ("second", 11.6)]),
    ],
)
def test_only_what_is_beyond_its_limit_is_a_breach(ways, named):
    found = breaches(*ways, kept_m=0.01)
    assert [breach.text.split()[0] for breach in found] == [name for name, _ in named]
    assert [breach.excess for breach in found] == pytest.approx([e for _, e in named])
    assert all(isinstance(breach, Breach) for breach in found)
