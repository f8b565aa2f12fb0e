"""Sensors measured from captures, after EMVA 1288."""

from __future__ import annotations

import difflib
import html
import json
import math
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from . import _petzval, jobs
from ._arguments import flag, not_written, path_of
from ._errors import setting
from ._petzval import Cancel
from ._watch import Progress, watch
from .cameras import _known

if TYPE_CHECKING:
    import pandas

__all__ = ["Figure", "Sheet", "characterize"]


@dataclass(frozen=True)
class Figure:
    """A measured number.

    Attributes:
        name: Name in the EMVA 1288 Python library, such as ``K``.
        section: Section of its report.
        meaning: What it is.
        unit: Unit; empty for pure numbers.
        value: The number; NaN where the captures do not determine it.
        standard_error: Its standard error in the same unit; NaN where none can be stated.
        not_resolved: Why the captures do not determine it; empty if they do.
        library_value: The value as the library derives it, with its mistakes; NaN where it has none.
        linear_gain: Linear gain of the captures.
        colour: Colour of the pixels: ``red``, ``green``, ``blue``, or ``clear`` without filters.
    """

    name: str
    section: str
    meaning: str
    unit: str
    value: float
    standard_error: float
    not_resolved: str
    library_value: float
    linear_gain: float
    colour: str


