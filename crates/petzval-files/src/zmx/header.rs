//! Reads the header of a file: title, units, aperture, fields, wavelengths.

use super::record::{HEADER_BOOKKEEPING, Line};
use crate::draft::{AFOCAL_IMAGE_SPACE, Aperture, FieldKind, Fields, MOST_VALUES, Record, Wave, Wavelengths};
use crate::loss::{Effect, Losses};
use crate::wavelength::WavelengthUnit;
use petzval_base::FileError;

/// Temperature and pressure at which catalogues print indices: degrees Celsius and atmospheres.
const STANDARD_AIR: [f64; 2] = [20.0, 1.0];

/// The values of a header.
#[derive(Debug, Default)]
pub(super) struct Header {
    pub name: String,
    pub notes: Vec<String>,
    /// Millimetres in a lens unit; 0 if the file gives no unit.
    pub mm: f64,
    pub aperture: Option<(Aperture, Record)>,
    /// Glass catalogues of the file, in upper case.
    pub catalogs: Vec<String>,
    pub primary: Option<(usize, Record)>,
    field_kind: FieldKind,
    field_count: Option<usize>,
    wavelength_count: Option<usize>,
    x: Vec<f64>,
    x_at: Record,
    y: Vec<f64>,
    field_weights: Option<(Vec<f64>, Record)>,
    vignetting: Vec<(Vec<f64>, Record)>,
    fields_at: Record,
    telecentric: Option<Record>,
    /// `None` for a number that the file left out.
    waves: Vec<Option<Wave>>,
    /// Weights in a record of their own, which count before those beside the wavelengths.
    wave_weights: Vec<f64>,
    waves_at: Record,
    /// Records of [`ONCE`] that were read, and their lines.
    said: Vec<(&'static str, u32)>,
}

/// Records that a header has at most once, with the older names of some.
const ONCE: &[(&str, &str)] = &[
    ("UNIT", ""),
    ("FTYP", ""),
    ("XFLN", "XFLD"),
    ("YFLN", "YFLD"),
    ("FWGN", "FWGT"),
    ("PWAV", ""),
    ("WAVN", "WAVL"),
    ("WWGN", "WWGT"),
];

impl Header {
    /// Reads one line.
    pub fn read(&mut self, line: &Line<'_>, losses: &mut Losses) -> Result<(), FileError> {
        self.check_once(line)?;
        match line.keyword {
            "MODE" if line.word(0) != Some("SEQ") => {
                return Err(line.error("only sequential lenses are read").hint("the mode must be SEQ"));
            }
            "MODE" => {}
            "NAME" => self.name = line.rest().to_owned(),
            // The first value is a number that is not part of the text.
            "NOTE" => {
                let rest = line.rest();
                let text = rest.split_once(char::is_whitespace).map_or("", |(_, text)| text);
                if self.notes.len() < MOST_VALUES {
                    self.notes.push(text.trim().to_owned());
                }
            }
            "UNIT" => self.mm = millimetres(line)?,
            "ENPD" => self.set_aperture(Aperture::EntrancePupil(line.needed(0)?), line)?,
            "FNUM" => {
                let working = line.number(1)?.unwrap_or(0.0) != 0.0;
                let f = line.needed(0)?;
                let kind = if working { Aperture::WorkingFNumber(f) } else { Aperture::FNumber(f) };
                self.set_aperture(kind, line)?;
            }
            "OBNA" => {
                let is_angle = line.number(1)?.unwrap_or(0.0) != 0.0;
                let value = line.needed(0)?;
                let kind = if is_angle { Aperture::ObjectCone(value) } else { Aperture::ObjectNa(value) };
                self.set_aperture(kind, line)?;
            }
            "FLOA" => self.set_aperture(Aperture::StopSize, line)?,
            "GCAT" => {
                self.catalogs =
                    line.rest().split_whitespace().take(MOST_VALUES).map(str::to_uppercase).collect()
            }
            "ENVD" => {
                let given = [line.number(0)?, line.number(1)?];
                let adjusts = line.number(2)?.unwrap_or(0.0) != 0.0;
                if adjusts && given != STANDARD_AIR.map(Some) {
                    let message = "glass has its index at 20 degrees Celsius and 1 atmosphere";
                    line.lose(losses, Effect::Approximated, message);
                }
            }
            "FTYP" => self.read_field_type(line, losses)?,
            "XFLN" | "XFLD" => {
                self.x = line.numbers(MOST_VALUES)?;
                self.x_at = line.record();
            }
            "YFLN" | "YFLD" => {
                self.y = line.numbers(MOST_VALUES)?;
                self.fields_at = line.record();
            }
            "FWGN" | "FWGT" => self.field_weights = Some((line.numbers(MOST_VALUES)?, line.record())),
            "VDXN" | "VDYN" | "VCXN" | "VCYN" | "VANN" => {
                if self.vignetting.len() < MOST_VALUES {
                    self.vignetting.push((line.numbers(MOST_VALUES)?, line.record()));
                }
            }
            "WAVM" => self.set_wave(line.count(0)?, line.needed(1)?, line.number(2)?.unwrap_or(1.0), line)?,
            "WAVL" | "WAVN" => {
                for (i, um) in line.numbers(MOST_VALUES)?.into_iter().enumerate() {
                    self.set_wave(i + 1, um, 1.0, line)?;
                }
            }
            "WWGT" | "WWGN" => self.wave_weights = line.numbers(MOST_VALUES)?,
            "TELE" | "AFOC" if line.number(0)?.unwrap_or(0.0) == 0.0 => {}
            "TELE" => self.telecentric = Some(line.record()),
            "AFOC" => line.lose(losses, Effect::Approximated, AFOCAL_IMAGE_SPACE),
            "PWAV" => self.primary = Some((line.count(0)?, line.record())),
            known if HEADER_BOOKKEEPING.contains(&known) => {}
            _ => line.lose(losses, Effect::NotUnderstood, "this record is not understood"),
        }
        Ok(())
    }

