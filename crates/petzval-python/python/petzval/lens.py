"""Lenses: read, changed, looked at, optimised and toleranced."""

from __future__ import annotations

import html
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval, jobs
from ._arguments import count, finite, json_of, made_by, not_written, of_class, path_of, paths_of, placed, real, reals, shaped
from ._arguments import text as checked_text
from ._errors import Stopped, setting
from ._petzval import Cancel
from ._watch import Progress, watch

__all__ = ["Coordinate", "DesignSpace", "Lens", "Mtf", "Optimized", "Spots", "Surface", "Tolerance", "Variable", "Wavefront"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """A surface of a lens.

    Attributes:
        radius_mm: Radius of curvature; infinite where it is flat.
        conic: Conic constant.
        asphere: Coefficients of r^2, r^4, ..., r^16, in mm^-1, mm^-3, ...
        thickness_mm: Distance to the next vertex; of the last one, to the image plane.
        glass: The medium behind it; ``AIR`` for air.
        semi_diameter_mm: Clear radius.
        is_stop: Whether it is the aperture stop.
        label: What it is called; may be empty.
    """

    radius_mm: float
    conic: float
    asphere: tuple[float, ...]
    thickness_mm: float
    glass: str
    semi_diameter_mm: float
    is_stop: bool
    label: str


@dataclass(frozen=True, eq=False)
class Spots:
    """Spot diagrams by field.

    Attributes:
        fields_deg: Fields, degrees, ``[field]``.
        rms_um: RMS radius of all wavelengths together about their centroid, um, ``[field]``.
        rms_by_wavelength_um: The same of each wavelength about its own centroid, um, ``[field, wavelength]``.
        centroid_um: Centroid from the chief ray, x and y, um, ``[field, 2]``.
        chief_mm: Where the chief ray lands, x and y, mm, ``[field, 2]``.
        airy_um: Radius of the first dark ring of a perfect lens, um.
        points_um: Rays from the chief ray, um: of each field and wavelength an array ``[ray, 2]``.
    """

    fields_deg: Array
    rms_um: Array
    rms_by_wavelength_um: Array
    centroid_um: Array
    chief_mm: Array
    airy_um: float
    points_um: list[list[Array]] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Mtf:
    """Modulation by field and frequency.

    Modulations are ``[field, frequency]``, 0 to 1, of all wavelengths together.

    Attributes:
        fields_deg: Fields, degrees, ``[field]``.
        per_mm: Frequencies, cycles/mm, ``[frequency]``.
        sagittal: Modulation by waves of patterns that vary across the plane of the field; NaN where there are no waves.
        tangential: The same of patterns that vary along it.
        geometric_sagittal: Modulation by rays.
        geometric_tangential: The same along the plane of the field.
        limit_sagittal: What a lens without aberrations has by diffraction.
        limit_tangential: The same along the plane of the field.
    """

    fields_deg: Array
    per_mm: Array
    sagittal: Array
    tangential: Array
    geometric_sagittal: Array
    geometric_tangential: Array
    limit_sagittal: Array
    limit_tangential: Array


@dataclass(frozen=True, eq=False)
class Wavefront:
    """Wavefronts by field and wavelength, in waves.

    Attributes:
        rms_waves: RMS about the mean, ``[field, wavelength]``.
        rms_centroid_waves: RMS without tilt.
        peak_to_valley_waves: Highest minus lowest value.
        strehl: Strehl ratio; NaN where the wavefront is too rough.
        zernike_waves: Fringe coefficients, ``[field, wavelength, 37]``; NaN where they are not determined.
    """

    fields_deg: Array
    wavelengths_um: Array
    rms_waves: Array
    rms_centroid_waves: Array
    peak_to_valley_waves: Array
    strehl: Array
    zernike_waves: Array


@dataclass(frozen=True)
class Variable:
    """A number of a surface that may move between two bounds, as a lens file states them: radii in mm, tilts in degrees."""

    surface: int
    number: str
    min: float
    max: float


@dataclass(frozen=True)
class Coordinate:
    """What a free coordinate stands for, and its bounds; ``None`` where there is none."""

    name: str
    min: float | None
    max: float | None


class Lens:
    """A lens. It never changes: what would change it gives another one.

    Make it with `load` or `parse`.
    """

    def __init__(self, core: _petzval.Lens) -> None:
        self._core = made_by(core, _petzval.Lens, "petzval.Lens.load(PATH) or petzval.Lens.parse(TEXT)")

    @classmethod
    def load(cls, name: str | os.PathLike[str], *, glasses: Sequence[str | os.PathLike[str]] = ()) -> Lens:
        """Reads a lens: a built-in name, or a file of Petzval (``.toml``), OpticStudio (``.zmx``), CODE V (``.seq``) or Optiland (``.json``).

        What the file says and the lens does not hold is a `PetzvalWarning` each.

        Args:
            name: Path or built-in name; ``petzval.jobs.run("lens-list")`` lists these.
            glasses: Glass catalogues (``.agf``, ``.toml``, ``.yml`` or folders) whose glasses take precedence.

        Raises:
            InputError: The file is wrong; its place is in the error.
        """
        path, catalogues = path_of("name", name), paths_of("glasses", glasses)
        with watch() as watching, placed("name", path, "give a file that exists, or a built-in name"):
            return cls(_petzval.Lens.load(path, catalogues, watching))

    @classmethod
    def parse(
        cls,
        text: str,
        format: Literal["toml", "zmx", "seq", "json"] = "toml",
        *,
        glasses: Sequence[str | os.PathLike[str]] = (),
    ) -> Lens:
        """Reads the text of a lens file, as `load` reads the file."""
        for key, value in (("text", text), ("format", format)):
            checked_text(key, value, "the text of a lens file, and its format")
        with watch() as watching:
            return cls(_petzval.Lens.parse(text, format, paths_of("glasses", glasses), watching))

    @cached_property
    def _facts(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads(self._core.facts())
        return facts

    @property
    def name(self) -> str:
        """What it is called."""
        return str(self._facts["name"])

    @property
    def source(self) -> str:
        """Where its numbers come from."""
        return str(self._facts["source"])

    @property
    def efl_mm(self) -> float:
        """Effective focal length, mm; infinite where the lens is afocal."""
        return _or(self._facts["efl_mm"], math.inf)

    @property
    def bfl_mm(self) -> float:
        """From the last vertex to the rear focal point, mm; infinite where the lens is afocal."""
        return _or(self._facts["bfl_mm"], math.inf)

    @property
    def f_number(self) -> float:
        """Focal length over entrance pupil diameter."""
        return _or(self._facts["f_number"], math.inf)

    @property
    def entrance_pupil_mm(self) -> float:
        """Entrance pupil diameter, mm."""
        return float(self._facts["entrance_pupil_mm"])

    @property
    def reference_um(self) -> float:
        """Wavelength of first-order properties and of the reference chief ray, um."""
        return float(self._facts["reference_um"])

    @property
    def wavelengths_um(self) -> Array:
        """Wavelengths in which it is judged, um, ``[wavelength]``."""
        return np.array(self._facts["wavelengths_um"])

    @property
    def fields_deg(self) -> Array:
        """Fields at which it is judged, degrees, ``[field]``."""
        return np.array(self._facts["fields_deg"])

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """Its surfaces in the order that light meets them."""
        return tuple(
            Surface(
                radius_mm=_or(row["radius_mm"], math.inf),
                conic=row["conic"],
                asphere=tuple(row["asphere"]),
                thickness_mm=row["thickness_mm"],
                glass=row["glass"],
                semi_diameter_mm=row["semi_diameter_mm"],
                is_stop=row["is_stop"],
                label=row["label"],
            )
            for row in self._facts["surfaces"]
        )

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Every figure that ``petzval lens show`` prints, by name."""
        found: dict[str, Any] = self._run("lens-show", {})["figures"]
        return found

    def to_toml(self) -> str:
        """The lens as text of a lens file of Petzval."""
        return self._core.toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a lens file of Petzval (``.toml``), OpticStudio (``.zmx``) or CODE V (``.seq``), by the ending of its name.

        What the format cannot hold is a `PetzvalWarning` each. The file is whole or not there.
        """
        path = Path(path_of("path", path))
        with tempfile.TemporaryDirectory() as folder:
            own = Path(folder) / "lens.toml"
            own.write_text(self.to_toml(), encoding="utf-8")
            request = {"from": own, "to": path}
            jobs.run("lens-convert", request, glasses=self._core.glasses(), overwrite=True)

    def with_(
        self,
        surface: int | None = None,
        *,
        wavelengths_um: ArrayLike | None = None,
        fields_deg: ArrayLike | None = None,
        **numbers: float,
    ) -> Lens:
        """The lens with other numbers of a surface, or with other wavelengths or fields.

        Args:
            surface: The surface, from 0.
            wavelengths_um: Wavelengths, um, ascending.
            fields_deg: Fields, degrees, ascending.
            **numbers: By the names of lens files, such as ``radius_mm=-31.0`` or ``thickness_mm=2.0``.

        Raises:
            InputError: There is no such surface or number, or the lens could not be built.
        """
        if numbers and surface is None:
            raise setting("surface", "", "which surface has the numbers?", "its number, from 0")
        index = 0 if surface is None else count("surface", surface, "surfaces are counted from 0")
        changes = [(index, name, _number_of_surface(name, value)) for name, value in numbers.items()]
        with watch() as watching:
            core = self._core.changed(
                changes, _floats("wavelengths_um", wavelengths_um), _floats("fields_deg", fields_deg), watching
            )
        return Lens(core)

    def focused(self, at: Literal["best", "paraxial"] = "best") -> Lens:
        """The lens with its image plane elsewhere, by the job ``lens-focus``.

        Args:
            at: ``"best"``: where the mean squared spot over the fields is least; ``"paraxial"``: at the paraxial image of the reference wavelength.

        Raises:
            InputError: `at` is none of these, or the lens has no focus there.
        """
        with tempfile.TemporaryDirectory() as folder:
            to = Path(folder) / "focused.toml"
            self._run("lens-focus", {"focus": at, "to": to})
            return Lens.load(to, glasses=self._core.glasses())

    def layout_svg(self, path: str | os.PathLike[str] | None = None, *, px_per_mm: float | None = None) -> str:
        """The cross-section with rays, as text of an SVG picture; also written to `path` if one is given."""
        if px_per_mm is not None and not 0.0 < real("px_per_mm", px_per_mm) < 1e4:
            raise setting("px_per_mm", str(px_per_mm), "is out of range", "above 0, such as 10")
        with watch() as watching:
            svg = self._core.layout_svg(px_per_mm, watching)
        if path is not None:
            file = Path(path_of("path", path))
            try:
                file.write_text(svg, encoding="utf-8")
            except (OSError, ValueError) as error:
                raise not_written(file, error) from error
        return svg

    def spots(self, fields_deg: ArrayLike | None = None) -> Spots:
        """Spot diagrams through the real stop.

        Args:
            fields_deg: Fields, degrees; those of the lens if left out.
        """
        fields = self._fields(fields_deg)
        with watch() as watching:
            found = json.loads(self._core.spots(fields, watching))
        return Spots(
            fields_deg=np.array(fields),
            rms_um=_array(found, "rms_um"),
            rms_by_wavelength_um=_array(found, "rms_by_wavelength_um"),
            centroid_um=_array(found, "centroid_um"),
            chief_mm=_array(found, "chief_mm"),
            airy_um=float(found[0]["airy_radius_um"]),
            points_um=[[np.array(rays).reshape(-1, 2) for rays in field["points_um"]] for field in found],
        )

    def mtf(self, per_mm: ArrayLike, fields_deg: ArrayLike | None = None) -> Mtf:
        """Modulation at frequencies, all wavelengths of the lens together.

        Args:
            per_mm: Frequencies on the image plane, cycles/mm.
            fields_deg: Fields, degrees; those of the lens if left out.
        """
        fields = self._fields(fields_deg)
        frequencies = reals("per_mm", per_mm, "frequency")
        with watch() as watching:
            found = json.loads(self._core.mtf(fields, frequencies, watching))

        def curves(kind: str, section: str) -> Array:
            none = [math.nan] * len(frequencies)
            return np.array([none if field[kind] is None else field[kind][section] for field in found])

        return Mtf(
            fields_deg=np.array(fields),
            per_mm=frequencies,
            sagittal=curves("diffraction", "sagittal"),
            tangential=curves("diffraction", "tangential"),
            geometric_sagittal=curves("geometric", "sagittal"),
            geometric_tangential=curves("geometric", "tangential"),
            limit_sagittal=curves("limit", "sagittal"),
            limit_tangential=curves("limit", "tangential"),
        )

    def wavefront(self, fields_deg: ArrayLike | None = None) -> Wavefront:
        """Wavefronts about the chief ray of each wavelength.

        Args:
            fields_deg: Fields, degrees; those of the lens if left out.
        """
        fields = self._fields(fields_deg)
        with watch() as watching:
            found = json.loads(self._core.wavefront(fields, watching))
        terms = 37
        zernike = [[[math.nan] * terms if z is None else z for z in field["zernike_waves"]] for field in found]
        return Wavefront(
            fields_deg=np.array(fields),
            wavelengths_um=self.wavelengths_um,
            rms_waves=_array(found, "rms_waves"),
            rms_centroid_waves=_array(found, "rms_centroid_waves"),
            peak_to_valley_waves=_array(found, "peak_to_valley_waves"),
            strehl=_array(found, "strehl"),
            zernike_waves=np.array(zernike, dtype=np.float64),
        )

    def variables(
        self,
        variables: Sequence[Variable] | None = None,
        *,
        efl: Literal["held", "free"] | int = "held",
        focus: Literal["paraxial", "free", "fixed"] = "paraxial",
        defocus_mm: float | None = None,
        element_edge_mm: float | None = 0.8,
        element_centre_mm: float | None = None,
        air_gap_mm: float | None = 0.05,
        back_focal_mm: tuple[float, float] | None = None,
        track_mm: float | None = None,
        distortion: float | None = None,
        held_field_deg: float | None = None,
        held_share: float = 0.003,
    ) -> DesignSpace:
        """The lenses that this one may become.

        Args:
            variables: What may move. Those of the lens file if left out; or, where it names none, radii, air gaps and aspheres near their own values.
            efl: ``"held"``: the solve of the lens file, or the last curved surface, holds the focal length or, of a near object, the
                magnification; a number: this surface holds the focal length; ``"free"``: none does.
            focus: ``"paraxial"``: the image plane stands at the paraxial image, and a defocus is a coordinate; ``"free"``: its distance is one;
                ``"fixed"``: it stays at its distance from the last vertex.
            defocus_mm: Greatest defocus to both sides, mm. Left out, it is 0.5, or twice that of the lens where this is above 0.4.
            element_edge_mm: Least edge thickness of elements, mm; ``None`` for no limit, as in all limits.
            element_centre_mm: Least thickness of elements on the axis, mm.
            air_gap_mm: Least air between surfaces, mm.
            back_focal_mm: Least and greatest back focal length, mm, positive in the direction of the light.
            track_mm: Greatest distance between any two of the vertices and the image plane, mm; in space where mirrors bend the axis.
            distortion: Greatest distortion of the outermost field, a share.
            held_field_deg: A field whose image height stays as it is, degrees: it holds the field of view.
            held_share: By how much of itself that height may change.
        """
        if isinstance(efl, bool) or not (isinstance(efl, int) or efl in ("held", "free")):
            raise setting("efl", repr(efl), "holds no focal length", '"held", "free" or the number of a surface')
        if isinstance(efl, int) and not 0 <= efl < len(self.surfaces):
            raise setting("efl", str(efl), "there is no such surface", f"surfaces are numbered from 0 to {len(self.surfaces) - 1}")
        defocus_range = self._usual_defocus_mm() if defocus_mm is None else finite("defocus_mm", defocus_mm)
        if defocus_range is not None and defocus_range < 0.0:
            raise setting("defocus_mm", str(defocus_mm), "is negative", "the greatest defocus to both sides, in mm")
        plan: dict[str, Any] = {
            "variables": None if variables is None else [_variable(place, v) for place, v in enumerate(variables)],
            "efl_surface": efl if isinstance(efl, int) else None,
            "is_efl_free": efl == "free",
            "focus": checked_text("focus", focus, '"fixed", "free" or "paraxial"'),
            "defocus_mm": defocus_range,
            "element_edge_mm": finite("element_edge_mm", element_edge_mm),
            "element_centre_mm": finite("element_centre_mm", element_centre_mm),
            "air_gap_mm": finite("air_gap_mm", air_gap_mm),
            "back_focal_mm": shaped("back_focal_mm", back_focal_mm, (2,)),
            "track_mm": finite("track_mm", track_mm),
            "distortion": finite("distortion", distortion),
            "held_field_deg": finite("held_field_deg", held_field_deg),
            "held_share": finite("held_share", held_share),
        }
        return DesignSpace(_petzval.DesignSpace(self._core, json_of("variables", plan, "numbers and texts")))

    def optimize(
        self,
        out: str | os.PathLike[str] | None = None,
        *,
        goal: Mapping[str, Any] | None = None,
        search: bool = False,
        seed: int | None = None,
        progress: Progress = False,
        cancel: Cancel | None = None,
        **request: Any,
    ) -> Optimized:
        """The lens optimised within limits, by the job ``lens-optimize``.

        Args:
            out: Folder for the history, with which an interrupted optimisation goes on. If left out, the history is in a temporary folder, which is
                removed at the end; after a `Stopped` it stays, and is yours to remove.
            goal: What the lens has to be, such as ``{"edge": 0.8, "track": 60.0}``; the schema of the job has all keys.
            search: Whether to search the whole of the bounds, not only downhill from the lens.
            seed: Seed of the search.
            progress: ``True`` for a bar, or a function that takes every event.
            cancel: A flag that another thread may set.
            **request: Further keys of the job, such as ``iterations=50`` or ``rounds=100``; see `petzval.requests.LensOptimize`.

        Raises:
            InputError: An argument is wrong, or the lens has no image.
            Stopped: The flag was set. Its `kept` names the folder with the best lens so far, and ``petzval.jobs.run("lens-optimize", stopped.resume)``
                goes on.
        """
        if not (goal is None or isinstance(goal, Mapping)):
            raise setting("goal", repr(goal), f"is of the type {type(goal).__name__}", 'such as {"edge": 0.8, "track": 60.0}')
        with _kept_if_stopped() if out is None else nullcontext(Path(out)) as kept:
            new: dict[str, Any] = {"lens": {"toml": self.to_toml()}, "out": kept, "goal": dict(goal or {}), "global": search}
            if seed is not None:
                new["seed"] = seed
            asked = {**request, "start": {"new": new}}
            response = jobs.run(
                "lens-optimize", asked, glasses=self._core.glasses(), progress=progress, cancel=cancel
            )
            best = Lens.load(response["found"]["lens"], glasses=self._core.glasses())
        if out is None:
            response["found"] = {key: value for key, value in response["found"].items() if key not in ("lens", "page")}
        return Optimized(lens=best, response=response)

    def tolerance(self, *, progress: Progress = False, cancel: Cancel | None = None, **request: Any) -> Tolerance:
        """Sensitivities of the lens, and lenses made at random, by the job ``lens-tolerance``.

        Args:
            progress: ``True`` for a bar, or a function that takes every event.
            cancel: A flag that another thread may set.
            **request: Further keys of the job, such as ``grade="commercial"``, ``trials=1000`` or ``seed=0``; see
                `petzval.requests.LensTolerance`. With ``list_trials=False`` the random lenses are not listed one by one.
        """
        whole = {"list_trials": True, **request}
        response = self._run("lens-tolerance", whole, progress=progress, cancel=cancel)
        return Tolerance(response, {**whole, "lens": {"toml": self.to_toml()}}, self._core.glasses())

    def _usual_defocus_mm(self) -> float:
        own = abs(self.surfaces[-1].thickness_mm - self.bfl_mm)
        return 2.0 * own if math.isfinite(own) and own > 0.4 else 0.5

    def _run(self, job: str, request: Mapping[str, Any], **how: Any) -> dict[str, Any]:
        asked = {**request, "lens": {"toml": self.to_toml()}}
        return jobs.run(job, asked, glasses=self._core.glasses(), **how)

    def _fields(self, fields_deg: ArrayLike | None) -> Array:
        return self.fields_deg if fields_deg is None else reals("fields_deg", fields_deg, "field")

    def __repr__(self) -> str:
        return f"<Lens {self.name!r}: {len(self.surfaces)} surfaces, {self.efl_mm:.4g} mm, f/{self.f_number:.3g}>"

    def _repr_html_(self) -> str:
        return f"<figure>{self.layout_svg()}<figcaption>{html.escape(repr(self))}</figcaption></figure>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Lens) and (self.to_toml(), self._core.glasses()) == (other.to_toml(), other._core.glasses())

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.to_toml(), self._core.glasses())


@contextmanager
def _kept_if_stopped() -> Iterator[Path]:
    """A folder for the time of a job. If the job was stopped and has kept something there, the folder stays: the exception names it."""
    folder = Path(tempfile.mkdtemp(prefix="petzval-"))
    stays = False
    try:
        yield folder / "optimised"
    except Stopped as stopped:
        stays = any(path.exists() for path in stopped.kept)
        raise
    finally:
        if not stays:
            shutil.rmtree(folder, ignore_errors=True)


def _again(toml: str, glasses: list[str]) -> Lens:
    return Lens.parse(toml, glasses=glasses)


def _space_again(lens: Lens, plan: str) -> DesignSpace:
    return DesignSpace(_petzval.DesignSpace(lens._core, plan))


class DesignSpace:
    """The lenses that a lens may become, by free coordinates without bounds.

    A coordinate of 0 is the middle between the bounds of its number; the map is the sine, so that no step leaves the bounds. Make it with
    `Lens.variables`.
    """

    def __init__(self, core: _petzval.DesignSpace) -> None:
        self._core = made_by(core, _petzval.DesignSpace, "petzval.Lens.variables")

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """What each coordinate stands for."""
        return tuple(Coordinate(**row) for row in json.loads(self._core.describe()))

    @property
    def start(self) -> Array:
        """The coordinates of the lens that the space was made of, ``[coordinate]``."""
        return self._core.start()

    def lens_at(self, x: ArrayLike) -> Lens:
        """The lens at coordinates ``[coordinate]``. Pickups and solves follow.

        Raises:
            InputError: The coordinates are not finite or too many, or no curvature gives the focal length.
        """
        return Lens(self._core.lens_at(reals("x", x, "coordinate")))

    def coordinates_of(self, lens: Lens) -> Array:
        """The coordinates of a lens with the same surfaces, moved inside the bounds: not onto them, where the map has no slope."""
        return self._core.coordinates_of(of_class("lens", lens, Lens, "petzval.Lens.load(PATH) gives one")._core)

    def penalty(self, x: ArrayLike) -> tuple[float, Array]:
        """The sum of the squares of all violations of limits, mm^2, and its derivatives by the coordinates."""
        return self._core.penalty(reals("x", x, "coordinate"))

    def __len__(self) -> int:
        return len(self.coordinates)

    def __deepcopy__(self, memo: dict[int, Any]) -> DesignSpace:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        lens, plan = self._core.parts()
        return _space_again, (Lens(lens), plan)

    def __repr__(self) -> str:
        return f"<DesignSpace of {len(self)} coordinates: {', '.join(c.name for c in self.coordinates)}>"


@dataclass(frozen=True)
class Optimized:
    """An optimised lens, and the response of the job.

    Attributes:
        lens: The best lens.
        response: The response of the job. ``found`` names the files ``lens`` and ``page`` only if the optimisation had a folder to keep them in.
    """

    lens: Lens
    response: dict[str, Any]

    def _repr_html_(self) -> str:
        return self.lens._repr_html_()


class Tolerance:
    """What errors of making do to a lens."""

    def __init__(self, response: dict[str, Any], request: dict[str, Any], glasses: list[str]) -> None:
        self.response = response
        """The whole response of the job, as its schema says."""
        self._request = request
        self._glasses = glasses

    @property
    def sensitivities(self) -> list[dict[str, Any]]:
        """A row for each error: its name, unit and effect. ``pandas.DataFrame`` takes it as it is."""
        rows: list[dict[str, Any]] = self.response["report"]["sensitivities"]
        return rows

    @cached_property
    def trials(self) -> list[dict[str, Any]]:
        """A row for each random lens. ``pandas.DataFrame`` takes it as it is.

        Keys are ``trial``; the merit, ``merit_um`` for the RMS spot and ``merit`` for the MTF; ``set: NAME (UNIT)`` for every compensator, such as
        ``set: image distance (mm)``; and ``NAME (UNIT)`` for every error, such as ``surface 1 thickness (mm)``. Without an image, merit and
        compensators are NaN. Empty if the request did not list the lenses.
        """
        found = self.response.get("trials")
        if found is None:
            return []
        unit = self.response["report"]["unit"]
        merit = f"merit_{unit}" if unit else "merit"
        set_to = [f"set: {_with_unit(row)}" for row in found["compensators"]]
        off = [_with_unit(row) for row in found["errors"]]
        nowhere = [math.nan] * len(set_to)
        return [
            {
                "trial": number,
                merit: _or(lens["merit"], math.nan),
                **dict(zip(set_to, lens["compensators"] or nowhere, strict=True)),
                **dict(zip(off, lens["errors"], strict=True)),
            }
            for number, lens in enumerate(found["lenses"])
        ]

    def lens(self, trial: int) -> Lens:
        """The random lens of a number, from 0, made again with its compensators set.

        Raises:
            InputError: There is no such lens, or it brings no image.
        """
        number = count("trial", trial, "lenses are counted from 0")
        with watch() as watching:
            return Lens(_petzval.lens_of_trial(jobs._json(self._request), number, self._glasses, watching))


def _variable(place: int, variable: Any) -> dict[str, Any]:
    """A variable as the binary part takes it."""
    name = f"variables[{place}]"
    if not isinstance(variable, Variable):
        hint = 'such as petzval.Variable(0, "radius_mm", 10.0, 14.0)'
        raise setting(name, repr(variable), f"is of the type {type(variable).__name__}", hint)
    least, most = real(f"{name}.min", variable.min), real(f"{name}.max", variable.max)
    if not least < most:
        raise setting(name, f"from {least:g} to {most:g}", "has no room to move", "min is below max")
    return {"surface": count(f"{name}.surface", variable.surface), "number": variable.number, "min": least, "max": most}


def _with_unit(quantity: dict[str, Any]) -> str:
    return f"{quantity['name']} ({quantity['unit']})" if quantity["unit"] else str(quantity["name"])


def _or(value: float | None, other: float) -> float:
    return other if value is None else float(value)


def _number_of_surface(name: str, value: Any) -> float:
    if name == "glass":
        raise setting("glass", repr(value), "is no number", "change the glass in the text: Lens.parse(lens.to_toml().replace(..))")
    return real(name, value)


def _floats(name: str, values: ArrayLike | None) -> list[float] | None:
    return None if values is None else reals(name, values, name.partition("_")[0][:-1]).tolist()


def _array(rows: list[dict[str, Any]], key: str) -> Array:
    """What every row has under a key; null is NaN."""
    return np.array([row[key] for row in rows], dtype=np.float64)
