"""The requests of all jobs as typed dictionaries, by the name of the job: ``lens-tolerance`` is `LensTolerance`.

Every key may be left out but those that a job says it needs. `write_requests.py` writes this file from the schemas of the jobs.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

JobName = Literal['design', 'design-check', 'design-config', 'design-stop', 'run-view', 'task-view', 'init', 'experiment-list', 'experiment-show', 'experiment-run-all', 'schema', 'report', 'report-so-far', 'compare', 'evaluate', 'lens-show', 'lens-view', 'lens-edit', 'lens-trace', 'lens-analyze', 'lens-convert', 'lens-focus', 'lens-list', 'lens-optimize', 'lens-tolerance', 'glass-find', 'glass-list', 'glass-show', 'psf', 'psf-calibrate', 'psf-capture', 'sensor-list', 'sensor-show', 'sensor-capture', 'sensor-characterize', 'simulate', 'camera-view', 'photo-list', 'raw-show', 'raw-convert', 'raw-mtf', 'isp-show', 'isp-develop', 'isp-tune', 'isp-chart', 'apply', 'detect', 'weights', 'data-convert', 'data-check', 'train-isp-proxy', 'train-optics-proxy', 'bench', 'doctor', 'sweep-plan', 'sweep-status', 'sweep-gather', 'runs', 'unit-status', 'unit-list', 'unit-gather']
"""Every job."""


class Design(TypedDict, total=False):
    """A run to begin, or to go on with.

    Needs `run`."""
    device: str
    """Where tensors live."""
    log: list[Literal['tensorboard']]
    """Further forms in which losses, scores and figures of lenses are written after every step. A run that has them
    goes on with them."""
    run: "DesignRunRun1" | "DesignRunRun2"
    """Begin a run, or go on with one."""


class DesignRunRun1(TypedDict, total=False):
    """A new one.

    Needs `new`."""
    new: "DesignRunRun1NewNewRun"


class DesignRunRun1NewNewRun(TypedDict, total=False):
    """A run to begin."""
    changes: "DesignRunRun1NewNewRunChangesChanges"
    """What differs from the experiment's file."""
    experiment: str | "DesignRunRun1NewNewRunExperimentInput2ExperimentText1TomlText" | dict[str, Any]
    """Experiment: a built-in name, the path of a file, or the experiment itself; or the name or path of a lens, for
    which one is made as `init` does."""
    out: str | None
    """Folder of the run; `runs/EXPERIMENT-seed-SEED` if none is given, where a file `experiment.toml` is called by
    its folder, and the name of a variant that is made alone stands before the seed."""


class DesignRunRun1NewNewRunChangesChanges(TypedDict, total=False):
    """What differs from the file of an experiment."""
    data: str | None
    """Labelled pictures in place of the experiment's scenes: a folder of pictures with boxes in COCO format, or with
    label images for a segmentation."""
    is_full: bool
    """Take the budget of a night on a GPU, see `Experiment::to_full_size`; then `steps` must be none."""
    photos: str | None
    """Folder of pictures in place of the experiment's."""
    seed: int | None
    """Seed of everything random."""
    set: dict[str, Any]
    """Values in place of those of the file, by key path: `{"training.steps": 400, "psf.kind": "diffraction"}`. An
    element of a list of tables is named by its `name` or its place from 0, as in `variant.end-to-
    end.stage.2.schedule.optics.learning_rate`."""
    steps: int | None
    """Network steps of each variant in place of `training.steps`, or of `isp.steps` where a hardware ISP stands;
    lens steps in proportion. At least 1."""
    variant: str | list[str] | None
    """Make this variant or these alone, and those from which they start."""


class DesignRunRun1NewNewRunExperimentInput2ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class DesignRunRun2(TypedDict, total=False):
    """One that was begun before.

    Needs `resume`."""
    resume: "DesignRunRun2ResumeResume"


class DesignRunRun2ResumeResume(TypedDict, total=False):
    """A run to go on with."""
    accept_changed: list[str]
    """Files or folders of the run, by their path below it, that may differ from their digests."""
    data: str | None
    """Where its labelled pictures are now, if they were moved."""
    extend_to: int | None
    """Make every camera longer, so that its network takes this many steps in all."""
    photos: str | None
    """Where its photographs are now, if they were moved."""
    run: str
    """Its folder."""


class DesignCheck(TypedDict, total=False):
    """A run to look at before it begins.

    Needs `run`."""
    device: str
    """Where tensors live."""
    run: "DesignCheckRunNewRun"
    """The run."""


class DesignCheckRunNewRun(TypedDict, total=False):
    """A run to begin."""
    changes: "DesignCheckRunNewRunChangesChanges"
    """What differs from the experiment's file."""
    experiment: str | "DesignCheckRunNewRunExperimentInput2ExperimentText1TomlText" | dict[str, Any]
    """Experiment: a built-in name, the path of a file, or the experiment itself; or the name or path of a lens, for
    which one is made as `init` does."""
    out: str | None
    """Folder of the run; `runs/EXPERIMENT-seed-SEED` if none is given, where a file `experiment.toml` is called by
    its folder, and the name of a variant that is made alone stands before the seed."""


class DesignCheckRunNewRunChangesChanges(TypedDict, total=False):
    """What differs from the file of an experiment."""
    data: str | None
    """Labelled pictures in place of the experiment's scenes: a folder of pictures with boxes in COCO format, or with
    label images for a segmentation."""
    is_full: bool
    """Take the budget of a night on a GPU, see `Experiment::to_full_size`; then `steps` must be none."""
    photos: str | None
    """Folder of pictures in place of the experiment's."""
    seed: int | None
    """Seed of everything random."""
    set: dict[str, Any]
    """Values in place of those of the file, by key path: `{"training.steps": 400, "psf.kind": "diffraction"}`. An
    element of a list of tables is named by its `name` or its place from 0, as in `variant.end-to-
    end.stage.2.schedule.optics.learning_rate`."""
    steps: int | None
    """Network steps of each variant in place of `training.steps`, or of `isp.steps` where a hardware ISP stands;
    lens steps in proportion. At least 1."""
    variant: str | list[str] | None
    """Make this variant or these alone, and those from which they start."""


class DesignCheckRunNewRunExperimentInput2ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class DesignConfig(TypedDict, total=False):
    """A run to begin.

    Needs `run`."""
    run: "DesignConfigRunNewRun"
    """The run."""


class DesignConfigRunNewRun(TypedDict, total=False):
    """A run to begin."""
    changes: "DesignConfigRunNewRunChangesChanges"
    """What differs from the experiment's file."""
    experiment: str | "DesignConfigRunNewRunExperimentInput2ExperimentText1TomlText" | dict[str, Any]
    """Experiment: a built-in name, the path of a file, or the experiment itself; or the name or path of a lens, for
    which one is made as `init` does."""
    out: str | None
    """Folder of the run; `runs/EXPERIMENT-seed-SEED` if none is given, where a file `experiment.toml` is called by
    its folder, and the name of a variant that is made alone stands before the seed."""


class DesignConfigRunNewRunChangesChanges(TypedDict, total=False):
    """What differs from the file of an experiment."""
    data: str | None
    """Labelled pictures in place of the experiment's scenes: a folder of pictures with boxes in COCO format, or with
    label images for a segmentation."""
    is_full: bool
    """Take the budget of a night on a GPU, see `Experiment::to_full_size`; then `steps` must be none."""
    photos: str | None
    """Folder of pictures in place of the experiment's."""
    seed: int | None
    """Seed of everything random."""
    set: dict[str, Any]
    """Values in place of those of the file, by key path: `{"training.steps": 400, "psf.kind": "diffraction"}`. An
    element of a list of tables is named by its `name` or its place from 0, as in `variant.end-to-
    end.stage.2.schedule.optics.learning_rate`."""
    steps: int | None
    """Network steps of each variant in place of `training.steps`, or of `isp.steps` where a hardware ISP stands;
    lens steps in proportion. At least 1."""
    variant: str | list[str] | None
    """Make this variant or these alone, and those from which they start."""


class DesignConfigRunNewRunExperimentInput2ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class DesignStop(TypedDict, total=False):
    """A run at work.

    Needs `run`."""
    run: str
    """Its folder."""


class RunView(TypedDict, total=False):
    """A run, and which of its steps are given.

    Needs `run`."""
    after: int
    """Steps are given that come after this one."""
    most: int
    """Most steps that are given; of more, every second, third, and so on of each camera's block. Unit: steps."""
    run: str
    """Folder of the run."""


class TaskView(TypedDict, total=False):
    """A lens, and what it is looked at for.

    Needs `lens`."""
    batch: int
    """Number of the batch."""
    camera: str | None
    """The camera of that run, whose network, ISP and exposure are taken; the last one that is finished if none is
    named."""
    edits: list["TaskViewEditsItemEdit1" | "TaskViewEditsItemEdit2" | "TaskViewEditsItemEdit3" | "TaskViewEditsItemEdit4" | "TaskViewEditsItemEdit5" | "TaskViewEditsItemEdit6" | "TaskViewEditsItemEdit7" | "TaskViewEditsItemEdit8" | "TaskViewEditsItemEdit9" | "TaskViewEditsItemEdit10" | "TaskViewEditsItemEdit11" | "TaskViewEditsItemEdit12" | "TaskViewEditsItemEdit13" | "TaskViewEditsItemEdit14" | "TaskViewEditsItemEdit15" | "TaskViewEditsItemEdit16" | "TaskViewEditsItemEdit17" | "TaskViewEditsItemEdit18" | "TaskViewEditsItemEdit19" | "TaskViewEditsItemEdit20" | "TaskViewEditsItemEdit21" | "TaskViewEditsItemEdit22" | "TaskViewEditsItemEdit23" | "TaskViewEditsItemEdit24" | "TaskViewEditsItemEdit25" | "TaskViewEditsItemEdit26" | "TaskViewEditsItemEdit27"]
    """Changes of the lens that come first, in this order."""
    experiment: str | "TaskViewExperimentInput22ExperimentText1TomlText" | dict[str, Any]
    """Experiment whose task, sensor and network are taken: a built-in name, the path of a file, or the experiment
    itself. An empty name fits the default one to `start`, as `init` does."""
    lens: str | "TaskViewLensInput2LensText1" | "TaskViewLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    pictures: bool
    """Whether the pictures are given."""
    run: str | None
    """A run whose experiment and finished camera are taken in place of `experiment`."""
    slopes: bool
    """Whether the slopes are computed."""
    start: str | "TaskViewStart1Input2LensText1" | "TaskViewStart1Input2LensText2" | None
    """The lens at which the gap begins; the experiment's own if none is named. An empty experiment is fitted to it."""
    windows: int
    """Windows of the batch that are taken; fewer are quicker, and more are nearer to what a step of a design sees.
    Unit: windows."""


class TaskViewEditsItemEdit1(TypedDict, total=False):
    """Sets a radius of curvature.

    Needs `edit`, `surface`."""
    edit: Literal['radius']
    radius_mm: float | None
    """Radius, mm; null for a plane."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit2(TypedDict, total=False):
    """Sets a vertex curvature.

    Needs `edit`, `surface`, `curvature_per_mm`."""
    curvature_per_mm: float
    """Curvature, 1/mm."""
    edit: Literal['curvature']
    surface: int
    """Surface."""


class TaskViewEditsItemEdit3(TypedDict, total=False):
    """Bends an element: the same change of both curvatures, so that its power as a thin lens stays.

    Needs `edit`, `surface`, `by_per_mm`."""
    by_per_mm: float
    """What is added to both curvatures, 1/mm."""
    edit: Literal['bend']
    surface: int
    """Surface in front of the glass."""


class TaskViewEditsItemEdit4(TypedDict, total=False):
    """Sets the curvature with which the conic has a given sag at a given height; the even polynomial and what else
    departs from it stay.

    Needs `edit`, `surface`, `height_mm`, `sag_mm`."""
    edit: Literal['sag']
    height_mm: float
    """Height above the axis, mm."""
    sag_mm: float
    """Sag of the whole surface there, mm."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit5(TypedDict, total=False):
    """Sets a conic constant.

    Needs `edit`, `surface`, `conic`."""
    conic: float
    """Conic constant."""
    edit: Literal['conic']
    surface: int
    """Surface."""


class TaskViewEditsItemEdit6(TypedDict, total=False):
    """Sets a coefficient of the even polynomial.

    Needs `edit`, `surface`, `power`, `value`."""
    edit: Literal['asphere']
    power: int
    """Power of r: 2, 4, ..., 16."""
    surface: int
    """Surface."""
    value: float
    """Coefficient, mm^(1 - power)."""


class TaskViewEditsItemEdit7(TypedDict, total=False):
    """Sets the distance to the next surface; of the last one, to the image plane.

    Needs `edit`, `surface`, `thickness_mm`."""
    edit: Literal['thickness']
    surface: int
    """Surface."""
    thickness_mm: float
    """Distance, mm."""