    fn check_once(&mut self, line: &Line<'_>) -> Result<(), FileError> {
        let known = ONCE.iter().find(|(name, older)| [*name, *older].contains(&line.keyword));
        let Some((name, _)) = known else { return Ok(()) };
        match self.said.iter().find(|(said, _)| said == name) {
            Some((_, earlier)) => {
                Err(line.error(format!("line {earlier} already gives this")).hint("keep one of the two"))
            }
            None => {
                self.said.push((name, line.number));
                Ok(())
            }
        }
    }

    fn set_aperture(&mut self, aperture: Aperture, line: &Line<'_>) -> Result<(), FileError> {
        if let Some((_, earlier)) = &self.aperture {
            let message = format!("line {} already gives the aperture", earlier.line);
            return Err(line.error(message).hint("keep one of the two"));
        }
        self.aperture = Some((aperture, line.record()));
        Ok(())
    }

    fn set_wave(&mut self, number: usize, um: f64, weight: f64, line: &Line<'_>) -> Result<(), FileError> {
        if !(1..=MOST_VALUES).contains(&number) {
            return Err(line.error(format!("wavelengths are counted from 1 to {MOST_VALUES}")));
        }
        if self.waves.len() < number {
            self.waves.resize(number, None);
        }
        if number == 1 || self.waves_at.line == 0 {
            self.waves_at = line.record();
        }
        if line.keyword == "WAVM" && self.waves[number - 1].is_some() {
            let message = format!("wavelength {number} is already given");
            return Err(line.error(message).hint("keep one of the two"));
        }
        let (unit, record) = (WavelengthUnit::UM, line.record());
        self.waves[number - 1] = Some(Wave { um, weight, unit, record });
        Ok(())
    }

    /// Reads `FTYP type telecentric fields wavelengths ...`.
    fn read_field_type(&mut self, line: &Line<'_>, losses: &mut Losses) -> Result<(), FileError> {
        self.field_kind = match line.count(0)? {
            0 => FieldKind::Angle,
            1 => FieldKind::ObjectHeight,
            2 => FieldKind::ParaxialImageHeight,
            3 => FieldKind::RealImageHeight,
            other => {
                let message = format!("fields of type {other} are not read");
                return Err(line
                    .error(message)
                    .hint("angles (0), heights of object (1) or image (2, 3) are"));
            }
        };
        if line.number(1)?.unwrap_or(0.0) != 0.0 {
            self.telecentric = Some(line.record());
        }
        let count = |index: usize| line.word(index).map(|_| line.count(index)).transpose();
        self.field_count = count(2)?.filter(|n| *n > 0);
        self.wavelength_count = count(3)?.filter(|n| *n > 0);
        if self.field_count.is_some_and(|n| n > MOST_VALUES) {
            return Err(line.error(format!("a lens with more than {MOST_VALUES} fields is not read")));
        }
        if line.number(6)?.unwrap_or(0.0) != 0.0 {
            line.lose(losses, Effect::Approximated, AFOCAL_IMAGE_SPACE);
        }
        if self.fields_at.line == 0 {
            self.fields_at = line.record();
        }
        Ok(())
    }

