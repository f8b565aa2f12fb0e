//! The sensor that takes the image of a lens: one that fits, or the pixels of one in an array that does.

use std::ops::RangeInclusive;
use std::path::Path;

use petzval_base::pasted;
use petzval_camera::sensor::{Colour, SensorModel};

use super::field::Reach;
use super::focus::round;
use crate::assets::Assets;
use crate::error::Result;
use crate::experiment::ExposureConfig;

/// The corner of a sensor that takes the image of a lens, as a share of the image circle's radius.
const FITS: RangeInclusive<f64> = 0.85..=1.02;

/// Rows of an array that is fitted. Fewer hold few windows, more make whole frames that no photograph fills; outside, pixels change in size.
const ROWS: RangeInclusive<f64> = 480.0..=4800.0;

/// White in a pixel, as a share of what it can hold, where the experiment's is too much.
const WHITE: f64 = 0.55;

/// Pixels that hold no more take no picture, e-.
const LEAST_WHITE_E: f64 = 10.0;

/// The sensor of a fitted experiment.
pub(super) struct Picked {
    /// By what name it is known.
    pub name: String,
    /// The sensor.
    pub model: SensorModel,
    /// Whether its array was fitted to the lens.
    pub is_fitted: bool,
    /// Area of a pixel over that of the sensor of this name.
    pub pixel_area: f64,
    /// Half of the diagonal of the sensor of this name, mm.
    before_mm: f64,
}

/// Half of the diagonal of a sensor, mm.
pub(super) fn corner_mm(sensor: &SensorModel) -> f64 {
    0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64)
}

/// The size of a sensor: `31.3 megapixels`.
pub(super) fn megapixels(sensor: &SensorModel) -> String {
    format!("{:.1} megapixels", 1e-6 * (sensor.height * sensor.width) as f64)
}

/// The sensor that the user names; or the experiment's, or else another built-in one in colour, if it fits the image of the lens; or the pixels of the
/// experiment's in an array that does.
pub(super) fn choose(own: &str, named: Option<&str>, reach: &Reach, assets: &Assets) -> Result<Picked> {
    let as_it_is = |name: &str, model: SensorModel| {
        let before_mm = corner_mm(&model);
        Picked { name: name.to_owned(), model, is_fitted: false, pixel_area: 1.0, before_mm }
    };
    let first = assets.sensor(named.unwrap_or(own))?;
    let fits = |sensor: &SensorModel| FITS.contains(&(corner_mm(sensor) / reach.circle_mm));
    if named.is_some() || reach.circle_mm == 0.0 || fits(&first) {
        return Ok(as_it_is(named.unwrap_or(own), first));
    }
    for name in assets.names("sensors") {
        let other = assets.sensor(name)?;
        if other.cfa.colours() != [Colour::Clear] && fits(&other) {
            return Ok(as_it_is(name, other));
        }
    }
    let before_mm = corner_mm(&first);
    let (model, pixel_area) = with_corner(&first, reach.circle_mm);
    Ok(Picked { name: own.to_owned(), model, is_fitted: true, pixel_area, before_mm })
}

/// The pixels of a sensor in an array of the same shape whose corner lies at a radius. Where that takes too few or too many pixels, they change in size,
/// and what a pixel holds with its area. Also returns the area of a pixel over that of before.
fn with_corner(sensor: &SensorModel, radius_mm: f64) -> (SensorModel, f64) {
    let scale = radius_mm / corner_mm(sensor);
    let rows = scale * sensor.height as f64;
    let kept = rows.clamp(*ROWS.start(), *ROWS.end());
    // Whole cells of a colour array.
    let even = |count: f64| 2 * (0.5 * count).round() as usize;
    let (height, width) = (even(kept), even(kept * sensor.width as f64 / sensor.height as f64));
    let pixel_um = if kept == rows {
        sensor.pixel_um
    } else {
        three_digits(2e3 * radius_mm / (height as f64).hypot(width as f64))
    };
    let area = (pixel_um / sensor.pixel_um).powi(2);
    let of_pixel = if area == 1.0 { String::new() } else { format!(" of {pixel_um} um") };
    let model = SensorModel {
        name: format!("{}, {width} x {height} pixels{of_pixel}", sensor.name),
        height,
        width,
        pixel_um,
        full_well_e: area * sensor.full_well_e,
        // The converter takes a full pixel at the same number.
        gain_dn_per_e: sensor.gain_dn_per_e / area,
        dark_current_e_per_s: area * sensor.dark_current_e_per_s,
        ..sensor.clone()
    };
    (model, area)
}

