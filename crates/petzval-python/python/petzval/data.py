"""Data sets for object detection: checked, and converted to COCO's format."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from . import jobs
from ._petzval import Cancel
from ._watch import Progress
from .cameras import _known

__all__ = ["Checked", "Converted", "check", "convert"]


@dataclass(frozen=True)
class Checked:
    """What a data set holds, and what is wrong with it.

    Attributes:
        annotations: The file of annotations.
        statistics: What can be used: ``images``, ``boxes``, ``classes`` and more, as the schema of ``data-check`` says.
        defects: What was found wrong, errors first; one dict each.
        errors: Cases that cannot be used.
        taken: What the classes of an experiment take of it, if one was named.
        page: The page with samples, if a folder was named.
    """

    annotations: Path
    statistics: dict[str, Any]
    defects: list[dict[str, Any]]
    errors: int
    taken: dict[str, Any] | None
    page: Path | None


@dataclass(frozen=True)
class Converted:
    """A converted data set.

    Attributes:
        annotations: The file of annotations.
        linked: Pictures that are hard links to the given files.
        copied: Pictures that are copies.
        statistics: What the data set holds, as in `Checked`.
        defects: What was found wrong; what cannot be used is not in the data set.
        errors: Cases that cannot be used.
    """

    annotations: Path
    linked: int
    copied: int
    statistics: dict[str, Any]
    defects: list[dict[str, Any]]
    errors: int


def check(
    path: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    samples: int | None = None,
    classes_of: str | os.PathLike[str] | dict[str, Any] | None = None,
    overwrite: bool = False,
    progress: Progress = False,
    cancel: Cancel | None = None,
) -> Checked:
    """Reads and checks annotations and pictures of a data set in COCO's format, by the job ``data-check``.

    Args:
        path: Its folder, or its file of annotations.
        out: Folder for a page with samples; none is written if left out.
        samples: Pictures on the page, 0 to 200.
        classes_of: An experiment, by built-in name, by path, or itself, whose classes are looked for.
        overwrite: Whether files in `out` may be overwritten.
        progress: ``True`` for a bar, or a function that takes every event.
        cancel: A flag that another thread may set.

    Raises:
        InputError: There are no annotations, or they cannot be read.
    """
    request = _known(data=path, out=out, samples=samples, classes_of=classes_of)
    found = jobs.run("data-check", request, overwrite=overwrite, progress=progress, cancel=cancel)
    page = found["page"]
    return Checked(
        annotations=Path(found["annotations"]),
        statistics=found["statistics"],
        defects=found["defects"],
        errors=found["errors"],
        taken=found.get("taken"),
        page=None if page is None else Path(page),
    )


def convert(
    format: Literal["kitti", "bdd100k", "yolo", "voc"],
    input: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    copy: bool | None = None,
    turned: bool | None = None,
    progress: Progress = False,
    cancel: Cancel | None = None,
) -> Converted:
    """Converts a data set to COCO's format, by the job ``data-convert``.

    Args:
        format: Its format.
        input: Its folder; of BDD100K also a file.
        out: Folder for the data set; it must be new or empty.
        copy: Whether pictures are copied. Otherwise they are hard links where the file system allows.
        turned: Whether the boxes of pictures that EXIF turns are of the pictures as they are shown, or of the stored pixels, where neither
            the format nor a stated size says so. Without it such pictures are left out.
        progress: ``True`` for a bar, or a function that takes every event.
        cancel: A flag that another thread may set.

    Raises:
        InputError: The folder `out` is not empty, or no picture can be used.
    """
    request = _known(format=format, input=input, out=out, copy=copy, turned=turned)
    found = jobs.run("data-convert", request, progress=progress, cancel=cancel)
    return Converted(
        annotations=Path(found["annotations"]),
        linked=found["linked"],
        copied=found["copied"],
        statistics=found["statistics"],
        defects=found["defects"],
        errors=found["errors"],
    )