    /// The fields, with heights in mm. Vignetting factors are reported as losses.
    pub fn fields(&self, mm: f64, losses: &mut Losses) -> Fields {
        let given = self.x.len().max(self.y.len());
        if given == 0 {
            losses.assume("the file gives no fields; the axis is the only one");
        }
        let count = self.field_count.unwrap_or(given).min(given).max(1);
        let scale = if self.field_kind == FieldKind::Angle { 1.0 } else { mm };
        let at = |list: &[f64], i: usize| list.get(i).map_or(0.0, |v| v * scale);
        for (factors, record) in &self.vignetting {
            if factors.iter().take(count).any(|f| *f != 0.0) {
                let message = "vignetting factors are not read: clear semi-diameters vignette the beam";
                record.lose(losses, Effect::Approximated, message);
            }
        }
        Fields {
            kind: self.field_kind,
            points: (0..count).map(|i| [at(&self.x, i), at(&self.y, i)]).collect(),
            record: self.fields_at.clone(),
            x_record: self.x_at.clone(),
            telecentric: self.telecentric.clone(),
            weights: self.field_weights.clone(),
        }
    }

    /// The wavelengths with the weights that count.
    fn weighted_waves(&self) -> Vec<Option<Wave>> {
        let weighted = |(i, wave): (usize, &Option<Wave>)| {
            let wave = wave.clone()?;
            Some(Wave { weight: self.wave_weights.get(i).copied().unwrap_or(wave.weight), ..wave })
        };
        self.waves.iter().enumerate().map(weighted).collect()
    }

    /// Number of wavelengths before a run of equal ones at the end, but at least up to the primary wavelength.
    fn without_filling(&self, waves: &[Option<Wave>]) -> usize {
        let all = waves.len();
        let numbers = |wave: &Option<Wave>| wave.as_ref().map(|wave| (wave.um, wave.weight));
        let last = waves.last().map(numbers);
        let equal = waves.iter().rev().take_while(|wave| Some(numbers(wave)) == last).count();
        let primary = self.primary.as_ref().map_or(1, |(number, _)| *number);
        if equal < 2 { all } else { (all - equal).max(primary.max(1)).min(all) }
    }

    /// The wavelengths with their weights. The program fills its table beyond the count with wavelengths without meaning; these
    /// are left out.
    pub fn wavelengths(&self, losses: &mut Losses) -> Result<Wavelengths, FileError> {
        let waves = self.weighted_waves();
        let all = waves.len();
        let count = match self.wavelength_count {
            Some(count) => count.min(all),
            None => self.without_filling(&waves),
        };
        if self.wavelength_count.is_none() && count < all {
            let message = format!(
                "the file does not count its wavelengths; equal ones at the end are taken for filling, and {count} are used"
            );
            self.waves_at.lose(losses, Effect::Assumed, message);
        }
        let listed: Option<Vec<Wave>> = waves.into_iter().take(count).collect();
        match listed.filter(|list| !list.is_empty()) {
            Some(list) => Ok(Wavelengths { list, record: self.waves_at.clone() }),
            None => {
                let message = "the file has no wavelengths, or leaves some out";
                Err(self.waves_at.error(message).hint("each is a line `WAVM number um weight`"))
            }
        }
    }
}

/// Millimetres in a lens unit.
fn millimetres(line: &Line<'_>) -> Result<f64, FileError> {
    match line.word(0).unwrap_or("") {
        "MM" => Ok(1.0),
        "CM" => Ok(10.0),
        "IN" | "INCH" => Ok(25.4),
        "M" | "METER" => Ok(1000.0),
        _ => Err(line.error("no such lens unit").hint("MM, CM, IN and METER are known")),
    }
}
