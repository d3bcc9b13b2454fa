import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.disks import mount

ROOT = Path(__file__).parents[2]


@pytest.mark.weekly
def test_a_run_to_which_all_happens_comes_to_the_same(tmp_path, disk):
    mount("-t", "tmpfs", "-o", "size=8k", "tests", str(disk))  # or it is skipped
    command = [sys.executable, "-m", "tests.benchmarks.week", str(tmp_path / "week")]
    done = subprocess.run(
        [*command, "candidates=1000"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["the same result"]
    assert told["the disk was full"] > 1
    assert told["waits for the model"] > 1
