"""Try the winner of a run in a second engine, so that what one engine alone pays is not taken for a success."""

from __future__ import annotations

from collections.abc import Sequence

from omegaconf import OmegaConf

from core.config.compose import task_part
from core.errors import UserError, choices
from core.events import INTERRUPTED, Result, Run
from core.interfaces import Condition, Evaluation, Trial
from core.plugins import SIMULATOR, PluginPart, installed
from core.simulation.engines import list_scene_needs
from core.simulation.play import play
from core.support.progress_display import busy
from core.trial import Where


def check_engines(names: Sequence[str]) -> None:
    """Refuse names of second engines that nobody offers.

    Raises:
        UsageError: names those that there are.
    """
    offered = installed().names(SIMULATOR.name)
    for name in names:
        if name not in offered:
            raise choices("engine", name, offered, "second")


def try_second_engine(run: Run, result: Result, names: Sequence[str]) -> Trial | None:
    """Try the best candidate in a second engine, in the layout of the run's seed.

    Of several tasks, or where the fitness has several engines, that is known or asked for otherwise.

    Args:
        run: whose winner is tried.
        result: of the run.
        names: engines; the first counts that is not the run's own and can play the winner.

    Returns:
        The trial, which failed where the engine could not be used; None: no engine was asked.
    """
    best = result.best
    if best is None or best.reward == 0 or run.simulator is None:
        return None
    if result.stopped == INTERRUPTED:
        return None
    if len(run.task.parts) > 1 or len(best.by_engine) > 1:
        return None

    for name in names:
        if name == run.parts["sim"] or not _is_ready(run, name):
            continue

        try:
            trial = _play(run, best, name)
        except UserError as error:
            where = Where(run.task.name, name, run.seed)
            return Trial(where, best.candidate.id, "failed", reason=str(error))

        if trial.status != "rejected":
            return trial

    return None


def _is_ready(run: Run, name: str) -> bool:
    """Report whether an engine is installed, and can do what the scene needs, such as soft bodies."""
    try:
        engine = PluginPart(SIMULATOR.name, name).shared()
    except UserError:  # its package is missing
        return False

    needs = list_scene_needs(run.task.scene(run.seed))
    return all(ability in engine.supports for ability, _ in needs)


def _play(run: Run, best: Evaluation, name: str) -> Trial:
    """Play the best candidate in an engine.

    Raises:
        UserError: the engine is not there, or fails.
    """
    sim = PluginPart(SIMULATOR.name, name)
    task = task_part(OmegaConf.create(run.config))
    with busy(f"trying the best in {name}"):
        (trial,) = play(Condition(task, sim, run.seed, run.settings), [best.candidate])

    return trial
