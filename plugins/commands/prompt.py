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


def _describe_run(cfg: DictConfig, estimate: Estimate) -> str:
    """Say what the prompts of a whole run cost, with and without a provider that keeps what they share; empty: unknown.

    Prompts of later generations count as long as this one; the first request of each generation finds nothing kept.
    """
    paid = estimate.usd_per_prompt_token
    cached = estimate.usd_per_cached_token
    kept = estimate.usd_per_kept_token
    if paid is None or cached is None or kept is None:
        return ""

    generations = cfg.budget.n_iteration + 1
    requests = generations * cfg.budget.n_agent
    shared = estimate.shared_tokens
    rest = estimate.prompt_tokens - shared
    full = requests * estimate.prompt_tokens * paid
    later = requests - generations
    cheap = generations * shared * kept + later * shared * cached
    cheap += requests * rest * paid
    return (
        f"a run has {requests} requests, whose prompts cost {full:.2f} USD; {cheap:.2f} USD where the provider keeps "
        f"the {shared} tokens that they share"
    )


def _count_requests(
    cfg: DictConfig, request: Request, follow_ups: Sequence[Request]
) -> int:
    """Count the requests of a generation at most, but for those that send designs back."""
    return int(cfg.budget.n_agent * (1 + request.brief.n_tool * len(follow_ups)))


def _describe_generation(
    cfg: DictConfig, request: Request, follow_ups: Sequence[Request], estimate: Estimate
) -> str:
    """Say how many requests a generation has where others follow the first, and what they cost."""
    agents = cfg.budget.n_agent
    tools = request.brief.n_tool
    later = [estimate_request(cfg, other)[1].prompt_tokens for other in follow_ups]
    count = _count_requests(cfg, request, follow_ups)
    tokens = agents * (estimate.prompt_tokens + tools * sum(later))
    paid = estimate.usd_per_prompt_token
    cost = "" if paid is None else f" ({tokens * paid:.2f} USD, and the answers)"
    return (
        f"a generation has at most {count} requests with some {tokens} tokens{cost}: "
        f"of each agent one for {tools} tools, then {len(later)} for each tool"
    )


def _describe_repairs(repairs: int, count: int, estimate: Estimate) -> str:
    """Say how many requests more a generation of ``count`` may have for designs that break rules, and their cost."""
    tokens = estimate.prompt_tokens
    paid = estimate.usd_per_prompt_token
    cost = "" if paid is None else f" ({tokens * paid:.4f} USD)"
    return (
        f"prompt.repair={repairs}: at most {repairs * count} requests more in a generation where designs break "
        f"rules; each has these {tokens} tokens{cost}, and the answer that it mends"
    )


def main(words: list[str]) -> None:
    cfg = load("prompt", arguments(USAGE, words), PromptConfig)
    OmegaConf.resolve(cfg)
    request, *follow_ups = requests(cfg)
    model, estimate = estimate_request(cfg, request)
    write(request, model, estimate, Path(cfg.output))
    say(f"{estimate.prompt_tokens} tokens for {model} ({estimate.counted_by})")
    if follow_ups:
        say(_describe_generation(cfg, request, follow_ups, estimate))

    elif described := _describe_run(cfg, estimate):
        say(described)

    repairs = count_repairs(cfg, installed().factory("vlm", cfg.vlm.name))
    if repairs:
        count = _count_requests(cfg, request, follow_ups)
        say(_describe_repairs(repairs, count, estimate))
    if cfg.prompt.critic:
        say(
            f"prompt.critic={cfg.prompt.critic}: so many shorter requests come before each generation but the first"
        )

    say(str(Path(cfg.output)))