class TaskViewEditsItemEdit8(TypedDict, total=False):
    """Sets the clear semi-diameter.

    Needs `edit`, `surface`, `semi_diameter_mm`."""
    edit: Literal['semi-diameter']
    semi_diameter_mm: float
    """Clear semi-diameter, mm."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit9(TypedDict, total=False):
    """Sets the medium behind a surface.

    Needs `edit`, `surface`, `glass`."""
    edit: Literal['glass']
    glass: str
    """Name of a glass, or `MAKER:NAME`; `AIR` or nothing for air."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit10(TypedDict, total=False):
    """Names a surface.

    Needs `edit`, `surface`, `label`."""
    edit: Literal['label']
    label: str
    """What it is called."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit11(TypedDict, total=False):
    """Makes a surface the aperture stop.

    Needs `edit`, `surface`."""
    edit: Literal['stop']
    surface: int
    """Surface."""


class TaskViewEditsItemEdit12(TypedDict, total=False):
    """Inserts a plane without effect in front of a surface, in the middle of the gap; the other surfaces stay in
    place.

    Needs `edit`, `before`."""
    before: int
    """The surface that comes behind it; one more than the last surface inserts behind all."""
    edit: Literal['insert']


class TaskViewEditsItemEdit13(TypedDict, total=False):
    """Deletes a surface; the others stay in place.

    Needs `edit`, `surface`."""
    edit: Literal['delete']
    surface: int
    """Surface."""


class TaskViewEditsItemEdit14(TypedDict, total=False):
    """Sets the diameter of the entrance pupil.

    Needs `edit`, `entrance_pupil_mm`."""
    edit: Literal['aperture']
    entrance_pupil_mm: float
    """Diameter, mm."""


class TaskViewEditsItemEdit15(TypedDict, total=False):
    """Sets the fields.

    Needs `edit`, `fields_deg`."""
    edit: Literal['fields']
    fields_deg: list[float]
    """Fields, degrees, in any order."""


class TaskViewEditsItemEdit16(TypedDict, total=False):
    """Sets the wavelengths.

    Needs `edit`, `wavelengths_um`, `reference_um`."""
    edit: Literal['wavelengths']
    reference_um: float
    """The reference wavelength, um."""
    wavelengths_um: list[float]
    """Wavelengths, um, in any order."""


class TaskViewEditsItemEdit17(TypedDict, total=False):
    """Moves the object plane.

    Needs `edit`."""
    distance_mm: float | None
    """Distance from the object to the first vertex, mm; null for infinity."""
    edit: Literal['object']


class TaskViewEditsItemEdit18(TypedDict, total=False):
    """Names the lens.

    Needs `edit`, `name`."""
    edit: Literal['name']
    name: str
    """What it is called."""


class TaskViewEditsItemEdit19(TypedDict, total=False):
    """Moves the image plane to a focus, once.

    Needs `edit`, `at`."""
    at: Literal['file'] | Literal['paraxial'] | Literal['best']
    """To which."""
    edit: Literal['focus']


class TaskViewEditsItemEdit20(TypedDict, total=False):
    """Scales every length of the lens, so that its focal length becomes a given one.

    Needs `edit`, `efl_mm`."""
    edit: Literal['scale-to']
    efl_mm: float
    """Focal length, mm."""


class TaskViewEditsItemEdit21(TypedDict, total=False):
    """Lets a number vary in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['vary']
    max: float | None
    """Upper bound."""
    min: float | None
    """Lower bound; about the own value if both are left out."""
    parameter: str
    """The number as lens files name it: `radius_mm`, `thickness_mm`, `conic`, `a4`, ..."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit22(TypedDict, total=False):
    """Holds a number in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['hold']
    parameter: str
    """The number as lens files name it."""
    surface: int
    """Surface."""


class TaskViewEditsItemEdit23(TypedDict, total=False):
    """Lets a number follow the same number of another surface, now and after each further edit: `scale * other +
    offset`. The other one varies in optimisations from now on, if it does not yet.

    Needs `edit`, `surface`, `parameter`, `of`."""
    edit: Literal['pickup']
    of: int
    """Surface that it follows."""
    offset: float | None
    """Offset in the unit of the number, of radii in 1/mm, of tilts in degrees; 0 if it is left out."""
    parameter: str
    """The number as lens files name it; radii follow as curvatures."""
    scale: float | None
    """Factor; 1 if it is left out."""
    surface: int
    """Surface that follows."""


class TaskViewEditsItemEdit24(TypedDict, total=False):
    """Weights the fields in optimisations.

    Needs `edit`, `weights`."""
    edit: Literal['field-weights']
    weights: list[float]
    """One weight per field of the lens, in ascending order of the fields; empty for all the same."""


class TaskViewEditsItemEdit25(TypedDict, total=False):
    """Lets a radius hold the magnification of a near object, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-magnification']
    magnification: float | None
    """Magnification, negative for an inverted image; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class TaskViewEditsItemEdit26(TypedDict, total=False):
    """Lets a thickness hold the distance from the first vertex to the last, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-length']
    length_mm: float | None
    """Distance, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class TaskViewEditsItemEdit27(TypedDict, total=False):
    """Lets a radius hold the focal length, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-efl']
    efl_mm: float | None
    """Focal length, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class TaskViewExperimentInput22ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class TaskViewLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class TaskViewLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class TaskViewStart1Input2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class TaskViewStart1Input2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


Init = TypedDict('Init', {'data': Any, 'from': Any, 'lens': Any, 'out': Any, 'photos': Any, 'sensor': Any}, total=False)


class InitFromInput2ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class InitLens1Input22LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class InitLens1Input22LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class InitSensor1Input32TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class ExperimentList(TypedDict, total=False):
    """An empty request."""


class ExperimentShow(TypedDict, total=False):
    """Which experiment.

    Needs `name`."""
    name: str
    """Experiment file, or the name of a built-in one."""


class ExperimentRunAll(TypedDict, total=False):
    """What to run."""
    changes: "ExperimentRunAllChangesChanges"
    """What differs from the files of the experiments; its seed is ignored."""
    device: str
    """Where tensors live."""
    experiments: list[str]
    """Experiments by name or path; all built-in ones if none is named."""
    out: str
    """Folder for the runs, `EXPERIMENT-seed-SEED` each, and the page. Finished runs in it are kept, interrupted ones
    go on."""
    seeds: list[int]
    """Seeds. All experiments have a run of the first before any has one of the second."""


class ExperimentRunAllChangesChanges(TypedDict, total=False):
    """What differs from the file of an experiment."""
    data: str | None
    """Labelled pictures in place of the experiment's scenes: a folder of pictures with boxes in COCO format, or with
    label images for a segmentation."""
    is_full: bool
    """Take the budget of a night on a GPU, see `Experiment::to_full_size`; then `steps` must be none."""
    photos: str | None
    """Folder of pictures in place of the experiment's."""
    seed: int | None
    """Seed of everything random."""
    set: dict[str, Any]
    """Values in place of those of the file, by key path: `{"training.steps": 400, "psf.kind": "diffraction"}`. An
    element of a list of tables is named by its `name` or its place from 0, as in `variant.end-to-
    end.stage.2.schedule.optics.learning_rate`."""
    steps: int | None
    """Network steps of each variant in place of `training.steps`, or of `isp.steps` where a hardware ISP stands;
    lens steps in proportion. At least 1."""
    variant: str | list[str] | None
    """Make this variant or these alone, and those from which they start."""


class Schema(TypedDict, total=False):
    """Which files.

    Needs `kind`."""
    kind: Literal['experiment'] | Literal['lens'] | Literal['sensor']
    """Their kind."""


class Report(TypedDict, total=False):
    """A finished run.

    Needs `run`."""
    accept_changed: list[str]
    """Files or folders of the run, by their path below it, that may differ from their digests."""
    photo: str | None
    """A photograph that every camera takes over its whole sensor. The frames stay in the folder, for later reports."""
    run: str
    """Its folder."""


class ReportSoFar(TypedDict, total=False):
    """A run.

    Needs `run`."""
    run: str
    """Its folder."""


class Compare(TypedDict, total=False):
    """Runs to compare.

    Needs `runs`."""
    accept_changed: list[str]
    """Files or folders of the runs, by their path below them, that may differ from their digests."""
    csv: str | None
    """Comma-separated values of the cameras; not written without a name."""
    out: str
    """The page."""
    runs: list[str]
    """Folders of finished runs; those that differ in the seed alone are taken together."""


class Evaluate(TypedDict, total=False):
    """A finished run.

    Needs `run`."""
    accept_changed: list[str]
    """Files or folders of the run, by their path below it, that may differ from their digests."""
    data: str | None
    """Labelled pictures: those of the run where they are now, or others, none of which is kept for training. A
    folder or a file of annotations in COCO format, or a folder of pictures with label images. `street.held_out`
    of the run is the number of windows that are scored."""
    device: str
    """Where tensors live."""
    made: "EvaluateMade1Made" | None
    """Also make cameras at random, whose lenses are off by their tolerances, and score them."""
    photos: str | None
    """Photographs: those of the run where they are now, or others, none of which is kept for training.
    `scoring.pictures` of the run limits how many are scored."""
    psf: Literal['geometric'] | Literal['diffraction'] | None
    """PSFs by rays or by waves, in place of those of the run."""
    psfs: str | None
    """PSFs in place of those of each camera's lens: the folder of results of `psf` or `psf-calibrate`, or its
    `psf.json`. They form the images, and development and restoration know them; networks and ISPs stay as they
    were trained. Spots and fields of view are those of the lens."""
    run: str
    """Its folder."""


class EvaluateMade1Made(TypedDict, total=False):
    """Cameras to be made at random from each design of a run."""
    calibrate: bool
    """Whether each camera is calibrated: development knows its lens as it was made, not only the lens as drawn."""
    compensate: Literal['focus'] | Literal['none']
    """What is adjusted on every lens."""
    limit: float | None
    """What a camera has to reach in the first score; that of the first camera as drawn if none is given, as in all
    other scores."""
    pictures: int
    """Most held-out pictures on which each is scored, at least 1."""
    seed: int
    """Seed of their errors."""
    tolerances: "EvaluateMade1MadeTolerancesLensTolerances1" | "EvaluateMade1MadeTolerancesLensTolerances2"
    """Their tolerances."""
    trials: int
    """How many of each design, 1 to 100000."""


class EvaluateMade1MadeTolerancesLensTolerances1(TypedDict, total=False):
    """Tolerances of good practice, of this grade.

    Needs `grade`."""
    grade: Literal['commercial'] | Literal['precision'] | Literal['high']


class EvaluateMade1MadeTolerancesLensTolerances2(TypedDict, total=False):
    """A tolerance file, for the lenses of all designs.

    Needs `file`."""
    file: str


class LensShow(TypedDict, total=False):
    """Which lens to show.

    Needs `lens`."""
    focus: Literal['file'] | Literal['paraxial'] | Literal['best']
    """Where the image plane goes."""
    lens: str | "LensShowLensInput2LensText1" | "LensShowLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""


class LensShowLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensShowLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensView(TypedDict, total=False):
    """A lens, how it changes, and what to look at.

    Needs `lens`."""
    edits: list["LensViewEditsItemEdit1" | "LensViewEditsItemEdit2" | "LensViewEditsItemEdit3" | "LensViewEditsItemEdit4" | "LensViewEditsItemEdit5" | "LensViewEditsItemEdit6" | "LensViewEditsItemEdit7" | "LensViewEditsItemEdit8" | "LensViewEditsItemEdit9" | "LensViewEditsItemEdit10" | "LensViewEditsItemEdit11" | "LensViewEditsItemEdit12" | "LensViewEditsItemEdit13" | "LensViewEditsItemEdit14" | "LensViewEditsItemEdit15" | "LensViewEditsItemEdit16" | "LensViewEditsItemEdit17" | "LensViewEditsItemEdit18" | "LensViewEditsItemEdit19" | "LensViewEditsItemEdit20" | "LensViewEditsItemEdit21" | "LensViewEditsItemEdit22" | "LensViewEditsItemEdit23" | "LensViewEditsItemEdit24" | "LensViewEditsItemEdit25" | "LensViewEditsItemEdit26" | "LensViewEditsItemEdit27"]
    """Changes that come first, in this order."""
    goal: "LensViewGoalGoal"
    """Limits of the lens, as an optimisation has them. Its other keys do not matter."""
    lens: str | "LensViewLensInput2LensText1" | "LensViewLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself. It may be one that cannot be built."""
    max_frequency: float | None
    """Highest frequency of MTF curves, cycles/mm; if left out, 100, or about half of the cutoff if that is less.
    Unit: cycles/mm."""
    parts: list[Literal['layout'] | Literal['spots'] | Literal['fans'] | Literal['mtf'] | Literal['field-curves']]
    """What to look at, beside the prescription and the first-order data; everything if empty."""
    quick: bool
    """Few rays and few points, for a lens that is being dragged."""


