//! What a reader must know before the scores: a run with few steps, and networks that make pictures worse.

use super::view::{CameraPicture, PictureView, Report};

/// The caveats in sentences, the most important one first; none for a run at work.
pub(super) fn caveats(report: &Report) -> Vec<String> {
    if report.progress.is_some() || report.table.is_empty() {
        return Vec::new();
    }
    let short = report.short.map(|short| {
        format!(
            "This run is shorter than its experiment: {}. Scores of so few steps say how far the networks have come, and little about the lenses.",
            short.in_words()
        )
    });
    short.into_iter().chain(worse_than_developed(report)).collect()
}

/// In how many of the pictures of the page each network makes its picture worse than its input, by PSNR. None where a hardware ISP finishes
/// pictures, which gives them another tone, and where a score of all windows ranks cameras.
fn worse_than_developed(report: &Report) -> Option<String> {
    let is_of_pictures =
        report.scores.iter().any(|score| score.title == PSNR) && report.task.ranking.is_none();
    if !is_of_pictures || report.has_isp {
        return None;
    }
    let counts = report.table.iter().filter_map(|row| {
        let of_camera = report.pictures.iter().filter_map(|picture| {
            let camera = picture.cameras.iter().find(|camera| camera.camera == row.camera)?;
            is_worse(picture, camera)
        });
        let known: Vec<bool> = of_camera.collect();
        let worse = known.iter().filter(|worse| **worse).count();
        (worse > 0).then(|| format!("{} {worse} of {}", row.camera, known.len()))
    });
    let counts: Vec<String> = counts.collect();
    (!counts.is_empty()).then(|| {
        format!(
            "Finished pictures worse than the developed ones of the same place, which the network starts from, by PSNR of the pictures below: {}.",
            counts.join(", ")
        )
    })
}

/// The score by which pictures are compared.
const PSNR: &str = "PSNR";

/// Whether the finished picture is further from the scene than the developed one; none where a file is damaged.
fn is_worse(picture: &PictureView, camera: &CameraPicture) -> Option<bool> {
    let truth = image::load_from_memory(&picture.truth_png).ok()?.to_rgb8();
    let squares = |png: &[u8]| {
        let of = image::load_from_memory(png).ok()?.to_rgb8();
        let pairs = truth.as_raw().iter().zip(of.as_raw());
        (of.dimensions() == truth.dimensions())
            .then(|| pairs.map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum::<u64>())
    };
    Some(squares(&camera.output_png)? > squares(&camera.developed_png)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::ShortRun;
    use crate::sample;

    #[test]
    fn networks_that_make_pictures_worse_are_counted() {
        let mut report = sample::report();
        assert!(caveats(&report).is_empty());
        // The nominal camera's developed pictures are nearer to the scene than its finished ones, in one of two.
        let nominal = &mut report.pictures[1].cameras[0];
        std::mem::swap(&mut nominal.developed_png, &mut nominal.output_png);
        let [sentence] = &caveats(&report)[..] else { panic!("{:?}", caveats(&report)) };
        assert!(sentence.ends_with("by PSNR of the pictures below: nominal 1 of 2."), "{sentence}");
        assert!(super::super::html(&report).contains(sentence));
        assert!(super::super::sentences(&report).contains(sentence));
        // What a hardware ISP finishes has another tone.
        report.has_isp = true;
        assert!(caveats(&report).is_empty());
    }

    #[test]
    fn a_short_run_and_lost_light_stand_on_the_page() {
        let short = Some(ShortRun { steps: 12, usual: 400 });
        let warnings = vec!["nominal: the PSF grid of 192 um cuts off 25 % of the light".to_owned()];
        let report = Report { short, warnings, ..sample::answered() };
        let page = super::super::html(&report);
        assert!(page.contains("shorter than its experiment: 12 of 400 training steps."), "{page}");
        // The warning stands with the scores, behind the answer.
        let [result, light, lenses] =
            ["<h2>Result</h2>", "the PSF grid of 192 um cuts off", "<h2>Lenses</h2>"]
                .map(|text| page.find(text).unwrap());
        assert!(result < light && light < lenses);
    }
}
