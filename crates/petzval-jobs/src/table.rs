//! The table of jobs: one row a verb.

use crate::error::{JobError, Place, Result};
use crate::job::Row;

/// Makes the rows of jobs: a type for each job, which implements [`Job`](crate::Job), and `TABLE` with the rows of all.
///
/// A row has the name of that type, the name of the job, the keys that a request must hold, and what the job does. Request and response follow, then
/// the function that runs the job, and how it is done as a unit of work if that is not [`AsUnit::PLAIN`](crate::AsUnit::PLAIN).
#[macro_export]
macro_rules! table_of_jobs {
    ($($job:ident $name:literal $needs:tt $about:literal $request:ty => $response:ty, $run:path $(, $unit:path)?;)*) => {
        $(
            #[doc = $about]
            #[derive(Clone, Copy, Debug)]
            pub struct $job;

            impl $crate::Job for $job {
                const NAME: &'static str = $name;
                const ABOUT: &'static str = $about;
                const NEEDS: &'static [&'static str] = &$needs;
                type Request = $request;
                type Response = $response;
                $(const UNIT: $crate::AsUnit<$request> = $unit;)?

                fn run(request: &$request, context: &$crate::Context) -> $crate::Result<$response> {
                    $run(request, context)
                }
            }
        )*

        const TABLE: &[$crate::Row] = &[$($crate::Row::of::<$job>()),*];
    };
}

