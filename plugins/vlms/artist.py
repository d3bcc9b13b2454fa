"""Make the pictures that a prompt shows: of scenes, and of rollouts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice

from core.design import Tool
from core.designs.composer import PromptComposer
from core.designs.rules import given_tool
from core.errors import RAISED, NoPicture, UserError
from core.interfaces import Image, Picture, Simulator, Task
from core.search.assignment import Assignment
from core.search.designer import Aim, Artist, ScenePictures
from core.simulation.pictures import SIZE, Film, filmed, png, report_missing
from core.support.text import clean
from core.trial import Evaluation, Score
from plugins.vlms.context.causes import failing_trials
from plugins.vlms.telling import last_generation, most_telling

_CAUSE = 100  # characters of a caption


def shown_in(task: Task, evaluation: Evaluation) -> tuple[Task, Evaluation]:
    """Return the task of the trial that is shown, and what the candidate earned in it."""
    shown = evaluation.shown
    if shown is not None:
        for part in task.parts:
            if part.name == shown.task:
                return part, evaluation.in_task(part.name)
    return task, evaluation.in_task(task.name)


def _draw_aimed(film: Film, aim: Aim, index: int, usual: object) -> Image:
    """Draw a sample of a film with a camera of its own, in place of the ``usual`` one."""
    state = film.recording.states[index]
    return film.draw(index, lambda camera: aim(camera, state))


@dataclass(eq=False)
class EngineArtist(Artist):
    """Has an engine draw what prompts show of the scene and of rollouts.

    An engine with a loaded scene holds 100 MB. So the one that drew the scene is let go, and one for rollouts is made
    when the first is drawn.

    Attributes:
        assignment: names the task, the layout's seed, and the kinds of tools.
        prompts: their settings say what is shown.
        engine: makes an engine.
        can_draw: whether anything can draw here, as far as is known.
    """

    assignment: Assignment
    prompts: PromptComposer
    engine: Callable[[], Simulator]
    can_draw: bool = True

    @cached_property
    def _player(self) -> Simulator:
        return self.engine()

    @property
    def mounted(self) -> Sequence[Tool]:
        """What the arm carries in pictures of the scene: the given tool, or no tool, on each kind of mount.

        Raises:
            UserError: the given tool breaks a rule.
        """
        assignment = self.assignment
        given = given_tool(assignment.representation, assignment.task)
        if given is not None:
            return [given]
        kinds = dict.fromkeys(assignment.tool_kinds)
        return [Tool(gripper=kind == "gripper") for kind in kinds]

    def draw_strip(
        self, evaluation: Evaluation, aim: Aim | None = None
    ) -> Picture | None:
        """Draw a film strip of the trial that is shown; None: that fails, and standard error says why."""
        if not self.can_draw:
            return None

        task, evaluation = shown_in(self.assignment.task, evaluation)
        candidate = evaluation.candidate
        shown = evaluation.shown
        layout = self.assignment.seed if shown is None else shown.layout
        # Of several trials what was observed may be of another engine, or perturbed.
        seen = None if evaluation.combined else evaluation.observation
        level = self.prompts.facts.level
        rollout = self.prompts.facts.rollout

        try:
            film = filmed(
                task, self._player, candidate, layout, rollout, level.frame_size
            )
            draw = film.draw if aim is None else partial(_draw_aimed, film, aim)
            strip = level.strip(film.recording, draw, seen)
        except OSError:  # the machine fails: a request without the picture would be paid for all the same
            raise
        except RAISED as error:  # else it costs the picture, never the run
            report_missing(f"film strip of {candidate.id}", error)
            return None

        if strip is None:
            return None
        return Picture(png(strip), f"strip_{candidate.id}")

    def draw_strips(
        self, elites: Sequence[Evaluation], tried: Sequence[Evaluation]
    ) -> dict[str, Picture]:
        """Draw the best elite, and the most instructive failure of the last generation.

        That is for ``prompt.feedback=full``, and where pictures tell the scene. Where the best elite fails in a further
        layout, it is drawn there, too. A strip that can't be drawn is left out.
        """
        facts = self.prompts.facts
        feedback = facts.settings.feedback
        if feedback == "paper" or (feedback != "full" and facts.level.numbers):
            return {}

        best = elites[:1]
        strips: dict[str, Picture] = {}
        shown = islice(most_telling(best, last_generation(tried)), len(best) + 1)
        for evaluation in shown:
            strip = self.draw_strip(evaluation)
            if strip is not None:
                name = evaluation.candidate.id
                which = "an elite" if evaluation in best else "a failure"
                caption = f"Film strip of {which}, {name}: six instants of its motion, in reading order:"
                strips[name] = replace(strip, caption=caption)

        for elite in best:
            strips |= self._draw_failing(elite)

        return strips

    def _draw_failing(self, elite: Evaluation) -> dict[str, Picture]:
        """Draw an elite in the further layout where it earns least, if it fails in any, by its id and the layout."""
        failed = failing_trials(elite)
        if not failed:
            return {}

        trial = failed[0]
        score = Score(trial.reward)
        strip = self.draw_strip(Evaluation(elite.candidate, (trial,), score))
        if strip is None:
            return {}

        name = f"{elite.candidate.id}-layout{trial.layout}"
        facts = self.prompts.facts
        sight = facts.level.sight(self.assignment.task, self.assignment.seed)
        cause = sight.text(clean(trial.cause, _CAUSE))
        why = f" ({cause})" if cause else ""
        caption = (
            f"Film strip of the elite {elite.candidate.id} in layout {trial.layout}, where it fails{why}: six instants "
            "of its motion, in reading order:"
        )
        return {name: replace(strip, name=f"strip_{name}", caption=caption)}

    def draw_scene(self, task: Task) -> ScenePictures:
        """Make the pictures of the scene that the prompt's settings ask for: drawn and photographed.

        Where the prompt has the scene's numbers too, a picture that fails is left out, and standard error says why.

        Raises:
            UserError: the machine fails, or a prompt without numbers can't be drawn.
        """
        settings = self.prompts.facts.settings
        numbers = self.prompts.facts.level.numbers
        mounted = self.mounted
        simulator = self.engine()
        photographs: tuple[Picture, ...] = ()
        if settings.photographs != "none":
            photographs = tuple(task.photographs())
        pictures = {tool.gripper: photographs for tool in mounted}
        alone = photographs and settings.photographs == "alone"
        if alone or not (settings.picture or not numbers):
            return pictures

        for number, tool in enumerate(mounted):
            name = "scene_gripper" if number else "scene"
            try:
                drawn = self._draw(task, simulator, tool, name)
            except NoPicture as error:
                if not numbers:
                    why = f"prompt.context={settings.context} shows only pictures, and nothing here draws them: {error}"
                    raise UserError(why) from error

                report_missing("pictures", error)
                self.can_draw = False
                return pictures
            except OSError as error:
                raise UserError(f"the scene can't be drawn: {error}") from error
            except RAISED as error:
                if not numbers:
                    raise
                report_missing("picture of the scene", error)
            else:
                pictures[tool.gripper] = (*drawn, *photographs)

        return pictures

    def _draw(
        self, task: Task, simulator: Simulator, tool: Tool, name: str
    ) -> tuple[Picture, ...]:
        """Draw the scene with a tool: one picture, or those of the prompt's level where it has no numbers."""
        seed = self.assignment.seed
        level = self.prompts.facts.level
        render = partial(simulator.render, task, seed=seed, tool=tool)
        if not level.numbers:
            return level.draw(task, seed, render)
        width, height = SIZE
        return (Picture(png(render(width=width, height=height)), name),)
