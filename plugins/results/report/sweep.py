"""The summary of a multirun, printed when its last job has ended: a callback of Hydra's, for every launcher.

Covered by `tests/plugins/listeners/test_summary.py`.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from core.errors import UserError
from core.support.cli import say


class SweepSummary(Callback):  # type: ignore[misc]
    """Prints rewards by task and method, the runs that don't count, and the commands to look further, to standard
    error.
    """

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        # Hydra makes this object at every start; the modules that read runs are imported only after a multirun.
        from plugins.results.pages.runs import find_runs
        from plugins.results.report.command import show
        from plugins.results.report.results import Results

        folder = Path(config.hydra.sweep.dir)
        try:
            finished, left_out = find_runs([folder])
        except UserError:
            return  # no job made a folder; each has said why
        show(Results(tuple(finished), tuple(left_out)), sys.stderr)
        names = ["report", "gallery"] if finished else []
        if any("recording" in run.recordings() for run in finished):
            names.append("view")
        for name in names:
            say(f"vlmgineer {name} {shlex.quote(str(folder))}", file=sys.stderr)