class LensViewEditsItemEdit1(TypedDict, total=False):
    """Sets a radius of curvature.

    Needs `edit`, `surface`."""
    edit: Literal['radius']
    radius_mm: float | None
    """Radius, mm; null for a plane."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit2(TypedDict, total=False):
    """Sets a vertex curvature.

    Needs `edit`, `surface`, `curvature_per_mm`."""
    curvature_per_mm: float
    """Curvature, 1/mm."""
    edit: Literal['curvature']
    surface: int
    """Surface."""


class LensViewEditsItemEdit3(TypedDict, total=False):
    """Bends an element: the same change of both curvatures, so that its power as a thin lens stays.

    Needs `edit`, `surface`, `by_per_mm`."""
    by_per_mm: float
    """What is added to both curvatures, 1/mm."""
    edit: Literal['bend']
    surface: int
    """Surface in front of the glass."""


class LensViewEditsItemEdit4(TypedDict, total=False):
    """Sets the curvature with which the conic has a given sag at a given height; the even polynomial and what else
    departs from it stay.

    Needs `edit`, `surface`, `height_mm`, `sag_mm`."""
    edit: Literal['sag']
    height_mm: float
    """Height above the axis, mm."""
    sag_mm: float
    """Sag of the whole surface there, mm."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit5(TypedDict, total=False):
    """Sets a conic constant.

    Needs `edit`, `surface`, `conic`."""
    conic: float
    """Conic constant."""
    edit: Literal['conic']
    surface: int
    """Surface."""


class LensViewEditsItemEdit6(TypedDict, total=False):
    """Sets a coefficient of the even polynomial.

    Needs `edit`, `surface`, `power`, `value`."""
    edit: Literal['asphere']
    power: int
    """Power of r: 2, 4, ..., 16."""
    surface: int
    """Surface."""
    value: float
    """Coefficient, mm^(1 - power)."""


class LensViewEditsItemEdit7(TypedDict, total=False):
    """Sets the distance to the next surface; of the last one, to the image plane.

    Needs `edit`, `surface`, `thickness_mm`."""
    edit: Literal['thickness']
    surface: int
    """Surface."""
    thickness_mm: float
    """Distance, mm."""


class LensViewEditsItemEdit8(TypedDict, total=False):
    """Sets the clear semi-diameter.

    Needs `edit`, `surface`, `semi_diameter_mm`."""
    edit: Literal['semi-diameter']
    semi_diameter_mm: float
    """Clear semi-diameter, mm."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit9(TypedDict, total=False):
    """Sets the medium behind a surface.

    Needs `edit`, `surface`, `glass`."""
    edit: Literal['glass']
    glass: str
    """Name of a glass, or `MAKER:NAME`; `AIR` or nothing for air."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit10(TypedDict, total=False):
    """Names a surface.

    Needs `edit`, `surface`, `label`."""
    edit: Literal['label']
    label: str
    """What it is called."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit11(TypedDict, total=False):
    """Makes a surface the aperture stop.

    Needs `edit`, `surface`."""
    edit: Literal['stop']
    surface: int
    """Surface."""


class LensViewEditsItemEdit12(TypedDict, total=False):
    """Inserts a plane without effect in front of a surface, in the middle of the gap; the other surfaces stay in
    place.

    Needs `edit`, `before`."""
    before: int
    """The surface that comes behind it; one more than the last surface inserts behind all."""
    edit: Literal['insert']


class LensViewEditsItemEdit13(TypedDict, total=False):
    """Deletes a surface; the others stay in place.

    Needs `edit`, `surface`."""
    edit: Literal['delete']
    surface: int
    """Surface."""


class LensViewEditsItemEdit14(TypedDict, total=False):
    """Sets the diameter of the entrance pupil.

    Needs `edit`, `entrance_pupil_mm`."""
    edit: Literal['aperture']
    entrance_pupil_mm: float
    """Diameter, mm."""


class LensViewEditsItemEdit15(TypedDict, total=False):
    """Sets the fields.

    Needs `edit`, `fields_deg`."""
    edit: Literal['fields']
    fields_deg: list[float]
    """Fields, degrees, in any order."""


class LensViewEditsItemEdit16(TypedDict, total=False):
    """Sets the wavelengths.

    Needs `edit`, `wavelengths_um`, `reference_um`."""
    edit: Literal['wavelengths']
    reference_um: float
    """The reference wavelength, um."""
    wavelengths_um: list[float]
    """Wavelengths, um, in any order."""


class LensViewEditsItemEdit17(TypedDict, total=False):
    """Moves the object plane.

    Needs `edit`."""
    distance_mm: float | None
    """Distance from the object to the first vertex, mm; null for infinity."""
    edit: Literal['object']


class LensViewEditsItemEdit18(TypedDict, total=False):
    """Names the lens.

    Needs `edit`, `name`."""
    edit: Literal['name']
    name: str
    """What it is called."""


class LensViewEditsItemEdit19(TypedDict, total=False):
    """Moves the image plane to a focus, once.

    Needs `edit`, `at`."""
    at: Literal['file'] | Literal['paraxial'] | Literal['best']
    """To which."""
    edit: Literal['focus']


class LensViewEditsItemEdit20(TypedDict, total=False):
    """Scales every length of the lens, so that its focal length becomes a given one.

    Needs `edit`, `efl_mm`."""
    edit: Literal['scale-to']
    efl_mm: float
    """Focal length, mm."""


class LensViewEditsItemEdit21(TypedDict, total=False):
    """Lets a number vary in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['vary']
    max: float | None
    """Upper bound."""
    min: float | None
    """Lower bound; about the own value if both are left out."""
    parameter: str
    """The number as lens files name it: `radius_mm`, `thickness_mm`, `conic`, `a4`, ..."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit22(TypedDict, total=False):
    """Holds a number in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['hold']
    parameter: str
    """The number as lens files name it."""
    surface: int
    """Surface."""


class LensViewEditsItemEdit23(TypedDict, total=False):
    """Lets a number follow the same number of another surface, now and after each further edit: `scale * other +
    offset`. The other one varies in optimisations from now on, if it does not yet.

    Needs `edit`, `surface`, `parameter`, `of`."""
    edit: Literal['pickup']
    of: int
    """Surface that it follows."""
    offset: float | None
    """Offset in the unit of the number, of radii in 1/mm, of tilts in degrees; 0 if it is left out."""
    parameter: str
    """The number as lens files name it; radii follow as curvatures."""
    scale: float | None
    """Factor; 1 if it is left out."""
    surface: int
    """Surface that follows."""


class LensViewEditsItemEdit24(TypedDict, total=False):
    """Weights the fields in optimisations.

    Needs `edit`, `weights`."""
    edit: Literal['field-weights']
    weights: list[float]
    """One weight per field of the lens, in ascending order of the fields; empty for all the same."""


class LensViewEditsItemEdit25(TypedDict, total=False):
    """Lets a radius hold the magnification of a near object, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-magnification']
    magnification: float | None
    """Magnification, negative for an inverted image; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensViewEditsItemEdit26(TypedDict, total=False):
    """Lets a thickness hold the distance from the first vertex to the last, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-length']
    length_mm: float | None
    """Distance, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensViewEditsItemEdit27(TypedDict, total=False):
    """Lets a radius hold the focal length, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-efl']
    efl_mm: float | None
    """Focal length, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensViewGoalGoal(TypedDict, total=False):
    """What an optimised lens has to be."""
    air: float | None
    """Least air between elements, on the axis and at the edge, mm, 0.01 at least. Unit: mm."""
    bfl: list[float]
    """Least and greatest back focal length, mm, positive in the direction of the light; empty for none. Unit: mm."""
    centre: float | None
    """Least centre thickness of every element, mm. Unit: mm."""
    chief_ray_angle: float | None
    """Greatest angle of the outermost chief ray to the axis at the image, degrees. Unit: degrees."""
    clear_diameter: float | None
    """Greatest clear diameter of any surface, mm. Unit: mm."""
    distortion: float | None
    """Greatest distortion at the outermost field, percent. Unit: %."""
    edge: float | None
    """Least edge thickness of every element, mm, 0.01 at least. Unit: mm."""
    efl: str | None
    """Focal length to hold, mm, or `free`; if left out what the lens file solves for, else that of the lens at the
    start, or the magnification of a near object."""
    f_number: float | None
    """F-number: sets the entrance pupil by the focal length that is held, or that of the start."""
    fields: list[float]
    """Field angles, degrees, all of the same weight; those of the lens with their weights if empty. Unit: degrees."""
    glass: list[str]
    """Glasses that a search may exchange, each as `SURFACE` or `SURFACE=NAME,...`: the surface in front of the
    glass, and the names that it may get, the whole catalogue if none. The glass that it has always takes part."""
    operands: "LensViewGoalGoalOperands1OperandFile" | None
    """Further figures, each with a bound and a weight, and the weight of the spots beside them."""
    power: float
    """The mean over the fields of `RMS^power` is minimised: 1 the mean spot, 2 the mean square, 8 nearly the worst;
    0.5 to 64."""
    restored: "LensViewGoalGoalRestored1Restored" | None
    """The error of the best linear restoration of the frames of a camera is minimised in place of the spots."""
    slope: float | None
    """Steepest surface within its clear aperture, degrees. Unit: degrees."""
    track: float | None
    """Greatest track, mm: between any two of the vertices and the image plane. Unit: mm."""
    vary: list[Literal['curvature'] | Literal['thickness'] | Literal['air'] | Literal['conic'] | Literal['asphere']]
    """Kinds of numbers that vary beside the variables of the lens file; a lens whose file names none varies these
    alone."""
    wavelengths: list[float]
    """Wavelengths, um, all of the same weight; those of the lens if empty. Unit: um."""


class LensViewGoalGoalOperands1OperandFile(TypedDict, total=False):
    """Figures that a lens should reach.

    Needs `operand`."""
    operand: list["LensViewGoalGoalOperands1OperandFileOperandItemOperand"]
    """The figures."""
    spot_weight: float
    """How much the RMS spots count beside them, from 0."""


class LensViewGoalGoalOperands1OperandFileOperandItemOperand(TypedDict, total=False):
    """A figure with its bounds.

    Needs `of`."""
    at_least: float | None
    """Least value."""
    at_most: float | None
    """Greatest value."""
    field_deg: float | None
    """Field angle, degrees; where it is left out, all fields of the lens for contrast, spots and wavefronts, and the
    outermost for the others."""
    frequency_per_mm: float | None
    """Spatial frequency of contrast, cycles per mm."""
    of: Literal['mtf'] | Literal['spot'] | Literal['wavefront'] | Literal['focal-length'] | Literal['back-focal-length'] | Literal['track'] | Literal['distortion'] | Literal['chief-ray-angle'] | Literal['image-height']
    """The figure."""
    waves: bool
    """Whether contrast includes diffraction."""
    weight_um: float
    """The weight of one unit beyond a bound, as a spot radius in um. A unit is 1 for contrast, 1 wave for a
    wavefront, 1 um for a spot. Bounds of the other figures bind: a millimetre beyond weighs at least 10 000 um,
    as for a limit."""


class LensViewGoalGoalRestored1Restored(TypedDict, total=False):
    """The camera whose raw frames should be restored as well as possible."""
    sensor: str
    """Sensor, by file or built-in name."""
    white_e: float
    """Photoelectrons that white gives in a green pixel on the axis. Unit: e-."""


class LensViewLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensViewLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensEdit(TypedDict, total=False):
    """A lens, and how it changes. Nothing is written into a file.

    Needs `lens`."""
    edits: list["LensEditEditsItemEdit1" | "LensEditEditsItemEdit2" | "LensEditEditsItemEdit3" | "LensEditEditsItemEdit4" | "LensEditEditsItemEdit5" | "LensEditEditsItemEdit6" | "LensEditEditsItemEdit7" | "LensEditEditsItemEdit8" | "LensEditEditsItemEdit9" | "LensEditEditsItemEdit10" | "LensEditEditsItemEdit11" | "LensEditEditsItemEdit12" | "LensEditEditsItemEdit13" | "LensEditEditsItemEdit14" | "LensEditEditsItemEdit15" | "LensEditEditsItemEdit16" | "LensEditEditsItemEdit17" | "LensEditEditsItemEdit18" | "LensEditEditsItemEdit19" | "LensEditEditsItemEdit20" | "LensEditEditsItemEdit21" | "LensEditEditsItemEdit22" | "LensEditEditsItemEdit23" | "LensEditEditsItemEdit24" | "LensEditEditsItemEdit25" | "LensEditEditsItemEdit26" | "LensEditEditsItemEdit27"]
    """The changes, in this order."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq']
    """The format of the text."""
    lens: str | "LensEditLensInput2LensText1" | "LensEditLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself. It may be one that cannot be built."""