class Sheet:
    """Every number of a sensor that captures determine, with its standard error. Make it with `characterize`.

    ``sheet["K"]`` is the figure at the gain and of the colour that the page shows in front; `figure` has those of others.
    """

    def __init__(self, core: _petzval.Sheet) -> None:
        self._core = core

    @cached_property
    def characterization(self) -> dict[str, Any]:
        """All numbers, as the schema of the job ``sensor-characterize`` says: ``joint`` has those of all gains together."""
        with watch() as watching:
            found: dict[str, Any] = json.loads(self._core.characterization(watching))
        return found

    @cached_property
    def _front(self) -> tuple[float, str, list[tuple[str, str]], list[str]] | None:
        with watch() as watching:
            return self._core.front(watching)

    @cached_property
    def figures(self) -> tuple[Figure, ...]:
        """Every figure of every gain and colour."""
        found = []
        for gain in self.characterization["gains"]:
            for channel in gain["channels"]:
                found += [_figure(row, gain["linear_gain"], channel["colour"]) for row in channel["figures"]]
        return tuple(found)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The figures as one dict each."""
        return [asdict(figure) for figure in self.figures]

    def to_frame(self) -> pandas.DataFrame:
        """The figures as a table, a row each. Needs pandas."""
        import pandas

        return pandas.DataFrame(self.rows)

    def figure(self, name: str, *, linear_gain: float | None = None, colour: str | None = None) -> Figure:
        """A figure by name.

        Args:
            name: Name, such as ``K``.
            linear_gain: Linear gain; that of the front of the page if left out.
            colour: Colour; that of the front of the page if left out.

        Raises:
            InputError: There is no such figure.
        """
        front_gain, front_colour = (math.nan, "") if self._front is None else self._front[:2]
        gain = front_gain if linear_gain is None else linear_gain
        wanted = front_colour if colour is None else colour
        for found in self.figures:
            if found.name == name and math.isclose(found.linear_gain, gain, rel_tol=1e-9) and found.colour == wanted:
                return found
        names = [found.name for found in self.figures]
        if not names:
            hint = "the captures have no flat frames"
        elif name in names:
            points = sorted({(f.linear_gain, f.colour) for f in self.figures})
            hint = "gains and colours are " + ", ".join(f"{g:g} {c}" for g, c in points)
        else:
            near = difflib.get_close_matches(str(name), names, 3) or list(dict.fromkeys(names))[:8]
            hint = "names are such as " + ", ".join(dict.fromkeys(near))
        raise setting("name", str(name), "there is no such figure", hint)

    def __getitem__(self, name: str) -> Figure:
        return self.figure(name)

    def __contains__(self, name: object) -> bool:
        return any(found.name == name for found in self.figures)

    def __iter__(self) -> Iterator[str]:
        """Names of the figures."""
        return iter(dict.fromkeys(found.name for found in self.figures))

    def __len__(self) -> int:
        return len(set(self))

    @property
    def warnings(self) -> list[str]:
        """What looks odd about the captures."""
        return [str(warning) for warning in self.characterization["warnings"]]

    @cached_property
    def _pages(self) -> dict[str, str]:
        with watch() as watching:
            return dict(self._core.pages(watching))

    @property
    def plots(self) -> dict[str, str]:
        """The plots of the page by name, as text of SVG pictures."""
        return {name.removesuffix(".svg"): text for name, text in self._pages.items() if name.endswith(".svg")}

    def to_toml(self) -> str:
        """The sensor as text of a sensor file, which `petzval.Camera` takes.

        Raises:
            InputError: The captures do not determine K.
        """
        with watch() as watching:
            return self._core.sensor_toml(watching)

    def save_report(self, path: str | os.PathLike[str]) -> Path:
        """Writes the page, one file with all tables and plots; returns its path."""
        file = Path(path_of("path", path))
        try:
            file.write_text(self._pages["report.html"], encoding="utf-8")
        except (OSError, ValueError) as error:
            raise not_written(file, error) from error
        return file

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> list[Path]:
        """Writes every file of ``petzval sensor characterize``: sensor, results, tables, page and plots; returns their paths."""
        with watch() as watching:
            return [Path(path) for path in self._core.save(path_of("folder", folder), flag("overwrite", overwrite), watching)]

    def __repr__(self) -> str:
        sensor = self.characterization["sensor"]["name"]
        gains = len(self.characterization["gains"])
        return f"<Sheet of {sensor!r}: {gains} gain{'' if gains == 1 else 's'}, {len(self.figures)} figures>"

    def _repr_html_(self) -> str:
        title = f"<p>{html.escape(repr(self))}</p>"
        if self._front is None:
            return title
        gain, colour, figures, plots = self._front
        rows = "".join(f"<tr><td>{html.escape(what)}</td><td>{html.escape(value)}</td></tr>" for what, value in figures)
        about = f"<caption>{html.escape(colour)} pixels at linear gain {gain:g}</caption>"
        return f"{title}<table>{about}{rows}</table>{''.join(plots)}"


def characterize(
    folder: str | os.PathLike[str],
    *,
    pixel_um: float | None = None,
    highpass: Literal["none", "r3.1", "r4"] | None = None,
    progress: Progress = False,
    cancel: Cancel | None = None,
    **request: Any,
) -> Sheet:
    """Measures a sensor from captures of flat and dark frames, after EMVA 1288 release 4.0 Linear and Tseng et al. 2021.

    Args:
        folder: Folder of the captures with their list, ``captures.toml`` or ``EMVA1288descriptor.txt``.
        pixel_um: Pixel pitch, um, 0.1 to 1000, if the list does not state it.
        highpass: High-pass before DSNU and PRNU.
        progress: ``True`` for a bar, or a function that takes every event.
        cancel: A flag that another thread may set.
        **request: Further keys of `petzval.requests.SensorCharacterize`, such as ``fit_histograms=True``.

    Raises:
        InputError: The folder has no list of captures, or a frame cannot be read.
    """
    if "out" in request:
        raise setting("out", str(request["out"]), "nothing is written here", "`Sheet.save` writes the files")
    whole = request | _known(dir=folder, pixel_um=pixel_um, highpass=highpass)
    with watch(progress, cancel) as watching:
        return Sheet(_petzval.Sheet(jobs._json(whole), watching))


def _figure(row: dict[str, Any], linear_gain: float, colour: str) -> Figure:
    best = row.get("corrected", row["value"])
    return Figure(
        name=row["name"],
        section=row["section"],
        meaning=row["meaning"],
        unit=row["unit"],
        value=best.get("value", math.nan),
        standard_error=best.get("standard_error", math.nan),
        not_resolved=best.get("not_resolved", ""),
        library_value=row["value"].get("value", math.nan),
        linear_gain=float(linear_gain),
        colour=colour,
    )
