"""Find out whether other packages or folders stand in the places of this program's packages.

They are called ``core``, ``plugins``, ``tasks``, ``conf`` and ``prompts``: names that others may have chosen, too.
"""

from __future__ import annotations

import importlib.util
from importlib.metadata import packages_distributions
from pathlib import Path

from core.errors import UserError
from core.hooks import PROJECT

PACKAGES = ("core", "plugins", "tasks", "conf", "prompts")
HOME = Path(__file__).parents[2]


def refuse_hiding() -> None:
    """Look for a file or folder that hides one of this program's packages: Python finds that first.

    Raises:
        UserError: there is one.
    """
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        if spec and spec.origin and Path(spec.origin).parents[1] != HOME:
            raise UserError(
                f"{spec.origin} hides this program's package {package!r}: "
                "start in another folder, or give it another name"
            )


def refuse_rivals() -> None:
    """Look for another distribution that brings a package of the same name. It takes a moment.

    Raises:
        UserError: there is one.
    """
    owners = packages_distributions()
    for package in PACKAGES:
        for other in sorted({*owners.get(package, ())} - {PROJECT}):
            raise UserError(
                f"the installed package {other!r} brings {package!r}, too, and one may have replaced the other: "
                f"install {PROJECT} into an environment of its own"
            )


def check_configs(path: str) -> None:
    """Check that there is a package for a plugin's configs at ``path``.

    Raises:
        ValueError: there is none; says what is expected.
    """
    before, _, package = path.partition("pkg://")
    if before or importlib.util.find_spec(package) is None:
        raise ValueError(
            f'it gave {path!r}; expected a package that holds YAML files, "pkg://my_package.conf"'
        )
