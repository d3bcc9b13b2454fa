"""The commands that stand in a module or package of their own; each is imported when it is called."""

from __future__ import annotations

from core.hooks import Command, hookimpl


@hookimpl
def commands() -> dict[str, Command]:
    return {
        "conformance": Command(
            "check that a part does what its kind must do",
            "plugins.conformance.conformance_command:main",
        ),
        "evaluate": Command(
            "try the designs of a file, and print their rewards",
            "plugins.commands.evaluate:main",
        ),
        "facts": Command(
            "say where an arm reaches, how fast and how exact it is",
            "plugins.vlms.context.facts:main",
        ),
        "import": Command(
            "read a robot's or an object's file, and write the words or the scene that use it",
            "plugins.commands.import_file:main",
        ),
        "new": Command(
            "write a plugin package to start from", "plugins.new.new_command:main"
        ),
        "prompt": Command(
            "write the request that a model would receive, and estimate its cost",
            "plugins.commands.prompt:main",
        ),
        "render": Command(
            "draw a task's scene, with a tool if one is given",
            "plugins.commands.render:main",
        ),
    }
