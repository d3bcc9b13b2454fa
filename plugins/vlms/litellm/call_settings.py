"""What a user sets for each call of a model."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from core.errors import UsageError, check_positive, choices
from core.support.secrets import holds_secret, is_secret_name

THINKING = ("none", "low", "medium", "high")

# What the program sets itself, by the setting that says it.
_OWN = {
    "model": "vlm.model",
    "base_url": "vlm.api_base",
    "api_base": "vlm.api_base",
    "timeout": "vlm.timeout_s",
    "max_retries": "patience_s",
    "num_retries": "patience_s",
    "max_tokens": "vlm.max_output_tokens",
    "max_completion_tokens": "vlm.max_output_tokens",
    "temperature": "vlm.temperature",
    "reasoning_effort": "vlm.thinking",
    "thinking": "vlm.thinking",
    "seed": "seed",
    "messages": "prompt",
    "response_format": "budget",
}
# What would send requests elsewhere, or have answers that are none of designs.
_REFUSED = {
    *("callbacks", "functions", "logger_fn", "n", "organization", "stream", "tools"),
    *("tool_choice", "stream_options", "drop_params"),
}


class CallSettings(Protocol):
    """What a user sets for each call; see `plugins.vlms.litellm.language_model.LanguageModel`."""

    timeout_s: float
    max_output_tokens: int | None
    thinking: str | None
    temperature: float | None
    options: dict[str, Any] | None


def check_call_settings(settings: CallSettings) -> None:
    """Check what a user sets for each call, but for the options.

    Raises:
        UsageError: a setting can't be used.
    """
    check_positive("vlm.", timeout_s=settings.timeout_s)
    check_positive("vlm.", max_output_tokens=settings.max_output_tokens)
    if settings.thinking not in (None, *THINKING):
        raise choices("thinking", settings.thinking, THINKING, "vlm.thinking")

    temperature = settings.temperature
    if temperature is not None and not 0.0 <= temperature <= 2.0:
        raise UsageError(f"vlm.temperature={temperature:g} must be between 0 and 2")


def check_options(options: Mapping[str, Any]) -> None:
    """Check ``vlm.options``: nothing of the program's own, nothing of LiteLLM's own, and no secrets.

    Raises:
        UsageError: one is.
    """
    owned = importlib.import_module("litellm.types.utils").is_litellm_owned_kwarg
    for name in options:
        if name in _OWN:
            raise UsageError(
                f"vlm.options.{name} is set by the program: change {_OWN[name]}"
            )

        if name in _REFUSED or owned(name):
            raise UsageError(
                f"vlm.options.{name} is none that LiteLLM passes on to a model; leave it out"
            )

    for name, value in _walk(options):
        if is_secret_name(name) or holds_secret(json.dumps(value, default=str)):
            raise UsageError(
                f"vlm.options: {name} looks like a secret, and options are stored with the run; keys come from the "
                "environment"
            )


def _walk(options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield all names in options, at any depth, and their values."""
    for name, value in options.items():
        yield str(name), value
        if isinstance(value, Mapping):
            yield from _walk(value)
