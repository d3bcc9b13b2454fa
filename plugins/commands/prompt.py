"""``vlmgineer prompt task=NAME [prompt=NAME] [designs=FILE] [output=FOLDER]``: write the prompt of a run to files,
without a request to a model.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load
from core.config.schemas import SearchConfig
from core.designs.composer import as_markdown
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.interfaces import Estimate, Picture, Request
from core.plugins import installed
from core.search.assignment import Team
from core.search.builder import build_asking, count_repairs, estimate_request
from core.search.saved_designs import try_all
from core.support.cli import arguments, say, write_bytes
from core.support.templates import fill
from core.trial import Evaluation, best_first

USAGE = (
    "usage: vlmgineer prompt task=NAME [prompt=NAME] [tool=NAME] [designs=FILE] [vlm=NAME] [agent=N] "
    "[output=FOLDER] [KEY=VALUE ...]"
)


@dataclass
class PromptConfig(SearchConfig):
    """Settings of ``vlmgineer prompt``.

    Attributes:
        designs: the file of the elites.
        agent: the number of the agent that sends the request.
        output: the folder to write.
    """

    designs: str | None = None
    agent: int = 0
    output: str = "prompt"


def compose(cfg: DictConfig) -> Request:
    """Compose the first of the `requests`."""
    return requests(cfg)[0]


def requests(cfg: DictConfig) -> list[Request]:
    """Compose the first request of agent ``cfg.agent`` in a run with this configuration; with ``cfg.designs`` the one
    after a generation in which these were the elites. What the designer would ask next of the best elite follows.

    Raises:
        UserError: a part, a setting or the designs file is wrong.
    """
    if cfg.agent < 0:
        raise UsageError(f"agent must be 0 or greater, got {cfg.agent}")

    designer, fitness = build_asking(cfg)
    if cfg.designs is None:
        (first,) = designer.requests(0, Team([cfg.agent]))
        return [first, *designer.follow_ups(first, None)]

    assignment = designer.assignment
    document = load_designs(Path(cfg.designs))
    candidates = read_designs(document, assignment.representation, assignment.task)
    designer.tried = try_all(cfg, candidates, fitness)
    elites = _choose_elites(designer.tried)[: cfg.budget.k_top]
    if not elites:
        reason = next(e.reason for e in designer.tried if e.reason)
        raise UserError(
            f"{cfg.designs}: none of its designs can be an elite; the first reason: {reason}"
        )

    (first,) = designer.requests(1, Team([cfg.agent], elites))
    return [first, *designer.follow_ups(first, elites[0])]


def _choose_elites(evaluations: Sequence[Evaluation]) -> list[Evaluation]:
    """Return the best plan of each tool, the best first."""
    best: dict[int, Evaluation] = {}
    for evaluation in best_first(evaluations):
        best.setdefault(evaluation.candidate.design, evaluation)

    return list(best.values())


def write(request: Request, model: str, estimate: Estimate, folder: Path) -> None:
    """Write ``system.md``, ``user.md``, the pictures that the latter names, ``schema.json``, and ``request.json`` with
    the rest.

    Raises:
        UserError: the folder can't be written.
    """
    for message in request.messages:
        write_bytes(folder / f"{message.role}.md", as_markdown(message).encode())
        for picture in message.parts:
            if isinstance(picture, Picture):
                write_bytes(folder / f"{picture.name}.png", picture.png)

    write_bytes(folder / "schema.json", _json(request.schema))
    brief = request.brief
    rest = {
        "id": request.id,
        "model": model,
        "temperature": request.temperature,
        "seed": brief.seed,
        "gripper": brief.gripper,
        "n_tool": brief.n_tool,
        "n_action": brief.n_action,
        "elites": [elite.candidate.id for elite in brief.elites],
        "estimate": asdict(estimate),
    }
    write_bytes(folder / "request.json", _json(rest))


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()


def main(words: list[str]) -> None:
    cfg = load("prompt", arguments(USAGE, words), PromptConfig)
    OmegaConf.resolve(cfg)
    request, *follow_ups = requests(cfg)
    model, estimate = estimate_request(cfg, request)
    write(request, model, estimate, Path(cfg.output))
    costs = describe_costs(cfg, request, follow_ups, model, estimate)
    say(*costs.splitlines(), str(Path(cfg.output)))


def describe_costs(
    cfg: DictConfig,
    request: Request,
    follow_ups: Sequence[Request],
    model: str,
    estimate: Estimate,
) -> str:
    """Say how many tokens a request has, how many requests a generation has at most, and what these cost."""
    agents = cfg.budget.n_agent
    tools = request.brief.n_tool
    later = [estimate_request(cfg, other)[1].prompt_tokens for other in follow_ups]
    return fill(
        "plugins.commands",
        "costs",
        model=model,
        estimate=estimate,
        count=agents * (1 + tools * len(later)),
        tokens=agents * (estimate.prompt_tokens + tools * sum(later)),
        repairs=count_repairs(cfg, installed().factory("vlm", cfg.vlm.name)),
        critic=cfg.prompt.critic,
    )
