"""Give Hydra the configs of parts: from ``conf/``, packages of plugins, and factories' signatures."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any, cast

from hydra._internal.core_plugins.importlib_resources_config_source import (
    ImportlibResourcesConfigSource,
)
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins as HydraPlugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import MISSING, DictConfig, OmegaConf

from core.config.folders import notes_folder, run_folder, task_folder
from core.errors import UserError
from core.plugins import KINDS, installed
from core.plugins.registry import settings_of


class PluginConfigs(SearchPathPlugin):  # type: ignore[misc]  # hydra has no types
    """Search for the config of a part first; for other configs in ``conf/``, then in the packages that plugins name."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        search_path.prepend("parts", f"{PartConfigs.scheme()}://")

        for distribution, paths in installed().configs.items():
            for path in paths:
                search_path.append(distribution, path)


class PartConfigs(ConfigSource):  # type: ignore[misc]
    """The config of each part: the defaults of its factory's signature, under its YAML file, if there is one."""

    @staticmethod
    def scheme() -> str:
        return "parts"

    def available(self) -> bool:
        return True

    def is_group(self, config_path: str) -> bool:
        return config_path.strip("/") in ("", *KINDS)

    def is_config(self, config_path: str) -> bool:
        kind, name = _part(config_path)
        offered = (kind, name) in installed().offers
        return kind in KINDS and (offered or _file(config_path) is not None)

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        group = config_path.strip("/")
        if results_filter not in (
            None,
            ObjectType.CONFIG if group else ObjectType.GROUP,
        ):
            return []

        return installed().names(group) if group else sorted(KINDS)

    def load_config(self, config_path: str) -> ConfigResult:
        kind, name = _part(config_path)
        base = OmegaConf.create({"name": name, **defaults(kind, name)})
        file = _file(config_path)
        if file is None:
            config = _placed(kind, name, base)
            where = f"{self.scheme()}://"
            return ConfigResult(self.provider, where, config, {"package": None})

        result = file.load_config(config_path)
        if "defaults" not in result.config:  # else the defaults of its base hold
            written = result.config[name] if kind == "listener" else result.config
            settings = cast(DictConfig, OmegaConf.merge(base, written))
            result.config = _placed(kind, name, settings)

        return result


def _placed(kind: str, name: str, node: DictConfig) -> DictConfig:
    """Put a part's settings where its group has them.

    There are several listeners at once, each under its name.
    """
    if kind != "listener":
        return node
    settings = {
        key: value for key, value in node.items_ex(resolve=False) if key != "name"
    }

    return OmegaConf.create({name: settings})


def _part(config_path: str) -> tuple[str, str]:
    """Split the path of a config, such as ``sim/mujoco``, into the kind and the name of its part."""
    kind, _, name = config_path.strip("/").removesuffix(".yaml").partition("/")
    return kind, name


def _file(config_path: str) -> ConfigSource | None:
    """The package that holds the YAML file of a part, if one does."""
    for path in ("pkg://conf", *itertools.chain(*installed().configs.values())):
        source = ImportlibResourcesConfigSource("parts", path)
        if source.is_config(config_path):
            return source

    return None


def defaults(kind: str, name: str) -> dict[str, Any]:
    """Return the settings of a part with their defaults, as far as YAML can express them.

    What the program itself reads of such a part is among them (`core.plugins.kinds.Kind.defaults`). A part that can't
    be imported has none here; the error is reported when the part is made.
    """
    try:
        factory = installed().factory(kind, name)
        possible = settings_of(factory, KINDS[kind].provided)
    except (UserError, TypeError, ValueError):
        return {}

    settings: dict[str, Any] = {}

    for setting, parameter in possible.items():
        needed = parameter.default is parameter.empty
        default = MISSING if needed else parameter.default
        with suppress(TypeError):  # YAML can't say it
            json.dumps(default)
            settings[setting] = default

    for key, default in KINDS[kind].defaults.items():
        declared = getattr(factory, key, None)  # by the part's class
        is_list = isinstance(declared, list | tuple)
        settings[key] = list(declared) if declared and is_list else default

    return settings


def register() -> None:
    """Register the sources, and what configurations call, with Hydra; call it before composing."""
    for source in (PluginConfigs, PartConfigs):
        HydraPlugins.instance().register(source)
    resolvers: dict[str, Callable[..., Any]] = {
        "new_folder": run_folder,
        "notes_folder": notes_folder,
        "task_folder": task_folder,
    }
    for name, resolver in resolvers.items():
        OmegaConf.register_new_resolver(name, resolver, replace=True)
