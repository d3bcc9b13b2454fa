"""Packages that are installed for a test, or missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

PYTHON = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def install(package: Path, into: Path) -> Path:
    """Build the distribution in folder ``package`` and install it into a folder for PYTHONPATH. It is built with this
    environment, so that no network is needed.
    """
    copy = into / "source"
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__"))
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
        [sys.executable, "-m", *words, str(copy)],
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
