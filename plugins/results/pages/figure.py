"""Write figures as files: style, ink, and the same bytes each time."""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from core.support.text import clean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442")
"""M. Okabe and K. Ito's, which the colour-blind can distinguish."""

INK = "#1b1f24"

_DATED = {
    "png": ["Software"],
    "svg": ["Date", "Creator"],
    "pdf": ["CreationDate", "Creator", "Producer"],
}
"""What files hold of when and by what they were made; it is left out."""


@dataclass(frozen=True, eq=False)
class FigurePage:
    """A figure. What it shows, and how it was made, is in ``report.html.j2``.

    Attributes:
        name: of its file.
        title: above it.
        paint: draws it.
    """

    name: str
    title: str
    paint: Callable[[], Figure] = field(repr=False)

    def render(self, format_: str, ground: str = "white", titled: bool = True) -> bytes:
        """Return the figure as a file, the same bytes each time.

        Args:
            format_: ``png``, ``svg`` or ``pdf``.
            ground: the colour behind it.
            titled: whether its title stands above it.
        """
        import matplotlib

        metadata = dict.fromkeys(_DATED[format_])
        style = Path(__file__).parent / "templates" / "figure.mplstyle"
        buffer = io.BytesIO()
        with (
            matplotlib.rc_context({"svg.hashsalt": self.name}, style),
            warnings.catch_warnings(),
        ):
            # A name in a script that the font lacks.
            warnings.filterwarnings("ignore", "Glyph .* missing")
            figure = self.paint()
            if titled:
                figure.suptitle(wrapped(self.title, 80))
            figure.savefig(
                buffer, format=format_, dpi=160, facecolor=ground, metadata=metadata
            )

        return buffer.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure; width and height in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def wrapped(text: str, width: int) -> str:
    """Break a text into at most three lines of ``width`` letters."""
    lines = textwrap.wrap(clean(text, 300), width, max_lines=3, placeholder=" …")
    return "\n".join(lines)


def slug(text: str, longest: int = 60) -> str:
    """Make a file name of any text; it may be empty."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:longest]
