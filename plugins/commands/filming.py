"""Film the best of some designs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig

from core.config.compose import node, part
from core.interfaces import RolloutSettings, Task
from core.plugins import SIMULATOR
from core.simulation.pictures import write_film
from core.support.cli import say
from core.trial import Evaluation


def film_best(cfg: DictConfig, evaluations: Sequence[Evaluation], task: Task) -> None:
    """Film the design that earned most, beside the output file or in the working directory, and say where the film is.

    Of several tasks there is a film of each. What can't be filmed is said on standard error.
    """
    played = [evaluation for evaluation in evaluations if evaluation.status == "ok"]
    if not played:
        say("no film: no design could be played", file=sys.stderr)
        return

    best = max(played, key=lambda evaluation: evaluation.reward)
    assert best.shown is not None
    simulator = part(SIMULATOR, cfg.sim).create()
    settings = node(cfg.rollout, RolloutSettings)
    folder = Path(cfg.output or "film").parent
    for stage in task.parts:
        candidate = best.candidate.of(stage.name)
        file = folder / f"{stage.name}_s{candidate.design}_p{candidate.action}.gif"
        layout = best.shown.layout
        if write_film(stage, simulator, candidate, layout, settings, file):
            say(f"film: {file}")
