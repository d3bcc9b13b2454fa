"""Examples may take their time: what is slow on a busy machine is not wrong.

``HYPOTHESIS_PROFILE`` says how much of what is random is tried: ``patient`` (the default), ``ci`` (where ``CI`` is set)
or ``nightly``.
"""

import importlib.util
import os
import signal

import pytest
from hypothesis import settings

# In the background of a shell Ctrl-C is ignored, and every process started from here would ignore it too.
signal.signal(signal.SIGINT, signal.default_int_handler)

PROFILE = os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "patient")
for name in ("patient", "ci", "nightly"):
    settings.register_profile(name, deadline=None)
settings.load_profile(PROFILE)

PYBULLET = importlib.util.find_spec("pybullet") is not None
FUZZ_CASES = {"ci": 1_000, "nightly": 10_000}.get(PROFILE, 150)  # of tools, and as many of replies
POPULATION = 60 if PROFILE == "patient" else 200  # one in ten of which breaks


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """PyBullet is the default engine, and has no wheels for Python 3.12 and newer: there, tests are skipped that run
    into its absence.
    """
    report = yield
    if report.failed and "sim=pybullet needs PyBullet" in report.longreprtext and not PYBULLET:
        report.outcome, report.longrepr = "skipped", (str(item.path), item.location[1] or 0, "needs PyBullet")
    return report
