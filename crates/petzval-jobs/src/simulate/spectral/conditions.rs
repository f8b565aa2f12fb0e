//! The conditions of a simulation over the spectrum: lens, light, transmission, efficiency.

use std::path::{Path, PathBuf};

use petzval_camera::sensor::{Colour, QuantumEfficiency, SensorModel};
use petzval_camera::spectral::{
    ElectronsError, Illuminant, IlluminantError, PixelOptics, Spectrum, SpectrumTable,
};
use petzval_design::assets::Assets;
use petzval_design::error::DesignError;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_optics::analysis::image_f_number;
use petzval_optics::lens::Lens;

use super::super::request::Request;
use super::super::rig::Rig;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::glass_range::warn_of_wavelengths;

/// Prefix of an efficiency that is the same at all wavelengths.
const FLAT: &str = "flat:";

/// What all images of a simulation share, whatever their bands.
pub struct Conditions {
    pub lens: Lens,
    pub plan: PsfPlan,
    pub illuminant: Illuminant,
    pub lux: f64,
    pub optics: PixelOptics,
}

impl Conditions {
    /// Reads what the request names; the sensor of the rig gets the efficiency of `qe`.
    pub fn new(request: &Request, rig: &mut Rig, context: &Context) -> Result<Self> {
        let (over, assets) = (&request.spectral, &context.assets);
        if let Some(curves) = &over.qe {
            rig.sensor.quantum_efficiency = Some(efficiency(curves, assets)?);
        }
        let Some((lens, plan)) = rig.traced.clone() else {
            return Err(JobError::input(
                "--psfs: measured PSFs are those of three colours and of an unknown f-number",
                "leave out --psfs and name a lens with --lens, or leave out the spectral scene and the options over the spectrum",
            ));
        };
        has_curves(&rig.sensor, assets)?;
        let lux = over.illuminance_lux.unwrap_or(500.0);
        let illuminant = illuminant(over.illuminant.as_deref().unwrap_or("D65"))?;
        let transmission = over.transmission.as_deref().map(transmission).transpose()?;
        let optics = PixelOptics {
            pixel_um: rig.sensor.pixel_um,
            f_number: image_f_number(&lens),
            time_s: f64::from(request.time_s),
            transmission,
        };
        Ok(Self { lens, plan, illuminant, lux, optics })
    }

    /// Warns where the lens is traced at wavelengths outside the range of its glasses' formulas.
    pub fn warn_of_glasses(&self, band_um: &[f64], context: &Context) {
        warn_of_wavelengths(&self.lens, band_um, context);
    }
}

/// Curves by file, by built-in name, or one number.
fn efficiency(curves: &str, assets: &Assets) -> Result<QuantumEfficiency> {
    if let Some(value) = curves.strip_prefix(FLAT) {
        let flat = value.trim().parse().ok().and_then(QuantumEfficiency::flat);
        return flat.ok_or_else(|| {
            JobError::input(
                format!("--qe {curves}: no efficiency above 0 and up to 1"),
                "flat:0.6 is 0.6 electrons per photon at every wavelength",
            )
        });
    }
    let source = assets.text("quantum efficiency", "quantum-efficiency", curves)?;
    Ok(petzval_files::parse_quantum_efficiency(&source.text).map_err(DesignError::input(&source.path))?)
}

/// Checks that every colour of the filter array has a curve; the error names built-in curves that have them all.
fn has_curves(sensor: &SensorModel, assets: &Assets) -> Result<()> {
    let colours = sensor.cfa.colours();
    let lacks = |curves: &QuantumEfficiency| colours.iter().find(|c| curves.curve(**c).is_none()).copied();
    let error = match &sensor.quantum_efficiency {
        None => ElectronsError::NoCurves(sensor.name.clone()),
        Some(curves) => match lacks(curves) {
            None => return Ok(()),
            Some(colour) => ElectronsError::NoCurve(colour),
        },
    };
    let mut fitting = Vec::new();
    for name in assets.names("quantum-efficiency") {
        if lacks(&efficiency(name, assets)?).is_none() {
            fitting.push(name);
        }
    }
    let built_in = if fitting.is_empty() {
        let letters: String = colours.iter().copied().map(Colour::letter).collect();
        format!("no built-in curves are those of {letters} pixels")
    } else {
        format!("{} are built in", fitting.join(", "))
    };
    Err(JobError::input(
        error.to_string(),
        format!(
            "give the curves as [quantum_efficiency] in the sensor file, or with --qe ({built_in}; flat:0.6 takes 0.6 at all wavelengths)"
        ),
    ))
}

/// A light by name, or the only curve of a file; built-in names come first.
fn illuminant(name: &str) -> Result<Illuminant> {
    match Illuminant::named(name) {
        Err(IlluminantError::Unknown { .. }) if Path::new(name).is_file() => {
            Ok(Illuminant::from_spectrum(name, curve("--illuminant", name)?).map_err(DesignError::from)?)
        }
        Err(IlluminantError::Unknown { .. }) if Path::new(name).extension().is_some_and(|e| e == "csv") => {
            Err(JobError::input(
                format!("--illuminant {name}: there is no such file"),
                "a CSV file with a head line `wavelength_nm,power`, or the name of a light such as D65",
            ))
        }
        found => Ok(found.map_err(DesignError::from)?),
    }
}

fn transmission(text: &str) -> Result<Spectrum> {
    let hint = "a number above 0 and up to 1, or a CSV file with a head line `wavelength_nm,transmission`";
    let wrong = |what: String| JobError::input(format!("--transmission {text}: {what}"), hint);
    let curve = match text.parse::<f64>() {
        Ok(tau) => Spectrum::new(vec![0.01, 100.0], vec![tau, tau]).map_err(|e| wrong(e.to_string()))?,
        Err(_) => curve("--transmission", text)?,
    };
    if curve.value().iter().any(|tau| !(0.0..=1.0).contains(tau)) {
        return Err(wrong("a transmission outside 0..1".to_owned()));
    }
    if curve.support_um().is_none() {
        return Err(wrong("no light comes through".to_owned()));
    }
    Ok(curve)
}

/// The only curve of a CSV file.
fn curve(option: &str, path: &str) -> Result<Spectrum> {
    let (path, text) = read(path)?;
    let table = SpectrumTable::parse(&text).map_err(DesignError::input(&path))?;
    let names: Vec<&str> = table.curves.iter().map(|(name, _)| name.as_str()).collect();
    let several = format!("{}: {} curves ({})", path.display(), names.len(), names.join(", "));
    let mut curves = table.curves.into_iter();
    match (curves.next(), curves.next()) {
        (Some((_, curve)), None) => Ok(curve),
        _ => Err(JobError::input(
            several,
            format!("{option} takes a file of two columns: wavelengths and one curve"),
        )),
    }
}

/// A file that is named on the command line, as text.
fn read(path: &str) -> Result<(PathBuf, String)> {
    let path = PathBuf::from(path);
    let text = petzval_base::read_text(&path)
        .map_err(|e| JobError::input(format!("{}: {e}", path.display()), "give a CSV file that exists"))?;
    Ok((path, text))
}