class LensEditEditsItemEdit1(TypedDict, total=False):
    """Sets a radius of curvature.

    Needs `edit`, `surface`."""
    edit: Literal['radius']
    radius_mm: float | None
    """Radius, mm; null for a plane."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit2(TypedDict, total=False):
    """Sets a vertex curvature.

    Needs `edit`, `surface`, `curvature_per_mm`."""
    curvature_per_mm: float
    """Curvature, 1/mm."""
    edit: Literal['curvature']
    surface: int
    """Surface."""


class LensEditEditsItemEdit3(TypedDict, total=False):
    """Bends an element: the same change of both curvatures, so that its power as a thin lens stays.

    Needs `edit`, `surface`, `by_per_mm`."""
    by_per_mm: float
    """What is added to both curvatures, 1/mm."""
    edit: Literal['bend']
    surface: int
    """Surface in front of the glass."""


class LensEditEditsItemEdit4(TypedDict, total=False):
    """Sets the curvature with which the conic has a given sag at a given height; the even polynomial and what else
    departs from it stay.

    Needs `edit`, `surface`, `height_mm`, `sag_mm`."""
    edit: Literal['sag']
    height_mm: float
    """Height above the axis, mm."""
    sag_mm: float
    """Sag of the whole surface there, mm."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit5(TypedDict, total=False):
    """Sets a conic constant.

    Needs `edit`, `surface`, `conic`."""
    conic: float
    """Conic constant."""
    edit: Literal['conic']
    surface: int
    """Surface."""


class LensEditEditsItemEdit6(TypedDict, total=False):
    """Sets a coefficient of the even polynomial.

    Needs `edit`, `surface`, `power`, `value`."""
    edit: Literal['asphere']
    power: int
    """Power of r: 2, 4, ..., 16."""
    surface: int
    """Surface."""
    value: float
    """Coefficient, mm^(1 - power)."""


class LensEditEditsItemEdit7(TypedDict, total=False):
    """Sets the distance to the next surface; of the last one, to the image plane.

    Needs `edit`, `surface`, `thickness_mm`."""
    edit: Literal['thickness']
    surface: int
    """Surface."""
    thickness_mm: float
    """Distance, mm."""


class LensEditEditsItemEdit8(TypedDict, total=False):
    """Sets the clear semi-diameter.

    Needs `edit`, `surface`, `semi_diameter_mm`."""
    edit: Literal['semi-diameter']
    semi_diameter_mm: float
    """Clear semi-diameter, mm."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit9(TypedDict, total=False):
    """Sets the medium behind a surface.

    Needs `edit`, `surface`, `glass`."""
    edit: Literal['glass']
    glass: str
    """Name of a glass, or `MAKER:NAME`; `AIR` or nothing for air."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit10(TypedDict, total=False):
    """Names a surface.

    Needs `edit`, `surface`, `label`."""
    edit: Literal['label']
    label: str
    """What it is called."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit11(TypedDict, total=False):
    """Makes a surface the aperture stop.

    Needs `edit`, `surface`."""
    edit: Literal['stop']
    surface: int
    """Surface."""


class LensEditEditsItemEdit12(TypedDict, total=False):
    """Inserts a plane without effect in front of a surface, in the middle of the gap; the other surfaces stay in
    place.

    Needs `edit`, `before`."""
    before: int
    """The surface that comes behind it; one more than the last surface inserts behind all."""
    edit: Literal['insert']


class LensEditEditsItemEdit13(TypedDict, total=False):
    """Deletes a surface; the others stay in place.

    Needs `edit`, `surface`."""
    edit: Literal['delete']
    surface: int
    """Surface."""


class LensEditEditsItemEdit14(TypedDict, total=False):
    """Sets the diameter of the entrance pupil.

    Needs `edit`, `entrance_pupil_mm`."""
    edit: Literal['aperture']
    entrance_pupil_mm: float
    """Diameter, mm."""


class LensEditEditsItemEdit15(TypedDict, total=False):
    """Sets the fields.

    Needs `edit`, `fields_deg`."""
    edit: Literal['fields']
    fields_deg: list[float]
    """Fields, degrees, in any order."""


class LensEditEditsItemEdit16(TypedDict, total=False):
    """Sets the wavelengths.

    Needs `edit`, `wavelengths_um`, `reference_um`."""
    edit: Literal['wavelengths']
    reference_um: float
    """The reference wavelength, um."""
    wavelengths_um: list[float]
    """Wavelengths, um, in any order."""


class LensEditEditsItemEdit17(TypedDict, total=False):
    """Moves the object plane.

    Needs `edit`."""
    distance_mm: float | None
    """Distance from the object to the first vertex, mm; null for infinity."""
    edit: Literal['object']


class LensEditEditsItemEdit18(TypedDict, total=False):
    """Names the lens.

    Needs `edit`, `name`."""
    edit: Literal['name']
    name: str
    """What it is called."""


class LensEditEditsItemEdit19(TypedDict, total=False):
    """Moves the image plane to a focus, once.

    Needs `edit`, `at`."""
    at: Literal['file'] | Literal['paraxial'] | Literal['best']
    """To which."""
    edit: Literal['focus']


class LensEditEditsItemEdit20(TypedDict, total=False):
    """Scales every length of the lens, so that its focal length becomes a given one.

    Needs `edit`, `efl_mm`."""
    edit: Literal['scale-to']
    efl_mm: float
    """Focal length, mm."""


class LensEditEditsItemEdit21(TypedDict, total=False):
    """Lets a number vary in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['vary']
    max: float | None
    """Upper bound."""
    min: float | None
    """Lower bound; about the own value if both are left out."""
    parameter: str
    """The number as lens files name it: `radius_mm`, `thickness_mm`, `conic`, `a4`, ..."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit22(TypedDict, total=False):
    """Holds a number in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['hold']
    parameter: str
    """The number as lens files name it."""
    surface: int
    """Surface."""


class LensEditEditsItemEdit23(TypedDict, total=False):
    """Lets a number follow the same number of another surface, now and after each further edit: `scale * other +
    offset`. The other one varies in optimisations from now on, if it does not yet.

    Needs `edit`, `surface`, `parameter`, `of`."""
    edit: Literal['pickup']
    of: int
    """Surface that it follows."""
    offset: float | None
    """Offset in the unit of the number, of radii in 1/mm, of tilts in degrees; 0 if it is left out."""
    parameter: str
    """The number as lens files name it; radii follow as curvatures."""
    scale: float | None
    """Factor; 1 if it is left out."""
    surface: int
    """Surface that follows."""


class LensEditEditsItemEdit24(TypedDict, total=False):
    """Weights the fields in optimisations.

    Needs `edit`, `weights`."""
    edit: Literal['field-weights']
    weights: list[float]
    """One weight per field of the lens, in ascending order of the fields; empty for all the same."""


class LensEditEditsItemEdit25(TypedDict, total=False):
    """Lets a radius hold the magnification of a near object, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-magnification']
    magnification: float | None
    """Magnification, negative for an inverted image; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensEditEditsItemEdit26(TypedDict, total=False):
    """Lets a thickness hold the distance from the first vertex to the last, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-length']
    length_mm: float | None
    """Distance, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensEditEditsItemEdit27(TypedDict, total=False):
    """Lets a radius hold the focal length, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-efl']
    efl_mm: float | None
    """Focal length, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class LensEditLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensEditLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensTrace(TypedDict, total=False):
    """A ray through a lens.

    Needs `lens`, `field`, `wavelength`, `pupil`."""
    aim: Literal['real'] | Literal['paraxial']
    """What the pupil point lies on."""
    field: float
    """Field angle, degrees: within 180 degrees of the axis, or 90 for a near object. Unit: deg."""
    lens: str | "LensTraceLensInput2LensText1" | "LensTraceLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    pupil: list[float]
    """Point of the pupil, x and y in units of its radius."""
    wavelength: float
    """Wavelength, um, 0.2 to 20. Unit: um."""


class LensTraceLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensTraceLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensAnalyze(TypedDict, total=False):
    """What to compute of a lens, and what to write.

    Files: one SVG for every `Picture`; `analysis.html`, all of them on one page; `analysis.json`, the data; the
    curves as CSV. Of fields and wavelengths 31 each are analysed at most; rays are aimed at the real stop.

    Needs `lens`."""
    fields: list[float]
    """Field angles, degrees; those of the lens if empty. Unit: degrees."""
    focus: Literal['file'] | Literal['paraxial'] | Literal['best']
    """Where the image plane goes."""
    frequency: float | None
    """Frequency of MTF through focus, cycles/mm; half of the highest, or of the Nyquist frequency, if left out.
    Unit: cycles/mm."""
    lens: str | "LensAnalyzeLensInput2LensText1" | "LensAnalyzeLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    max_frequency: float | None
    """Highest frequency of MTF curves, cycles/mm; if left out, 100, or about half of the cutoff if that is less, but
    beyond the Nyquist frequency. Unit: cycles/mm."""
    only: list[str]
    """Write only these of `names`; all if empty."""
    out: str | None
    """Folder for the results; `NAME-analysis` if left out."""
    pixel_um: float | None
    """Pixel pitch, um, 0.1 to 1000, in place of a sensor. Unit: um."""
    sensor: str | "LensAnalyzeSensor1Input22TomlText" | None
    """Sensor, by name, by path, or itself: its pixels' Nyquist frequency is marked in MTF curves."""
    wavelengths: list[float]
    """Wavelengths, um; those of the lens if empty. First-order properties stay those of the lens's reference
    wavelength. Unit: um."""


class LensAnalyzeLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensAnalyzeLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensAnalyzeSensor1Input22TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


LensConvert = TypedDict('LensConvert', {'from': Any, 'to': Any}, total=False)


class LensConvertFromInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensConvertFromInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensFocus(TypedDict, total=False):
    """A lens to focus.

    Needs `lens`."""
    focus: Literal['file'] | Literal['paraxial'] | Literal['best']
    """Where its image plane goes."""
    lens: str | "LensFocusLensInput2LensText1" | "LensFocusLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    to: str | None
    """The file to write, whose ending names the format; none to see the figures alone."""


class LensFocusLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensFocusLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensList(TypedDict, total=False):
    """The built-in lenses."""


class LensOptimize(TypedDict, total=False):
    """An optimisation that begins, or one that is continued, and how far it goes in this call.

    Needs `start`."""
    iterations: int | None
    """Iterations of a descent: 200 if none are given. One that is continued goes on to those that it began with, or
    takes as many more as are given here."""
    rounds: int | None
    """Rounds of a search, 1 at least: 10 if none are given; the same rounds give the same lenses on any machine. One
    that is continued goes on to those that it began with, or takes as many more as are given here."""
    seconds: float | None
    """Stops a search after the round in which so many seconds have passed, if that is before its last round. Unit:
    s."""
    start: "LensOptimizeStartStart1" | "LensOptimizeStartStart2"
    """Where it starts."""
    trade: bool
    """Whether to search again, for as many rounds, with each of some further requirements, to see what each costs."""


class LensOptimizeStartStart1(TypedDict, total=False):
    """At a lens.

    Needs `new`."""
    new: "LensOptimizeStartStart1New"


LensOptimizeStartStart1New = TypedDict('LensOptimizeStartStart1New', {'global': Any, 'goal': Any, 'lens': Any, 'out': Any, 'seed': Any}, total=False)


class LensOptimizeStartStart1NewGoalGoal(TypedDict, total=False):
    """What an optimised lens has to be."""
    air: float | None
    """Least air between elements, on the axis and at the edge, mm, 0.01 at least. Unit: mm."""
    bfl: list[float]
    """Least and greatest back focal length, mm, positive in the direction of the light; empty for none. Unit: mm."""
    centre: float | None
    """Least centre thickness of every element, mm. Unit: mm."""
    chief_ray_angle: float | None
    """Greatest angle of the outermost chief ray to the axis at the image, degrees. Unit: degrees."""
    clear_diameter: float | None
    """Greatest clear diameter of any surface, mm. Unit: mm."""
    distortion: float | None
    """Greatest distortion at the outermost field, percent. Unit: %."""
    edge: float | None
    """Least edge thickness of every element, mm, 0.01 at least. Unit: mm."""
    efl: str | None
    """Focal length to hold, mm, or `free`; if left out what the lens file solves for, else that of the lens at the
    start, or the magnification of a near object."""
    f_number: float | None
    """F-number: sets the entrance pupil by the focal length that is held, or that of the start."""
    fields: list[float]
    """Field angles, degrees, all of the same weight; those of the lens with their weights if empty. Unit: degrees."""
    glass: list[str]
    """Glasses that a search may exchange, each as `SURFACE` or `SURFACE=NAME,...`: the surface in front of the
    glass, and the names that it may get, the whole catalogue if none. The glass that it has always takes part."""
    operands: "LensOptimizeStartStart1NewGoalGoalOperands1OperandFile" | None
    """Further figures, each with a bound and a weight, and the weight of the spots beside them."""
    power: float
    """The mean over the fields of `RMS^power` is minimised: 1 the mean spot, 2 the mean square, 8 nearly the worst;
    0.5 to 64."""
    restored: "LensOptimizeStartStart1NewGoalGoalRestored1Restored" | None
    """The error of the best linear restoration of the frames of a camera is minimised in place of the spots."""
    slope: float | None
    """Steepest surface within its clear aperture, degrees. Unit: degrees."""
    track: float | None
    """Greatest track, mm: between any two of the vertices and the image plane. Unit: mm."""
    vary: list[Literal['curvature'] | Literal['thickness'] | Literal['air'] | Literal['conic'] | Literal['asphere']]
    """Kinds of numbers that vary beside the variables of the lens file; a lens whose file names none varies these
    alone."""
    wavelengths: list[float]
    """Wavelengths, um, all of the same weight; those of the lens if empty. Unit: um."""


