//! From the colours of a camera to those of a display: the matrix that renders a ColorChecker best.

use super::colour::{Matrix3, apply, bradford, delta_e_1976, lab, product};
use super::colour_checker::{ChartData, colour_checker};
use super::electrons::{ElectronsError, curves_of};
use super::illuminant::Illuminant;
use super::observer::xyz_of_reflectance;
use super::photons::PixelOptics;
use super::spectrum::Spectrum;
use super::upsampling::d65_white;
use crate::sensor::{Colour, SensorModel};

/// A colour matrix and how well it does.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourMatrix {
    /// Linear sRGB from white-balanced camera RGB; its rows sum to 1, so that white stays white.
    pub matrix: Matrix3,
    /// Mean colour difference of the 24 patches, CIE 1976.
    pub mean_delta_e: f64,
    /// Largest colour difference of the 24 patches.
    pub worst_delta_e: f64,
}

/// Fits the matrix to the 24 patches (Ohta) under a light: least squares in linear sRGB, rows that sum to 1.
///
/// The target of a patch is its colour under the light, adapted to D65 by the Bradford transform. `None` for sensors
/// without red, green and blue pixels.
pub fn fit_colour_matrix(
    sensor: &SensorModel,
    light: &Illuminant,
) -> Result<Option<ColourMatrix>, ElectronsError> {
    let curves = curves_of(sensor)?;
    let colours = [Colour::Red, Colour::Green, Colour::Blue];
    if colours.iter().any(|c| !sensor.cfa.colours().contains(c)) {
        return Ok(None);
    }
    // Only ratios count, so any optics will do.
    let optics = PixelOptics { pixel_um: 1.0, f_number: 1.0, time_s: 1.0, transmission: None };
    let even = reference_white();
    let white = light.white_radiance(1.0);
    let camera = |reflectance: &Spectrum| -> Result<[f64; 3], ElectronsError> {
        let mut rgb = [0.0; 3];
        for (value, colour) in rgb.iter_mut().zip(colours) {
            let curve = curves.curve(colour).ok_or(ElectronsError::NoCurve(colour))?;
            let seen = |r: &Spectrum| white.times(r).map_or(0.0, |light| optics.electrons(&light, &curve));
            let of_white = seen(&even);
            if of_white <= 0.0 {
                return Err(ElectronsError::NoSignal(colour));
            }
            *value = seen(reflectance) / of_white;
        }
        Ok(rgb)
    };
    let (d65, _, srgb) = d65_white();
    let adapt = bradford(xyz_of_reflectance(&even, &light.power), d65);
    let to_srgb = product(&srgb, &adapt);
    let patches: Vec<([f64; 3], [f64; 3])> = colour_checker(ChartData::Ohta)
        .iter()
        .map(|(_, reflectance)| Ok((camera(reflectance)?, xyz_of_reflectance(reflectance, &light.power))))
        .collect::<Result<_, ElectronsError>>()?;

    // With m3 = 1 - m1 - m2 a row is fitted by two numbers: t - c3 = m1 (c1 - c3) + m2 (c2 - c3).
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
        [m1, m2, 1.0 - m1 - m2]
    };
    let matrix: Matrix3 = [row(0), row(1), row(2)];
    let (_, from_srgb, _) = d65_white();
    let differences: Vec<f64> = patches
        .iter()
        .map(|(camera, xyz)| {
            let shown = apply(&from_srgb, apply(&matrix, *camera));
            delta_e_1976(lab(shown, d65), lab(apply(&adapt, *xyz), d65))
        })
        .collect();
    let mean_delta_e = differences.iter().sum::<f64>() / differences.len() as f64;
    let worst_delta_e = differences.iter().copied().fold(0.0, f64::max);
    Ok(Some(ColourMatrix { matrix, mean_delta_e, worst_delta_e }))
}

/// Reflectance 1 over the visible.
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

    fn sensor(curves: QuantumEfficiency) -> SensorModel {
        let text = include_str!("../../../../data/sensors/imx249-fitted.toml");
        SensorModel { quantum_efficiency: Some(curves), ..SensorModel::from_toml(text).unwrap() }
    }

    #[test]
    fn an_observer_as_a_camera_has_the_right_colours() {
        // Electrons count photons: the matching functions divided by the wavelength make a colorimetric camera.
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
        let fit = fit_colour_matrix(&sensor(curves), &light).unwrap().unwrap();
        assert!(fit.worst_delta_e < 0.1, "{fit:?}");
        assert!(fit.matrix.iter().all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }

    #[test]
    fn a_real_camera_comes_close() {
        let curves = include_str!("../../../../data/quantum-efficiency/imx219.toml");
        let sensor = sensor(QuantumEfficiency::from_toml(curves).unwrap());
        for name in ["D65", "A", "FL11"] {
            let fit = fit_colour_matrix(&sensor, &Illuminant::named(name).unwrap()).unwrap().unwrap();
            assert!(fit.mean_delta_e < 10.0, "{name}: {fit:?}");
        }
        let mono = SensorModel { cfa: crate::sensor::CfaPattern::MONO, ..sensor };
        assert_eq!(fit_colour_matrix(&mono, &Illuminant::named("D65").unwrap()).unwrap(), None);
    }
}
