//! Reads the commands of the whole lens: title, units, aperture, fields, wavelengths.

use super::command::Command;
use crate::draft::{AFOCAL_IMAGE_SPACE, Aperture, FieldKind, Fields, MOST_VALUES, Record, Wave, Wavelengths};
use crate::loss::{Effect, Losses};
use crate::wavelength::WavelengthUnit;
use petzval_base::FileError;

/// Default wavelength, um.
const DEFAULT_UM: f64 = 0.5876;

/// The values of the commands of the whole lens.
#[derive(Debug, Default)]
pub(super) struct System {
    pub title: String,
    /// Millimetres in a lens unit; 0 if the file gives no unit.
    pub mm: f64,
    pub aperture: Option<(Aperture, Record)>,
    wavelengths: Option<(Vec<f64>, Record)>,
    weights: Option<Vec<f64>>,
    reference: Option<(usize, Record)>,
    field_kind: Option<(FieldKind, Record)>,
    x: Vec<f64>,
    x_at: Record,
    y: Vec<f64>,
    field_weights: Option<(Vec<f64>, Record)>,
    telecentric: Option<Record>,
}

impl System {
    /// Reads a command; `false` if it is not one of these.
    pub fn read(&mut self, command: &Command, losses: &mut Losses) -> Result<bool, FileError> {
        let mut lose = |effect, message: &str| command.record.lose(losses, effect, message);
        match command.name.as_str() {
            "TIT" => self.title = command.word(0).unwrap_or("").trim().to_owned(),
            "DIM" => {
                self.mm = match command.word(0).unwrap_or("").to_uppercase().as_str() {
                    "M" | "MM" => 1.0,
                    "C" | "CM" => 10.0,
                    "I" | "IN" => 25.4,
                    _ => {
                        return Err(command
                            .error("no such unit")
                            .hint("M (mm), C (cm) and I (inches) are known"));
                    }
                }
            }
            "EPD" => self.set_aperture(Aperture::EntrancePupil(command.only_number()?), command)?,
            "FNO" => self.set_aperture(Aperture::ImageFNumber(command.only_number()?), command)?,
            "NA" => self.set_aperture(Aperture::ImageNa(command.only_number()?), command)?,
            "NAO" => self.set_aperture(Aperture::ObjectNa(command.only_number()?), command)?,
            "WL" => {
                // Convert from nm by moving the decimal point.
                let earlier = self.wavelengths.as_ref().map_or(&[] as &[f64], |(um, _)| um.as_slice());
                let um = command.list(earlier, f64::NAN, -3)?;
                if um.iter().any(|um| um.is_nan()) {
                    return Err(command.error("the wavelengths before it are missing"));
                }
                self.wavelengths = Some((um, command.record.clone()));
            }
            "WTW" => {
                self.weights = Some(command.list(self.weights.as_deref().unwrap_or(&[]), 1.0, 0)?);
            }
            "REF" => {
                let value = command.only_number()?;
                if !(1.0..=MOST_VALUES as f64).contains(&value) || value.fract() != 0.0 {
                    return Err(command.error("the reference is the number of a wavelength, from 1"));
                }
                self.reference = Some((value as usize - 1, command.record.clone()));
            }
            "XAN" | "YAN" => self.read_fields(FieldKind::Angle, command)?,
            "XOB" | "YOB" => self.read_fields(FieldKind::ObjectHeight, command)?,
            "XIM" | "YIM" => self.read_fields(FieldKind::ParaxialImageHeight, command)?,
            "XRI" | "YRI" => self.read_fields(FieldKind::RealImageHeight, command)?,
            "WTF" => {
                let earlier =
                    self.field_weights.as_ref().map_or(&[] as &[f64], |(weights, _)| weights.as_slice());
                self.field_weights = Some((command.list(earlier, 1.0, 0)?, command.record.clone()));
            }
            "VUX" | "VLX" | "VUY" | "VLY" => {
                if command.list(&[], 0.0, 0)?.iter().any(|v| *v != 0.0) {
                    let message = "vignetting factors are not read: clear semi-diameters vignette the beam";
                    lose(Effect::Approximated, message);
                }
            }
            "TEM" if command.only_number()? != 20.0 => {
                lose(Effect::Approximated, "glass has its index at 20 degrees Celsius");
            }
            "PRE" if command.only_number()? != 760.0 => {
                lose(Effect::Approximated, "glass has its index at 760 mm of mercury");
            }
            "TEM" | "PRE" => {}
            "TEL" | "AFO" if !command.says_yes()? => {}
            "TEL" => self.telecentric = Some(command.record.clone()),
            "AFI" if command.says_yes().is_ok_and(|yes| !yes) => {}
            "AFI" => lose(Effect::Approximated, AFOCAL_IMAGE_SPACE),
            "AFO" => lose(Effect::Approximated, "afocal: the image plane stays where the file places it"),
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn set_aperture(&mut self, aperture: Aperture, command: &Command) -> Result<(), FileError> {
        let is_zoomed = |earlier: &Aperture| {
            command.zoomed && std::mem::discriminant(earlier) == std::mem::discriminant(&aperture)
        };
        if let Some((kind, earlier)) = &self.aperture
            && !is_zoomed(kind)
        {
            let message = format!("line {} already gives the aperture", earlier.line);
            return Err(command.error(message).hint("keep one of the two"));
        }
        self.aperture = Some((aperture, command.record.clone()));
        Ok(())
    }

    fn read_fields(&mut self, kind: FieldKind, command: &Command) -> Result<(), FileError> {
        if let Some((earlier, record)) = &self.field_kind
            && *earlier != kind
        {
            let message = format!("line {} already gives fields of another kind", record.line);
            return Err(command.error(message).hint("keep one of the two"));
        }
        let is_x = command.name.starts_with('X');
        let values = command.list(if is_x { &self.x } else { &self.y }, 0.0, 0)?;
        if is_x {
            (self.x, self.x_at) = (values, command.record.clone());
        } else {
            self.y = values;
        }
        if self.field_kind.is_none() || command.name.starts_with('Y') {
            self.field_kind = Some((kind, command.record.clone()));
        }
        Ok(())
    }

    /// The fields, with heights in mm; only the axis if the file gives none.
    pub fn fields(&self, mm: f64, losses: &mut Losses) -> Fields {
        let telecentric = self.telecentric.clone();
        let Some((kind, record)) = self.field_kind.clone() else {
            losses.assume("the file gives no fields; the axis is the only one");
            return Fields { points: vec![[0.0; 2]], telecentric, ..Fields::default() };
        };
        let scale = if kind == FieldKind::Angle { 1.0 } else { mm };
        let at = |list: &[f64], i: usize| list.get(i).map_or(0.0, |v| v * scale);
        let count = self.x.len().max(self.y.len()).max(1);
        let points = (0..count).map(|i| [at(&self.x, i), at(&self.y, i)]).collect();
        let (x_record, weights) = (self.x_at.clone(), self.field_weights.clone());
        Fields { kind, points, record, x_record, telecentric, weights }
    }

    /// Wavelengths with their weights, and the index of the reference.
    pub fn wavelengths(&self, losses: &mut Losses) -> Result<(Wavelengths, usize), FileError> {
        let (um, record) = match &self.wavelengths {
            Some((um, record)) if !um.is_empty() => (um.clone(), record.clone()),
            _ => {
                losses.assume("the file gives no wavelength; 587.6 nm is taken");
                (vec![DEFAULT_UM], Record::default())
            }
        };
        let weight = |i: usize| self.weights.as_ref().and_then(|w| w.get(i)).copied().unwrap_or(1.0);
        let reference = match &self.reference {
            Some((index, record)) if *index >= um.len() => {
                return Err(record.error(format!("there is no wavelength {}", index + 1)));
            }
            Some((index, _)) => *index,
            None => {
                let middle = um.len() / 2;
                if um.len() > 1 {
                    let message = format!(
                        "the file gives no reference wavelength; the middle one, {}, is taken",
                        middle + 1
                    );
                    losses.assume(message);
                }
                middle
            }
        };
        let wave = |(i, um): (usize, f64)| Wave {
            um,
            weight: weight(i),
            unit: WavelengthUnit::NM,
            record: record.clone(),
        };
        let list = um.into_iter().enumerate().map(wave).collect();
        Ok((Wavelengths { list, record }, reference))
    }
}
