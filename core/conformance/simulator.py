"""What any simulator must satisfy: each check takes one and raises an AssertionError that says what is wrong.

``python -m core.conformance sim=NAME`` runs them all, against anybody's simulator; with pytest::

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
    def test_conforms(check):
        check(installed().create("sim", "mine"))

That the same job gives the same bits in another process too is not among them: compare `digest` there with here.
"""

from __future__ import annotations

from core.conformance import bodies, output, repeat, robot
from core.conformance.repeat import digest

CHECKS = (*repeat.CHECKS, *robot.CHECKS, *bodies.CHECKS, *output.CHECKS)

__all__ = ["CHECKS", "digest"]
