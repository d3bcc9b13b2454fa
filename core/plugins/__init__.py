"""Find plugins, check the settings of their parts, and make the parts. ``python -m core.plugins`` lists them."""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together

from core.plugins.blame import (
    PluginError as PluginError,
    describe_failure as describe_failure,
)
from core.plugins.kinds import (
    ACTION as ACTION,
    COMMAND as COMMAND,
    EVOLUTION as EVOLUTION,
    EXECUTOR as EXECUTOR,
    FITNESS as FITNESS,
    KINDS as KINDS,
    LISTENER as LISTENER,
    MODEL as MODEL,
    ROBOT as ROBOT,
    SIMULATOR as SIMULATOR,
    TASK as TASK,
    TOOL as TOOL,
    Kind as Kind,
    event_hub as event_hub,
)
from core.plugins.parts import PluginPart as PluginPart
from core.plugins.registry import (
    Failure as Failure,
    Offer as Offer,
    Plugins as Plugins,
    check_settings as check_settings,
    describe_part as describe_part,
    installed as installed,
)
