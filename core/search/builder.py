"""Build the designer of a search, which asks a model for candidates, and the fitness that judges them."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import ClassVar

import pluggy
from omegaconf import DictConfig

from core.config.compose import check_seed, node, part, task_part, tool_part
from core.config.schemas import PromptSettings, Sampling
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.errors import UsageError, choices
from core.interfaces import (
    VLM,
    Budget,
    Condition,
    Estimate,
    Fitness,
    Reply,
    Request,
    RolloutSettings,
    Task,
)
from core.plugins import (
    ACTION,
    FITNESS,
    SIMULATOR,
    PluginPart,
    event_hub,
    installed,
)
from core.robot.kinematics import arm_of
from core.search.assignment import DEFAULT_KINDS, Assignment, borne_kinds
from core.search.designer import ModelDesigner
from core.search.kept_tools import KeptTools
from core.simulation.measuring import describe_order, figures
from core.solids.standing import find_layout_warnings
from core.trial import TIE

_log = logging.getLogger(__name__)

MAY_BE_ZERO = ("n_iteration", "k_least", "curves", "final_s", "elite_s")  # of a budget


class SearchBuilder:
    """Builds the fitness and the designer of a search. A task may name a builder of its own (`Task.builder`)."""

    asks_for_plans: ClassVar[bool] = False  # for tools that the model designed before

    def build_fitness(self, cfg: DictConfig, settings: RolloutSettings) -> Fitness:
        """Make the fitness that a configuration names.

        Raises:
            UserError: a part or setting that can't be used.
        """
        return build_fitness_in(task_part(cfg), cfg, settings)

    def finish(self, designer: ModelDesigner, fitness: Fitness) -> ModelDesigner:
        """Give a designer the pictures of the scene that it shows the model.

        Where nothing can draw, standard error says why, and the model gets text alone. Another designer may be
        returned in its place.

        Raises:
            UserError: a prompt without numbers can't be drawn.
        """
        task = designer.assignment.task
        designer.pictures = designer.artist.draw_scene(task)
        return designer


def build_designer(
    cfg: DictConfig, vlm: VLM, events: pluggy.PluginManager
) -> tuple[ModelDesigner, Fitness]:
    """Make what asks ``vlm`` for candidates in a run with this configuration, and what judges them.

    Raises:
        UserError: a part or setting that can't be used.
    """
    check_numbers(cfg)
    if cfg.prompt.file and not vlm.sees:
        raise UsageError(
            f"{vlm.model} reads no text, so prompt.file={cfg.prompt.file} would change nothing; choose a model that "
            "does with vlm=NAME, or leave prompt=human away"
        )

    named = task_part(cfg)
    builder = builder_for(named)
    assignment = _read_assignment(cfg, named.create())
    settings = node(cfg.rollout, RolloutSettings)
    # Plans for a known tool are shown with what was observed of them, too.
    asks_for_plans = assignment.given is not None or builder.asks_for_plans
    shown = asks_for_plans or cfg.prompt.critic or cfg.prompt.feedback != "paper"
    if shown and vlm.sees:
        settings = replace(settings, observe=True)

    fitness = builder.build_fitness(cfg, settings)
    prompt = node(cfg.prompt, PromptSettings)
    facts = RunFacts(
        replace(prompt, repair=count_repairs(cfg, vlm)),
        settings,
        cfg.sim.name,
        tie=cfg.evolution.get("tie", TIE),
        decides=describe_order(fitness.tie_by),
        judged=fitness.instructions(),
    )
    prompts = PromptComposer(facts)
    sampling = node(cfg.sampling, Sampling)
    designer = ModelDesigner(assignment, vlm, prompts, sampling, events)
    return finish_designer(builder, designer, fitness, cfg), fitness


def check_numbers(cfg: DictConfig) -> None:
    """Check the seed and the budget, which takes no time.

    Raises:
        UsageError: a number can't be used.
    """
    check_seed(cfg.seed)
    _read_budget(cfg)


class _NoModel(VLM):
    """A model that receives no request, in place of another one, whose factory it is made of."""

    model = "none"

    def __init__(self, factory: object) -> None:
        self.takes_schema = getattr(factory, "takes_schema", False)

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        raise TypeError("requests are composed here, not sent")


def build_asking(cfg: DictConfig) -> tuple[ModelDesigner, Fitness]:
    """Make a designer, as `build_designer` does, to see what it would ask: its model can't be called.

    Raises:
        UserError: a part or setting that can't be used.
    """
    factory = installed().factory("vlm", cfg.vlm.name)
    return build_designer(cfg, _NoModel(factory), event_hub())


def estimate_request(cfg: DictConfig, request: Request) -> tuple[str, Estimate]:
    """Name the model of a configuration, and estimate what a request to it takes, without a call."""
    model = str(cfg.vlm.get("model") or cfg.vlm.name)
    count = getattr(installed().factory("vlm", cfg.vlm.name), "estimate", VLM.estimate)
    return model, count(request, model)


def count_repairs(cfg: DictConfig, vlm: object) -> int:
    """Return how often designs that break a rule go back to a model, or what is made of its factory."""
    if cfg.prompt.repair is not None:
        return int(cfg.prompt.repair)
    can_mend = getattr(vlm, "repairs", VLM.repairs)

    return int(can_mend and cfg.budget.name != "paper")


def _read_assignment(cfg: DictConfig, task: Task) -> Assignment:
    """Read what agents are asked for, to solve a task.

    Raises:
        UserError: a part or setting that can't be used; no tool kind that the robot can bear, or no given tool.
    """
    budget = _read_budget(cfg)
    representation = tool_part(cfg).create()
    check_starts(task)
    kinds = list(cfg.task.get("tool_kinds") or task.tool_kinds or DEFAULT_KINDS)
    actions = part(ACTION, cfg.action).create()
    assignment = Assignment(task, representation, actions, budget, cfg.seed, kinds)
    if assignment.given is not None:
        # As many candidates as there would be with tools.
        plans = budget.n_tool * budget.n_action
        return replace(assignment, budget=replace(budget, n_tool=1, n_action=plans))

    return replace(assignment, tool_kinds=borne_kinds(kinds, task.robot))


def _read_budget(cfg: DictConfig) -> Budget:
    """Read the budget of a run.

    Raises:
        UsageError: there would be no agent, tool, plan or elite; or a number that may be 0 is below it.
    """
    budget = node(cfg.budget, Budget)

    for name in ("n_agent", "n_tool", "n_action", "k_top", *MAY_BE_ZERO):
        least = int(name not in MAY_BE_ZERO)
        number = getattr(budget, name)
        if number < least:
            raise UsageError(f"budget.{name} must be at least {least}, got {number}")

    if budget.n_rollouts is not None and budget.n_rollouts < 1:
        raise UsageError(
            f"budget.n_rollouts must be at least 1, or null, got {budget.n_rollouts}"
        )

    return budget


def builder_for(task: PluginPart[Task]) -> SearchBuilder:
    """Make the builder of searches for a task."""
    builder: SearchBuilder = (task.declared("builder", None) or SearchBuilder)()
    return builder


def build_fitness_in(
    task: PluginPart[Task], cfg: DictConfig, settings: RolloutSettings
) -> Fitness:
    """Make the fitness that a configuration names, for a task.

    Raises:
        UserError: a part or setting that can't be used, or there is no such figure as ``tie_by``.
    """
    condition = Condition(task, part(SIMULATOR, cfg.sim), cfg.seed, settings)
    fitness = part(FITNESS, cfg.fitness).create(condition=condition)
    fitness.tie_by = cfg.fitness.get("tie_by", Fitness.tie_by)
    known = (Fitness.tie_by, *figures())
    if fitness.tie_by not in known:
        raise choices("figure", fitness.tie_by, known, "fitness.tie_by")

    return fitness


def check_starts(task: Task) -> None:
    """Check that the arm can start a task, and find the rules for tools, before anything is drawn, asked or tried.

    Raises:
        UserError: the arm can't reach the home pose, or a rule can't be imported.
    """
    installed().factories("tool_rule")
    for stage in task.parts:
        arm_of(task.robot).home_for(stage.home)

    warn_of_scene(task)


def warn_of_scene(task: Task) -> None:
    """Say what is questionable in the scene of a task, before anything is drawn, asked or tried."""
    for stage in task.parts:
        for warning in (*stage.find_warnings(), *find_layout_warnings(stage)):
            _log.warning("%s: %s", stage.name, warning)


def finish_designer(
    builder: SearchBuilder, designer: ModelDesigner, fitness: Fitness, cfg: DictConfig
) -> ModelDesigner:
    """Let a builder finish a designer, which then has an artist, and all that the settings ask for (`equip`).

    Raises:
        UserError: a prompt without numbers can't be drawn.
    """
    engine = part(SIMULATOR, cfg.sim)
    for make in installed().factories("artist").values():
        designer.artist = make(designer.assignment, designer.prompts, engine.create)

    designer = builder.finish(designer, fitness)
    equip(designer)
    return designer


def equip(designer: ModelDesigner) -> None:
    """Give a designer the critic, the mender and the memory that the prompts' settings ask for, and known tools.

    Raises:
        UserError: the model can't write the lessons that are asked for, or a library can't be used.
    """
    settings = designer.prompts.facts.settings

    if settings.repair:
        for make in installed().factories("mender").values():
            designer.mender = make(designer.prompts)

    if settings.critic and designer.vlm.criticises:
        for make in installed().factories("critic").values():
            designer.critic = make(designer)

    if settings.writes_lessons and not designer.vlm.criticises:
        raise UsageError(
            f"{designer.vlm.model} writes no lessons; leave prompt.lessons=write away, or choose a language model "
            "with vlm=NAME"
        )

    named = settings.lesson_folders or settings.examples
    if settings.writes_lessons or (named and designer.vlm.sees):
        for make in installed().factories("memory").values():
            designer.memory = make(designer)

    assignment = designer.assignment
    kept = assignment.representation.kept(assignment.task)
    if kept:
        designer.first_tools = KeptTools(designer, kept)
