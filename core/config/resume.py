"""Change the configuration of a resumed run, where its past results do not depend on it.

A run goes on as it began: with the same parts, settings and seed. What may change is how it is executed and watched,
the settings of its model, and how long it goes on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.config.compose import explain, first_line, load
from core.config.schemas import RunConfig
from core.config.trust import refuse_key_words
from core.config.words import quote_paths
from core.errors import UsageError, UserError

# What may change in a run that goes on: parts as a whole, their settings, and single ones.
GROUPS = ("executor", "listener")
PARTS = ("executor.", "listener.", "vlm.")
KEYS = (
    "film",
    "second",
    "patience_s",
    "budget.n_iteration",
    "budget.n_rollouts",
    "budget.final_s",
    "budget.stop_reward",
    "evolution.refine",
)


def changed(config: dict[str, Any], overrides: Sequence[str]) -> DictConfig:
    """Apply the command line's overrides to a run's configuration.

    Args:
        config: of the run, resolved.
        overrides: the words of the command line.

    Raises:
        UsageError: a setting that can't change, or not to this value.
        UserError: this version can't read the configuration.
    """
    refuse_key_words(overrides)
    unusable = "the run's configuration can't be used by this version"

    try:
        schema = OmegaConf.structured(RunConfig)
        before = cast(DictConfig, OmegaConf.merge(schema, config))
        lacks = sorted(OmegaConf.missing_keys(before))
    except OmegaConfBaseException as error:
        raise UserError(f"{unusable}: {first_line(error)}") from error

    if lacks:
        raise UserError(f"{unusable}: it lacks {', '.join(lacks[:3])}")
    after = before.copy()
    words = quote_paths(overrides)

    try:
        for override in OverridesParser.create().parse_overrides(words):
            _apply(after, override)
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error) from error

    _refuse_less(before, after)

    return after


def refuse_other_run(stored: dict[str, Any], asked: DictConfig, folder: Path) -> None:
    """Check that a stored run's configuration differs from ``asked`` in nothing but what may change.

    Raises:
        UserError: it differs in more, or less is asked for than there was; names the setting.
    """
    words = json.dumps(OmegaConf.to_container(asked, resolve=True))
    before = _fixed(stored)
    after = _fixed(json.loads(words))

    for key in sorted(before.keys() | after.keys()):
        if before.get(key) != after.get(key):
            raise UserError(
                f"{folder} holds a run with another {key}; choose another folder, or give the words with which "
                f"it began. To go on with this run alone: resume={folder}"
            )

    _refuse_less(OmegaConf.create(stored), asked)


def _fixed(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that can't change in a run that goes on, by their whole names."""
    found: dict[str, Any] = {}
    for kind, settings in config.items():
        below = settings if isinstance(settings, Mapping) else {"": settings}
        for name, value in below.items():
            key = f"{kind}.{name}".rstrip(".")
            if kind not in GROUPS and not _may_change(key):
                found[key] = value

    return found


def _may_change(key: str) -> bool:
    return key in KEYS or (key.startswith(PARTS) and key != "vlm.name")


def _refuse_less(before: DictConfig, after: DictConfig) -> None:
    """Check that a run that goes on is not asked for less than it may have done already.

    Raises:
        UsageError: a setting that can only be raised is less.
    """
    for key in ("budget.n_iteration", "evolution.refine"):
        least = OmegaConf.select(before, key, default=0)
        if OmegaConf.select(after, key, default=0) < least:
            raise UsageError(
                f"{key} of a run that goes on can only be raised; it is {least}"
            )

    rollouts = after.budget.n_rollouts
    if rollouts is not None and rollouts < (before.budget.n_rollouts or math.inf):
        raise UsageError(
            "budget.n_rollouts of a run that goes on can only be raised, or lifted with null; it is "
            f"{before.budget.n_rollouts or 'null'}"
        )

    more_generations = after.budget.n_iteration > before.budget.n_iteration
    if more_generations and before.evolution.get("refine", 0):
        raise UsageError(
            "budget.n_iteration of a run with evolution.refine can't change: refinement comes last"
        )


def _apply(config: DictConfig, override: Override) -> None:
    """Apply an override to a configuration.

    A group is composed anew: its part has the settings that the command line gives, and else its defaults. What
    repeats a value changes nothing, and may stand there.

    Raises:
        UsageError: the setting can't change in a run that goes on.
    """
    key = override.key_or_group
    line = override.input_line or ""
    if override.is_sweep_override():
        raise UsageError(f"{line}: one run goes on, with one value for each setting")
    if override.is_delete() or not (_may_change(key) or key in GROUPS):
        if not override.is_delete() and override.value() == _get_value(config, key):
            return
        possible = ", ".join([*GROUPS, "vlm.*", *KEYS])
        raise UsageError(
            f"{line}: a run goes on as it began; what may change: {possible}"
        )

    if key in GROUPS:
        config[key] = load("config", [line])[key]
    else:
        OmegaConf.update(config, key, override.value(), force_add=True)


def _get_value(config: DictConfig, key: str) -> Any:
    """Return what a configuration has under a key; None: nothing."""
    value = OmegaConf.select(config, key, default=None)
    return OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
