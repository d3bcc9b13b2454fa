"""Define the configurations as typed schemas, one for each command."""

from __future__ import annotations

from dataclasses import dataclass, field, make_dataclass
from typing import Any

from omegaconf import MISSING

from core.config.settings import Fit, PerturbationRange, Printer, PromptSettings, Sampling
from core.interfaces import RolloutSettings
from core.materials import Material
from core.plugins import KINDS


@dataclass
class BudgetConfig:
    """How many designs a run tries; ``stop_reward``: stop when the best reward reaches it (null: never)."""

    n_agent: int = MISSING
    n_tool: int = MISSING
    n_action: int = MISSING
    k_top: int = MISSING
    reward_save: float = MISSING
    n_iteration: int = MISSING
    name: str = MISSING
    stop_reward: float | None = None


@dataclass
class PromptConfig(PromptSettings):
    """The prompt's settings, under a name."""

    name: str = MISSING


@dataclass
class SceneConfig:
    """The task, the robot, the engine, the tools' material, the layout's seed.

    A part's settings are checked by its factory's signature.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)  # empty: the default robot, as in runs of earlier versions
    sim: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    seed: int = 0


@dataclass
class ProtocolConfig:
    """What all entries of a benchmark have in common.

    ``fixed``: the settings that an entry may not change. ``tracks``: the plugin that offers the tasks of each.
    ``engines`` and ``layouts``: how many unseen layouts the best candidate is tried in, in each engine.
    """

    name: str = "none"
    version: int = 0
    fixed: list[str] = field(default_factory=list)
    tracks: dict[str, str] = field(default_factory=dict)
    engines: list[str] = field(default_factory=list)
    layouts: int = 0


@dataclass
class TrialConfig(SceneConfig):
    """How candidates are read, tried and judged."""

    tool: dict[str, Any] = MISSING
    action: dict[str, Any] = field(default_factory=lambda: {"name": "waypoints"})
    fitness: dict[str, Any] = field(default_factory=lambda: {"name": "nominal"})
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    protocol: ProtocolConfig = field(default_factory=ProtocolConfig)


@dataclass
class SearchConfig(TrialConfig):
    """How candidates are asked for."""

    vlm: dict[str, Any] = MISSING
    evolution: dict[str, Any] = MISSING
    prompt: PromptConfig = field(default_factory=PromptConfig)
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    sampling: Sampling = field(default_factory=Sampling)


@dataclass
class RunConfig(SearchConfig):
    """Settings of ``python -m core.run``."""

    listener: dict[str, Any] = field(default_factory=dict)
    film: bool = True


@dataclass
class EvaluateConfig(TrialConfig):
    """Settings of ``python -m core.evaluate``. ``output``: a JSON file to write as well."""

    designs: str = MISSING
    output: str | None = None


@dataclass
class TransferConfig:
    """Settings of ``python -m core.transfer``.

    ``designs``: a designs file, or a run's folder, of which the ``top`` best are taken. ``robots``: entries as those of
    ``sims``; empty: ``robot`` alone. ``seed`` is the layout's, and ``seeds`` are those of the perturbations.
    ``output``: a JSON file to write as well.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)
    tool: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    robots: list[Any] = field(default_factory=list)
    sims: list[Any] = MISSING
    seed: int = 0
    seeds: list[int] = MISSING
    perturbation: PerturbationRange = field(default_factory=PerturbationRange)
    designs: str = MISSING
    top: int = 1
    output: str | None = None


@dataclass
class ExportConfig:
    """Settings of ``python -m core.export``.

    ``designs``: a run's folder, whose best is exported, or a designs file, of which it is the first. ``sims``: engines
    that play the motion back. ``rate_hz``: of the samples. ``speed``: 1 is the motion as it was simulated. ``start``:
    joints (J,) from which the arm approaches, radians; none: its home. ``printer`` and ``fit``: of the tool's parts.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)
    tool: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    sims: list[Any] = MISSING
    seed: int = 0
    designs: str = MISSING
    top: int = 1
    output: str = MISSING
    rate_hz: float = MISSING
    speed: float = MISSING
    start: list[float] = field(default_factory=list)
    printer: Printer = field(default_factory=Printer)
    fit: Fit = field(default_factory=Fit)


@dataclass
class RenderConfig(SceneConfig):
    """Settings of ``python -m core.render``. ``designs``: a file, of which the tool number ``strategy`` is mounted."""

    tool: dict[str, Any] = MISSING
    designs: str | None = None
    strategy: int = 0
    output: str = "scene.png"
    width: int = 640
    height: int = 480


ConformanceConfig = make_dataclass(
    "ConformanceConfig",
    [
        ("seed", int, 0),
        ("material", Material, field(default_factory=Material)),
        *((kind, dict[str, Any] | None, None) for kind in KINDS),
    ],
)
"""Settings of ``python -m core.conformance``: the part of each kind to check, if any. The configs of parts may name
``seed`` and ``material``.
"""


@dataclass
class ComposeConfig(SearchConfig):
    """Settings of ``python -m core.prompt``.

    ``designs``: the file of the elites; ``agent``: the number of the agent that sends the request; ``output``: the
    folder to write.
    """

    designs: str | None = None
    agent: int = 0
    output: str = "prompt"


@dataclass
class ReportConfig:
    """Settings of ``python -m core.report``.

    ``formats``: the figures' file formats; ``confidence`` and ``resamples`` belong to the bootstrap intervals.
    ``name``: of what is an entry of a benchmark; ``entries``: results files to compare it with.
    """

    output: str = "report"
    formats: list[str] = field(default_factory=lambda: ["png", "svg"])
    confidence: float = 0.95
    resamples: int = 10_000
    name: str = ""
    entries: list[str] = field(default_factory=list)


@dataclass
class FactsConfig:
    """Settings of ``python -m core.facts``. ``output``: a JSON file to write as well."""

    robot: dict[str, Any] = MISSING
    sims: list[Any] = MISSING
    output: str | None = None


@dataclass
class GalleryConfig:
    """Settings of ``python -m core.gallery``.

    ``top``: the number of tools for each task; ``apart_mm``: two tools differ if a component's corner is this far
    away; ``plate_mm``: the printer's build volume (x, y, z); ``min_wall_mm``: the thinnest wall that it prints.
    """

    output: str = "gallery"
    top: int = 3
    apart_mm: float = 10.0
    plate_mm: list[float] = field(default_factory=lambda: [250.0, 210.0, 220.0])
    min_wall_mm: float = 0.8
