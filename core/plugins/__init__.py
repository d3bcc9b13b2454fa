"""Find plugins, check the settings of their parts, and make the parts. ``python -m core.plugins`` lists them."""

from core.plugins.blame import PluginError, culprit, describe_failure
from core.plugins.discovery import Discovery, Failure, Offer
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
from core.plugins.registry import PluginPart, Plugins, RobotPart, check_settings, describe_part, installed

__all__ = ["ACTION", "COMMAND", "EVOLUTION", "EXECUTOR", "FITNESS", "KINDS", "LISTENER", "MODEL", "ROBOT", "SIMULATOR"]
__all__ += ["TASK", "TOOL", "Kind", "event_hub"]
__all__ += ["Discovery", "Failure", "Offer", "PluginPart", "Plugins", "RobotPart"]
__all__ += ["PluginError", "check_settings", "culprit", "describe_failure", "describe_part", "installed"]
