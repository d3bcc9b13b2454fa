"""Find plugins, check the settings of their parts, and make the parts. ``python -m core.plugins`` lists them."""

from core.plugins.blame import PluginError, describe_failure
from core.plugins.kinds import (
    ACTION,
    COMMAND,
    EVOLUTION,
    EXECUTOR,
    FITNESS,
    KINDS,
    LISTENER,
    MODEL,
    ROBOT,
    SIMULATOR,
    TASK,
    TOOL,
    Kind,
    event_hub,
)
from core.plugins.parts import PluginPart, RobotPart
from core.plugins.registry import (
    Failure,
    Offer,
    Plugins,
    check_settings,
    describe_part,
    installed,
)

__all__ = [
    "ACTION",
    "COMMAND",
    "EVOLUTION",
    "EXECUTOR",
    "FITNESS",
    "KINDS",
    "LISTENER",
    "MODEL",
    "ROBOT",
    "SIMULATOR",
]
__all__ += ["TASK", "TOOL", "Kind", "event_hub"]
__all__ += ["Failure", "Offer", "PluginPart", "Plugins", "RobotPart"]
__all__ += [
    "PluginError",
    "check_settings",
    "describe_failure",
    "describe_part",
    "installed",
]
