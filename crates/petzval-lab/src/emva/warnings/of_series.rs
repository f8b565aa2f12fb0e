//! Warnings about all gains of a series together.

use crate::emva::captures::{Kind, SensorFacts};
use crate::emva::counts::PointHistogram;
use crate::emva::joint::{GainRow, JointFit};
use crate::emva::measured::Measured;
use crate::emva::result::{ChannelResult, GainResult};
use crate::emva::rounding::LEAST_DARK_VARIANCE_DN2;
use crate::emva::samples::ConverterFlags;
use crate::emva::spatial::{Components, Spatial};
use crate::emva::transfer_point::TransferPoint;
use crate::emva::warning::Warning;
use petzval_base::statistics::median;

/// The warnings about the converter, the gains and the joint fit.
pub fn series_warnings(
    sensor: &SensorFacts,
    converter: &ConverterFlags,
    gains: &[GainResult],
    joint: &JointFit,
    histograms: &[PointHistogram],
) -> Vec<Warning> {
    let mut warnings = of_converter(converter);
    warnings.extend(not_proportional(joint));
    warnings.extend(dark_current_disagrees(joint));
    warnings.extend(gains.iter().flat_map(more_electrons_than_photons));
    warnings.extend(joint.gain_dn_per_e.reason().map(|why| Warning::NoSensorFile { why }));
    warnings.extend(joint.rows.iter().filter_map(ruled_by_rounding));
    warnings.extend(joint.rows.iter().filter_map(below_the_converter));
    warnings.extend(gains.iter().flat_map(not_linear));
    warnings.extend(full_well_differs(sensor, gains));
    let rows = gains.iter().zip(&joint.rows);
    warnings.extend(rows.filter_map(|(gain, row)| black_level_differs(gain, row, joint, histograms)));
    warnings.extend(hot_pixels(joint));
    warnings.extend(gains.iter().filter_map(bright_pixels));
    warnings.extend(gains.iter().flat_map(defect_pixels));
    warnings
}

/// Warnings about the bits of the converter.
fn of_converter(flags: &ConverterFlags) -> Vec<Warning> {
    let max_dn = flags.max_dn;
    let factor = flags.common_factor.map(|factor| Warning::CommonFactor { factor, max_dn });
    let top = flags.top_not_reached.map(|top| Warning::TopNotReached {
        largest_dn: top.largest_dn,
        max_dn,
        piled: top.piled,
    });
    factor.into_iter().chain(top).collect()
}

/// Gains whose `K_g / g` differs from the median of all by more than five standard errors and 2 %. A single wrong gain
/// hardly shifts the median.
fn not_proportional(joint: &JointFit) -> Vec<Warning> {
    let all = joint.rows.iter().filter_map(|r| {
        let at_unit = r.gain_at_unit_dn_per_e;
        Some((r.linear_gain, at_unit.value()?, at_unit.standard_error()?))
    });
    let all: Vec<(f64, f64, f64)> = all.collect();
    let n = all.len();
    if n < 2 {
        return Vec::new();
    }
    let median = median(all.iter().map(|(_, k, _)| *k));
    // The variance of a median is pi/2 times that of the mean for a normal distribution.
    let mean_square = all.iter().map(|(.., se)| se * se).sum::<f64>() / n as f64;
    let median_se = (0.5 * std::f64::consts::PI * mean_square / n as f64).sqrt();
    all.iter()
        .filter(|(_, k, se)| {
            (k - median).abs() > 5.0 * se.hypot(median_se) && (k - median).abs() > 0.02 * median
        })
        .map(|(linear_gain, k, _)| Warning::GainNotProportional {
            linear_gain: *linear_gain,
            gain_dn_per_e: *k,
            expected_dn_per_e: median,
        })
        .collect()
}

/// A gain at which rounding contributes more to the error of the dark variance than noise does.
fn ruled_by_rounding(row: &GainRow) -> Option<Warning> {
    let (variance, se) = (row.dark_variance_dn2.value()?, row.dark_variance_dn2.standard_error()?);
    (2.0 * row.rounding_error_dn2.powi(2) > se * se).then(|| Warning::Rounding {
        linear_gain: row.linear_gain,
        noise_dn: variance.max(0.0).sqrt(),
        error_dn2: row.rounding_error_dn2,
    })
}

