"""Says at the end of a run what it came to, and how to look further."""

from __future__ import annotations

import os
import re
import shlex
import statistics
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.design import Evaluation, best_first
from core.hooks import hookimpl
from core.text import clean

if TYPE_CHECKING:
    import rich.table

    from core.events import Generation, Result, Run
    from core.interfaces import Reply

_LONGEST = 60  # letters of a name


@hookimpl
def listeners() -> Mapping[str, Callable[..., Any]]:
    return {"summary": SummaryListener}


class SummaryListener:
    """Two tables, of the generations and of the ``top`` best tools, and the commands to type next; to standard error,
    so that standard output stays free for results.
    """

    def __init__(self, top: int = 3) -> None:
        self.top = top
        self._replies: list[Reply] = []

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        self._replies.append(reply)

    @hookimpl(trylast=True)
    def run_finished(self, run: Run, result: Result) -> None:
        from rich.console import Console
        from rich.text import Text

        console = Console(stderr=True)
        console.print(_generations(result.generations))
        if result.best is not None:
            console.print(_tools(run, result, self.top))
        console.print(Text(_asked(self._replies)))
        for line in _next(run, result) if not _one_of_many() else ():
            console.print(Text(line), soft_wrap=True)


def _generations(generations: Iterable[Generation]) -> rich.table.Table:
    table = _table("generation", "best", "so far", "mean", "s.d.", "candidates", "rejected", "failed")
    so_far = 0.0
    for generation in generations:
        rewards = [e.reward for e in generation.evaluations if e.status == "ok"]
        so_far = max([so_far, *rewards])
        table.add_row(
            str(generation.index),
            *(_number(x) for x in (max(rewards, default=None), so_far, generation.mean_reward)),
            _number(statistics.stdev(rewards) if len(rewards) > 1 else None),
            *(str(n) for n in (len(generation.evaluations), generation.count("rejected"), generation.count("failed"))),
        )
    return table


def _tools(run: Run, result: Result, top: int) -> rich.table.Table:
    from rich.text import Text

    table = _table("reward", "distance m", "parts", "mass g", "candidate", "tool")
    table.columns[-1].justify = table.columns[-2].justify = "left"
    seen: set[tuple[int, ...]] = set()
    for evaluation in best_first(e for g in result.generations for e in g.evaluations):
        key = evaluation.candidate.key[:3]
        if key in seen or len(seen) == top:
            continue
        seen.add(key)
        table.add_row(*_row(evaluation), Text(_name(evaluation)))
    return table


def _row(evaluation: Evaluation) -> tuple[str, ...]:
    tool = evaluation.candidate.tool
    assert tool is not None
    return (
        _number(evaluation.reward),
        f"{evaluation.distance_m:.2f}",
        str(len(tool.components)),
        f"{1000 * tool.mass:.0f}",
        evaluation.candidate.id,
    )


def _name(evaluation: Evaluation) -> str:
    """The model's words, which nobody has checked."""
    tool = evaluation.candidate.tool
    assert tool is not None
    return clean(tool.name or evaluation.candidate.strategy_name, _LONGEST)


def _asked(replies: list[Reply]) -> str:
    said = f"{len(replies)} repl{'y' if len(replies) == 1 else 'ies'}"
    failed = sum(reply.error is not None for reply in replies)
    tokens = [n for reply in replies for n in (reply.prompt_tokens, reply.completion_tokens) if n is not None]
    costs = [reply.cost_usd for reply in replies if reply.cost_usd is not None]
    said += f", {failed} of them failed" if failed else ""
    said += f", {sum(tokens)} tokens" if tokens else ""
    return said + (f", {sum(costs):.2f} USD" if costs else "")


def _one_of_many() -> bool:
    """Whether this is a job of a multirun, which says at its end how to look further."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    return bool(HydraConfig.initialized() and HydraConfig.get().mode == RunMode.MULTIRUN)


def _next(run: Run, result: Result) -> Iterable[str]:
    """Lines to type."""
    folder = shlex.quote(_short(run.folder))
    if "rerun" in run.config.get("listener", {}):
        yield f"python -m core.view {folder}"
    if result.best is None:
        return
    yield f"python -m core.report {folder}"
    yield f"python -m core.gallery {folder}"
    parts = " ".join(f"{kind}={run.parts[kind]}" for kind in ("task", "sim", "tool"))
    design = _short(run.folder / "best" / "design.json").replace("\\", "\\\\").replace('"', '\\"')
    if not re.fullmatch(r"[\w./-]+", design):
        design = f'"{design}"'  # as Hydra wants it, beside what the shell wants
    yield f"python -m core.evaluate {parts} seed={run.seed} {shlex.quote(f'designs={design}')}"


def _short(path: Path) -> str:
    """As seen from here, where that is shorter."""
    return min(str(path), os.path.relpath(path), key=len)


def _table(*columns: str) -> rich.table.Table:
    import rich.table

    table = rich.table.Table(box=None, header_style="bold")
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    return table


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"
