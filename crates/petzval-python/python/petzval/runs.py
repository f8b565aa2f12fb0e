"""Runs: what a design has left in its folder."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval, jobs
from ._arguments import check_unmasked, path_of, paths_of
from ._errors import InputError, setting
from ._petzval import Cancel
from ._pictures import Picture, figure, given, read_picture
from ._watch import Progress, watch
from .cameras import Frames
from .lens import Lens

__all__ = ["Finished", "Run", "RunCamera", "RunPicture"]


@dataclass(frozen=True, repr=False)
class Finished:
    """A finished picture.

    Attributes:
        picture: The picture, sRGB-encoded, 0 to 1, ``[y, x, 3]``.
        shown: The same with what the network reads in it, such as boxes.
        read: Files that say what the network reads, by name; such as the bytes of ``classes.png``.
    """

    picture: NDArray[np.float32]
    shown: NDArray[np.float32]
    read: dict[str, bytes]

    def __repr__(self) -> str:
        height, width, _ = self.picture.shape
        return f"<Finished: {height} x {width} pixels{'; ' if self.read else ''}{', '.join(self.read)}>"

    def _repr_html_(self) -> str:
        shown = np.round(self.shown.clip(0, 1) * 255).astype(np.uint8)
        return figure(shown, repr(self))


@dataclass(frozen=True)
class RunPicture:
    """A picture among those of a run.

    Attributes:
        path: Its file.
        index: Number of the held-out picture; ``None`` for other pictures.
        camera: The camera; ``None`` for the truth.
        state: ``truth``, ``developed`` or ``output``; ``None`` for other pictures.
    """

    path: Path
    index: int | None
    camera: str | None
    state: str | None

    def light(self) -> NDArray[np.float32]:
        """The picture in linear light, ``[y, x, 3]``; 1 is white."""
        return read_picture(self.path)


class RunCamera:
    """A finished camera of a run: lens, sensor, development and network. Make it with `Run.camera`."""

    def __init__(self, core: _petzval.Cameras, run: Run, name: str) -> None:
        self._core = core
        self._run = run
        self.name = name

    @property
    def lens(self) -> Lens:
        """Its lens."""
        return self._run.lens(self.name)

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the sensor."""
        return self._core.size()

    def take(
        self,
        picture: Picture,
        *,
        seed: int | None = None,
        frame: int = 0,
        place: Literal["fill", "centre"] | None = None,
        progress: Progress = False,
    ) -> Finished:
        """Takes a picture through lens, sensor, development and network, as ``petzval apply`` does.

        Args:
            picture: A path, or an array ``[y, x, 3]``: ``uint8`` is sRGB-encoded, floats are linear light where 1 is white.
            seed: Seed of the noise; that of the command if left out.
            frame: Number of the frame: other numbers have other noise.
            place: Whether the picture covers the sensor (``"fill"``, the default of the command), or one pixel lands on one (``"centre"``).
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: The picture is wrong.
        """
        with watch(progress) as watching:
            return _finished(self._core.take(self.name, given(picture), place, seed, frame, watching))

    def develop(self, raw: ArrayLike | str | os.PathLike[str] | Frames, *, progress: Progress = False) -> Finished:
        """A raw frame of the sensor, or a smaller one from its middle, through development and network.

        Args:
            raw: The path of a DNG file or of a raw frame with its sidecar; a frame of `petzval.Camera`; or digital numbers ``[y, x]``, ``uint16``.
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: The sensor cannot have taken the frame.
        """
        with watch(progress) as watching:
            if isinstance(raw, str | os.PathLike):
                return _finished(self._core.develop_file(self.name, os.fspath(raw), watching))
            numbers = _numbers(raw.raw if isinstance(raw, Frames) else raw)
            return _finished(self._core.develop(self.name, numbers, watching))

    def __repr__(self) -> str:
        return f"<RunCamera {self.name!r} of {str(self._run.path)!r}>"


