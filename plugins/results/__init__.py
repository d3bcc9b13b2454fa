"""What one does with finished runs: reports, transfer, toolboxes, and tools for the workshop.

``pages`` is what the other rooms draw with, ``workshop`` makes tools; ``report`` and ``toolbox`` use what they need.
"""

from __future__ import annotations

from core.hooks import Command, Factories, hookimpl


@hookimpl
def commands() -> dict[str, Command]:
    return {
        "report": Command(
            "write tables, figures and a page about runs",
            "plugins.results.report.report_command:main",
        ),
        "study": Command(
            "compare methods on tasks, as in the paper: estimate, run, report",
            "plugins.results.study.study_command:main",
        ),
        "toolbox": Command(
            "try tools on each other's tasks, and choose few that do most",
            "plugins.results.toolbox.toolbox_command:main",
        ),
        "inspect": Command(
            "say what another person's folder would do, and play its winner again",
            "plugins.results.inspect_command:main",
        ),
        "transfer": Command(
            "try the best designs in several engines and in perturbed scenes",
            "plugins.results.transfer:main",
        ),
        "view": Command("show the recording of a run", "plugins.results.view:main"),
        "export": Command(
            "write what a real arm needs to run the best motion",
            "plugins.results.workshop.export_command:main",
        ),
    }


@hookimpl
def fitness_functions() -> dict[str, str]:
    return {"buildable": "plugins.results.workshop.buildable:Buildable"}


@hookimpl
def exports() -> Factories:
    return {"best": "plugins.results.best:save_best"}


@hookimpl
def makers() -> Factories:
    return {"workshop": "plugins.results.workshop.maker:judge_design"}
