"""Packages that are installed for a test, or missing."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ONE_CANDIDATE = [
    "budget=tiny",
    "executor.workers=1",
    "film=false",
]
"""The words of a run with one candidate and one worker, without a film."""

PYTHON = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def install(packages: Sequence[Path], into: Path) -> Path:
    """Build the distributions in folders and install them into a folder for PYTHONPATH. They are built with this
    environment, so that no network is needed.
    """
    left_out = ["__pycache__", ".git", ".venv*", ".*_cache", "build", "runs", "outputs"]
    ignored = shutil.ignore_patterns(*left_out)
    copies = []
    for package in packages:
        copy = into / "source" / package.name
        shutil.copytree(package, copy, ignore=ignored)
        copies.append(str(copy))
    site = into / "site"
    words = [
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--target",
        str(site),
    ]
    done = subprocess.run(
        [sys.executable, "-m", *words, *copies],
        capture_output=True,
        text=True,
        env=PYTHON,
    )
    assert done.returncode == 0, done.stderr
    return site


def without(
    missing: list[str], arguments: list[str], folder: Path, **environment: str
) -> subprocess.CompletedProcess:
    """Run a command in a process that can't import ``missing``, nor can those that it starts."""
    lines = [f"sys.modules[{name!r}] = None\n" for name in missing]
    (folder / "sitecustomize.py").write_text("import sys\n" + "".join(lines))
    environment = {**os.environ, "PYTHONPATH": str(folder), **environment}
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True
    )
