"""Where Hydra finds what plugins bring: their packages of configs, and of parts that come without a file the defaults
of their factories.
"""

from __future__ import annotations

import inspect
from typing import Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins as HydraPlugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import MISSING, OmegaConf

from core.errors import UserError
from core.plugins import KINDS, PROVIDED, installed


class PluginConfigs(SearchPathPlugin):  # type: ignore[misc]  # hydra has no types
    """Looks into ``conf/`` first, then into the packages that plugins name, then at signatures."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        for distribution, paths in installed().configs.items():
            for path in paths:
                search_path.append(distribution, path)
        search_path.append("signatures", f"{Signatures.scheme()}://")


class Signatures(ConfigSource):  # type: ignore[misc]
    """A config for each part: its name, and the defaults in its factory's signature; what has none is missing."""

    @staticmethod
    def scheme() -> str:
        return "signatures"

    def available(self) -> bool:
        return True

    def is_group(self, config_path: str) -> bool:
        return config_path.strip("/") in ("", *KINDS)

    def is_config(self, config_path: str) -> bool:
        return _part(config_path) in installed().offers

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        group = config_path.strip("/")
        if group == "":
            return sorted(KINDS) if results_filter in (None, ObjectType.GROUP) else []
        return installed().names(group) if results_filter in (None, ObjectType.CONFIG) else []

    def load_config(self, config_path: str) -> ConfigResult:
        kind, name = _part(config_path)
        settings = defaults(kind, name)
        config = {name: settings} if kind == "listener" else {"name": name, **settings}  # listeners: several at once
        return ConfigResult(self.provider, f"{self.scheme()}://", OmegaConf.create(config), {"package": None})


def _part(config_path: str) -> tuple[str, str]:
    kind, _, name = config_path.strip("/").removesuffix(".yaml").partition("/")
    return kind, name


def defaults(kind: str, name: str) -> dict[str, Any]:
    """The settings of a part, as far as YAML can tell them. Nothing of a part that can't be imported: whoever makes
    it will be told why.
    """
    try:
        parameters = inspect.signature(installed().factory(kind, name)).parameters.values()
    except (UserError, TypeError, ValueError):
        return {}
    settings = {p.name: MISSING if p.default is p.empty else p.default for p in parameters if _is_setting(kind, p)}
    return {key: value for key, value in settings.items() if _is_plain(value)}


def _is_setting(kind: str, parameter: inspect.Parameter) -> bool:
    named = parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    return named and parameter.name not in PROVIDED.get(kind, ())


def _is_plain(value: object) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    if isinstance(value, dict):
        return all(isinstance(key, str) and _is_plain(item) for key, item in value.items())
    return value is None or isinstance(value, bool | int | float | str)


def register() -> None:
    """Make both known to Hydra; before any config is composed."""
    for source in (PluginConfigs, Signatures):
        HydraPlugins.instance().register(source)
