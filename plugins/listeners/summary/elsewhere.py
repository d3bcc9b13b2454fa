"""Try the winner of a run in a second engine, so that what one engine alone pays is not taken for a success."""

from __future__ import annotations

from typing import TYPE_CHECKING

from omegaconf import OmegaConf

from core.config.compose import task_part
from core.errors import UserError
from core.events import INTERRUPTED
from core.interfaces import Condition, Evaluation, Trial
from core.plugins import SIMULATOR, PluginPart
from core.simulation.engines import list_scene_needs
from core.simulation.play import play
from core.support.progress_display import busy
from core.support.text import clean, number
from core.trial import Where

if TYPE_CHECKING:
    from core.events import Result, Run

AUTO = "auto"
NEVER = "none"
ENGINES = ("mujoco", "pybullet", "sapien")
"""Of these ``auto`` takes the first that is not the run's own and can play the winner."""

LONGEST = 600  # letters of a cause


def describe_elsewhere(trial: Trial) -> str:
    """Say what the winner earned in a second engine, or that it could not be tried there."""
    if trial.status == "failed" and not trial.measured:
        return f"the best could not be tried in {trial.engine}"

    return f"in {trial.engine} it earns {number(trial.reward, 3)}"


def explain_elsewhere(trial: Trial) -> str:
    """Say that, and why it did not solve the task there, if so."""
    cause = "" if trial.solved else clean(trial.cause, LONGEST)
    outcome = describe_elsewhere(trial)
    return f"{outcome}: {cause}" if cause else outcome


def try_elsewhere(run: Run, result: Result, chosen: str = AUTO) -> Trial | None:
    """Try the best candidate in a second engine; None: it is not tried, or no other engine can play it.

    Of several tasks, or where the fitness has several engines, that is known or asked for otherwise.

    Args:
        run: whose winner is tried once, in the layout of the run's seed.
        result: of the run.
        chosen: the name of the engine, ``auto`` or ``none``.
    """
    best = result.best
    if best is None or best.reward == 0 or run.simulator is None:
        return None
    if result.stopped == INTERRUPTED or chosen == NEVER:
        return None
    if len(run.task.parts) > 1 or len(best.by_engine) > 1:
        return None

    names = [chosen]
    if chosen == AUTO:
        others = [name for name in ENGINES if name != run.parts["sim"]]
        names = [name for name in others if _is_ready(run, name)]

    for name in names:
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