class Run:
    """The folder of a run of ``petzval design``.

    Args:
        folder: The folder.
        accept_changed: Files or folders of the run, by their path below it, that may differ from their digests: a list, or one path. Everything
            else that was changed is refused where it is read.

    Raises:
        InputError: It is not the folder of a run.
    """

    def __init__(self, folder: str | os.PathLike[str], *, accept_changed: str | Sequence[str] = ()) -> None:
        self.path = Path(path_of("folder", folder))
        self.accept_changed = tuple(paths_of("accept_changed", accept_changed))
        self._core = _petzval.Run(str(self.path), list(self.accept_changed))
        _check_in(self.path, self.accept_changed)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Facts: ``name`` of the experiment, ``seed``, ``cameras``, those that are ``finished``, and the ``record`` with ``version``, ``begun`` and
        ``finished``.
        """
        with watch() as watching:
            found: dict[str, Any] = json.loads(self._core.facts(watching))
        return found

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return str(self.facts["name"])

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the finished cameras, in the order of the experiment."""
        return tuple(self.facts["finished"])

    @property
    def is_finished(self) -> bool:
        """Whether every camera is finished."""
        return self.cameras == tuple(self.facts["cameras"])

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """The figures of all cameras, as the schema of the job ``design`` says.

        Raises:
            InputError: The run is not finished, or a file of it was changed.
        """
        with watch() as watching:
            found: dict[str, Any] = json.loads(self._core.metrics(watching))
        return found

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each camera: its scores with their 95 % intervals (``NAME_low``, ``NAME_high``) and the figures of its lens."""
        rows = []
        for camera in self.metrics["rows"]:
            row = {key: value for key, value in camera.items() if not isinstance(value, list | dict)}
            for score, (low, high) in camera.get("intervals", {}).items():
                row |= {f"{score}_low": low, f"{score}_high": high}
            rows.append(row)
        return rows

    @property
    def picture_rows(self) -> list[dict[str, Any]]:
        """A row for each camera and held-out picture with scores of its own."""
        return [
            {"camera": camera["camera"], **picture} for camera in self.metrics["rows"] for picture in camera["pictures"]
        ]

    def lens(self, camera: str | None = None) -> Lens:
        """The lens of a finished camera; without a name, the one that the run began with.

        Raises:
            InputError: There is no finished camera of this name, or a file of it was changed.
        """
        if camera is not None:
            self._check(camera)
        with watch() as watching:
            return Lens(self._core.lens(camera, watching))

    @property
    def lenses(self) -> dict[str, Lens]:
        """The lenses of all finished cameras by name."""
        return {name: self.lens(name) for name in self.cameras}

    def camera(
        self, name: str, *, device: str | None = None, accept_changed: str | Sequence[str] | None = None, progress: Progress = False
    ) -> RunCamera:
        """A finished camera, which takes pictures and develops raw frames.

        Args:
            name: Its name.
            device: Where tensors live; that of the command if left out.
            accept_changed: Files or folders of the run, by their path below it, that may differ from their digests; those of the run if left out.
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: There is no finished camera of this name, or a file of it was changed.
        """
        self._check(name)
        with watch(progress) as watching:
            accepted = self.accept_changed if accept_changed is None else tuple(paths_of("accept_changed", accept_changed))
            _check_in(self.path, accepted)
            core = _petzval.Cameras(os.fspath(self.path), [name], device, list(accepted), watching)
        return RunCamera(core, self, name)

    @property
    def weights(self) -> dict[str, Path]:
        """Files of the weights of networks (safetensors) by camera; cameras without a network are left out."""
        with watch() as watching:
            paths = {name: self._core.weights(name, watching) for name in self.cameras}
        return {name: Path(path) for name, path in paths.items() if path is not None}

    @property
    def pictures(self) -> list[RunPicture]:
        """The pictures that the run keeps: held-out ones of every camera, and others.

        Raises:
            InputError: The run is not finished.
        """
        with watch() as watching:
            found = json.loads(self._core.pictures(watching))
        return [RunPicture(Path(row["path"]), row["index"], row["camera"], row["state"]) for row in found]

    def events(self) -> Iterator[dict[str, Any]]:
        """Every step: ``step``, ``camera``, ``block``, ``losses`` by name, ``learning_rate``, ``seconds``."""
        with watch() as watching:
            found = json.loads(self._core.events(watching))
        yield from found

    def report(self, *, photo: str | os.PathLike[str] | None = None, progress: Progress = False) -> Path:
        """Writes the page of the run again; returns its path.

        Args:
            photo: A photograph that every camera takes over its whole sensor.
            progress: ``True`` for a bar, or a function that takes every event.
        """
        request: dict[str, Any] = {"run": self.path, "accept_changed": self.accept_changed}
        if photo is not None:
            request["photo"] = photo
        return Path(jobs.run("report", request, progress=progress)["report"])

    def evaluate(self, *, progress: Progress = False, cancel: Cancel | None = None, **request: Any) -> dict[str, Any]:
        """Scores the cameras again with exact optics, by the job ``evaluate``.

        Args:
            progress: ``True`` for a bar, or a function that takes every event.
            cancel: A flag that another thread may set.
            **request: Keys of `petzval.requests.Evaluate`, such as ``psf="diffraction"``.
        """
        return jobs.run("evaluate", {"accept_changed": self.accept_changed, **request, "run": self.path}, progress=progress, cancel=cancel)

    def _check(self, camera: str) -> None:
        if camera not in self.cameras:
            hint = f"the run has {', '.join(self.cameras) or 'none yet'}"
            raise setting("camera", str(camera), "there is no finished camera of this name", hint)

    def __repr__(self) -> str:
        return f"<Run {str(self.path)!r}: {self.name}, seed {self.facts['seed']}, cameras {', '.join(self.cameras) or 'none yet'}>"

    def _repr_html_(self) -> str:
        title = f"<p>{html.escape(repr(self))}</p>"
        if not self.cameras:
            return title
        try:
            last = self.lens(self.cameras[-1])._repr_html_()
        except InputError as error:
            return f"{title}<p>{html.escape(str(error))}</p>"
        try:
            scores = [score["name"] for score in self.metrics["scores"]]
        except InputError:
            return title + last
        columns = ["camera", *scores, "rms_spot_um", "efl_mm", "f_number"]
        head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
        body = "".join(f"<tr>{''.join(f'<td>{_cell(row.get(name))}</td>' for name in columns)}</tr>" for row in self.rows)
        return f"{title}<table><tr>{head}</tr>{body}</table>{last}"


def _check_in(run: Path, accepted: Sequence[str]) -> None:
    """Fails if a file or folder that may differ is not in the run: a wrong name would accept nothing, in silence."""
    for name in accepted:
        if not os.path.lexists(run / name):
            raise setting("accept_changed", repr(name), "the run has no such file", "a path below the run, such as cameras/NAME/lens.toml")


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else html.escape("" if value is None else str(value))


def _finished(seen: tuple[NDArray[np.float32], NDArray[np.float32], list[tuple[str, bytes]]]) -> Finished:
    picture, shown, read = seen
    return Finished(picture=picture, shown=shown, read={name: bytes(content) for name, content in read})


def _numbers(raw: ArrayLike) -> NDArray[np.uint16]:
    check_unmasked("raw", raw)
    try:
        array = np.asarray(raw)
    except (ValueError, TypeError) as error:
        raise _no_frame(type(raw).__name__) from error
    if array.ndim != 2 or array.size == 0:
        raise _no_frame(f"of shape {list(array.shape)}")
    if array.dtype.kind not in "ui" or array.min() < 0 or array.max() > 65535:
        raise _no_frame(f"of type {array.dtype}")
    return array.astype(np.uint16, copy=False)


def _no_frame(value: str) -> InputError:
    return setting("raw", value, "is no raw frame", "digital numbers [y, x] as uint16, or a path")