/// A gain at which the dark noise is only an upper limit.
fn below_the_converter(row: &GainRow) -> Option<Warning> {
    let variance = row.dark_variance_dn2.value()?;
    (variance <= LEAST_DARK_VARIANCE_DN2).then_some(Warning::DarkNoiseLimit { linear_gain: row.linear_gain })
}

/// Deviation from a straight line above which the captures are more likely wrong than the sensor, percent.
const NOT_LINEAR_PERCENT: f64 = 5.0;

/// Colours whose response is off the straight line by more than 5 % and six standard errors.
fn not_linear(gain: &GainResult) -> Vec<Warning> {
    let of = |c: &ChannelResult| {
        let linearity = c.transfer.linearity.as_ref()?;
        let (first, last) = linearity.range;
        let off = |i: &usize| linearity.deviation_percent[*i].abs();
        let worst = (first..=last).max_by(|a, b| off(a).total_cmp(&off(b)))?;
        let error = linearity.deviation_se_percent[worst];
        (off(&worst) > NOT_LINEAR_PERCENT && off(&worst) > 6.0 * error).then(|| Warning::NotLinear {
            linear_gain: gain.linear_gain,
            colour: c.colour,
            percent: linearity.deviation_percent[worst],
            mean_dn: c.points[worst].mean_dn,
        })
    };
    gain.channels.iter().filter_map(of).collect()
}

/// A stated full well that differs from the measured one by more than five standard errors and 2 %. If the converter
/// clips first, the well may be larger than measured.
fn full_well_differs(sensor: &SensorFacts, gains: &[GainResult]) -> Option<Warning> {
    let stated_e = sensor.full_well_e?;
    let channel = gains.first()?.saturated_channel()?;
    let measured = channel.figure("u_e_sat")?.best();
    let (measured_e, standard_error_e) = (measured.value()?, measured.standard_error()?);
    let is_clipped = channel.points.last().is_some_and(TransferPoint::is_full);
    let off_e = measured_e - stated_e;
    let matters = off_e.abs() > (5.0 * standard_error_e).max(0.02 * stated_e);
    (matters && (off_e > 0.0 || !is_clipped)).then_some(Warning::FullWellDiffers {
        stated_e,
        measured_e,
        standard_error_e,
    })
}

/// A stated black level that differs from the level of the dark frames by more than five standard deviations of their noise and 1 DN: the means of
/// read noise and of the electronics are smaller.
fn black_level_differs(
    gain: &GainResult,
    row: &GainRow,
    joint: &JointFit,
    histograms: &[PointHistogram],
) -> Option<Warning> {
    let stated_dn = joint.black_level_dn? + row.black_shift_dn;
    let first = gain.dark.points.first()?;
    let off = |level_dn: f64| (level_dn - stated_dn).abs();
    // Light that leaks in tilts the line over exposure time, and dark current raises its first point: take the nearer of both.
    let levels = row.dark_mean_dn.value().into_iter().chain([first.mean_dn]);
    let measured_dn = levels.min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
    let limit_dn = 5.0 * first.variance_dn2.max(0.0).sqrt() + 1.0;
    // Stuck pixels raise means, not medians.
    let median_is_off = |shortest: &PointHistogram| {
        let median_dn = f64::from(shortest.counts.quantile_dn(0.5));
        let current_dn = gain.dark.mean.slope.value().unwrap_or(0.0) * shortest.exposure_s;
        [median_dn, median_dn - current_dn].into_iter().all(|level_dn| off(level_dn) > limit_dn)
    };
    let darks = histograms.iter().filter(|h| h.kind == Kind::Dark && h.linear_gain == row.linear_gain);
    let shortest = darks.min_by(|a, b| a.exposure_s.total_cmp(&b.exposure_s));
    (off(measured_dn) > limit_dn && shortest.is_none_or(median_is_off))
        .then_some(Warning::BlackLevelDiffers { linear_gain: row.linear_gain, stated_dn, measured_dn })
}

