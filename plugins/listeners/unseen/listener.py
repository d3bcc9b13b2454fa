"""Film the unseen layouts in which the best design of a run fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.design import Candidate
from core.errors import RAISED
from core.events import INTERRUPTED
from core.hooks import hookimpl
from core.plugins import SIMULATOR, installed
from core.store.run_figures import failed_layouts
from core.support.progress_display import busy

if TYPE_CHECKING:
    from core.events import Result, Run
    from core.store.rows import FailedLayout


class UnseenListener:
    """Writes films of the worst layouts to ``best/unseen/``; ``result.json`` names them and says what was drawn::

        python -m core.run task=BringCube task.variation=wide fitness=layouts listener.unseen.films=3

    Args:
        films: how many at most; each costs a rollout and a few seconds.
    """

    def __init__(self, films: int = 3) -> None:
        self.films = films

    @hookimpl(tryfirst=True)
    def run_finished(self, run: Run, result: Result) -> None:
        """Film them before the store looks for films, and others name them."""
        if result.best is None or result.stopped == INTERRUPTED:
            return
        if not run.config.get("film", True):
            return

        # Imported here, since each command's start asks for this class's settings.
        from core.simulation.pictures import report_missing

        for failed in list(failed_layouts(run, result))[: self.films]:
            try:
                with busy(f"drawing the film of unseen layout {failed.layout}"):
                    _film(run, result.best.candidate, failed)
            except RAISED as error:  # a film that fails costs the film, never the run
                report_missing(f"film of unseen layout {failed.layout}", error)


def _film(run: Run, candidate: Candidate, failed: FailedLayout) -> None:
    """Play a design again in a layout in which it failed, and write the film.

    Raises:
        UserError: the engine can't be made.
    """
    from core.simulation.pictures import filmed, save_film

    (task,) = (task for task in run.task.parts if task.name == failed.task)
    file = run.folder / failed.film_file
    file.parent.mkdir(parents=True, exist_ok=True)
    simulator = run.simulator
    if simulator is None or failed.engine != run.parts["sim"]:
        simulator = installed().create(SIMULATOR, failed.engine)

    played = candidate.of(task.name)
    save_film(filmed(task, simulator, played, failed.layout, run.settings), file)
