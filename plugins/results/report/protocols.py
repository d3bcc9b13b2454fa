"""Protocols of benchmarks: what all of their entries have in common."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from omegaconf import OmegaConf

from core.config.compose import load
from core.errors import UserError
from core.plugins import installed
from core.values.efforts import Effort
from plugins.results.pages.runs import short
from plugins.results.report.methods import flatten


@dataclass(frozen=True)
class Protocol:
    """A protocol as it is now.

    Attributes:
        name: as in ``protocol=NAME``.
        version: a file of another version can't be compared.
        tracks: the tasks of each track.
        engines: in which the best of a run is tried.
        layouts: in how many unseen layouts.
        references: the effort of a reference solution, by task. With these, what counts of a design that holds is the
            effort saved.
    """

    name: str
    version: int
    tracks: dict[str, list[str]]
    engines: list[str]
    layouts: int
    references: dict[str, Effort] = field(default_factory=dict)


@lru_cache
def protocol(name: str) -> Protocol:
    """Return the protocol of this name, which a file or a store says.

    Raises:
        UserError: there is none.
    """
    if not re.fullmatch(r"\w{1,50}", name):
        raise UserError(f"no protocol {short(name)!r}")
    config = load("config", [f"protocol={name}"])
    chosen = config.protocol
    if "tracks" not in chosen:
        raise UserError(f"the protocol {name} has no tracks, and so no entries")

    references = {
        task: Effort(*numbers)
        for task, numbers in config.fitness.get("references", {}).items()
    }
    tracks = {
        track: [
            task for task in _tasks_of(plugin) if task in references or not references
        ]
        for track, plugin in chosen.tracks.items()
    }

    return Protocol(
        name=name,
        version=chosen.version,
        tracks=tracks,
        engines=list(chosen.engines),
        layouts=chosen.layouts,
        references=references,
    )


def _tasks_of(plugin: str) -> list[str]:
    """Return the names of the tasks that a plugin offers."""
    return [
        offer.name
        for offer in installed().offers.values()
        if offer.kind == "task" and offer.entry_point == plugin
    ]


@lru_cache
def fixed_settings(protocol_name: str, engine: str) -> dict[str, str]:
    """Return the settings that all entries share, and those of their engine as it is, as text by dotted key.

    Raises:
        UserError: there is no engine of this name, or it can't be imported here.
    """
    if not re.fullmatch(r"\w{1,50}", engine):
        raise UserError(f"sim.name is {short(engine)!r}, which is no engine")
    config = load("config", [f"protocol={protocol_name}", f"sim={engine}"])

    # Of an engine that can't be imported no setting is known, and any would pass.
    try:
        installed().factory("sim", engine)
    except UserError as error:
        raise UserError(
            f"the settings of its engine can't be checked here: {error}"
        ) from error

    settings: Any = OmegaConf.to_container(config, resolve=True)
    starts = tuple(f"{key}." for key in (*config.protocol.fixed, "sim"))
    return {
        key: value
        for key, value in flatten(settings).items()
        if f"{key}.".startswith(starts)
    }