/// Dark current from the mean and from its shot noise, if they differ by more than five standard errors, 10 %, and the part
/// of the hot pixels in the mean. That part is allowed because the noise of few pixels is uncertain, and full pixels have
/// none.
fn dark_current_disagrees(joint: &JointFit) -> Option<Warning> {
    let difference = joint.dark_current_difference_e_per_s;
    let (off, se) = (difference.value()?, difference.standard_error()?);
    let mean = joint.dark_current_e_per_s.value().unwrap_or(0.0);
    let hot = joint.hot_pixel_share.value().and(joint.dark_current_ordinary_e_per_s.value());
    let of_hot = hot.map_or(0.0, |ordinary| (mean - ordinary).max(0.0));
    (off.abs() > 5.0 * se + of_hot && off.abs() > 0.1 * mean.abs()).then_some(Warning::DarkCurrentDisagrees {
        mean_e_per_s: mean,
        difference_e_per_s: off,
        standard_error_e_per_s: se,
    })
}

/// Quantum efficiencies above one by more than five standard errors.
fn more_electrons_than_photons(gain: &GainResult) -> Vec<Warning> {
    let of = |c: &ChannelResult| {
        let efficiency = c.figure("QE")?.best();
        let (percent, standard_error) = (efficiency.value()?, efficiency.standard_error()?);
        (percent - 100.0 > 5.0 * standard_error).then_some(Warning::QuantumEfficiencyAboveOne {
            linear_gain: gain.linear_gain,
            colour: c.colour,
            percent,
            standard_error,
        })
    };
    gain.channels.iter().filter_map(of).collect()
}

/// Hot pixels, and how far they raise the mean dark current.
fn hot_pixels(joint: &JointFit) -> Option<Warning> {
    Some(Warning::HotPixels {
        share: joint.hot_pixel_share.value()?,
        excess_e_per_s: joint.hot_pixel_e_per_s.value()?,
        ordinary_e_per_s: joint.dark_current_ordinary_e_per_s.value()?,
        mean_e_per_s: joint.dark_current_e_per_s.value()?,
    })
}

/// Pixels that are bright in the dark at every exposure time, and the DSNU of the colour where they add most to it.
fn bright_pixels(gain: &GainResult) -> Option<Warning> {
    let currents = gain.pixel_dark_currents.as_ref()?;
    let stacks: Vec<&Spatial> = gain.channels.iter().filter_map(|c| c.spatial.as_ref()).collect();
    let pixels = if stacks.is_empty() { currents.bright } else { stacks.iter().map(|s| s.bright).sum() };
    let spread = |of: &Components| of.total.if_above_noise().root();
    let pair = |s: &&Spatial| {
        s.dark_components_without_bright.map(|without| [spread(&s.dark_components), spread(&without)])
    };
    let added =
        |[with, without]: &[Measured; 2]| with.value().unwrap_or(0.0) - without.value().unwrap_or(0.0);
    (pixels > 0).then_some(Warning::BrightPixels {
        linear_gain: gain.linear_gain,
        pixels,
        offset_dn: currents.bright_offset_dn?,
        dark_dn: stacks.iter().filter_map(pair).max_by(|a, b| added(a).total_cmp(&added(b))),
    })
}

/// Pixels of each colour that do not answer light.
fn defect_pixels(gain: &GainResult) -> Vec<Warning> {
    let of = |c: &ChannelResult| {
        let spatial = c.spatial.as_ref()?;
        let (first, [flat, dark]) = (spatial.defects.first()?, spatial.components_with_defects.as_ref()?);
        let pair = |clean: &Components, whole: &Components| {
            [clean, whole].map(|components| components.total.if_above_noise().root())
        };
        Some(Warning::DefectPixels {
            linear_gain: gain.linear_gain,
            colour: c.colour,
            pixels: spatial.defects.len(),
            first: [first.row, first.column],
            dark_dn: pair(&spatial.dark_components, dark),
            flat_dn: pair(&spatial.flat_components, flat),
            bias_percent: spatial.signal_bias.map(|bias| 100.0 * bias),
            of_others: ["R", "QE", "u_e_sat"]
                .iter()
                .filter_map(|name| {
                    let (figure, others) = (c.figure(name)?, c.without_defects(name)?);
                    Some((figure.name, others.value()?, figure.unit))
                })
                .collect(),
        })
    };
    gain.channels.iter().filter_map(of).collect()
}
