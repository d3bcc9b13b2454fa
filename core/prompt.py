"""``python -m core.prompt task=NAME [prompt=NAME] [designs=FILE] [output=FOLDER]``: write the prompt of a run to files,
without a request to a model.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load
from core.designs.composer import as_markdown
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.evaluate import try_all
from core.interfaces import (
    VLM,
    Estimate,
    Fitness,
    Picture,
    Request,
    Task,
    ToolRepresentation,
)
from core.plugins import event_hub, installed
from core.plugins.blame import refuse_exit
from core.search.agent_groups import Team
from core.search.asking import build_designer
from core.support.cli import arguments, command, say, write_bytes
from core.trial import Evaluation, best_first

USAGE = (
    "usage: python -m core.prompt task=NAME [prompt=NAME] [tool=NAME] [designs=FILE] [vlm=NAME] [agent=N] "
    "[output=FOLDER] [KEY=VALUE ...]"
)


class NoModel(VLM):
    """A model that receives no request, in place of another."""

    def __init__(self, factory: object) -> None:
        self.model = "none"
        self.takes_schema = getattr(factory, "takes_schema", False)

    def complete(self, requests: Sequence[Request]) -> Any:
        raise TypeError("prompts are composed here, not sent")


def compose(cfg: DictConfig) -> Request:
    """Compose the first of the `requests`."""
    return requests(cfg)[0]


@refuse_exit()
def requests(cfg: DictConfig) -> list[Request]:
    """Compose the first request of agent ``cfg.agent`` in a run with this configuration; with ``cfg.designs`` the one
    after a generation in which these were the elites. What the designer would ask next of the best elite follows.

    Raises:
        UserError: a part, a setting or the designs file is wrong.
    """
    if cfg.agent < 0:
        raise UsageError(f"agent must be 0 or greater, got {cfg.agent}")
    designer, fitness = build_designer(
        cfg, NoModel(installed().factory("vlm", cfg.vlm.name)), event_hub()
    )
    elites: list[Evaluation] = []
    if cfg.designs is not None:
        elites, designer.tried = elites_of(
            cfg,
            designer.assignment.task,
            designer.assignment.representation,
            fitness,
        )
    (first,) = designer.requests(1 if elites else 0, Team([cfg.agent], elites))
    best = elites[0] if elites else None
    return [first, *designer.follow_ups(first, best)]


def elites_of(
    cfg: DictConfig, task: Task, representation: ToolRepresentation, fitness: Fitness
) -> tuple[list[Evaluation], list[Evaluation]]:
    """The best plan of each tool in ``cfg.designs``, at most ``cfg.budget.k_top`` of them, the best first; and all.

    Raises:
        UserError: the file can't be used, or nothing in it can be tried.
    """
    candidates = read_designs(load_designs(Path(cfg.designs)), representation, task)
    evaluations = try_all(cfg, candidates, fitness)
    best: dict[int, Evaluation] = {}
    for evaluation in best_first(evaluations):
        best.setdefault(evaluation.candidate.strategy, evaluation)
    if not best:
        reason = next(e.reason for e in evaluations if e.reason)
        raise UserError(
            f"{cfg.designs}: none of its designs can be an elite; the first reason: {reason}"
        )
    return list(best.values())[: cfg.budget.k_top], evaluations


def estimate_cost(cfg: DictConfig, request: Request) -> tuple[str, Estimate]:
    """The model that the configuration names, and its estimate of the request's tokens and cost."""
    model = str(cfg.vlm.get("model") or cfg.vlm.name)
    count = getattr(installed().factory("vlm", cfg.vlm.name), "estimate", VLM.estimate)
    return model, count(request, model)


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
    cfg = load("prompt", arguments(USAGE, words))
    OmegaConf.resolve(cfg)
    request, *plans = requests(cfg)
    model, estimate = estimate_cost(cfg, request)
    write(request, model, estimate, Path(cfg.output))
    say(f"{estimate.prompt_tokens} tokens for {model} ({estimate.counted_by})")
    if plans:
        tools, agents, paid = (
            request.brief.n_tool,
            cfg.budget.n_agent,
            estimate.usd_per_prompt_token,
        )
        tokens = agents * (
            estimate.prompt_tokens
            + tools * sum(estimate_cost(cfg, of)[1].prompt_tokens for of in plans)
        )
        cost = "" if paid is None else f" ({tokens * paid:.2f} USD, and the answers)"
        most = f"at most {agents * (1 + tools * len(plans))} requests with some {tokens} tokens{cost}"
        say(
            f"a generation has {most}: of each agent one for {tools} tools, then {len(plans)} for each tool"
        )
    if cfg.prompt.critic:
        say(
            f"prompt.critic={cfg.prompt.critic}: so many shorter requests come before each generation but the first"
        )
    say(str(Path(cfg.output)))


if __name__ == "__main__":
    command(main)
