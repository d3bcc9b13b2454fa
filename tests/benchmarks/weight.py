"""What do tools earn if they weigh what they weigh? ``python -m tests.benchmarks.weight`` tries the tasks' reference
solutions, and with ``designs`` above 0 the best of the embedded designer's, of ``paper`` and of ``material``.

The designer knows what it designs for: it makes ``designs`` tools of either material. All results are kept in
``folder``, so that an interrupted measurement can go on. ``page=docs/materials.md`` gets the table. Run by hand.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.config.compose import load
from core.design import best_first
from core.errors import UserError
from core.evaluate import evaluate
from core.search.orchestration import run
from core.support.cli import arguments, command, say
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.weight [sim=NAME] [material=NAME] [tasks=NAME,...] [designs=N] [seed=N] "
    "[workers=N] [folder=DIR] [page=FILE.md]"
)
NAME = "weight"  # of the table


@dataclass
class Settings:
    """``designs``: how many tools the embedded designer makes for each task and material; 0: none."""

    sim: str = "mujoco"
    material: str = "pla"
    tasks: list[str] = field(default_factory=list)
    designs: int = 0
    seed: int = 0
    workers: int | None = None
    folder: str = "weight"
    page: str | None = None


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    found = {
        name: {of: measured(name, of, given) for of in ("paper", given.material)}
        for name in measuring.tasks(given.tasks)
    }
    table = markdown(found, given)
    sys.stdout.write(table)
    if given.page is not None:
        measuring.write_page(Path(given.page), NAME, table)


def measured(task: str, material: str, given: Settings) -> dict[str, Any]:
    """Return what the reference solution (``solution``) and the designer's best (``best``) weigh and earn."""
    file = Path(given.folder) / given.sim / material / f"{task}.json"
    found: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
    words = [f"task={task}", f"sim={given.sim}", f"material={material}", f"executor.workers={given.workers or 1}"]
    file.parent.mkdir(parents=True, exist_ok=True)
    if "solution" not in found:
        solution = measuring.SOLUTIONS / f"{task}.json"
        found["solution"] = figures(evaluate(load("evaluate", [*words, f"designs={solution}"]))[0])
        measuring.save(file, found)
    if given.designs and "best" not in found:
        words += [f"seed={given.seed}", "vlm=offline", "film=false", "listener=[]", "budget.n_agent=1"]
        words += [f"budget.n_tool={given.designs}", "budget.n_action=1", "budget.n_iteration=0"]
        try:
            result = run(load("config", words), file.with_suffix(""))
            best = best_first(result.ranking)[:1]
            found["best"] = figures(best[0]) if best else {"reward": None, "reason": "no design could be tried"}
        except UserError as error:
            found["best"] = {"reward": None, "reason": str(error)}
        measuring.save(file, found)
    say(f"{task}, {material}: {found}", file=sys.stderr)
    return found


def figures(evaluation: Any) -> dict[str, Any]:
    tool = evaluation.candidate.tool
    tried = evaluation.status == "ok"
    return {"kg": tool and tool.mass, "reward": evaluation.reward if tried else None, "reason": evaluation.reason}


def markdown(found: Mapping[str, Mapping[str, dict[str, Any]]], given: Settings) -> str:
    """Format the table, and below it why tools are refused."""
    materials = ("paper", given.material)
    kinds = ("solution", *(["best"] if given.designs else []))
    titles = {"solution": "solution", "best": "designer's best"}
    head = [f"{titles[kind]}, `{of}`: {what}" for kind in kinds for of in materials for what in ("g", "reward")]
    lines = [f"| task | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for task, row in found.items():
        cells = [cell for kind in kinds for of in materials for cell in pair(row[of].get(kind, {}))]
        lines.append(f"| {task} | {' | '.join(cells)} |")
    lines.append("")
    for task, row in found.items():
        for of in materials:
            for kind in kinds:
                reason = row[of].get(kind, {}).get("reason")
                if reason:
                    lines.append(f"- {task}, {titles[kind]}, {of}: {reason}")
    return "\n".join(lines).rstrip() + "\n"


def pair(of: Mapping[str, Any]) -> tuple[str, str]:
    """Write mass and reward; a dash where there is none."""
    kg, reward = of.get("kg"), of.get("reward")
    return "–" if kg is None else f"{1000 * kg:.0f}", "–" if reward is None else f"{reward:.3f}"


if __name__ == "__main__":
    command(lambda _: main())