table_of_jobs! {
    Design "design" ["run"]
        "Designs lens and network together, and compares with controls."
        crate::design::Request => crate::design::Response, crate::design::run, crate::design::UNIT;
    DesignCheck "design-check" ["run"]
        "Looks at an experiment as before its first step; writes nothing."
        crate::design::LookRequest => petzval_design::first_look::FirstLook, crate::design::look_at;
    DesignConfig "design-config" ["run"]
        "Gives the experiment of a run to begin, with every key; writes nothing."
        crate::design_config::Request => crate::design_config::Response, crate::design_config::run;
    DesignStop "design-stop" ["run"]
        "Ends the process that designs a run, with a checkpoint."
        crate::design_stop::Request => crate::design_stop::Response, crate::design_stop::run;
    RunView "run-view" ["run"]
        "Looks at a run at work, stopped or finished: steps, losses, lenses, cameras."
        crate::run_view::Request => crate::run_view::Response, crate::run_view::run;
    TaskView "task-view" ["lens"]
        "Looks at a lens by the task of an experiment: loss, slopes by surface, pictures."
        crate::task_view::Request => crate::task_view::Response, crate::task_view::run;
    Init "init" ["out"]
        "Writes an experiment with its lens and sensor as files to edit."
        crate::init::Request => crate::init::Response, crate::init::run, crate::init::UNIT;
    ExperimentList "experiment-list" []
        "Lists the built-in experiments with their variants."
        crate::experiment::ListRequest => Vec<crate::experiment::Entry>, crate::experiment::list;
    ExperimentShow "experiment-show" ["name"]
        "Gives the text of an experiment."
        crate::experiment::ShowRequest => String, crate::experiment::show;
    ExperimentRunAll "experiment-run-all" []
        "Runs the built-in experiments, or some, with several seeds."
        crate::run_all::Request => crate::run_all::Response, crate::run_all::run, crate::run_all::UNIT;
    Schema "schema" ["kind"]
        "Gives the JSON Schema of experiment, lens or sensor files."
        crate::experiment::SchemaRequest => serde_json::Value, crate::experiment::schema;
    Report "report" ["run"]
        "Writes the report of a run again."
        crate::report::Request => crate::report::Response, crate::report::run;
    ReportSoFar "report-so-far" ["run"]
        "Gives the report of a run as it stands; writes nothing."
        crate::report_so_far::Request => crate::report_so_far::Response, crate::report_so_far::run;
    Compare "compare" ["runs"]
        "Puts several runs on one page."
        crate::compare::Request => crate::compare::Response, crate::compare::run, crate::compare::UNIT;
    Evaluate "evaluate" ["run"]
        "Scores the cameras of a run again, with exact optics."
        crate::evaluate::Request => crate::evaluate::Response, crate::evaluate::run, crate::evaluate::UNIT;
    LensShow "lens-show" ["lens"]
        "Gives the prescription of a lens and its first-order data."
        crate::lens::show::Request => crate::lens::show::Response, crate::lens::show::run;
    LensView "lens-view" ["lens"]
        "Looks at a lens and at changes of it: prescription, layout, spots, fans, modulation."
        crate::lens::view::Request => crate::lens::view::Response, crate::lens::view::run;
    LensEdit "lens-edit" ["lens"]
        "Changes a lens, and gives its text in any format."
        crate::lens::edit::Request => crate::lens::edit::Response, crate::lens::edit::run;
    LensTrace "lens-trace" ["lens", "field", "wavelength", "pupil"]
        "Traces one ray through a lens."
        crate::lens::trace::Request => crate::lens::trace::Response, crate::lens::trace::run;
    LensAnalyze "lens-analyze" ["lens"]
        "Writes the analysis of a lens: pictures and data."
        crate::lens::analyze::Request => crate::lens::analyze::Response, crate::lens::analyze::run, crate::lens::analyze::UNIT;
    LensConvert "lens-convert" ["from", "to"]
        "Writes a lens in the format of another program."
        crate::lens::convert::Request => crate::lens::convert::Response, crate::lens::convert::run, crate::lens::convert::UNIT;
    LensFocus "lens-focus" ["lens"]
        "Moves the image plane of a lens to its best focus."
        crate::lens::focus::Request => crate::lens::focus::Response, crate::lens::focus::run, crate::lens::focus::UNIT;
    LensList "lens-list" []
        "Lists the built-in lenses."
        crate::lens::list::Request => crate::lens::list::Response, crate::lens::list::run;
    LensOptimize "lens-optimize" ["start"]
        "Optimises a lens within limits."
        crate::lens::optimize::Request => crate::lens::optimize::Response, crate::lens::optimize::run, crate::lens::optimize::UNIT;
    LensTolerance "lens-tolerance" ["lens"]
        "Tolerances a lens: sensitivities and lenses made at random."
        crate::lens::tolerance::Request => crate::lens::tolerance::Response, crate::lens::tolerance::run, crate::lens::tolerance::UNIT;
    GlassFind "glass-find" ["nd", "vd"]
        "Finds the glasses nearest to an index and an Abbe number."
        crate::glass::find::Request => crate::glass::find::Response, crate::glass::find::run;
    GlassList "glass-list" []
        "Lists every glass."
        crate::glass::list::Request => crate::glass::list::Response, crate::glass::list::run;
    GlassShow "glass-show" ["name"]
        "Gives all data of a glass."
        crate::glass::show::Request => crate::glass::show::Response, crate::glass::show::run;
    Psf "psf" ["lens", "out"]
        "Writes the point-spread functions of a lens."
        crate::psf::Request => crate::psf::Response, crate::psf::run, crate::psf::UNIT;
    PsfCalibrate "psf-calibrate" ["captures"]
        "Measures point-spread functions from captures of a pinhole."
        crate::psf_calibrate::Request => crate::psf_calibrate::Response, crate::psf_calibrate::run, crate::psf_calibrate::UNIT;
    PsfCapture "psf-capture" ["lens", "out"]
        "Simulates captures of a pinhole for `psf-calibrate`."
        crate::psf_capture::Request => crate::psf_capture::Response, crate::psf_capture::run, crate::psf_capture::UNIT;
    SensorList "sensor-list" []
        "Lists the built-in sensors."
        crate::sensor::list::Request => crate::sensor::list::Response, crate::sensor::list::run;
    SensorShow "sensor-show" ["sensor"]
        "Gives the numbers of a sensor."
        crate::sensor::show::Request => crate::sensor::show::Response, crate::sensor::show::run;
    SensorCapture "sensor-capture" ["sensor", "out"]
        "Simulates the calibration series of a sensor."
        crate::sensor::capture::Request => crate::sensor::capture::Response, crate::sensor::capture::run, crate::sensor::capture::UNIT;
    SensorCharacterize "sensor-characterize" ["dir"]
        "Measures a sensor from captures, after EMVA 1288."
        crate::sensor::characterize::Request => crate::sensor::characterize::Response, crate::sensor::characterize::run, crate::sensor::characterize::UNIT;
    Simulate "simulate" ["images"]
        "Takes photographs through a lens: photograph, raw frame, developed picture."
        crate::simulate::Request => crate::simulate::Response, crate::simulate::run, crate::simulate::UNIT;
    CameraView "camera-view" ["lens"]
        "Develops a window of the frame of a camera, quickly or exactly, as values."
        crate::simulate::view::Request => crate::simulate::view::Response, crate::simulate::view::run;
    PhotoList "photo-list" []
        "Lists the built-in photographs and scenes."
        crate::photos::Request => crate::photos::Response, crate::photos::run;
    RawShow "raw-show" ["file"]
        "Gives what raw frames say of themselves."
        crate::raw::show::Request => crate::raw::show::Response, crate::raw::show::run;
    RawConvert "raw-convert" ["input", "output"]
        "Writes raw frames in another format."
        crate::raw::convert::Request => crate::raw::convert::Response, crate::raw::convert::run, crate::raw::convert::UNIT;
    RawMtf "raw-mtf" ["file"]
        "Measures slanted edges of raw frames."
        crate::raw::mtf::Request => crate::raw::mtf::Response, crate::raw::mtf::run, crate::raw::mtf::UNIT;
    IspShow "isp-show" []
        "Gives the parameters of an image signal processor."
        crate::isp::show::Request => crate::isp::show::Response, crate::isp::show::run;
    IspDevelop "isp-develop" ["raws", "out"]
        "Develops raw frames."
        crate::isp::develop::Request => crate::isp::develop::Response, crate::isp::develop::run, crate::isp::develop::UNIT;
    IspTune "isp-tune" ["start"]
        "Tunes the parameters of an image signal processor."
        crate::isp::tune::Request => crate::isp::tune::Response, crate::isp::tune::run, crate::isp::tune::UNIT;
    IspChart "isp-chart" ["out"]
        "Measures the developed test chart."
        crate::isp::chart::Request => crate::isp::chart::Response, crate::isp::chart::run, crate::isp::chart::UNIT;
    Apply "apply" ["run", "images"]
        "Takes pictures with the cameras of a run."
        crate::apply::Request => crate::apply::Response, crate::apply::run, crate::apply::UNIT;
    Detect "detect" ["detector"]
        "Finds objects in pictures."
        crate::detect::Request => crate::detect::Response, crate::detect::run, crate::detect::UNIT;
    Weights "weights" ["weights"]
        "Lists the weights of a network by name, and writes them to a file."
        crate::weights::Request => crate::weights::Response, crate::weights::run, crate::weights::UNIT;
    DataConvert "data-convert" ["format", "input", "out"]
        "Converts a data set for object detection."
        crate::data::convert::Request => crate::data::convert::Response, crate::data::convert::run, crate::data::convert::UNIT;
    DataCheck "data-check" ["data"]
        "Checks a data set for object detection."
        crate::data::check::Request => crate::data::check::Response, crate::data::check::run, crate::data::check::UNIT;
    TrainIspProxy "train-isp-proxy" []
        "Trains a network that imitates an image signal processor."
        crate::train::isp_proxy::Request => crate::train::isp_proxy::Response, crate::train::isp_proxy::run, crate::train::isp_proxy::UNIT;
    TrainOpticsProxy "train-optics-proxy" []
        "Trains a network in place of ray tracing."
        crate::train::optics_proxy::Request => crate::train::optics_proxy::Response, crate::train::optics_proxy::run, crate::train::optics_proxy::UNIT;
    Bench "bench" []
        "Measures a standard workload."
        crate::bench::Request => crate::bench::Response, crate::bench::run;
    Doctor "doctor" []
        "Says what this machine and this build offer, and reads every built-in file."
        crate::doctor::Request => crate::doctor::Response, crate::doctor::run;
}

