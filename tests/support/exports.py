"""Exports of solutions."""

from plugins.results.workshop.export_command import configured, export

ANCHORED = "tests/tasks/anchored"


def exported(folder, *words, task="OneBook"):
    given = [
        f"designs={ANCHORED}/{task}.json",
        f"task={task}",
        "tool=boxes",
        f"output={folder}",
        "sims=[mujoco]",
    ]
    if not any(word.startswith("printer=") for word in words):
        given.append("printer.plate_mm=[500,500,500]")
    (found,) = export(configured([*given, *words]))
    return found