class LensOptimizeStartStart1NewGoalGoalOperands1OperandFile(TypedDict, total=False):
    """Figures that a lens should reach.

    Needs `operand`."""
    operand: list["LensOptimizeStartStart1NewGoalGoalOperands1OperandFileOperandItemOperand"]
    """The figures."""
    spot_weight: float
    """How much the RMS spots count beside them, from 0."""


class LensOptimizeStartStart1NewGoalGoalOperands1OperandFileOperandItemOperand(TypedDict, total=False):
    """A figure with its bounds.

    Needs `of`."""
    at_least: float | None
    """Least value."""
    at_most: float | None
    """Greatest value."""
    field_deg: float | None
    """Field angle, degrees; where it is left out, all fields of the lens for contrast, spots and wavefronts, and the
    outermost for the others."""
    frequency_per_mm: float | None
    """Spatial frequency of contrast, cycles per mm."""
    of: Literal['mtf'] | Literal['spot'] | Literal['wavefront'] | Literal['focal-length'] | Literal['back-focal-length'] | Literal['track'] | Literal['distortion'] | Literal['chief-ray-angle'] | Literal['image-height']
    """The figure."""
    waves: bool
    """Whether contrast includes diffraction."""
    weight_um: float
    """The weight of one unit beyond a bound, as a spot radius in um. A unit is 1 for contrast, 1 wave for a
    wavefront, 1 um for a spot. Bounds of the other figures bind: a millimetre beyond weighs at least 10 000 um,
    as for a limit."""


class LensOptimizeStartStart1NewGoalGoalRestored1Restored(TypedDict, total=False):
    """The camera whose raw frames should be restored as well as possible."""
    sensor: str
    """Sensor, by file or built-in name."""
    white_e: float
    """Photoelectrons that white gives in a green pixel on the axis. Unit: e-."""


class LensOptimizeStartStart1NewLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensOptimizeStartStart1NewLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class LensOptimizeStartStart2(TypedDict, total=False):
    """Where the optimisation in a folder ended, with its goal.

    Needs `resume`."""
    resume: "LensOptimizeStartStart2Resume"


class LensOptimizeStartStart2Resume(TypedDict, total=False):
    """A part of a request.

    Needs `folder`."""
    folder: str
    """The folder."""
    rewind: int | None
    """Forget every step after this one first."""


class LensTolerance(TypedDict, total=False):
    """A lens with its tolerances, and what to find out.

    Needs `lens`."""
    compensate: Literal['focus'] | Literal['none']
    """What is adjusted on every lens."""
    frequency: float
    """Spatial frequency of the MTF, cycles/mm, 0.01 to 10000. Unit: cycles/mm."""
    grade: Literal['commercial'] | Literal['precision'] | Literal['high'] | None
    """Tolerances of good practice for everything that the file does not name; precision without a file."""
    inverse: float | None
    """A loss of the merit; the response gives the tolerance of each quantity that costs this loss over the root of
    their number: together they cost it as a root sum square."""
    kind: Literal['geometric'] | Literal['diffraction']
    """Whether the MTF takes light for rays or for waves."""
    lens: str | "LensToleranceLensInput2LensText1" | "LensToleranceLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    limit: float | None
    """A value of the merit; the response gives the number of lenses that reach it."""
    list_trials: bool
    """Whether the response lists every random lens with its errors: some 50 numbers each."""
    merit: Literal['rms'] | Literal['mtf']
    """What a lens is judged by, over its fields (on both sides of the axis) and wavelengths."""
    out: str | None
    """Folder for the results; nothing is written without one."""
    part: "LensTolerancePart1Part" | None
    """Only random lenses of these numbers, as a part of `trials` that is joined with others later; sensitivities are
    then left to the joining."""
    seed: int
    """Seed of the random lenses."""
    tolerances: str | None
    """Tolerance file."""
    trials: int
    """How many lenses are made at random, 1000000 at most."""
    worst: int
    """How many of the worst lenses are named and written."""


class LensToleranceLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class LensToleranceLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


LensTolerancePart1Part = TypedDict('LensTolerancePart1Part', {'from': Any, 'to': Any}, total=False)


class GlassFind(TypedDict, total=False):
    """Which glasses to look for. The distance is `sqrt((dnd / 0.01)^2 + dVd^2)`: 0.01 of index counts as much as 1
    of Abbe number.

    Needs `nd`, `vd`."""
    count: int
    """Largest number of glasses in the response."""
    maker: str | None
    """Only glasses of this maker: any part of the name, in upper or lower case."""
    nd: float
    """Index at the d line, 587.6 nm, 1 to 5."""
    obsolete: bool
    """Whether obsolete glasses count too."""
    vd: float
    """Abbe number `(nd - 1) / (nF - nC)`, 1 to 1000."""


class GlassList(TypedDict, total=False):
    """Which glasses to list."""
    maker: str | None
    """Only glasses of this maker: any part of the name, in upper or lower case."""


class GlassShow(TypedDict, total=False):
    """Which glass to show, and in which air.

    Needs `name`."""
    name: str
    """Its name, or `MAKER:NAME` where several makers have one of that name."""
    pressure: float | None
    """Pressure of that air, atm, 0 (vacuum) to 100; 1 if left out. Needs a temperature. Unit: atm."""
    temperature: float | None
    """Temperature of the glass and of the air around it, degrees Celsius, -200 to 1000, for `Line::index_at`. Unit:
    degrees Celsius."""


class Psf(TypedDict, total=False):
    """The PSFs of a lens, per field and wavelength, written to a folder.

    Files: `psf.npy`, float64 `[field, wavelength, row, column]`, each of unit sum, centred on the chief ray;
    `illumination.npy`, float64 `[field, wavelength]`; `psf.png`, a labelled sheet to look at; `psf.json`, the
    axes. `simulate`, `apply`, `evaluate` and experiments take the folder.

    Needs `lens`, `out`."""
    corner_mm: float
    """Image radius of the last field, mm. Unit: mm."""
    fields: int
    """Number of fields from the axis to the corner, 2 to 201."""
    grid: int
    """Cells a side, 16 to 1024."""
    kind: Literal['geometric'] | Literal['diffraction']
    """Rays or waves."""
    lens: str | "PsfLensInput2LensText1" | "PsfLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    out: str
    """Folder for the results."""
    pitch_um: float
    """Cell size, um. Unit: um."""
    pupil_cells: int
    """Least pupil cells a side; diffraction chooses its own."""
    pupil_error: float
    """Error (L1, of PSFs of unit sum) above which the pupil cells are doubled."""
    wavelengths: list[float]
    """Wavelengths of the red, green and blue channel, um, 0.2 to 20. Unit: um."""


class PsfLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class PsfLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class PsfCalibrate(TypedDict, total=False):
    """Captures of a pinhole from which to measure PSFs.

    Files: `calibration.json`, all figures; `psf-calibration.html`, a page to look at; `psf-calibration.png`, all
    PSFs on a sheet; `measured.npy`, float64 `[position, channel, row, column]`; `psf.json`, `psf.npy` (float32)
    and `illumination.npy`, the bank of PSFs, which `simulate`, `apply`, `evaluate` and experiments take.

    Needs `captures`."""
    captures: str
    """Folder of captures, with `captures.toml`."""
    lens: str | "PsfCalibrateLens1Input2LensText1" | "PsfCalibrateLens1Input2LensText2" | None
    """Lens to compare with, if any: a built-in name, the path of a file, or the lens itself."""
    out: str | None
    """Folder for the results; `psf-calibration` in the folder of captures if it is not given."""
    seed: int
    """Seed of the draws behind the noise floor."""


class PsfCalibrateLens1Input2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class PsfCalibrateLens1Input2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class PsfCapture(TypedDict, total=False):
    """Captures of a pinhole: frames and their manifest, for `crate::psf_calibrate`.

    A pinhole lit by a white diode of 4900 K is put at field radii along directions from the axis; fields that the
    sensor does not reach are left out. The camera turns towards the source. At each place frames are taken at
    several exposure times with the sensor's noise; only a window around the source is written. A folder that
    holds captures is not changed.

    Needs `lens`, `out`."""
    axes: list[Literal['vertical'] | Literal['horizontal'] | Literal['diagonal']]
    """Directions in which the source is moved."""
    dark_frames: int
    """Dark frames of each exposure time and place, 0 to 1000."""
    distance_mm: float
    """Distance of the pinhole from the lens, mm, 10 to 1e7. Unit: mm."""
    exposures_ms: list[float]
    """Exposure times, ms, the shortest first. Unit: ms."""
    fields: int
    """Number of fields from the axis to `radius_mm`, 1 to 99."""
    focus: Literal['source'] | Literal['file']
    """Where the lens is focused."""
    frames: int
    """Frames of each exposure time, 1 to 1000."""
    lens: str | "PsfCaptureLensInput2LensText1" | "PsfCaptureLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    out: str
    """Folder for the captures."""
    peak: float
    """Signal of the brightest pixel of all places, behind its own colour filter, at the longest exposure, as a share
    of the range of converter or full well, the lesser; above 1 it clips. It sets the brightness of the source."""
    pinhole_um: float
    """Diameter of the pinhole, um; its image may be at most a pixel wide. Unit: um."""
    radius_mm: float
    """Image radius of the last field, mm. Unit: mm."""
    seed: int
    """Seed of the noise and of the error of alignment, up to half a pixel."""
    sensor: str | "PsfCaptureSensorInput22TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""
    window: int
    """Pixels a side of the window that is written, 48 to 1024."""


class PsfCaptureLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class PsfCaptureLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class PsfCaptureSensorInput22TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class SensorList(TypedDict, total=False):
    """The built-in sensors."""


class SensorShow(TypedDict, total=False):
    """A sensor to look at.

    Needs `sensor`."""
    gains: list[float]
    """Linear gains of the figures, above 0 and at most 10000; if empty those that the sensor offers, or 1."""
    sensor: str | "SensorShowSensorInput2TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""


class SensorShowSensorInput2TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class SensorCapture(TypedDict, total=False):
    """The calibration series of a sensor: pairs of flat and of dark frames over gains and exposure times, further
    dark pairs for the dark current, and stacks for the non-uniformity, all listed in `captures.toml`.

    The same request continues a series that was interrupted. An empty field takes its value from the series that
    `emva` chooses.

    Needs `sensor`, `out`."""
    dark_exposures: list[float] | None
    """Exposure times of dark pairs, ms. Unit: ms."""
    emva: bool
    """The series of EMVA 1288 release 4.0 Linear (`Plan::emva`) in place of that of Tseng et al. 2021
    (`Plan::default`)."""
    exposures: list[float] | None
    """Exposure times of flat and dark pairs, ms. Unit: ms."""
    format: Literal['tiff'] | Literal['png']
    """Format of the frames."""
    gains: list[float]
    """Linear gains; if empty, those of the series."""
    level: float | None
    """Signal of the brightest colour at the longest exposure as a share of the range; above 1 it saturates."""
    out: str
    """Folder for the captures."""
    quantum_efficiency: float | None
    """Quantum efficiency of green or clear pixels, 0 to 1, which converts electrons to photons."""
    seed: int
    """Seed of the noise."""
    sensor: str | "SensorCaptureSensorInput2TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""
    size: list[int] | None
    """Rows and columns of the frames, from the corner of the sensor; by default the whole sensor."""
    stack: int | None
    """Frames of the flat and the dark stack; 0 for none."""
    wavelength: float | None
    """Wavelength of the light, um; the sensor's curves there give the photons and the response of each colour,
    unless `quantum_efficiency` is given. Unit: um."""


class SensorCaptureSensorInput2TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class SensorCharacterize(TypedDict, total=False):
    """Captures from which to measure a sensor: EMVA 1288, and the paper's calibration over all gains.

    Needs `dir`."""
    dir: str
    """Folder of the captures, or its `captures.toml`."""
    fit_histograms: bool
    """Whether the remaining parameters of the model are fitted to the captured histograms."""
    highpass: Literal['none'] | Literal['r3.1'] | Literal['r4']
    """High-pass before DSNU and PRNU."""
    mean_difference: bool
    """Whether the difference of the frames' means is taken from the temporal variance; without it, Eq. 6 of Tseng et
    al. 2021."""
    out: str | None
    """Folder for the results, which are not written without it: `sensor.toml` if K is resolved, `results.json`,
    `emva-*.xml` for each gain and colour, `histograms.csv`, `report.html`, and its plots as `.svg`."""
    pixel_um: float | None
    """Pixel pitch, um, 0.1 to 1000, if the list does not state it. Unit: um."""
    values: Literal['library'] | Literal['corrected']
    """Which values the XML files hold."""


