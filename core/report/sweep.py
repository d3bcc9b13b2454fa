"""What a multirun came to, told when its last job has ended: a callback of Hydra's, whatever launched the jobs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from core.errors import UserError


class SweepSummary(Callback):  # type: ignore[misc]
    """Writes to standard error: rewards by task and method, the runs that don't count, and how to look further."""

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        # Every start of the program makes one of these; what it takes to read runs is loaded when there are some.
        import rich.console

        from core.report.results import Results
        from core.report.runs import find_runs
        from core.report.terminal import rich_table, short_left_out, short_rewards

        folder = Path(config.hydra.sweep.dir)
        try:
            finished, left_out = find_runs([folder])
        except UserError:
            return  # not one job came as far as a folder; each said why
        console = rich.console.Console(stderr=True)
        results = Results(tuple(finished), tuple(left_out))
        for table in (short_rewards(results), short_left_out(results)):
            if table.rows:
                console.print(rich_table(table))
        names = ["core.report", "core.gallery"] if finished else []
        if any("recording" in run.recordings() for run in finished):
            names.append("core.view")
        for name in names:
            line = f"python -m {name} {shlex.quote(str(folder))}"
            console.print(line, highlight=False, markup=False, soft_wrap=True)
