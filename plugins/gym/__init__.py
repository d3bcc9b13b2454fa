"""Tasks as Gymnasium environments. Importing this registers every task that is installed::

    import plugins.gym
    import gymnasium

    env = gymnasium.make("RoboToolBench/BringCube-v0")

Tasks of RoboToolBench, HardToolBench and SoftToolBench have these names as their namespaces, a plugin package's tasks
the name of their distribution.
Gymnasium has had no entry points of its own since its version 1.0; ``make("plugins.gym:RoboToolBench/BringCube-v0")``
imports this by itself.
"""

import re

from gymnasium.envs.registration import register

from core.hooks import PROJECT
from core.plugins import Offer, installed

NAMESPACES = {
    "robotoolbench": "RoboToolBench",
    "hardtoolbench": "HardToolBench",
    "softtoolbench": "SoftToolBench",
}
"""By the project's own entry points."""

MAX_STEPS = 500
"""Of 0.05 s; then an episode is truncated."""


def environment_id(offer: Offer) -> str:
    """Gymnasium's name for a task: namespace, name, version. Characters that Gymnasium refuses become hyphens."""
    namespace = offer.distribution.replace(".", "-")
    if offer.distribution == PROJECT:
        namespace = NAMESPACES.get(offer.entry_point, namespace)
    words = [re.sub(r"[^\w:.-]+", "-", word) for word in (namespace, offer.name)]
    return f"{'/'.join(words)}-v0"


def register_tasks() -> None:
    """Register every installed task."""
    for offer in installed().offers.values():
        if offer.kind == "task":
            register(
                environment_id(offer),
                "plugins.gym.environment:ToolEnv",
                kwargs={"task": offer.name},
                max_episode_steps=MAX_STEPS,
            )


register_tasks()