/// A number to three significant digits.
fn three_digits(value: f64) -> f64 {
    let decimals = (2.0 - value.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

impl Picked {
    /// The sensor against the image circle of a lens, which the user calls by `lens_name`.
    pub fn in_words(&self, reach: &Reach, lens_name: &str) -> String {
        let (corner, name) = (corner_mm(&self.model), &self.name);
        if reach.circle_mm == 0.0 {
            return format!(
                "sensor: `{name}`, {}, whose corner lies {corner:.2} mm from the axis",
                megapixels(&self.model)
            );
        }
        let percent = |corner_mm: f64| 100.0 * corner_mm / reach.circle_mm;
        let SensorModel { width, height, pixel_um, .. } = self.model;
        if self.is_fitted {
            return format!(
                "sensor: the corner of `{name}` lies at {:.0} % of the image circle; its pixels are taken in an array of {width} x {height} pixels of \
                 {pixel_um} um, {}, whose corner lies at {:.0} % of it (`petzval init --lens {} --sensor NAME` takes another sensor)",
                percent(self.before_mm),
                megapixels(&self.model),
                percent(corner),
                pasted(Path::new(lens_name))
            );
        }
        let use_of_it = match percent(corner) {
            p if p < 100.0 * FITS.start() => ": the rest of the image is not used",
            p if p > 100.0 * FITS.end() => ": its corners lie beyond the fields of the lens file",
            _ => "",
        };
        format!(
            "sensor: `{name}`, {}, whose corner lies {corner:.2} mm from the axis, at {:.0} % of the image circle{use_of_it}",
            megapixels(&self.model),
            percent(corner)
        )
    }
}

/// Changes the electrons of white with the area of a pixel that was fitted, and lowers them to what a pixel holds; returns what to say then.
pub(super) fn fit_exposure(exposure: &mut ExposureConfig, picked: &Picked) -> Option<String> {
    let before = exposure.white_e;
    exposure.white_e = (f64::from(before) * picked.pixel_area) as f32;
    let lowered = white_that_fits(exposure, &picked.model);
    if lowered.is_some() || picked.pixel_area == 1.0 {
        return lowered;
    }
    exposure.white_e = round(f64::from(exposure.white_e)) as f32;
    let white_e = exposure.white_e;
    (white_e != before)
        .then(|| format!("exposure.white_e = {white_e} in place of {before}: pixels have another area"))
}

/// Lowers the electrons of white where a pixel of the sensor saturates before; returns what to say then.
pub fn white_that_fits(exposure: &mut ExposureConfig, sensor: &SensorModel) -> Option<String> {
    let before = exposure.white_e;
    let capacity_e = sensor.light_capacity_e(f64::from(exposure.time_s), f64::from(exposure.linear_gain));
    if f64::from(before) <= capacity_e || capacity_e <= LEAST_WHITE_E {
        return None;
    }
    exposure.white_e = round(WHITE * capacity_e) as f32;
    Some(format!(
        "exposure.white_e = {} in place of {before}: a pixel of `{}` saturates at {capacity_e:.0} e- of light",
        exposure.white_e, sensor.name
    ))
}

#[cfg(test)]
mod tests {
    use petzval_optics::glass::Catalog;

    use super::*;

    fn imx249() -> SensorModel {
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap()
    }

    #[test]
    fn an_array_has_its_corner_on_the_image_circle() {
        // Half of the diagonal of 1920 x 1200 pixels of 5.86 um is 6.634 mm.
        for (radius_mm, keeps_pixels) in [(24.8, true), (3.0, true), (0.5, false), (300.0, false)] {
            let (sensor, area) = with_corner(&imx249(), radius_mm);
            assert!((corner_mm(&sensor) / radius_mm - 1.0).abs() < 0.02, "{radius_mm}: {sensor:?}");
            assert_eq!(sensor.pixel_um == 5.86, keeps_pixels, "{radius_mm}: {sensor:?}");
            assert!(sensor.height.is_multiple_of(2) && sensor.width.is_multiple_of(2));
            assert!((sensor.full_well_e / (33723.0 * area) - 1.0).abs() < 1e-9);
            // A full pixel has the same number whatever its size.
            assert!((sensor.gain_dn_per_e * sensor.full_well_e / (0.14 * 33723.0) - 1.0).abs() < 1e-9);
            assert!(petzval_files::parse_sensor(&toml::to_string(&sensor).unwrap()).is_ok());
        }
    }

    /// `design LENS` has no --sensor: the words name the command that has it.
    #[test]
    fn the_words_of_a_fitted_array_name_a_command_that_takes_another_sensor() {
        let text = "name = \"singlet\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 10.0\n[object]\ndistance_mm = inf\n\
                    [wavelengths]\num = [0.5876]\nreference_um = 0.5876\n[fields]\nangle_deg = [0.0, 14.0]\n\
                    [glass.crown]\nnd = 1.5\nvd = 60.0\n\
                    [[surface]]\nstop = true\nradius_mm = 100.0\nthickness_mm = 5.0\nglass = \"crown\"\nsemi_diameter_mm = 6.0\n\
                    [[surface]]\nradius_mm = -100.0\nthickness_mm = 99.0\nsemi_diameter_mm = 7.0\n";
        let lens = petzval_files::parse_lens(text, &Catalog::default()).unwrap().lens;
        let reach = Reach { lens, field_deg: 14.0, stated_deg: 14.0, circle_mm: 24.8 };
        let (model, pixel_area) = with_corner(&imx249(), reach.circle_mm);
        let name = "imx249-fitted".to_owned();
        let picked = Picked { name, model, is_fitted: true, pixel_area, before_mm: corner_mm(&imx249()) };
        let said = picked.in_words(&reach, "my lenses/tele.seq");
        assert!(said.contains("(`petzval init --lens 'my lenses/tele.seq' --sensor NAME` takes"), "{said}");
    }

    #[test]
    fn white_follows_the_area_of_a_pixel_and_is_said_where_it_differs() {
        let fitted = |pixel_area: f64| {
            let model = SensorModel { full_well_e: pixel_area * 33723.0, ..imx249() };
            let picked = Picked {
                name: String::new(),
                model,
                is_fitted: true,
                pixel_area,
                before_mm: corner_mm(&imx249()),
            };
            let mut exposure = ExposureConfig::default();
            let said = fit_exposure(&mut exposure, &picked);
            (exposure.white_e, said)
        };
        // Pixels of 5.78 um in place of 5.86 um: 15 566 electrons, which are the same to two digits.
        assert_eq!(fitted((5.78_f64 / 5.86).powi(2)), (16_000.0, None));
        let (white_e, said) = fitted(0.25);
        assert_eq!(white_e, 4000.0);
        assert!(said.unwrap().contains("white_e = 4000 in place of 16000"));
    }

    #[test]
    fn white_fits_into_a_pixel() {
        let mut exposure = ExposureConfig::default();
        assert_eq!(white_that_fits(&mut exposure, &imx249()), None);
        let small = SensorModel { full_well_e: 5000.0, ..imx249() };
        assert!(white_that_fits(&mut exposure, &small).unwrap().contains("in place of 16000"));
        let capacity_e = small.light_capacity_e(0.005, 1.0);
        assert!(
            f64::from(exposure.white_e) < 0.6 * capacity_e && f64::from(exposure.white_e) > 0.5 * capacity_e
        );
    }
}
