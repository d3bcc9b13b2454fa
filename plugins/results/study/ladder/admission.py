"""Admit a rung: its reference holds, nothing is earned by waiting, and a simpler design does not hold."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from core.config.compose import load, task_part
from core.errors import UserError
from core.search.saved_designs import build_fitness, read_candidates, try_all
from core.support.files import read_text, write_whole
from core.support.inputs import check
from core.trial import Evaluation, rewards_by_engine
from core.values.efforts import HOLDS, holds

FIRST_LAYOUT = 500_000
"""No search sees the layouts from this one on, and no winner is tried in them."""

MOST_IDLE = 1e-6  # what waiting may earn
_WAITING = {
    "strategy_name": "waiting",
    "tool_name": "stub",
    "gripper": False,
    "tool_components": [
        {
            "name": "stub",
            "shape": "box",
            "size": [0.02, 0.02, 0.02],
            "position": [0.0, 0.0, -0.01],
            "rpy": [0.0, 0.0, 0.0],
            "parent": "tool_mount",
        }
    ],
}


@dataclass(frozen=True)
class Admission:
    """Whether a rung counts.

    Attributes:
        scene: a checksum of the scene and of the designs that were tried.
        refused: why it does not count; empty: it does.
        reference: the share of layouts in which the reference holds, by engine.
        simpler: likewise of the simpler design.
        waiting: the most that waiting earns.
    """

    scene: str
    refused: str
    reference: dict[str, float]
    simpler: dict[str, float]
    waiting: float


def admit(words: Sequence[str], file: Path) -> Admission:
    """Return whether a rung counts: as the file says, or by trying, which the file says then.

    Args:
        words: of ``vlmgineer evaluate``, which choose the rung.
        file: beside its scene.

    Raises:
        UserError: the task has no proof, or nothing can be tried or written.
    """
    config = load("evaluate", words)
    task = task_part(config).create()
    if task.proof is None:
        raise UserError(
            f"{task.name} has no designs that show that it can be solved (`proof`)"
        )

    home = [*task.home.position.tolist(), 0.0, 0.0, 0.0]
    waiting = {**_WAITING, "action": "waypoints", "action_sets": [[home]]}
    document = {
        "strategies": [dict(task.proof.reference), dict(task.proof.simpler), waiting]
    }
    text = task.source() + json.dumps(document, sort_keys=True)
    scene = sha256(text.encode()).hexdigest()[:16]
    known = _read(file)
    if known is not None and known.scene == scene:
        return known

    config.seed = FIRST_LAYOUT
    fitness = build_fitness(config)
    tried = try_all(config, read_candidates(config, document), fitness)
    admission = _judge(scene, tried)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file.with_suffix(".yaml"), task.source().encode())
    whole = json.dumps(asdict(admission), indent=2) + "\n"
    write_whole(file, whole.encode())
    return admission


def _judge(scene: str, tried: Sequence[Evaluation]) -> Admission:
    reference, simpler, waiting = tried
    held = share_by_engine(reference)
    simply = share_by_engine(simpler)
    idle = max((trial.reward for trial in waiting.trials), default=0.0)
    refused = ""
    if not held:
        refused = f"the reference was rejected: {reference.reason}"
    elif not all(map(holds, held.values())):
        refused = f"the reference holds in {_say(held)}"
    elif simply and all(map(holds, simply.values())):
        refused = f"the simpler design holds, in {_say(simply)}"
    elif waiting.status == "rejected":
        refused = f"waiting could not be tried: {waiting.reason}"
    elif idle > MOST_IDLE:
        refused = f"waiting earns {idle:.3g}"

    return Admission(scene, refused, held, simply, idle)


def share_by_engine(tried: Evaluation) -> dict[str, float]:
    """Return in which share of layouts a design earns enough, by engine."""
    rewards = rewards_by_engine(tried.trials)
    return {engine: share(earned) for engine, earned in rewards.items()}


def share(rewards: Sequence[float]) -> float:
    """Return the share of rewards that are enough."""
    return sum(reward >= HOLDS for reward in rewards) / len(rewards)


def _say(shares: dict[str, float]) -> str:
    return ", ".join(
        f"{100 * held:.0f} % of layouts in {engine}" for engine, held in shares.items()
    )


def _read(file: Path) -> Admission | None:
    """Read what was found before; None: nothing that can be read."""
    if not file.exists():
        return None

    try:
        stored: Any = json.loads(read_text(file, most=10_000))
        return check(Admission, stored, str(file), UserError)
    except (UserError, ValueError):
        return None
