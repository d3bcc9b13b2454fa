"""Keep keys out of what a run stores, and take what a run has stored as it stands: nothing in it is resolved."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from core.errors import UsageError, UserError
from core.support.secrets import holds_secret, is_secret_name
from core.support.text import clean

# In a mapping or an address's query, or of a variable.
_NAMED = re.compile(r"(?:[{,?&]|\.env:)\s*['\"]?([\w-]+)")
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
        if value not in ("", "null") and _leaks(key, value):
            raise UsageError(f"{clean(key, 100)} is a key or holds one: {_HINT}")


def refuse_keys(config: DictConfig) -> None:
    """Look for keys in a configuration, wherever they came from.

    Raises:
        UserError: there is one; the message does not repeat it.
    """
    for path, value in texts(OmegaConf.to_container(config)):
        if not path.startswith("hydra.") and value != "???" and _leaks(path, value):
            raise UserError(
                f"{path} of the configuration is a key or holds one: {_HINT}"
            )


def _leaks(path: str, value: str) -> bool:
    """Say if the setting at ``path`` is a key by its name, or holds one; only the name ``key`` itself tells nothing."""
    names = [name for name in path.split(".") if name.lower() != "key"]
    return any(map(is_secret_name, [*names, *_NAMED.findall(value)])) or holds_secret(
        f"{path}={value}"
    )


def texts(node: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield each text in a configuration that is not empty, with its path; keys with a reference in them too."""
    if isinstance(node, str) and node:
        yield path, node
    elif isinstance(node, list):
        for item in node:
            yield from texts(item, path)
    elif isinstance(node, dict):
        for key, item in node.items():
            if "${" in str(key):
                yield path, str(key)
            yield from texts(item, f"{path}.{key}" if path else str(key))


def as_stored(config: Any, where: Path) -> dict[str, Any]:
    """Return a configuration that was read from a run's folder, if nothing in it would be resolved.

    Raises:
        UserError: it refers to something, such as an environment variable of this machine.
    """
    if not isinstance(config, dict):
        raise UserError(f"{where}: its configuration is no object")
    for path, value in texts(config):
        if "${" in value:
            raise UserError(
                f"{where}: its configuration has {clean(value, 100)!r} for {clean(path, 100)}, which is not resolved: "
                "it comes from a run's folder"
            )

    return config
