"""Check a part's settings against the signature of its factory."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Mapping
from typing import Any

import pydantic

from core.errors import UsageError, choices

_NAMED = ("missing", "unexpected_keyword_argument")  # errors about a key of a setting, which their text doesn't name


def check_settings(
    factory: Callable[..., Any], settings: Mapping[str, Any], where: str, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Convert ``settings`` to the types that the factory's signature names.

    Raises:
        UserError: a setting that is unknown, missing, or of the wrong type.
    """
    parameters = {
        name: parameter
        for name, parameter in inspect.signature(factory).parameters.items()
        if name not in given and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }
    hints = typing.get_type_hints(factory.__init__ if inspect.isclass(factory) else factory)
    checked: dict[str, Any] = {}
    for name, value in settings.items():
        if name not in parameters:
            raise choices("setting", name, parameters, where)
        try:
            checked[name] = pydantic.TypeAdapter(hints.get(name, Any)).validate_python(value)
        except pydantic.ValidationError as error:
            first = error.errors()[0]
            reason = f"{first['msg']}: {first['loc'][-1]}" if first["type"] in _NAMED else first["msg"]
            raise UsageError(f"{where}: setting {name!r} can't be {value!r}: {reason}") from error
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in checked:
            raise UsageError(f"{where}: setting {name!r} is needed; settings: {', '.join(parameters)}")
    return checked
