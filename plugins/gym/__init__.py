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
    name.lower(): name for name in ("RoboToolBench", "HardToolBench", "SoftToolBench")
}  # by entry point
MAX_STEPS = 500  # of 0.05 s; then an episode is truncated


def environment_id(offer: Offer) -> str:
    """Gymnasium's name for a task: namespace, name, version. Characters that Gymnasium refuses become hyphens."""
    given = NAMESPACES.get(offer.entry_point) if offer.distribution == PROJECT else None
    namespace = given or offer.distribution.replace(".", "-")
    return (
        "/".join(re.sub(r"[^\w:.-]+", "-", name) for name in (namespace, offer.name))
        + "-v0"
    )


def register_tasks() -> None:
    """Register every installed task."""
    for offer in installed().offers.values():
        if offer.kind == "task":
            where = "plugins.gym.environment:ToolEnv"
            register(
                environment_id(offer),
                where,
                kwargs={"task": offer.name},
                max_episode_steps=MAX_STEPS,
            )


register_tasks()
