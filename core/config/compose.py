"""Compose configurations with Hydra, and turn its complaints into one line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, replace
from typing import Any, TypeVar, cast, overload

from hydra import compose, initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import (
    ConfigAttributeError,
    ConfigKeyError,
    MissingMandatoryValue,
    OmegaConfBaseException,
)

from core.config import schemas, sources
from core.config.trust import refuse_key_words, refuse_keys
from core.errors import UsageError, UserError, choices
from core.interfaces import Simulator, Task, ToolRepresentation
from core.plugins import (
    KINDS,
    ROBOT,
    SIMULATOR,
    TASK,
    TOOL,
    Kind,
    PluginPart,
    RobotPart,
    installed,
)
from core.trial import Part
from core.values.materials import Material

T = TypeVar("T")

SCHEMAS: dict[str, type] = {
    "config": schemas.RunConfig,
    "evaluate": schemas.EvaluateConfig,
    "prompt": schemas.ComposeConfig,
}
"""The schema of each primary config; ``config`` belongs to ``core.run``. Plugins' commands add theirs (`load`)."""
_registered: dict[str, type] = {}


def register() -> None:
    """Register the schemas, from which the primary configs start, and the configs of plugins with Hydra."""
    sources.register()
    for name, schema in SCHEMAS.items():
        if _registered.get(name) is not schema:  # a quarter of the time of composing
            ConfigStore.instance().store(
                f"{'run' if name == 'config' else name}_schema", schema
            )
            _registered[name] = schema


def prepared(name: str, overrides: Sequence[str]) -> list[str]:
    """Prepare the overrides of the primary config ``name`` for Hydra, and register all that they need.

    Hydra adds any key that has a ``+``. Here a key can be added to a part, whose factory checks it, and a config group
    that a plugin brings. Elsewhere the ``+`` is dropped, so that an unknown key is an error.
    """
    refuse_key_words(overrides)
    register()
    elsewhere = any(
        word.startswith(("--config-dir", "-cd", "hydra.searchpath="))
        for word in overrides
    )
    known = {field.name for field in fields(SCHEMAS[name])}
    return [_checked_addition(word, known, elsewhere) for word in overrides]


def _checked_addition(word: str, known: set[str], elsewhere: bool) -> str:
    """Keep, drop or double the ``+`` of an override; ``elsewhere``: unknown folders may bring config groups too."""
    found = re.match(r"\+\+?(?=(\w+)([^=]*)=)", word)
    if found is None:
        return word
    top, rest = found.groups()
    if (
        top == "hydra"
        or rest[:1] in ("@", "/")
        or (not rest and top not in known and (elsewhere or top in _groups()))
    ):
        return word
    plain, steps = word[found.end() :], rest.split(".")[1:]
    checked = (
        top in known
        and top in KINDS
        and not (len(steps) > 1 and steps[0] in KINDS[top].defaults)
    )
    return f"++{plain}" if checked and steps else plain


def load(name: str, overrides: Sequence[str], schema: type | None = None) -> DictConfig:
    """Compose the primary config ``name`` with command-line overrides.

    Args:
        name: of a file in ``conf/``, or in a package that a plugin names (`core.hooks.Configs`).
        overrides: the words of the command line.
        schema: the dataclass of its keys, for a plugin's command; the file names it ``NAME_schema`` in its defaults.

    Raises:
        UserError: a wrong group, key or type; the message says what is possible.
    """
    if schema is not None:
        SCHEMAS[name] = schema
    overrides = prepared(name, overrides)
    try:
        config = _compose(name, overrides)
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error, name, overrides) from error
    refuse_keys(config)
    return config


def overview(name: str, overrides: Sequence[str]) -> str:
    """Describe the config groups with their choices, and the primary config ``name`` with command-line overrides."""
    config = load(name, overrides)
    groups = "".join(
        f"{group}: {', '.join(sorted(names))}\n"
        for group, names in sorted(_groups().items())
        if group != "command"
    )
    return f"groups (GROUP=NAME):\n\n{groups}\nkeys (KEY=VALUE), and their values:\n\n{OmegaConf.to_yaml(config)}"


def _compose(name: str, overrides: Sequence[str]) -> DictConfig:
    with _hydra():
        config: DictConfig = compose(name, list(overrides))
    return config


