//! The colour matrix from camera RGB to display RGB, fitted to a ColorChecker.

use super::colour::{Matrix3, apply, bradford, delta_e_1976, lab};
use super::colour_checker::{ChartData, colour_checker};
use super::electrons::{ElectronsError, band_weights};
use super::illuminant::Illuminant;
use super::observer::xyz_of_reflectance;
use super::upsampling::d65_white;
use crate::sensor::{Colour, SensorModel};
use crate::spectrum::PixelOptics;
use crate::spectrum::Spectrum;
use crate::spectrum::bands::{band_mean, ends};

/// A colour matrix and its colour errors.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourMatrix {
    /// Linear sRGB from white-balanced camera RGB. Its rows sum to 1, so white stays white.
    pub matrix: Matrix3,
    /// Mean colour difference of the 24 patches, CIE 1976.
    pub mean_delta_e: f64,
    /// Largest colour difference of the 24 patches.
    pub worst_delta_e: f64,
}

/// Largest element of a usable matrix. Larger elements would amplify noise more than colour.
const LARGEST_ELEMENT: f64 = 100.0;
/// Least `1 - r^2` of the two fitted colour differences; r is their correlation.
const LEAST_INDEPENDENCE: f64 = 1e-6;

/// Fits the matrix to camera RGB of the 24 patches (Ohta): least squares in linear sRGB, with rows that sum to 1.
///
/// The camera is the sensor with the transmission of `optics`, in the bands `band_um` (um, ascending, at least two) of the
/// picture that the matrix is for. The target of a patch is its colour under the light, adapted to D65 by the Bradford
/// transform.
///
/// `None` for sensors without red, green and blue pixels, and for sensors whose three curves are too similar to separate
/// colours. Fails if a colour has no curve, or gives no electrons for white.
pub fn fit_colour_matrix(
    sensor: &SensorModel,
    optics: &PixelOptics,
    light: &Illuminant,
    band_um: &[f64],
) -> Result<Option<ColourMatrix>, ElectronsError> {
    let weights = band_weights(sensor, optics, band_um)?;
    let of = |colour: Colour| weights.iter().find(|(c, _)| *c == colour).map(|(_, weights)| weights);
    let (Some(red), Some(green), Some(blue)) = (of(Colour::Red), of(Colour::Green), of(Colour::Blue)) else {
        return Ok(None);
    };
    // Compute white-balanced camera RGB of a reflectance under the light.
    let radiance = light.white_radiance(1.0);
    let electrons = |reflectance: &Spectrum| {
        let bands = band_mean(&[&radiance, &reflectance.held(ends(band_um))], band_um);
        [red, green, blue].map(|weights| weights.iter().zip(&bands).map(|(w, l)| w * l).sum::<f64>())
    };
    let even = reference_white();
    let of_white = electrons(&even);
    if let Some(dark) = of_white.iter().position(|e| *e <= 0.0) {
        return Err(ElectronsError::NoSignal([Colour::Red, Colour::Green, Colour::Blue][dark]));
    }
    let camera = |reflectance: &Spectrum| {
        let seen = electrons(reflectance);
        [0, 1, 2].map(|c| seen[c] / of_white[c])
    };
    // Pair camera RGB and target colour of every patch.
    let (d65, from_srgb, to_srgb) = d65_white();
    let patches: Vec<([f64; 3], [f64; 3])> = colour_checker(ChartData::Ohta)
        .iter()
        .map(|(_, reflectance)| (camera(reflectance), seen_under(reflectance, light)))
        .collect();

    // With m3 = 1 - m1 - m2 a row has two unknowns: t - c3 = m1 (c1 - c3) + m2 (c2 - c3).
    let row = |channel: usize| {
        let (mut a11, mut a12, mut a22, mut b1, mut b2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (camera, xyz) in &patches {
            let (u, v) = (camera[0] - camera[2], camera[1] - camera[2]);
            let t = apply(&to_srgb, *xyz)[channel] - camera[2];
            a11 += u * u;
            a12 += u * v;
            a22 += v * v;
            b1 += u * t;
            b2 += v * t;
        }
        let determinant = a11 * a22 - a12 * a12;
        let (m1, m2) = ((b1 * a22 - b2 * a12) / determinant, (a11 * b2 - a12 * b1) / determinant);
        let row = [m1, m2, 1.0 - m1 - m2];
        // These comparisons also reject NaN.
        let fits =
            determinant > LEAST_INDEPENDENCE * a11 * a22 && row.iter().all(|m| m.abs() <= LARGEST_ELEMENT);
        fits.then_some(row)
    };
    let (Some(to_red), Some(to_green), Some(to_blue)) = (row(0), row(1), row(2)) else { return Ok(None) };
    // Measure the colour error of every patch.
    let matrix: Matrix3 = [to_red, to_green, to_blue];
    let differences: Vec<f64> = patches
        .iter()
        .map(|(camera, xyz)| {
            let shown = apply(&from_srgb, apply(&matrix, *camera));
            delta_e_1976(lab(shown, d65), lab(*xyz, d65))
        })
        .collect();
    let mean_delta_e = differences.iter().sum::<f64>() / differences.len() as f64;
    let worst_delta_e = differences.iter().copied().fold(0.0, f64::max);
    Ok(Some(ColourMatrix { matrix, mean_delta_e, worst_delta_e }))
}

/// XYZ, relative to D65, of the colour that a reflectance has under a light to an eye that is adapted to it (Bradford transform).
pub fn seen_under(reflectance: &Spectrum, light: &Illuminant) -> [f64; 3] {
    let white = xyz_of_reflectance(&reference_white(), &light.power);
    apply(&bradford(white, d65_white().0), xyz_of_reflectance(reflectance, &light.power))
}

/// Reflectance 1 over the visible range.
fn reference_white() -> Spectrum {
    match Spectrum::new(vec![0.38, 0.78], vec![1.0, 1.0]) {
        Ok(curve) => curve,
        Err(error) => unreachable!("two samples make a curve: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::observer::cie1931;
    use super::*;
    use crate::sensor::QuantumEfficiency;
    use crate::spectrum::bands::even_bands;

    fn sensor(curves: QuantumEfficiency) -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        SensorModel { quantum_efficiency: Some(curves), ..toml::from_str::<SensorModel>(text).unwrap() }
    }

    /// A lens of f/4.4 with this transmission.
    fn optics(transmission: Option<Spectrum>) -> PixelOptics {
        PixelOptics { pixel_um: 5.86, f_number: 4.4, time_s: 0.005, transmission }
    }

    fn imx219() -> SensorModel {
        let curves = include_str!("../../../petzval-data/data/quantum-efficiency/imx219.toml");
        sensor(toml::from_str::<QuantumEfficiency>(curves).unwrap())
    }

    #[test]
    fn a_camera_with_the_curves_of_the_observer_has_no_colour_error() {
        // Electrons are proportional to photons: matching functions divided by the wavelength make a colorimetric camera.
        let [x, y, z] = cie1931();
        let wavelength_um = x.wavelength_um().to_vec();
        let per_photon =
            |c: &Spectrum| c.value().iter().zip(&wavelength_um).map(|(v, um)| v / um / 5.0).collect();
        let curves = QuantumEfficiency {
            red: per_photon(x),
            green: per_photon(y),
            blue: per_photon(z),
            wavelength_um: wavelength_um.clone(),
            ..Default::default()
        };
        let light = Illuminant::named("D65").unwrap();
        let bands = even_bands(0.38, 0.78, 401);
        let fit = fit_colour_matrix(&sensor(curves), &optics(None), &light, &bands).unwrap().unwrap();
        assert!(fit.worst_delta_e < 0.1, "{fit:?}");
        assert!(fit.matrix.iter().all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }

    #[test]
    fn colour_errors_of_a_real_camera_match_the_independent_program() {
        // Figures of tests/fixtures/generators/colour_matrix.py, which sums over every half nanometre.
        for (name, count, mean, worst) in [
            ("D65", 61, 3.319, 8.504),
            ("A", 61, 4.731, 13.440),
            ("FL11", 61, 1.512, 3.829),
            ("D65", 16, 3.512, 8.706),
            ("A", 16, 5.074, 14.010),
        ] {
            let light = Illuminant::named(name).unwrap();
            let bands = even_bands(0.4, 0.7, count);
            let fit = fit_colour_matrix(&imx219(), &optics(None), &light, &bands).unwrap().unwrap();
            assert!((fit.mean_delta_e - mean).abs() < 0.02, "{name}: {fit:?}");
            assert!((fit.worst_delta_e - worst).abs() < 0.05, "{name}: {fit:?}");
        }
        let bands = even_bands(0.4, 0.7, 16);
        let mono = SensorModel { cfa: crate::sensor::CfaPattern::MONO, ..imx219() };
        let mono = SensorModel {
            quantum_efficiency: Some(QuantumEfficiency {
                wavelength_um: vec![0.3, 1.1],
                clear: vec![0.5, 0.5],
                ..Default::default()
            }),
            ..mono
        };
        let light = Illuminant::named("D65").unwrap();
        assert_eq!(fit_colour_matrix(&mono, &optics(None), &light, &bands).unwrap(), None);
    }

    #[test]
    fn the_matrix_depends_on_the_transmission_of_the_lens() {
        let yellow = Spectrum::new(vec![0.4, 0.48, 0.52, 0.7], vec![0.02, 0.1, 0.9, 0.95]).unwrap();
        let light = Illuminant::named("D65").unwrap();
        let bands = even_bands(0.4, 0.7, 16);
        let plain = fit_colour_matrix(&imx219(), &optics(None), &light, &bands).unwrap().unwrap();
        let glass = fit_colour_matrix(&imx219(), &optics(Some(yellow)), &light, &bands).unwrap().unwrap();
        // A camera with little blue light has larger colour errors. 9.492 is also of colour_matrix.py.
        assert!((glass.mean_delta_e - 9.492).abs() < 0.03, "{plain:?} {glass:?}");
        let gray = Spectrum::new(vec![0.3, 0.8], vec![0.5, 0.5]).unwrap();
        let gray = fit_colour_matrix(&imx219(), &optics(Some(gray)), &light, &bands).unwrap().unwrap();
        assert!((gray.mean_delta_e - plain.mean_delta_e).abs() < 1e-9);
    }

    #[test]
    fn curves_that_do_not_separate_colours_have_no_matrix() {
        let even = vec![0.5, 0.6, 0.4];
        let light = Illuminant::named("D65").unwrap();
        let bands = even_bands(0.4, 0.7, 16);
        for blue in [even.clone(), even.iter().map(|v| v * 0.7).collect(), vec![0.5, 0.6, 0.400001]] {
            let curves = QuantumEfficiency {
                wavelength_um: vec![0.4, 0.55, 0.7],
                red: even.clone(),
                green: even.clone(),
                blue,
                ..Default::default()
            };
            let fit = fit_colour_matrix(&sensor(curves), &optics(None), &light, &bands).unwrap();
            assert_eq!(fit, None);
        }
    }
}