/// Every job of this crate, in the order of the command's help.
pub fn jobs() -> &'static [Row] {
    TABLE
}

/// The row of a job of this crate. The error says which names come near.
pub fn row(name: &str) -> Result<&'static Row> {
    named(TABLE, name)
}

/// Jobs by name: those of this crate, and those of crates above it.
#[derive(Clone)]
pub struct Table {
    rows: Vec<Row>,
}

impl Table {
    /// The jobs of this crate.
    pub fn built_in() -> Self {
        Self { rows: TABLE.to_vec() }
    }

    /// The same with further jobs. No two jobs have one name.
    pub fn with(mut self, rows: &[Row]) -> Self {
        self.rows.extend_from_slice(rows);
        self
    }

    /// Every job, in the order of the command's help.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The row of a name. The error says which names come near.
    pub fn row(&self, name: &str) -> Result<&Row> {
        named(&self.rows, name)
    }
}

fn named<'r>(rows: &'r [Row], name: &str) -> Result<&'r Row> {
    rows.iter().find(|row| row.name == name).ok_or_else(|| {
        let names: Vec<&str> = rows.iter().map(|row| row.name).collect();
        let near = petzval_base::nearest(name, &names);
        let hint = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("one of {}", names.join(", ")),
        };
        let place = Place { key: "job".to_owned(), value: name.to_owned(), ..Place::default() };
        JobError::input(format!("call: there is no job `{name}`"), hint).at_place(place)
    })
}
