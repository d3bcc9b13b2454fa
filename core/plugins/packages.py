"""Find out whether other packages or folders stand in the places of this program's packages.

They are called ``core``, ``plugins``, ``tasks``, ``conf`` and ``prompts``: names that others may have chosen, too.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

from core.hooks import PROJECT

PACKAGES = ("core", "plugins", "tasks", "conf", "prompts")
HOME = Path(__file__).parents[2]


def find_hidden() -> Iterator[str]:
    """Yield a line for each of this program's packages that a file or folder hides: Python finds that first."""
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        if spec and spec.origin and Path(spec.origin).parents[1] != HOME:
            yield (
                f"{spec.origin} hides this program's package {package!r}: "
                "start in another folder, or give it another name"
            )


def find_rivals() -> Iterator[str]:
    """Yield a line for each installed distribution that brings a package of the same name. It takes a moment."""
    owners = packages_distributions()
    for package in PACKAGES:
        for other in sorted({*owners.get(package, ())} - {PROJECT}):
            yield (
                f"the installed package {other!r} brings {package!r}, too, and one may have replaced the other: "
                f"install {PROJECT} into an environment of its own"
            )
