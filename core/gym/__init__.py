"""Tasks as Gymnasium environments. Importing this registers every task that is installed, whosever it is::

    import core.gym
    import gymnasium

    env = gymnasium.make("RoboToolBench/BringCube-v0")

Gymnasium has had no entry points of its own since its version 1.0; ``make("core.gym:RoboToolBench/BringCube-v0")``
imports this by itself.
"""

from gymnasium.envs.registration import register

from core.plugins import installed

NAMESPACE = "RoboToolBench"
MAX_STEPS = 500  # of 0.05 s; then an episode is truncated

for _name in installed().names("task"):
    register(
        id=f"{NAMESPACE}/{_name}-v0",
        entry_point="core.gym.environment:ToolEnv",
        kwargs={"task": _name},
        max_episode_steps=MAX_STEPS,
    )
