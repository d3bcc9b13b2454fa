"""Reports with few bootstrap samples, and one that several files look at."""

import numpy as np
import pytest

from plugins.results.report import statistics
from plugins.results.report.report_command import report
from tests.core.run_folders import write_run

statistics.RESAMPLES = 200


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Runs of four methods on two tasks, two of which don't count, and the report of them."""
    root = tmp_path_factory.mktemp("report")
    rng = np.random.default_rng(0)
    finished = []
    for task in ("BringCube", "OneBook"):
        for words in (
            [],
            ["evolution=sampling"],
            ["tool=none", "budget.n_iteration=0"],
            ["tool=rlbench"],
        ):
            if "tool=rlbench" in words and task == "OneBook":
                continue
            for seed in (0, 1):
                name = "_".join([task, *words, str(seed)])
                generations = 1 if "tool=none" in words else 3
                rewards = np.sort(rng.uniform(size=(generations, 3)), axis=0).tolist()
                distances = rng.uniform(0.3, 2, 3).tolist()
                folder = root / "runs" / name
                write_run(
                    folder,
                    f"task={task}",
                    f"seed={seed}",
                    *words,
                    rewards=rewards,
                    distances=distances,
                )
                finished.append(folder)
    write_run(root / "runs" / "killed", "seed=3", rewards=[[1.0]], finish=False)
    write_run(root / "runs" / "empty", "seed=4", rewards=[[None]])
    (root / "runs" / finished[0].name / "recording.rrd").write_bytes(b"")
    results = report([root / "runs"], root / "out")
    return root, finished, results
