"""Film the unseen layouts in which the best design of a run fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.events import INTERRUPTED
from core.hooks import hookimpl
from core.plugins import SIMULATOR, installed
from core.store.run_figures import failed_layouts

if TYPE_CHECKING:
    from core.events import Result, Run


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
        from core.simulation.pictures import write_film

        tasks = {task.name: task for task in run.task.parts}
        for failed in list(failed_layouts(run, result))[: self.films]:
            engine = run.simulator
            if engine is None or failed.engine != run.parts["sim"]:
                engine = installed().create(SIMULATOR, failed.engine)
            write_film(
                tasks[failed.task],
                engine,
                result.best.candidate.of(failed.task),
                failed.layout,
                run.settings,
                run.folder / failed.film_file,
            )
