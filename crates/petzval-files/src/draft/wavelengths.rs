//! The wavelengths of a file, with their weights.

use super::record::Record;
use crate::loss::{Effect, Losses};
use crate::wavelength::{OPTICAL_UM, WavelengthUnit};
use petzval_base::FileError;

/// A wavelength of a file.
#[derive(Clone, Debug)]
pub(crate) struct Wave {
    /// The wavelength, um.
    pub um: f64,
    /// Its weight.
    pub weight: f64,
    /// The unit in which the file states it.
    pub unit: WavelengthUnit,
    /// Where the file states it.
    pub record: Record,
}

/// The wavelengths of a file, in its order.
#[derive(Clone, Debug)]
pub(crate) struct Wavelengths {
    pub list: Vec<Wave>,
    /// The record for messages about all of them.
    pub record: Record,
}

impl Wavelengths {
    /// The wavelengths of the lens, um, ascending, and the wavelength with the index `reference`, um. Wavelengths of weight 0 are left out, except
    /// as the reference; if all have it, all stay. Fails on the first one that is not optical.
    pub(super) fn of_lens(
        &self,
        reference: usize,
        losses: &mut Losses,
    ) -> Result<(Vec<f64>, f64), FileError> {
        let Self { list, record } = self;
        if let Some(Wave { um, unit, record, .. }) = list.iter().find(|wave| !OPTICAL_UM.contains(&wave.um)) {
            return Err(record.error(unit.message(*um)).hint(unit.hint(*um)));
        }
        let Some(reference_um) = list.get(reference).map(|wave| wave.um) else {
            let message = format!("there is no wavelength {}: the file has {}", reference + 1, list.len());
            return Err(record.error(message).hint("wavelengths are counted from 1"));
        };
        let mut judged: Vec<(f64, f64)> =
            list.iter().filter(|wave| wave.weight != 0.0).map(|wave| (wave.um, wave.weight)).collect();
        if judged.is_empty() {
            if list.len() > 1 {
                record.lose(losses, Effect::NoRay, "all wavelengths have the weight 0: all count the same");
            }
            judged = list.iter().map(|wave| (wave.um, wave.weight)).collect();
        } else if list.iter().enumerate().any(|(i, wave)| wave.weight == 0.0 && i != reference) {
            record.lose(losses, Effect::NoRay, "wavelengths of weight 0 are not kept");
        }
        let mut all: Vec<f64> = judged.iter().map(|(um, _)| *um).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        // A wavelength that the file lists twice has twice the weight there.
        let is_even = all.len() == judged.len() && judged.windows(2).all(|pair| pair[0].1 == pair[1].1);
        if all.len() > 1 && !is_even {
            record.lose(losses, Effect::NoRay, "weights of wavelengths are not kept: all count the same");
        }
        Ok((all, reference_um))
    }
}
