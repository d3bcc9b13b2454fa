"""Checks that every simulator must pass. Each takes one and raises an AssertionError that says what is wrong.

``python -m core.conformance sim=NAME`` runs them. With pytest::

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
    def test_conforms(check):
        check(installed().create("sim", "mine"))

To check that another process gives the same bits, compare `digest` there and here.
Covered by `tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

from core.conformance import bodies, output, repeat, robot
from core.conformance.repeat import digest

CHECKS = (*repeat.CHECKS, *robot.CHECKS, *bodies.CHECKS, *output.CHECKS)

__all__ = ["CHECKS", "digest"]
