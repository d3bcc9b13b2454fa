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


@dataclass(frozen=True, eq=False)
class FigurePage:
    """A figure; ``name`` is its file's. What it shows, and how it was made, is in ``report.html.j2``."""

    name: str
    title: str
    paint: Callable[[], Figure] = field(repr=False)

    def render(self, format_: str, ground: str = "white", titled: bool = True) -> bytes:
        """The figure as a file of PNG or SVG, the same bytes each time; untitled unless ``titled``."""
        import matplotlib

        buffer = io.BytesIO()
        metadata = (
            {"Software": None} if format_ == "png" else {"Date": None, "Creator": None}
        )
        style = Path(__file__).parent / "templates" / "figure.mplstyle"
        with (
            matplotlib.rc_context({"svg.hashsalt": self.name}, style),
            warnings.catch_warnings(),
        ):
            warnings.filterwarnings(
                "ignore", "Glyph .* missing"
            )  # a name in a script that the font lacks
            figure = self.paint()
            if titled:
                figure.suptitle(wrapped(self.title, 80))
            figure.savefig(
                buffer, format=format_, dpi=160, facecolor=ground, metadata=metadata
            )
        return buffer.getvalue()


def new_figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def wrapped(text: str, width: int, lines: int = 3) -> str:
    return "\n".join(
        textwrap.wrap(clean(text, 300), width, max_lines=lines, placeholder=" …")
        or [""]
    )


def slug(text: str, longest: int = 60) -> str:
    """A file name made of any text; it may be empty."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:longest]
