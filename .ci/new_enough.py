"""Hatchling's build backend, which refuses a Python that is too old in a line.

Older pips look for all packages before they look at ``requires-python``, and complain of one that an old Python can't
have.
"""

import sys

if sys.version_info < (3, 11):  # noqa: UP036  # pip runs this with any Python
    found = f"{sys.version_info[0]}.{sys.version_info[1]}"
    sys.exit(f"VLMgineer needs Python 3.11 or newer; this is Python {found}")

from hatchling.build import *  # noqa: F403