class Simulate(TypedDict, total=False):
    """Photographs and scenes to take. What is left out has the default of the command.

    Needs `images`."""
    development: "SimulateDevelopmentInterpolation"
    """How the colours of the mosaic are interpolated."""
    gain: float
    """Linear analogue gain."""
    images: list[str]
    """Photographs (PNG, JPEG, TIFF, WebP, BMP; OpenEXR and Radiance HDR in linear light), spectral images, or
    `scene:NAME`."""
    isp: str | None
    """An image signal processor whose picture is written beside the developed one: a preset, a file, or `neutral`."""
    lens: str | "SimulateLensInput2LensText1" | "SimulateLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    no_distortion: bool
    """Take the picture as the light on the image plane: straight lines stay straight. Without it, the picture is the
    rectilinear scene in front of the lens, and its distortion is rendered."""
    no_noise: bool
    """Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays."""
    out: str
    """Folder for the results."""
    picture_format: Literal['png'] | Literal['png16'] | Literal['exr'] | Literal['npy']
    """Format of the developed picture."""
    place: Literal['fill'] | Literal['centre']
    """How a photograph lands on the sensor."""
    psfs: str | None
    """PSFs in place of those of the lens: the folder of results of `psf` or `psf-calibrate`, or its `psf.json`."""
    raw_format: Literal['tiff'] | Literal['png'] | Literal['packed'] | Literal['npy']
    """Format of the raw frame."""
    restore: "SimulateRestore1Restore" | None
    """Restoration of the developed picture with the PSFs of the lens; none leaves its blur."""
    samples: int | None
    """Samples of the scene along a side of a pixel, 1 to 8: a pixel collects the light of `samples` x `samples` of
    them. If left out, 4 where every image is a built-in scene of edges and at most a million pixels are read, and
    else 1."""
    seed: int
    """Seed of the noise."""
    sensor: str | "SimulateSensorInput22TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""
    size: list[Any] | None
    """Rows and columns in the middle of the sensor that are read; all of them if none are given."""
    spectral: "SimulateSpectralSpectral"
    """The light, for a simulation over the spectrum."""
    time_s: float
    """Exposure time, s. Unit: s."""
    white_e: float | None
    """Photoelectrons that white gives in a green pixel on the axis; 70 % of those with which white saturates the
    first colour if none are given, or what the light gives over the spectrum. Unit: e-."""


class SimulateDevelopmentInterpolation(TypedDict, total=False):
    """Interpolation of the colours of white-balanced mosaics, 1 = white."""
    demosaic: Literal['bilinear'] | Literal['malvar'] | Literal['rcd'] | Literal['menon']
    """The method."""
    domain: Literal['linear'] | Literal['stabilised']
    """The values that it takes."""


class SimulateLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class SimulateLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class SimulateRestore1Restore(TypedDict, total=False):
    """Restoration of a developed picture."""
    noise: float | None
    """Power of noise over that of the picture at a tenth of a cycle per pixel; that of sensor, exposure and
    demosaicing if none is given."""


class SimulateSensorInput22TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class SimulateSpectralSpectral(TypedDict, total=False):
    """The light, and how finely its spectrum is sampled. Any of these makes a simulation one over the spectrum."""
    bands: int | None
    """Bands for scenes and photographs, 2 to 401; 16, or more where these would be over 20 nm apart."""
    illuminance_lux: float | None
    """Illuminance of the scene, lux; 500, or as `white_e` needs. Unit: lux."""
    illuminant: str | None
    """Light on the scene: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file of wavelengths
    in nm and relative power; D65 if none is named."""
    no_colour_matrix: bool
    """The camera's own colours, without the matrix fitted to the ColorChecker."""
    qe: str | None
    """Quantum efficiency in place of the sensor's: a built-in name, `flat:VALUE`, or a CSV or TOML file."""
    three_band: bool
    """Photographs through three PSFs, then electrons by a 3x3 matrix."""
    transmission: str | None
    """Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission."""


class CameraView(TypedDict, total=False):
    """A camera, and the place of its image that is looked at.

    Needs `lens`."""
    array: list[int]
    """Rows and columns of the array; those of the sensor's pixels that fill the image circle if left empty. Unit:
    pixels."""
    at: list[float]
    """Where: x and y from the upper left corner of the array, as shares of its width and height."""
    edges: list["CameraViewEdgesItemRegion"]
    """Regions of the window with one slanted edge each, whose MTF is measured in the developed picture, as `raw-mtf`
    measures it."""
    edits: list["CameraViewEditsItemEdit1" | "CameraViewEditsItemEdit2" | "CameraViewEditsItemEdit3" | "CameraViewEditsItemEdit4" | "CameraViewEditsItemEdit5" | "CameraViewEditsItemEdit6" | "CameraViewEditsItemEdit7" | "CameraViewEditsItemEdit8" | "CameraViewEditsItemEdit9" | "CameraViewEditsItemEdit10" | "CameraViewEditsItemEdit11" | "CameraViewEditsItemEdit12" | "CameraViewEditsItemEdit13" | "CameraViewEditsItemEdit14" | "CameraViewEditsItemEdit15" | "CameraViewEditsItemEdit16" | "CameraViewEditsItemEdit17" | "CameraViewEditsItemEdit18" | "CameraViewEditsItemEdit19" | "CameraViewEditsItemEdit20" | "CameraViewEditsItemEdit21" | "CameraViewEditsItemEdit22" | "CameraViewEditsItemEdit23" | "CameraViewEditsItemEdit24" | "CameraViewEditsItemEdit25" | "CameraViewEditsItemEdit26" | "CameraViewEditsItemEdit27"]
    """Changes of the lens that come first, in this order."""
    exposure_ev: float
    """Stops by which the picture is exposed more than `white_e` says. Unit: stops."""
    gain: float
    """Linear analogue gain."""
    isp: str | None
    """An ISP in place of linear development: the name of a preset, `neutral`, or a file of settings or of the
    description of an external ISP."""
    lens: str | "CameraViewLensInput2LensText1" | "CameraViewLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    no_noise: bool
    """Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays."""
    photo: str
    """The scene: a built-in photograph, the path of a picture, or `scene:NAME`. One that is smaller than the array,
    and every built-in scene, lies at the place that is looked at; a larger one covers the array."""
    quick: bool
    """Few fields, few rays, few patches, for a lens that is being dragged."""
    raw: bool
    """Whether the raw frame is given as well."""
    seed: int
    """Seed of the noise."""
    sensor: str | "CameraViewSensorInput22TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""
    set: list[str]
    """Further values of its parameters, each `stage.key=value`."""
    size: list[int]
    """Rows and columns that are developed; fewer where the array has no more. Unit: pixels."""
    time_s: float
    """Exposure time, s. Unit: s."""
    white_e: float | None
    """Photoelectrons that white gives in a green pixel on the axis; 70 % of what saturates the first colour if left
    out. Unit: e-."""


class CameraViewEdgesItemRegion(TypedDict, total=False):
    """A rectangle of a frame's pixels. As text: `ROW,COL,HEIGHT,WIDTH`.

    Needs `row`, `col`, `height`, `width`."""
    col: int
    """First column, from 0."""
    height: int
    """Rows."""
    row: int
    """First row, from 0."""
    width: int
    """Columns."""


class CameraViewEditsItemEdit1(TypedDict, total=False):
    """Sets a radius of curvature.

    Needs `edit`, `surface`."""
    edit: Literal['radius']
    radius_mm: float | None
    """Radius, mm; null for a plane."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit2(TypedDict, total=False):
    """Sets a vertex curvature.

    Needs `edit`, `surface`, `curvature_per_mm`."""
    curvature_per_mm: float
    """Curvature, 1/mm."""
    edit: Literal['curvature']
    surface: int
    """Surface."""


class CameraViewEditsItemEdit3(TypedDict, total=False):
    """Bends an element: the same change of both curvatures, so that its power as a thin lens stays.

    Needs `edit`, `surface`, `by_per_mm`."""
    by_per_mm: float
    """What is added to both curvatures, 1/mm."""
    edit: Literal['bend']
    surface: int
    """Surface in front of the glass."""


class CameraViewEditsItemEdit4(TypedDict, total=False):
    """Sets the curvature with which the conic has a given sag at a given height; the even polynomial and what else
    departs from it stay.

    Needs `edit`, `surface`, `height_mm`, `sag_mm`."""
    edit: Literal['sag']
    height_mm: float
    """Height above the axis, mm."""
    sag_mm: float
    """Sag of the whole surface there, mm."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit5(TypedDict, total=False):
    """Sets a conic constant.

    Needs `edit`, `surface`, `conic`."""
    conic: float
    """Conic constant."""
    edit: Literal['conic']
    surface: int
    """Surface."""


class CameraViewEditsItemEdit6(TypedDict, total=False):
    """Sets a coefficient of the even polynomial.

    Needs `edit`, `surface`, `power`, `value`."""
    edit: Literal['asphere']
    power: int
    """Power of r: 2, 4, ..., 16."""
    surface: int
    """Surface."""
    value: float
    """Coefficient, mm^(1 - power)."""


class CameraViewEditsItemEdit7(TypedDict, total=False):
    """Sets the distance to the next surface; of the last one, to the image plane.

    Needs `edit`, `surface`, `thickness_mm`."""
    edit: Literal['thickness']
    surface: int
    """Surface."""
    thickness_mm: float
    """Distance, mm."""


