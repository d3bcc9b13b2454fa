"""Settings of Hypothesis, what is left out by default, and what is skipped where PyBullet is missing.

``HYPOTHESIS_PROFILE`` chooses how many random cases are tried: ``patient`` (the default), ``many`` or ``nightly``. The
default tries the same cases each time, so that a change is not blamed for what luck found; the others draw anew. None
has a deadline: what is slow on a busy machine is not wrong.
"""

import importlib.util
import os
import signal
import tempfile

import pytest
from hypothesis import settings

from core.errors import UserError
from tests.support.disks import disk, sealed  # noqa: F401  # fixtures
from tests.support.executors import inline  # noqa: F401  # a fixture
from tests.support.processes import undisturbed  # noqa: F401  # a fixture
from tests.support.runs import toy  # noqa: F401  # a fixture

# What this user has typed is no part of a test, nor what a test types of this user.
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="vlmgineer-state-")

# In the background of a shell Ctrl-C is ignored, and every process started from here would ignore it too.
signal.signal(signal.SIGINT, signal.default_int_handler)

PROFILE = os.environ.get("HYPOTHESIS_PROFILE") or "patient"
for name, examples in {"patient": 30, "many": 100, "nightly": 100}.items():
    settings.register_profile(
        name,
        deadline=None,
        max_examples=examples,
        derandomize=name == "patient",
    )
settings.load_profile(PROFILE)

PYBULLET = importlib.util.find_spec("pybullet") is not None
# Of tools, and as many of replies.
FUZZ_CASES = {"many": 1_000, "nightly": 10_000}.get(PROFILE, 150)
POPULATION = 60 if PROFILE == "patient" else 200  # one in ten of which breaks


def lacks_pybullet(error: BaseException) -> bool:
    """Report whether a failure is the missing engine's own error, or that of a process that printed it and ended.

    A command prints it as a line; a script ends with a traceback, whose last line has it.
    """
    refusal = "sim=pybullet needs PyBullet: "
    if isinstance(error, UserError):
        return refusal in str(error)

    # What stands after `assert done.returncode == 0,`.
    message, asserted, _ = str(error).partition("\nassert ")
    if not asserted:
        return False

    last_line = message.strip().rpartition("\n")[2].strip()
    if last_line.startswith(f"core.errors.UserError: {refusal}"):
        return True

    return any(
        line.strip().startswith(f"error: {refusal}") for line in message.splitlines()
    )


def pytest_collection_modifyitems(config, items):
    """Leave out what is ``thorough``, ``weekly``, ``real``, ``cluster`` or ``slicer``, unless ``-m`` names it."""
    left_out = [
        item
        for item in items
        if (mark := _rarest_mark(item)) and mark not in config.option.markexpr
    ]
    rare = {id(item) for item in left_out}
    items[:] = [item for item in items if id(item) not in rare]
    config.hook.pytest_deselected(items=left_out)


def _rarest_mark(item: pytest.Item) -> str | None:
    """Return the mark by which a test is left out: one that is both weekly and thorough is tried weekly."""
    for mark in ("real", "cluster", "slicer", "weekly", "thorough"):
        if item.get_closest_marker(mark):
            return mark

    return None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Halve the tests in their order, and let the process that is done first take some of the other's."""
    if config.option.dist != "load":
        return None

    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Skip tests that need PyBullet where it is not installed: there are no wheels for Python 3.12 and newer."""
    report = yield
    if report.failed and not PYBULLET and lacks_pybullet(call.excinfo.value):
        report.outcome, report.longrepr = (
            "skipped",
            (str(item.path), item.location[1] or 0, "needs PyBullet"),
        )
    return report
