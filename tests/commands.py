"""Call commands as a user does."""

import os
import subprocess
import sys


def python_m(folder, *words, **environment):
    """Run ``python -m`` with these words in a folder, with more in the environment."""
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=240,
    )
