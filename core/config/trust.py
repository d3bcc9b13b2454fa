"""Keep keys out of what a run stores, and take what a run has stored as it stands: nothing in it is resolved."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import yaml
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.errors import UsageError, UserError
from core.support.files import read_untrusted
from core.support.secrets import holds_secret, is_secret_name
from core.support.text import clean

MAX_BYTES = 100_000  # of a stored configuration
_IN_MAPPING = re.compile(r"[\w-]+(?=['\"]?\s*:)")  # the names in {name: value}
_NAMED = re.compile(r"(?:[?&](?=[\w-]+=)|oc\.env:\s*)([\w-]+)")  # in an address's query, or of a variable
_HINT = "it would be stored with the run; set the provider's environment variable instead, such as OPENAI_API_KEY"


class KeyFound(BaseException):
    """A key in a configuration, raised where Hydra catches every Exception."""


class KeyCheck(Callback):  # type: ignore[misc]  # hydra has no types
    """Look for keys before Hydra writes a file: a callback of Hydra's."""

    def on_run_start(self, config: DictConfig, **_: Any) -> None:
        try:
            refuse_keys(config)
        except UserError as error:
            raise KeyFound(str(error)) from None

    on_multirun_start = on_run_start


def refuse_key_words(words: Sequence[str]) -> None:
    """Look for keys in the words of a command line.

    Raises:
        UsageError: there is one; the message does not repeat it.
    """
    for word in words:
        key, _, value = word.lstrip("+~").partition("=")
        names = [*key.split("."), *_IN_MAPPING.findall(value)]
        if value not in ("", "null") and (any(map(_is_key, names)) or _holds(value) or holds_secret(key)):
            raise UsageError(f"{clean(key, 100)} is a key or holds one: {_HINT}")


def refuse_keys(config: DictConfig) -> None:
    """Look for keys in a configuration, wherever they came from.

    Raises:
        UserError: there is one; the message does not repeat it.
    """
    for path, value in texts(OmegaConf.to_container(config)):
        names = path.split(".")
        if names[0] != "hydra" and value != "???" and (any(map(_is_key, names)) or _holds(value)):
            raise UserError(f"{path} of the configuration is a key or holds one: {_HINT}")


def _is_key(name: str) -> bool:
    return is_secret_name(name) and name.lower() != "key"  # of a piano, or a part's own


def _holds(value: str) -> bool:
    return holds_secret(value) or any(map(is_secret_name, _NAMED.findall(value)))


def texts(node: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield each text in a configuration that is not empty, with its path; the keys too."""
    if isinstance(node, str) and node:
        yield path, node
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, item in items:
        if "${" in str(key):
            yield path, str(key)
        yield from texts(item, ".".join(filter(None, (path, key if isinstance(key, str) else ""))))


def as_stored(config: Any, where: Path, *, references: bool = False) -> dict[str, Any]:
    """Return a configuration that was read from a run's folder, if nothing in it would be resolved.

    With ``references`` it may refer to its own keys, as Hydra writes it.

    Raises:
        UserError: it refers to something, such as an environment variable of this machine.
    """
    if not isinstance(config, dict):
        raise UserError(f"{where}: its configuration is no object")
    for path, value in texts(config):
        rest = re.sub(r"\$\{[\w.\[\]]+\}", "", value) if references else value
        if "${" in rest:
            raise UserError(
                f"{where}: its configuration has {clean(value, 100)!r} for {clean(path, 100)}, which is not resolved: "
                "it comes from a run's folder"
            )
    return config


def read_stored_yaml(file: Path) -> dict[str, Any]:
    """Read the configuration that Hydra wrote into a run's folder, unresolved.

    Raises:
        UserError: it can't be read.
    """
    try:
        text = read_untrusted(file, MAX_BYTES).decode()
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, Loader=yaml.CSafeLoader)):
            raise UserError(f"{file} can't be used: it has aliases, a few of which may unfold to gigabytes")
        config = OmegaConf.to_container(OmegaConf.create(text))
    except (OmegaConfBaseException, yaml.YAMLError, ValueError, RecursionError) as error:
        why = str(error).strip().partition("\n")[0]
        raise UserError(f"{file} can't be used: {clean(why, 200)}") from error
    if not isinstance(config, dict):
        raise UserError(f"{file} can't be used: it is no configuration")
    return cast(dict[str, Any], config)