class CameraViewEditsItemEdit8(TypedDict, total=False):
    """Sets the clear semi-diameter.

    Needs `edit`, `surface`, `semi_diameter_mm`."""
    edit: Literal['semi-diameter']
    semi_diameter_mm: float
    """Clear semi-diameter, mm."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit9(TypedDict, total=False):
    """Sets the medium behind a surface.

    Needs `edit`, `surface`, `glass`."""
    edit: Literal['glass']
    glass: str
    """Name of a glass, or `MAKER:NAME`; `AIR` or nothing for air."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit10(TypedDict, total=False):
    """Names a surface.

    Needs `edit`, `surface`, `label`."""
    edit: Literal['label']
    label: str
    """What it is called."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit11(TypedDict, total=False):
    """Makes a surface the aperture stop.

    Needs `edit`, `surface`."""
    edit: Literal['stop']
    surface: int
    """Surface."""


class CameraViewEditsItemEdit12(TypedDict, total=False):
    """Inserts a plane without effect in front of a surface, in the middle of the gap; the other surfaces stay in
    place.

    Needs `edit`, `before`."""
    before: int
    """The surface that comes behind it; one more than the last surface inserts behind all."""
    edit: Literal['insert']


class CameraViewEditsItemEdit13(TypedDict, total=False):
    """Deletes a surface; the others stay in place.

    Needs `edit`, `surface`."""
    edit: Literal['delete']
    surface: int
    """Surface."""


class CameraViewEditsItemEdit14(TypedDict, total=False):
    """Sets the diameter of the entrance pupil.

    Needs `edit`, `entrance_pupil_mm`."""
    edit: Literal['aperture']
    entrance_pupil_mm: float
    """Diameter, mm."""


class CameraViewEditsItemEdit15(TypedDict, total=False):
    """Sets the fields.

    Needs `edit`, `fields_deg`."""
    edit: Literal['fields']
    fields_deg: list[float]
    """Fields, degrees, in any order."""


class CameraViewEditsItemEdit16(TypedDict, total=False):
    """Sets the wavelengths.

    Needs `edit`, `wavelengths_um`, `reference_um`."""
    edit: Literal['wavelengths']
    reference_um: float
    """The reference wavelength, um."""
    wavelengths_um: list[float]
    """Wavelengths, um, in any order."""


class CameraViewEditsItemEdit17(TypedDict, total=False):
    """Moves the object plane.

    Needs `edit`."""
    distance_mm: float | None
    """Distance from the object to the first vertex, mm; null for infinity."""
    edit: Literal['object']


class CameraViewEditsItemEdit18(TypedDict, total=False):
    """Names the lens.

    Needs `edit`, `name`."""
    edit: Literal['name']
    name: str
    """What it is called."""


class CameraViewEditsItemEdit19(TypedDict, total=False):
    """Moves the image plane to a focus, once.

    Needs `edit`, `at`."""
    at: Literal['file'] | Literal['paraxial'] | Literal['best']
    """To which."""
    edit: Literal['focus']


class CameraViewEditsItemEdit20(TypedDict, total=False):
    """Scales every length of the lens, so that its focal length becomes a given one.

    Needs `edit`, `efl_mm`."""
    edit: Literal['scale-to']
    efl_mm: float
    """Focal length, mm."""


class CameraViewEditsItemEdit21(TypedDict, total=False):
    """Lets a number vary in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['vary']
    max: float | None
    """Upper bound."""
    min: float | None
    """Lower bound; about the own value if both are left out."""
    parameter: str
    """The number as lens files name it: `radius_mm`, `thickness_mm`, `conic`, `a4`, ..."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit22(TypedDict, total=False):
    """Holds a number in optimisations.

    Needs `edit`, `surface`, `parameter`."""
    edit: Literal['hold']
    parameter: str
    """The number as lens files name it."""
    surface: int
    """Surface."""


class CameraViewEditsItemEdit23(TypedDict, total=False):
    """Lets a number follow the same number of another surface, now and after each further edit: `scale * other +
    offset`. The other one varies in optimisations from now on, if it does not yet.

    Needs `edit`, `surface`, `parameter`, `of`."""
    edit: Literal['pickup']
    of: int
    """Surface that it follows."""
    offset: float | None
    """Offset in the unit of the number, of radii in 1/mm, of tilts in degrees; 0 if it is left out."""
    parameter: str
    """The number as lens files name it; radii follow as curvatures."""
    scale: float | None
    """Factor; 1 if it is left out."""
    surface: int
    """Surface that follows."""


class CameraViewEditsItemEdit24(TypedDict, total=False):
    """Weights the fields in optimisations.

    Needs `edit`, `weights`."""
    edit: Literal['field-weights']
    weights: list[float]
    """One weight per field of the lens, in ascending order of the fields; empty for all the same."""


class CameraViewEditsItemEdit25(TypedDict, total=False):
    """Lets a radius hold the magnification of a near object, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-magnification']
    magnification: float | None
    """Magnification, negative for an inverted image; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class CameraViewEditsItemEdit26(TypedDict, total=False):
    """Lets a thickness hold the distance from the first vertex to the last, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-length']
    length_mm: float | None
    """Distance, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class CameraViewEditsItemEdit27(TypedDict, total=False):
    """Lets a radius hold the focal length, now and after each further edit.

    Needs `edit`."""
    edit: Literal['solve-efl']
    efl_mm: float | None
    """Focal length, mm; the own one if left out."""
    surface: int | None
    """Surface; null ends the solve."""


class CameraViewLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class CameraViewLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class CameraViewSensorInput22TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class PhotoList(TypedDict, total=False):
    """Nothing to choose."""


class RawShow(TypedDict, total=False):
    """A raw frame to summarise: gray TIFF or PNG of 8 or 16 bits, a NumPy array, a packed `.raw` with its sidecar,
    or DNG with the cargo feature `dng`.

    Needs `file`."""
    file: str
    """The frame."""


class RawConvert(TypedDict, total=False):
    """A raw frame to write in the format that the name of the output ends with. Its digital numbers do not change.

    Camera and exposure are those of the input and its sidecar, except where the request gives them; they go into
    the sidecar of the output.

    Needs `input`, `output`."""
    bits: int | None
    """Bits of the digital numbers."""
    black_level_dn: float | None
    """Black level, DN. Unit: DN."""
    cfa: str | None
    """Colour filter array from the first pixel."""
    gain: float | None
    """Linear analogue gain."""
    input: str
    """The frame."""
    output: str
    """Where to write it: `.tiff`, `.png`, `.npy`, `.raw` or `.exr`."""
    packing: Literal['mipi'] | Literal['lsb'] | Literal['u16le'] | Literal['u16be'] | None
    """Packing of a `.raw`; by default the usual one of its bits."""
    pixel_um: float | None
    """Pixel pitch, um. Unit: um."""
    time_s: float | None
    """Exposure time, s. Unit: s."""
    white_level_dn: float | None
    """White level, DN. Unit: DN."""


class RawMtf(TypedDict, total=False):
    """A frame to measure.

    Needs `file`."""
    cfa: str | None
    """Colour filter array in place of that of the sidecar; of raw frames only."""
    file: str
    """A raw frame, as `raw show` reads it, or a picture."""
    is_picture: bool
    """Take gray integers as a picture, and undo its sRGB curve; otherwise they are digital numbers."""
    out: str | None
    """Folder for `mtf.csv`, `mtf.json` and `mtf.svg`; nothing is written without it."""
    pixel_um: float | None
    """Pixel pitch in place of that of the sidecar, um. Unit: um."""
    regions: list["RawMtfRegionsItemRegion"]
    """Regions with one edge each; if none are given, edges are looked for."""


class RawMtfRegionsItemRegion(TypedDict, total=False):
    """A rectangle of a frame's pixels. As text: `ROW,COL,HEIGHT,WIDTH`.

    Needs `row`, `col`, `height`, `width`."""
    col: int
    """First column, from 0."""
    height: int
    """Rows."""
    row: int
    """First row, from 0."""
    width: int
    """Columns."""


class IspShow(TypedDict, total=False):
    """An ISP to show."""
    gain_ev: float
    """Gain of the sensor above its lowest at which to show the values of a preset, EV. Unit: EV."""
    isp: str
    """Name of a preset, or a file of settings or of the description of an external ISP."""


class IspDevelop(TypedDict, total=False):
    """Raw frames to develop.

    For each `NAME.*` the folder `out` gets `NAME.png`, or `NAME.y4m` or `NAME.yuv`, and, with `strip`, `NAME-
    strip.html`: the picture after every stage, with the parameters of the stage. Frames that are merged give one
    picture, named by the first.

    Needs `raws`, `out`."""
    bits: int
    """Bits of the pictures, 8, 10 or 16; of luma and colour differences, 8 or 10. A PNG of 10 bits has its codes
    scaled to 16."""
    frame: "IspDevelopFrameFrameOptions"
    """What the raw files leave open."""
    isp: str
    """Name of a preset, or a file of settings or of the description of an external ISP."""
    merge: "IspDevelopMerge1Merge" | None
    """Merge the frames, exposures of one scene, into one."""
    out: str
    """Folder for the pictures; or, where there is one picture, its file."""
    raws: list[str]
    """The frames, in files with sidecars."""
    set: list[str]
    """Further values, each `stage.key=value`."""
    strip: bool
    """Whether to write the page of all stages."""
    ycbcr: "IspDevelopYcbcr1YcbcrFile" | None
    """Luma and colour differences in place of a PNG."""


class IspDevelopFrameFrameOptions(TypedDict, total=False):
    """What raw files leave open."""
    auto_balance: bool
    """Whether to estimate the white balance from the frame."""
    auto_exposure: bool
    """Whether to estimate from the frame what is white."""
    sensor: str | "IspDevelopFrameFrameOptionsSensor1Input2TomlText" | None
    """Sensor: a built-in name, the path of a file, or the sensor itself; none means the built-in sensor that the
    sidecar names, if any. What the calibration of a frame states counts before it."""
    white_dn: float | None
    """Digital number of white light in a green pixel; none means that of the calibration, else the level of
    saturation. Of merged frames it counts in numbers of the longest exposure, and the level of saturation is that
    of the merged frame, where the shortest exposure ends."""


class IspDevelopFrameFrameOptionsSensor1Input2TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class IspDevelopMerge1Merge(TypedDict, total=False):
    """Several raw files as one frame."""
    exposures: list[float] | None
    """Relative exposures, products of time and gain, one for each file; none takes them from the sidecars."""
    no_motion_check: bool
    """Leave out the check for motion."""


class IspDevelopYcbcr1YcbcrFile(TypedDict, total=False):
    """A file of luma and colour differences."""
    chroma: Literal['444'] | Literal['422'] | Literal['420']
    """How many colour differences there are."""
    container: Literal['y4m'] | Literal['yuv']
    """The kind of file."""
    range: Literal['full'] | Literal['limited']
    """The codes between black and white."""
    standard: Literal['bt601'] | Literal['bt709']
    """The standard of luma."""


class IspTune(TypedDict, total=False):
    """A search that begins, or one that is continued, and how far it goes.

    Needs `start`."""
    evaluations: int | None
    """Settings that are tried in all, those before an interruption included. If none are given, a new search tries
    500, and one that is continued as many as it began with."""
    start: "IspTuneStartStart1" | "IspTuneStartStart2"
    """Where it starts."""


class IspTuneStartStart1(TypedDict, total=False):
    """At the settings of an ISP.

    Needs `new`."""
    new: "IspTuneStartStart1New"


class IspTuneStartStart1New(TypedDict, total=False):
    """A part of a request.

    Needs `plan`, `out`."""
    out: str
    """Folder for results and state; it must not hold a search."""
    plan: "IspTuneStartStart1NewPlanPlan"
    """What is tuned for what."""


class IspTuneStartStart1NewPlanPlan(TypedDict, total=False):
    """What is tuned for what."""
    frame: "IspTuneStartStart1NewPlanPlanFrameFrameOptions"
    """What the raw files leave open."""
    isp: str
    """Name of a preset, or a file of settings or of the description of an external ISP."""
    objective: str
    """Score to raise: `psnr_db`, `ssim` or `one_minus_lpips`; `psnr` and `lpips` mean the same."""
    raws: str
    """Folder of raw frames with sidecars."""
    reference: str
    """Folder of the pictures that each should become: a picture of the same name, and of the same size."""
    seed: int
    """Seed of the search."""
    set: list[str]
    """Further values, each `stage.key=value`."""
    vary: list[str]
    """Parameters that vary: names, stages, or `all`."""


class IspTuneStartStart1NewPlanPlanFrameFrameOptions(TypedDict, total=False):
    """What raw files leave open."""
    auto_balance: bool
    """Whether to estimate the white balance from the frame."""
    auto_exposure: bool
    """Whether to estimate from the frame what is white."""
    sensor: str | "IspTuneStartStart1NewPlanPlanFrameFrameOptionsSensor1Input2TomlText" | None
    """Sensor: a built-in name, the path of a file, or the sensor itself; none means the built-in sensor that the
    sidecar names, if any. What the calibration of a frame states counts before it."""
    white_dn: float | None
    """Digital number of white light in a green pixel; none means that of the calibration, else the level of
    saturation. Of merged frames it counts in numbers of the longest exposure, and the level of saturation is that
    of the merged frame, where the shortest exposure ends."""


class IspTuneStartStart1NewPlanPlanFrameFrameOptionsSensor1Input2TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class IspTuneStartStart2(TypedDict, total=False):
    """Where the search in a folder ended.

    Needs `resume`."""
    resume: "IspTuneStartStart2Resume"


class IspTuneStartStart2Resume(TypedDict, total=False):
    """A part of a request.

    Needs `folder`."""
    folder: str
    """The folder."""


class IspChart(TypedDict, total=False):
    """A camera and an ISP to measure. What is left out has the default of the command.

    Needs `out`."""
    camera: "IspChartCameraRequest"
    """The camera and its exposure. Images, formats and the other developments of a simulation are not used."""
    isp: str
    """Name of a preset, or a file of settings or of the description of an external ISP."""
    out: str
    """Folder for the results."""
    set: list[str]
    """Further values, each `stage.key=value`."""


class IspChartCameraRequest(TypedDict, total=False):
    """Photographs and scenes to take. What is left out has the default of the command."""
    development: "IspChartCameraRequestDevelopmentInterpolation"
    """How the colours of the mosaic are interpolated."""
    gain: float
    """Linear analogue gain."""
    images: list[str]
    """Photographs (PNG, JPEG, TIFF, WebP, BMP; OpenEXR and Radiance HDR in linear light), spectral images, or
    `scene:NAME`."""
    isp: str | None
    """An image signal processor whose picture is written beside the developed one: a preset, a file, or `neutral`."""
    lens: str | "IspChartCameraRequestLensInput2LensText1" | "IspChartCameraRequestLensInput2LensText2"
    """Lens: a built-in name, the path of a file, or the lens itself."""
    no_distortion: bool
    """Take the picture as the light on the image plane: straight lines stay straight. Without it, the picture is the
    rectilinear scene in front of the lens, and its distortion is rendered."""
    no_noise: bool
    """Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays."""
    out: str
    """Folder for the results."""
    picture_format: Literal['png'] | Literal['png16'] | Literal['exr'] | Literal['npy']
    """Format of the developed picture."""
    place: Literal['fill'] | Literal['centre']
    """How a photograph lands on the sensor."""
    psfs: str | None
    """PSFs in place of those of the lens: the folder of results of `psf` or `psf-calibrate`, or its `psf.json`."""
    raw_format: Literal['tiff'] | Literal['png'] | Literal['packed'] | Literal['npy']
    """Format of the raw frame."""
    restore: "IspChartCameraRequestRestore1Restore" | None
    """Restoration of the developed picture with the PSFs of the lens; none leaves its blur."""
    samples: int | None
    """Samples of the scene along a side of a pixel, 1 to 8: a pixel collects the light of `samples` x `samples` of
    them. If left out, 4 where every image is a built-in scene of edges and at most a million pixels are read, and
    else 1."""
    seed: int
    """Seed of the noise."""
    sensor: str | "IspChartCameraRequestSensorInput22TomlText"
    """Sensor: a built-in name, the path of a file, or the sensor itself."""
    size: list[Any] | None
    """Rows and columns in the middle of the sensor that are read; all of them if none are given."""
    spectral: "IspChartCameraRequestSpectralSpectral"
    """The light, for a simulation over the spectrum."""
    time_s: float
    """Exposure time, s. Unit: s."""
    white_e: float | None
    """Photoelectrons that white gives in a green pixel on the axis; 70 % of those with which white saturates the
    first colour if none are given, or what the light gives over the spectrum. Unit: e-."""


class IspChartCameraRequestDevelopmentInterpolation(TypedDict, total=False):
    """Interpolation of the colours of white-balanced mosaics, 1 = white."""
    demosaic: Literal['bilinear'] | Literal['malvar'] | Literal['rcd'] | Literal['menon']
    """The method."""
    domain: Literal['linear'] | Literal['stabilised']
    """The values that it takes."""


class IspChartCameraRequestLensInput2LensText1(TypedDict, total=False):
    """Petzval's own format.

    Needs `toml`."""
    toml: str
    """The text."""


class IspChartCameraRequestLensInput2LensText2(TypedDict, total=False):
    """Any format that is read.

    Needs `text`, `format`."""
    format: Literal['toml'] | Literal['zmx'] | Literal['seq'] | Literal['json']
    """Its format."""
    text: str
    """The text."""


class IspChartCameraRequestRestore1Restore(TypedDict, total=False):
    """Restoration of a developed picture."""
    noise: float | None
    """Power of noise over that of the picture at a tenth of a cycle per pixel; that of sensor, exposure and
    demosaicing if none is given."""


class IspChartCameraRequestSensorInput22TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class IspChartCameraRequestSpectralSpectral(TypedDict, total=False):
    """The light, and how finely its spectrum is sampled. Any of these makes a simulation one over the spectrum."""
    bands: int | None
    """Bands for scenes and photographs, 2 to 401; 16, or more where these would be over 20 nm apart."""
    illuminance_lux: float | None
    """Illuminance of the scene, lux; 500, or as `white_e` needs. Unit: lux."""
    illuminant: str | None
    """Light on the scene: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file of wavelengths
    in nm and relative power; D65 if none is named."""
    no_colour_matrix: bool
    """The camera's own colours, without the matrix fitted to the ColorChecker."""
    qe: str | None
    """Quantum efficiency in place of the sensor's: a built-in name, `flat:VALUE`, or a CSV or TOML file."""
    three_band: bool
    """Photographs through three PSFs, then electrons by a 3x3 matrix."""
    transmission: str | None
    """Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission."""