def _groups() -> dict[str, list[str]]:
    """Return the config groups and the names in each, without Hydra's own."""
    with _hydra():
        loader = GlobalHydra.instance().config_loader()
        return {
            group: loader.get_group_options(group)
            for group in loader.list_groups("")
            if group != "hydra"
        }


def _hydra() -> AbstractContextManager[object]:
    """Initialise Hydra for composing, unless this is one of its jobs."""
    within = GlobalHydra.instance().is_initialized()
    return (
        nullcontext()
        if within
        else initialize_config_module("conf", version_base="1.3")
    )


def explain(error: Exception, name: str, overrides: Sequence[str]) -> UserError:
    """Turn Hydra's complaint about ``overrides`` into one line that says what is possible."""
    if (
        isinstance(error, MissingConfigException)
        and error.missing_cfg_file
        and error.options
    ):
        group, _, choice = error.missing_cfg_file.rpartition("/")
        return UsageError(
            f"{choices(group, choice, error.options)}{installed().failed}"
        )
    if isinstance(error, MissingMandatoryValue):
        return UsageError(
            f"{error.full_key} has no value; give one with {error.full_key}=VALUE"
        )
    found = re.search(r"Could not override '([^']+)'", str(error))
    cause = error.__cause__
    if found and (
        "in the defaults list" in str(error)
        or isinstance(cause, ConfigAttributeError | ConfigKeyError)
    ):
        unknown = _unknown_key(found.group(1), name, overrides)
        if unknown is not None:
            return unknown
    message = " ".join(
        re.sub("To append to your config use .*", "", str(error)).split()
    )
    if message.startswith("LexerNoViableAltException: "):
        word = message.partition(": ")[2].partition(" ^")[0]
        return UsageError(
            f"can't read {word}; put its value in quotes: '{word.partition('=')[0]}=\"...\"'"
        )
    if isinstance(cause, OmegaConfBaseException):
        message = f"{message.rstrip('.')}: {first_line(cause)}"
    return UsageError(f"{message}{installed().failed}")


def _unknown_key(key: str, name: str, overrides: Sequence[str]) -> UsageError | None:
    """Name the unknown step of ``key``, and what is possible there; None: something else is wrong as well."""
    try:
        words = OverridesParser.create().parse_overrides(list(overrides))
        others = [
            word.input_line
            for word in words
            if word.key_or_group != key and not word.is_sweep_override()
        ]
        node: Any = _compose(name, others)
    except (HydraException, OmegaConfBaseException):
        return None
    steps = key.split(".")
    for i, step in enumerate(steps):
        if not isinstance(node, DictConfig):
            break
        if step not in node.keys():  # noqa: SIM118 - `in node` leaves out missing values
            if i == 1 and steps[0] in KINDS and step in installed().names(steps[0]):
                return UsageError(
                    f"{key} is a setting of {steps[0]}={step}; add {steps[0]}={step}"
                )
            return choices(
                "key",
                step,
                [str(k) for k in node],
                ".".join(steps[:i]) or "the configuration",
            )
        node = OmegaConf.select(node, step)
    return None


def first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0]


def check_seed(seed: int) -> None:
    """Raise a UsageError if the seed is negative, which no generator takes."""
    if seed < 0:
        raise UsageError(f"seed must be 0 or greater, got {seed}")


def node(config: DictConfig, of: type[T]) -> T:
    """Convert a typed node of a configuration to its dataclass."""
    value = OmegaConf.to_object(config)
    assert isinstance(value, of)
    return value


@overload
def part(kind: Kind[T], config: DictConfig) -> PluginPart[T]: ...
@overload
def part(kind: str, config: DictConfig) -> PluginPart: ...
def part(kind: Kind[Any] | str, config: DictConfig) -> PluginPart:
    """Return the part that a config node names, with its settings.

    Raises:
        UserError: the node names no part, or refers to a key that this command lacks.
    """
    try:
        settings = OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        raise UserError(
            f"{kind}: its configuration can't be used here: {first_line(error)}"
        ) from error
    if not isinstance(settings, dict) or not isinstance(settings.get("name"), str):
        raise UserError(f"{kind}: the configuration names no part; give it a 'name'")
    group = KINDS[str(kind)]
    others = ("name", *group.defaults)
    given = [
        (str(k), v)
        for k, v in settings.items()
        if k not in others and not OmegaConf.is_missing(config, k)
    ]
    return PluginPart(group.name, settings["name"], tuple(given))


