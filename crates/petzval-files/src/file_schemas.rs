//! What may stand in each kind of file, as JSON Schemas and as lists of records: the reference pages of the book are made from them.

use schemars::{Schema, schema_for};

use crate::{glass_toml, isp_file, operand_toml, psf_file, raw_file, spectral_file, tolerance_toml};

/// A kind of file, with the schema of what may stand in it.
pub struct FileSchema {
    /// What the file describes.
    pub title: &'static str,
    /// Its name, and where it is read.
    pub read_by: &'static str,
    /// Its keys.
    pub schema: Schema,
}

/// Every kind of file of this crate that has keys, but lenses, which have [`lens_schema`](crate::lens_schema).
pub fn file_schemas() -> Vec<FileSchema> {
    let file = |title, read_by, schema| FileSchema { title, read_by, schema };
    vec![
        file(
            "Glass catalogue",
            "A TOML file with a table `[glass.NAME]` for each glass: `--glasses FILE`, or in a lens file. These are the keys of such a table.",
            schema_for!(glass_toml::GlassText),
        ),
        file(
            "Operands",
            "A TOML file of figures that a lens should reach: `petzval lens optimize --operands FILE`.",
            schema_for!(operand_toml::OperandFile),
        ),
        file(
            "Tolerances",
            "A TOML file: `petzval lens tolerance --tolerances FILE`, `petzval evaluate --tolerances FILE`.",
            schema_for!(tolerance_toml::FileText),
        ),
        file(
            "Bank of PSFs",
            "`psf.json` in a folder that `petzval psf` or `petzval psf-calibrate` wrote, beside its arrays.",
            schema_for!(psf_file::PsfAxes),
        ),
        file(
            "Raw frame",
            "`NAME.toml` beside a raw frame `NAME`, such as `frame.raw.toml`.",
            schema_for!(raw_file::SidecarKeys),
        ),
        file(
            "Calibration of a raw frame",
            "A TOML file that the one beside a raw frame names in `calibration`: what an ISP may know of the frame.",
            schema_for!(raw_file::FrameCalibration),
        ),
        file(
            "Spectral image",
            "`NAME.toml` beside `NAME.npy` or `NAME.tif`.",
            schema_for!(spectral_file::Sidecar),
        ),
        file(
            "Preset of the built-in ISP",
            "A TOML file: `--isp FILE` of `petzval isp`, `isp.preset` of an experiment.",
            schema_for!(petzval_camera::isp::IspPreset),
        ),
        file(
            "Description of an external ISP",
            "A TOML file: `--isp FILE` of `petzval isp`, `isp.preset` of an experiment.",
            schema_for!(isp_file::DescriptionKeys),
        ),
        file(
            "Settings of an external ISP",
            "A TOML file that names the description: `--isp FILE` of `petzval isp`.",
            schema_for!(isp_file::SettingsKeys),
        ),
    ]
}

/// Records of a format of another program that are not read into the lens, by name.
pub struct ForeignRecords {
    /// Those that do not describe the lens.
    pub ignored: Vec<&'static str>,
    /// Those that change no ray, each with the message of its loss.
    pub lost: Vec<(&'static str, &'static str)>,
    /// Solves, of which the value is kept.
    pub solves: Vec<&'static str>,
    /// Those without which rays would take another path, each with the reason.
    pub refused: Vec<(&'static str, &'static str)>,
}
