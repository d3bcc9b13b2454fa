"""Failures that become skips where PyBullet is not installed, in a session of pytest inside this one."""

import pytest

pytest_plugins = ["pytester"]

CONFTEST = "from tests.conftest import pytest_runtest_makereport"
CASES = """
    import subprocess, sys
    import pytest
    from core.errors import UserError

    MISSING = "sim=pybullet needs PyBullet: pip install pybullet"
    COMMAND = f"import sys; sys.exit('a warning\\\\nerror: {MISSING}')"
    TRACEBACK = f"Traceback:\\\\ncore.errors.UserError: {MISSING}"
    SCRIPT = f"import sys; sys.exit('{TRACEBACK}')"
    HANDLING = f"import sys; sys.exit('{TRACEBACK}\\\\nKeyError: reward')"

    @pytest.fixture
    def engine():
        raise UserError(MISSING)

    def test_engine_in_setup(engine):
        pass

    def test_engine():
        raise UserError(f"no picture: {MISSING}")

    def test_command():
        done = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    def test_script():
        done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    def test_script_that_handles_the_error():
        done = subprocess.run([sys.executable, "-c", HANDLING], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    def test_process_that_prints_nothing():
        printed = ""
        assert 1 == 0, printed

    def test_other_error_of_the_engine():
        raise UserError("sim=pybullet: no such shape")

    def test_bug_while_the_error_is_handled():
        try:
            raise UserError(MISSING)
        except UserError:
            raise KeyError("reward")

    def test_other_text():
        assert f"warning\\nerror: {MISSING}" == f"caution\\nerror: {MISSING}"

    def test_wrong_match():
        with pytest.raises(UserError, match="no such task"):
            raise UserError(MISSING)
"""


@pytest.mark.parametrize(
    ("pybullet", "skipped"),
    [
        (
            False,
            {"test_engine_in_setup", "test_engine", "test_command", "test_script"},
        ),
        (True, set()),
    ],
)
def test_only_the_missing_engine_is_skipped(pytester, monkeypatch, pybullet, skipped):
    monkeypatch.setattr("tests.conftest.PYBULLET", pybullet)
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(CASES)
    reports = pytester.inline_run("-p", "no:cacheprovider").getreports(
        "pytest_runtest_logreport"
    )
    by_outcome = {
        outcome: {
            report.nodeid.partition("::")[2]
            for report in reports
            if report.outcome == outcome
        }
        for outcome in ("skipped", "failed")
    }
    assert by_outcome["skipped"] == skipped
    assert len(by_outcome["failed"]) == 10 - len(skipped)