class Apply(TypedDict, total=False):
    """Pictures, and the cameras that take them.

    Needs `run`, `images`."""
    accept_changed: list[str]
    """Files or folders of the run, by their path below it, that may differ from their digests."""
    cameras: list[str]
    """Names of cameras of the run; all that are finished if empty."""
    device: str
    """Where tensors live."""
    images: list[str]
    """Photographs, which the cameras take; and raw frames, which they develop: DNG files, and files with a sidecar."""
    out: str
    """Folder for the pictures."""
    place: Literal['fill'] | Literal['centre']
    """How a photograph lands on the sensor."""
    psfs: str | None
    """PSFs in place of those of each camera's lens: the folder of results of `psf` or `psf-calibrate`, or its
    `psf.json`. They form the images of photographs. Development and restoration know them, also those of raw
    frames; the network stays as it was trained."""
    run: str
    """Folder of the run."""
    seed: int
    """Seed of the noise."""


class Detect(TypedDict, total=False):
    """Pictures to look at, and the detector.

    Needs `detector`."""
    accept_changed: list[str]
    """Files or folders of the run, by their path below it, that may differ from their digests."""
    data: str | None
    """In place of `images`: a data set in COCO format, in all of whose pictures is looked, and with whose objects is
    compared."""
    detector: "DetectDetectorSource1" | "DetectDetectorSource2"
    """Where the detector comes from."""
    device: str
    """Device of the tensors."""
    images: list[str]
    """Pictures, and folders of pictures; for the camera of a run also raw frames, which it develops: DNG files, and
    files with a sidecar."""
    least_score: float
    """Least score of a detection, 0..1."""
    out: str | None
    """Folder for results and drawn pictures."""
    part: str | None
    """The part of the data set that is looked at, such as `valid`; all of it if none is named."""


class DetectDetectorSource1(TypedDict, total=False):
    """A finished camera of a run; the last one if none is named.

    Needs `run`."""
    run: "DetectDetectorSource1Run"


class DetectDetectorSource1Run(TypedDict, total=False):
    """A part of a request.

    Needs `run`."""
    camera: str | None
    """The camera."""
    run: str
    """Folder of the run."""


class DetectDetectorSource2(TypedDict, total=False):
    """Weights of a Faster R-CNN under the names of torchvision.

    Needs `weights`."""
    weights: "DetectDetectorSource2WeightsWeights"


class DetectDetectorSource2WeightsWeights(TypedDict, total=False):
    """Weights of a Faster R-CNN under the names of torchvision, and the size in which it looks."""
    backbone: Literal['small'] | Literal['resnet18'] | Literal['resnet50'] | Literal['mobilenet-v2']
    """Their backbone."""
    classes: int
    """Classes of the weights, without the background."""
    file: str
    """The safetensors file."""
    longer_side: int
    """Most pixels that the longer side may have after that. Unit: pixels."""
    shorter_side: int
    """Pixels to which the shorter side of a picture is scaled before the detector looks. Unit: pixels."""


class Weights(TypedDict, total=False):
    """Weights to list, and to write to a file.

    Needs `weights`."""
    camera: str | None
    """The camera of a run; it need not be named where one has weights."""
    kind: str | None
    """What the network is, where neither its weights nor their file say so, such as `segmenter`."""
    names: Literal['petzval'] | Literal['torchvision']
    """By which names the file has them."""
    to: str | None
    """The safetensors file to write; none to list the weights alone."""
    weights: str
    """The weights: a safetensors file, the folder of a run, of a camera or of a proxy, or a built-in name such as
    `restoration_naf`."""


class DataConvert(TypedDict, total=False):
    """A data set to convert.

    Needs `format`, `input`, `out`."""
    copy: bool
    """Copy pictures. Otherwise they are hard links to the given files, which take no space, where the file system
    allows."""
    format: Literal['kitti'] | Literal['bdd100k'] | Literal['yolo'] | Literal['voc']
    """Its format."""
    input: str
    """Its folder; of BDD100K also a file."""
    out: str
    """Folder for the data set; it must be new or empty."""
    turned: bool | None
    """Whether the boxes of pictures that EXIF turns are of the pictures as they are shown (`true`), or of the stored
    pixels (`false`), where neither the format nor a stated size says so. Without it such pictures are left out."""


class DataCheck(TypedDict, total=False):
    """A data set to check. What is left out has the default of the command.

    Needs `data`."""
    classes_of: str | "DataCheckClassesOf1Input2ExperimentText1TomlText" | dict[str, Any] | None
    """An experiment, by built-in name, by path, or itself, whose classes are looked for in the data set."""
    data: str
    """Its folder, or its file of annotations; or photographs: a folder, a list with one path a line, a tar shard or
    a folder of shards."""
    no_cache: bool
    """Decodes every picture, also those that an earlier check has decoded and that have not changed since by size
    and time."""
    out: str | None
    """Folder for a page with samples; none is written without."""
    samples: int
    """Pictures on the page."""


class DataCheckClassesOf1Input2ExperimentText1TomlText(TypedDict, total=False):
    """The text of a file in TOML.

    Needs `toml`."""
    toml: str
    """The text."""


class TrainIspProxy(TypedDict, total=False):
    """A training that begins, or one that is continued."""


class TrainOpticsProxy(TypedDict, total=False):
    """A training that begins, or one that is continued."""


class Bench(TypedDict, total=False):
    """A workload to measure."""
    seconds: float
    """Seconds to spend on it; it runs at least three times. Unit: s."""
    threads: list[int]
    """Numbers of threads to compare, which take turns in one process; none for those of the process."""
    workload: str
    """Its name, one of `names`."""


class Doctor(TypedDict, total=False):
    """What is looked at beside machine, build and built-in files."""
    device: str | None
    """Device to check: its convolutions at the sizes of our networks, forward and back, against the CPU, and its
    memory over 300 steps."""
    seconds: int
    """Time after which the check of a device begins nothing new; what it leaves out is listed. Unit: s."""


class SweepPlan(TypedDict, total=False):
    """A sweep.

    Needs `file`."""
    file: str
    """Its file."""
    store: str | None
    """Folder of its store, whose results say what the other units cost; `sweeps/FILE` if none is named. It need not
    exist."""


class SweepStatus(TypedDict, total=False):
    """A sweep.

    Needs `store`."""
    store: str
    """Folder of its store."""


class SweepGather(TypedDict, total=False):
    """A sweep, and where its tables and its page go.

    Needs `store`."""
    figure: list[str]
    """Figures that the page shows; those that vary if none is named."""
    out: str | None
    """Folder for tables and page, which is made; nothing is written if none is named. Those in the store itself are
    replaced, whether or not results may be overwritten."""
    store: str
    """Folder of its store."""
    x: str | None
    """Key or figure along the axis of the page's scatter plot to the right; the key with the most values other than
    the seed if none is named, else the second figure."""
    y: str | None
    """Key or figure along the upward axis of the plot; the first figure that varies if none is named."""


class Runs(TypedDict, total=False):
    """Which runs."""
    folder: str
    """Folder with runs, at any depth. Links to folders are followed one level."""


class UnitStatus(TypedDict, total=False):
    """A store of units.

    Needs `store`."""
    store: str
    """Its folder."""


class UnitList(TypedDict, total=False):
    """Units of work.

    Needs `units`."""
    units: list["UnitListUnitsItemUnit"]
    """The units, as the lines of a file of units hold them. Relative paths in them start in the folder in which this
    program runs."""


class UnitListUnitsItemUnit(TypedDict, total=False):
    """A unit of work. A file of units has one in each line, as JSON.

    Needs `name`, `call`."""
    call: "UnitListUnitsItemUnitCallCall"
    """The job with its request. Relative paths are those of the folder in which the program runs; `petzval unit run`
    runs in the folder of the file of units. The folder of results in the request is replaced by one in the store,
    and may be left out where a call needs one."""
    key: str | None
    """Its key when the file was made, as a sweep writes it. A unit whose inputs have changed since is refused."""
    name: str
    """Its name, by which it is run again. It does not belong to the key."""
    seed: int | None
    """Seed of everything random in place of that of the request."""
    simd: str
    """Instruction set: `avx2`, `avx512`, `neon` or `scalar`. A machine that lacks it refuses the unit."""
    version: str
    """Version of the program; another one refuses the unit."""


class UnitListUnitsItemUnitCallCall(TypedDict, total=False):
    """A job with its request and its surroundings.

    Needs `format`, `job`."""
    device: str | None
    """Where tensors live, for jobs whose request has the key `device`; that of the request if none is named here."""
    format: int
    """Version of this form: 1."""
    glasses: list[str]
    """Glass catalogues whose glasses take precedence over the built-in ones, by path."""
    job: str
    """Name of the job; `petzval jobs` lists them."""
    overwrite: bool
    """Overwrite results that are there already."""
    request: Any
    """Its request; `petzval schema job NAME` prints the schema."""
    threads: int
    """Threads to use; 0 means those of the process. Results do not depend on it."""


class UnitGather(TypedDict, total=False):
    """Units of work, and where their results are.

    Needs `units`, `store`."""
    out: str | None
    """Folder for the files of the analysis, as `lens-tolerance` writes them; of several analyses one folder each in
    it. Nothing is written if none is named."""
    store: str
    """Folder of their store."""
    units: list["UnitGatherUnitsItemUnit"]
    """The units, as the lines of a file of units hold them. Those of other jobs than `lens-tolerance` are passed
    over. Relative paths in them start in the folder in which this program runs."""


class UnitGatherUnitsItemUnit(TypedDict, total=False):
    """A unit of work. A file of units has one in each line, as JSON.

    Needs `name`, `call`."""
    call: "UnitGatherUnitsItemUnitCallCall"
    """The job with its request. Relative paths are those of the folder in which the program runs; `petzval unit run`
    runs in the folder of the file of units. The folder of results in the request is replaced by one in the store,
    and may be left out where a call needs one."""
    key: str | None
    """Its key when the file was made, as a sweep writes it. A unit whose inputs have changed since is refused."""
    name: str
    """Its name, by which it is run again. It does not belong to the key."""
    seed: int | None
    """Seed of everything random in place of that of the request."""
    simd: str
    """Instruction set: `avx2`, `avx512`, `neon` or `scalar`. A machine that lacks it refuses the unit."""
    version: str
    """Version of the program; another one refuses the unit."""


class UnitGatherUnitsItemUnitCallCall(TypedDict, total=False):
    """A job with its request and its surroundings.

    Needs `format`, `job`."""
    device: str | None
    """Where tensors live, for jobs whose request has the key `device`; that of the request if none is named here."""
    format: int
    """Version of this form: 1."""
    glasses: list[str]
    """Glass catalogues whose glasses take precedence over the built-in ones, by path."""
    job: str
    """Name of the job; `petzval jobs` lists them."""
    overwrite: bool
    """Overwrite results that are there already."""
    request: Any
    """Its request; `petzval schema job NAME` prints the schema."""
    threads: int
    """Threads to use; 0 means those of the process. Results do not depend on it."""
