//! Pixels that do not belong to the profile: dead and hot ones, and rows and columns of them.

use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

use super::region::Region;

/// Standard deviations of the ordinary pixels beyond which a pixel is a defect, and the least deviation, of the step.
const SIGMAS: f64 = 7.0;
const LEAST: f64 = 0.03;

/// If at least this share and this number of the pixels of a row or column are defects, all of it is left out. Pixels whose values happen
/// to agree with the profile are then dead as well.
const LINE_SHARE: f64 = 0.25;
const LINE_LEAST: usize = 5;

/// Marks defects. `deviations` holds for every pixel its deviation from the profile, of the step, and its zone: dark, blurred or bright; none for
/// pixels that are not compared. `last` marks what was left out before.
pub fn marked(region: &Region, deviations: &[Option<(f64, usize)>]) -> Vec<bool> {
    let limits = [0, 1, 2].map(|zone| {
        let of_zone = deviations.iter().flatten().filter(|(_, z)| *z == zone).map(|(d, _)| d.abs());
        (SIGMAS * SIGMA_OVER_MEDIAN * median(of_zone)).max(LEAST)
    });
    let marks =
        deviations.iter().map(|of| of.is_some_and(|(deviation, zone)| deviation.abs() > limits[zone]));
    let mut marks: Vec<bool> = marks.collect();
    let (height, width) = (region.height, region.width);
    let single = marks.clone();
    let mut mark_line = |places: &dyn Fn(usize) -> usize, length: usize| {
        let known = (0..length).filter(|k| deviations[places(*k)].is_some()).count();
        let off = (0..length).filter(|k| single[places(*k)]).count();
        if off >= LINE_LEAST && off as f64 > LINE_SHARE * known as f64 {
            (0..length).for_each(|k| marks[places(k)] = true);
        }
    };
    (0..height).for_each(|row| mark_line(&|k| row * width + k, width));
    (0..width).for_each(|col| mark_line(&|k| k * width + col, height));
    marks
}
