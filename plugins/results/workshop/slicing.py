"""Ask a slicer what printing takes: the command line of PrusaSlicer, or of another that takes its options."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.support.text import clean, count_words
from core.values.materials import Material
from core.values.printers import Printer
from plugins.results.workshop.plates import Plate, arrange, to_3mf
from plugins.results.workshop.printing import (
    PLA_G_PER_CM3,
    Check,
    PrintedPart,
)
from plugins.results.workshop.texts import filled

UNASKED = "no slicer was asked what printing takes: slice=prusa-slicer (apt-get install prusa-slicer)"
LIMIT_S = 900.0  # for a plate
LINE_MM = 0.45  # the width of a line of a nozzle of 0.4 mm
MOST_BYTES = 400_000_000  # of a file of toolpaths

_TIME = re.compile(r"^; estimated printing time \(normal mode\) = (.+)$", re.MULTILINE)
_GRAMS = re.compile(r"^; filament used \[g\] = ([\d.]+)", re.MULTILINE)
_UNITS = {"d": 86400, "h": 3600, "m": 60, "s": 1}
_SAYS = re.compile(r"warning|error|empty|outside|fail|stability|loose", re.IGNORECASE)


@dataclass(frozen=True)
class Sliced:
    """What a slicer says of a plate.

    Attributes:
        parts: their names.
        hours: that printing takes.
        grams: of filament.
        support_g: of that, in supports.
        warnings: the slicer's own words.
    """

    parts: tuple[str, ...]
    hours: float
    grams: float
    support_g: float
    warnings: tuple[str, ...]


def find_slicer(program: str) -> Path:
    """Find a slicer's program, by its name on the PATH or by its file.

    Raises:
        UserError: it isn't there.
    """
    found = shutil.which(program)
    if found is None:
        raise UserError(
            f"{program}: no such program; install one (apt-get install prusa-slicer), or name its file in slicer=FILE"
        )

    return Path(found)


def slice_plates(
    slicer: Path,
    plates: Sequence[Plate],
    printer: Printer,
    material: Material,
    limit_s: float = LIMIT_S,
) -> list[Sliced]:
    """Slice plates, one after the other.

    Args:
        slicer: the program.
        plates: with what lies on them.
        printer: whose profile counts.
        material: of the tool.
        limit_s: for each plate, seconds.

    Raises:
        UserError: the slicer fails, does not end, or is another program.
    """
    found = []
    with tempfile.TemporaryDirectory(prefix="vlmgineer_slice_") as name:
        folder = Path(name)
        profile = folder / "profile.ini"
        profile.write_text(write_profile(printer, material), encoding="utf-8")
        words = ["--load", str(profile)]
        if printer.profile:
            own = Path(printer.profile).expanduser()
            if not own.is_file():
                raise UserError(f"printer.profile={printer.profile}: no such file")
            words += ["--load", str(own.resolve())]

        for plate in plates:
            file = folder / "plate.3mf"
            file.write_bytes(to_3mf([plate], printer))
            paths = folder / "plate.gcode"
            paths.unlink(missing_ok=True)
            options = ["--export-gcode", *words, "--dont-arrange", "-o", str(paths)]
            said = _run([str(slicer), *options, str(file)], folder, limit_s)
            names = tuple(part.name for part, _ in plate.parts)
            found.append(_read(slicer, paths, said, names))

    return found


def write_profile(printer: Printer, material: Material) -> str:
    """Write the settings of a printer and a material, as PrusaSlicer reads them."""
    density = material.density_kg_m3 or 1000 * PLA_G_PER_CM3
    return filled(
        "slicer.ini.j2",
        printer=printer,
        perimeters=max(2, round(material.wall_mm / LINE_MM)),
        infill=round(100 * material.infill),
        density=density / 1000,
    )


def _run(command: Sequence[str], folder: Path, limit_s: float) -> str:
    """Run a slicer, and return what it said.

    Raises:
        UserError: it fails, or does not end.
    """
    name = Path(command[0]).name
    try:
        done = subprocess.run(  # noqa: S603
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            timeout=limit_s,
        )
    except OSError as error:
        raise UserError(f"{command[0]} can't be run: {error}") from error
    except subprocess.TimeoutExpired as error:
        raise UserError(
            f"{name} has not sliced a plate in {limit_s:g} s, and was ended"
        ) from error

    if done.returncode != 0:
        last = clean(done.stdout.strip()[-300:], 300)
        raise UserError(f"{name} failed with status {done.returncode}: {last}")

    return done.stdout


def _read(slicer: Path, paths: Path, said: str, names: tuple[str, ...]) -> Sliced:
    """Read what a slicer wrote of a plate.

    Args:
        slicer: the program.
        paths: the file of toolpaths.
        said: what the program said.
        names: of the parts.

    Raises:
        UserError: there are no toolpaths of PrusaSlicer.
    """
    other = f"{slicer} is no PrusaSlicer, or one that does not say what printing takes"
    if not paths.is_file() or paths.stat().st_size > MOST_BYTES:
        raise UserError(f"{other}: it wrote no toolpaths")

    text = paths.read_text("utf-8", "replace")
    time = _TIME.search(text)
    grams = _GRAMS.search(text)
    if time is None or grams is None:
        raise UserError(f"{other}: its toolpaths name no time or no filament")

    seconds = 0.0
    for number, unit in re.findall(r"(\d+)([dhms])", time[1]):
        seconds += int(number) * _UNITS[unit]

    total, support = _measure_filament(text)
    share = support / total if total > 0 else 0.0
    lines = [clean(line, 300) for line in said.splitlines() if _SAYS.search(line)]

    return Sliced(
        parts=names,
        hours=round(seconds / 3600, 2),
        grams=float(grams[1]),
        support_g=round(share * float(grams[1]), 2),
        warnings=tuple(dict.fromkeys(lines)),
    )


def _measure_filament(text: str) -> tuple[float, float]:
    """Measure the filament that toolpaths with relative steps push in all, and in supports, mm."""
    total = support = 0.0
    in_support = False
    for line in text.splitlines():
        if line.startswith(";TYPE:"):
            in_support = "Support" in line
        elif line.startswith("G1 ") and " E" in line:
            pushed = float(line.partition(" E")[2].split()[0])
            total += pushed
            if in_support:
                support += pushed

    return total, support


def ask_slicer(
    slicer: Path | None,
    parts: Sequence[PrintedPart],
    printer: Printer,
    material: Material,
) -> tuple[dict[str, Any], list[Check]]:
    """Return what a slicer says of parts, as data of the sheet and as checks; it fails where the slicer does.

    Args:
        slicer: the program; None: none was asked.
        parts: as they lie.
        printer: whose plates and profile count.
        material: of the parts; metal is not sliced.
    """
    if not parts or material.is_metal:
        return {}, []
    if slicer is None:
        return {}, [Check("sliced", None, UNASKED)]

    try:
        slices = slice_plates(slicer, arrange(parts, printer), printer, material)
    except UserError as error:
        return {}, [Check("sliced", False, str(error))]

    hours = sum(plate.hours for plate in slices)
    grams = sum(plate.grams for plate in slices)
    support = sum(plate.support_g for plate in slices)
    plates = count_words(len(slices), "plate")
    takes = f"{hours:.1f} h, {grams:.0f} g, of which {support:.0f} g are supports"
    checks = [Check("sliced", True, f"{slicer.name}: {plates}, {takes}")]
    for number, plate in enumerate(slices, 1):
        for warning in plate.warnings:
            checks.append(Check("slicer warns", None, warning, "", f"plate {number}"))

    data = {
        "slicer": slicer.name,
        "hours": round(hours, 2),
        "grams": round(grams, 1),
        "support_g": round(support, 1),
        "plates": [asdict(plate) for plate in slices],
    }
    return data, checks
