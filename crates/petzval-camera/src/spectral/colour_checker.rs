//! The ColorChecker Classic: 24 measured reflectances.

use std::sync::LazyLock;

use petzval_data::spectra;

use super::table::SpectrumTable;
use crate::spectrum::Spectrum;

/// The measurement of the chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChartData {
    /// N. Ohta 1997: 380..780 nm every 5 nm, one chart.
    Ohta,
    /// BabelColor: 380..730 nm every 10 nm, mean of 30 charts.
    BabelColor,
}

/// Patches in a row of the chart.
pub const CHART_COLUMNS: usize = 6;
/// Rows of the chart.
pub const CHART_ROWS: usize = 4;

/// Names and reflectances of the 24 patches, row by row from the top left (dark skin) to the bottom right (black).
pub fn colour_checker(data: ChartData) -> &'static [(String, Spectrum)] {
    type Table = LazyLock<SpectrumTable>;
    static OHTA: Table = Table::new(|| SpectrumTable::built_in(spectra::COLORCHECKER_OHTA));
    static BABEL: Table = Table::new(|| SpectrumTable::built_in(spectra::COLORCHECKER_BABELCOLOR));
    match data {
        ChartData::Ohta => &OHTA.curves,
        ChartData::BabelColor => &BABEL.curves,
    }
}

#[cfg(test)]
mod tests {
    use super::super::colour::{delta_e_1976, lab};
    use super::super::illuminant::Illuminant;
    use super::super::observer::xyz_of_reflectance;
    use super::*;

    /// xyY of the chart under ICC D50 (white x = 0.345703, y = 0.358539), "ColorChecker 2005", GretagMacbeth / X-Rite, as
    /// tabulated by colour-science 0.4.
    const XYY_2005: [[f64; 3]; 24] = [
        [0.4316, 0.3777, 0.1008], // dark skin
        [0.4197, 0.3744, 0.3495], // light skin
        [0.276, 0.3016, 0.1836],  // blue sky
        [0.3703, 0.4499, 0.1325], // foliage
        [0.2999, 0.2856, 0.2304], // blue flower
        [0.2848, 0.3911, 0.4178], // bluish green
        [0.5295, 0.4055, 0.3118], // orange
        [0.2305, 0.2106, 0.1126], // purplish blue
        [0.5012, 0.3273, 0.1938], // moderate red
        [0.3319, 0.2482, 0.0637], // purple
        [0.3984, 0.5008, 0.4446], // yellow green
        [0.4957, 0.4427, 0.4357], // orange yellow
        [0.2018, 0.1692, 0.0575], // blue
        [0.3253, 0.5032, 0.2318], // green
        [0.5686, 0.3303, 0.1257], // red
        [0.4697, 0.4734, 0.5981], // yellow
        [0.4159, 0.2688, 0.2009], // magenta
        [0.2131, 0.3023, 0.193],  // cyan
        [0.3469, 0.3608, 0.9131], // white 9.5 (.05 D)
        [0.344, 0.3584, 0.5894],  // neutral 8 (.23 D)
        [0.3432, 0.3581, 0.3632], // neutral 6.5 (.44 D)
        [0.3446, 0.3579, 0.1915], // neutral 5 (.70 D)
        [0.3401, 0.3548, 0.0883], // neutral 3.5 (1.05 D)
        [0.3406, 0.3537, 0.0311], // black 2 (1.5 D)
    ];

    #[test]
    fn the_chart_matches_the_colours_that_its_maker_published() {
        let d50 = Illuminant::named("D50").unwrap().power;
        let (x, y) = (0.345702914918791, 0.358538596679933);
        let published_white = [x / y, 1.0, (1.0 - x - y) / y];
        let even = Spectrum::new(vec![0.3, 0.83], vec![1.0, 1.0]).unwrap();
        let white = xyz_of_reflectance(&even, &d50);
        for (data, mean_limit, worst_limit) in
            [(ChartData::Ohta, 1.7, 3.7), (ChartData::BabelColor, 0.9, 2.6)]
        {
            let patches = colour_checker(data);
            assert_eq!(patches.len(), CHART_ROWS * CHART_COLUMNS);
            let differences: Vec<f64> = patches
                .iter()
                .zip(XYY_2005)
                .map(|((_, reflectance), [x, y, luminance])| {
                    let published = [x / y * luminance, luminance, (1.0 - x - y) / y * luminance];
                    let ours = xyz_of_reflectance(reflectance, &d50);
                    delta_e_1976(lab(ours, white), lab(published, published_white))
                })
                .collect();
            let mean = differences.iter().sum::<f64>() / 24.0;
            let worst = differences.iter().copied().fold(0.0, f64::max);
            assert!(mean < mean_limit && worst < worst_limit, "{data:?}: mean {mean}, worst {worst}");
        }
    }
}
