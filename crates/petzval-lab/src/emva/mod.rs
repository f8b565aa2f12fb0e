//! EMVA 1288 characterisation: from captures of flat and dark frames to the numbers of a sensor, and back.
//!
//! | step | module |
//! |---|---|
//! | the list of captures: its values, its two formats, wildcards in names | [`captures`], [`compat`], `frame_names` |
//! | open a folder of captures | `open` |
//! | reduce the frames of a point to sums | [`point`], [`counts`] |
//! | temporal noise of rows, columns and pixels, and how it is correlated | [`line_noise`], [`line_covariance`], `gain_lines` |
//! | means of parts of a frame without defect pixels | [`mod@block_means`] |
//! | whether pixels of one colour differ by their place in a tile, and dark ones of all colours | `tile_range`, `tile_levels` |
//! | flags: what the captures show about the use of each point | `flags` |
//! | find where the converter clips, from all samples | [`samples`] |
//! | find digital numbers that were compressed | [`mod@compressed`] |
//! | select the points of one gain by their flags, and evaluate them | `gain` |
//! | whether the points of a fit lie on its model, and what a departure adds to the errors | [`goodness`], [`mod@fits`] |
//! | photon transfer: R, K, QE, linearity | [`transfer_point`], [`transfer`], `deviation_noise` |
//! | find where the signal ends | [`mod@saturation`] |
//! | dark frames over exposure time, and pixel by pixel | [`dark`], [`hot_pixels`] |
//! | whether pixels differ independently of their neighbours | `neighbours` |
//! | temporal noise that pixels or frames share: filters in the camera | [`mod@shared_noise`] |
//! | non-uniformity, spectrograms, profiles, histograms of defects | [`spatial`], [`plane_moments`], [`high_pass`], [`spectrogram`], [`histogram`] |
//! | pixels that do not answer light, and dark frames without them | [`mod@defects`], `dark_defects` |
//! | figures under the names of the EMVA 1288 Python library | [`figures`] |
//! | all gains together | [`joint`] |
//! | histograms: the exact distribution, and the fit to it | [`pmf`], [`histogram_fit`] |
//! | all steps in order, and their result | [`mod@characterize`], [`result`] |
//! | reject series from which no sensor follows | `usable` |
//! | warnings, made from flags and results | [`warnings`] |
//! | write a sensor file, write XML | [`sensor_file`], [`compat`] |
//! | simulate captures of a sensor | [`plan`], [`series`] |
//! | figures of a sensor file | [`mod@derived`] |
//!
//! Every number is a [`Measured`]: a value with its standard error, or the reason why it cannot be measured from these captures.
//! Sources: EMVA 1288 release 4.0 Linear; Tseng et al. 2021, supplement sections 1 and 2.

pub mod block_means;
pub mod captures;
pub mod characterize;
mod clamp;
mod colour_name;
pub mod compat;
pub mod compressed;
pub mod counts;
pub mod dark;
mod dark_defects;
pub mod defects;
pub mod derived;
mod deviation_noise;
pub mod figures;
pub mod fit;
pub mod fits;
mod flags;
mod frame_names;
mod gain;
mod gain_lines;
pub mod goodness;
pub mod high_pass;
pub mod histogram;
pub mod histogram_fit;
pub mod hot_pixels;
pub mod joint;
pub mod line_covariance;
pub mod line_noise;
pub mod measured;
mod neighbours;
mod open;
pub mod plan;
pub mod plane_moments;
pub mod pmf;
pub mod point;
pub mod result;
pub mod rounding;
pub mod samples;
pub mod saturation;
pub mod sensor_file;
pub mod series;
pub mod shared_noise;
pub mod spatial;
pub mod spectrogram;
mod tile_levels;
mod tile_range;
pub mod transfer;
pub mod transfer_point;
mod usable;
mod warning;
pub mod warnings;

pub use captures::{CaptureError, Captures, FrameFile, Kind, Point, SensorFacts};
pub use characterize::{Done, characterize};
pub use colour_name::colour_name;
pub use compat::result_xml::{Values, result_xml};
pub use compressed::Compression;
pub use counts::PointHistogram;
pub use derived::{Derived, derived};
pub use figures::{Figure, Limit};
pub use fits::{NamedFit, fits};
pub use goodness::{FitTest, Verdict};
pub use high_pass::HighPass;
pub use histogram_fit::{HistogramComparison, HistogramFit};
pub use hot_pixels::PixelDarkCurrents;
pub use joint::JointFit;
pub use measured::{Measured, Unresolved};
pub use plan::{Plan, PlannedPoint};
pub use result::{ChannelResult, Characterization, GainResult, Options};
pub use sensor_file::sensor_toml;
pub use series::{Series, SeriesFrame, Written, write_series};
pub use shared_noise::SharedNoise;
pub use spatial::Spatial;
pub use warning::Warning;
pub use warnings::warning_lines;
