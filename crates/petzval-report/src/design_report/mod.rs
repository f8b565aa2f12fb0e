//! The report of a run as one HTML file, with its lenses, PSFs, pictures, scores and curves.
//!
//! The input is plain data and the output is text: nothing here traces a lens or reads a file, a clock or the network.
//! The page contains everything it shows, so that it can be mailed, archived and printed.

mod answer;
mod answer_view;
mod attribution;
mod caveats;
mod change;
mod choice;
mod detail;
mod detection;
mod frames;
mod made;
mod mtf;
mod page;
mod picture;
mod place_chart;
mod progress;
mod psf_table;
mod ranked_answer;
mod reading;
mod score_table;
mod scored_answer;
mod segmentation;
mod standing;
mod view;

pub use choice::choice;
pub use detail::detail;
pub use detection::detection_part;
pub(crate) use page::{lenses, over_the_field, over_the_run};
pub(crate) use picture::pictures;
pub use segmentation::{
    CameraSegments, SegmentFigure, SegmentationView, ShownSegments, segmentation_section,
};
pub use view::{
    Attribution, CameraDetection, CameraPicture, CameraProgress, CameraState, CameraView, Change,
    DetectionView, FieldPoint, FrameView, GroupFigure, HeldOutScores, LossCurve, LostObjects, MadeCamera,
    MadeCameras, MadeScore, Mistake, OneSeed, PictureView, PrecisionCurve, Progress, PsfView, Range,
    RankedCamera, Ranking, RankingWords, Report, Role, Score, SeedDifference, SeedStudy, ShortRun, Spread,
    TableRow, TaskPart, TaskSection,
};

/// The result in sentences, as the page has it: the answer first. Empty if there are no cameras to compare.
pub fn sentences(report: &Report) -> Vec<String> {
    let answer = answer::answer(report).map(|answer| answer.sentence);
    answer.into_iter().chain(caveats::caveats(report)).chain(reading::reading(report)).collect()
}

/// The report as one self-contained HTML file.
pub fn html(report: &Report) -> String {
    page::page(report)
}