def robot_part(config: DictConfig) -> RobotPart:
    """Return the robot that a config node names, with its settings and its base."""
    found = part(ROBOT, config)
    return RobotPart(
        found.kind,
        found.name,
        found.settings,
        base=tuple(config.get("base") or (0.0,) * 4),
    )


def listed(
    kind: str,
    word: str,
    entries: Sequence[str | Mapping[str, Any]],
    chosen: Part[Any] | None = None,
) -> dict[str, DictConfig]:
    """Read a setting that lists parts of a kind: the configuration of each, by the name under which it is shown.

    An entry is a name, or a mapping of a ``name`` and settings that differ from the configuration's. For the name of
    ``chosen`` these are its settings. Messages call a part ``word``.

    Raises:
        UserError: an entry names no part; there are none, or one is repeated.
    """
    found: dict[str, DictConfig] = {}
    for entry in entries:
        settings = (
            {"name": entry}
            if isinstance(entry, str)
            else {str(key): value for key, value in entry.items()}
        )
        name = settings.pop("name", None)
        if not isinstance(name, str):
            raise UsageError(
                f"{kind.removesuffix('s')}s: {entry!r} names no {word}; give a name, or {{name: NAME, SETTING: VALUE}}"
            )
        shown = " ".join([name, *(f"{key}={value}" for key, value in settings.items())])
        if shown in found:
            raise UsageError(
                f"{kind.removesuffix('s')}s: {shown!r} is repeated; name each {word} once"
            )
        usual = chosen
        if usual is None or usual.name != name:
            node = load("config", [f"{kind}={name}"])[kind]
            usual = robot_part(node) if kind == "robot" else part(kind, node)
        base = {"base": list(usual.base)} if isinstance(usual, RobotPart) else {}
        found[shown] = OmegaConf.create(
            {"name": name, **dict(usual.settings), **base, **settings}
        )
    if not found:
        raise UsageError(f"{kind.removesuffix('s')}s: name at least one {word}")
    return found


def engines(
    sims: Sequence[str | Mapping[str, Any]], chosen: Part[Simulator] | None = None
) -> dict[str, PluginPart[Simulator]]:
    """Make the engines, by the names under which they are shown.

    An entry is a name as in ``sim=NAME``, or a mapping of a ``name`` and settings that differ from the
    configuration's. For the engine of ``chosen`` these are the configuration's settings.

    Raises:
        UserError: an engine does not exist or can't be used here; there are no entries, or one is repeated.
    """
    nodes = listed("sim", "engine", sims, chosen)
    found: dict[str, PluginPart[Simulator]] = {
        shown: part(SIMULATOR, node) for shown, node in nodes.items()
    }
    for engine in found.values():
        engine.create()  # so that a fault is reported once, not by each worker
    return found


def task_part(config: DictConfig) -> PluginPart[Task]:
    """Return the task of a command's configuration, for the robot that it names, if it does."""
    robot = config.get("robot")
    return replace(part(TASK, config.task), robot=robot_part(robot) if robot else None)


def task_parts(config: DictConfig) -> list[PluginPart[Task]]:
    """Return the tasks in which a tool is tried: that of the configuration, or what makes its parts."""
    whole = task_part(config)
    sources = whole.create().sources
    return [replace(source, robot=whole.robot) for source in sources] or [whole]


def tool_part(config: DictConfig) -> PluginPart[ToolRepresentation]:
    """Return the tool representation of a configuration, for the robot and the material (else ``paper``) it names.

    Raises:
        UserError: see `part`; or the material can't be used.
    """
    robot = config.get("robot")
    try:
        merged = OmegaConf.merge(
            OmegaConf.structured(Material), config.get("material") or {}
        )
        material = node(cast(DictConfig, merged), Material)
    except (OmegaConfBaseException, ValueError) as error:  # the latter: it has no keys
        raise UserError(f"material: {first_line(error)}") from error
    return replace(
        part(TOOL, config.tool),
        robot=robot_part(robot) if robot else None,
        material=material,
    )
