//! The one check of the numbers of requests against their ranges.

use petzval_base::parameter::{OutOfRange, Parameters};
use petzval_files::wavelength_hint;

use crate::error::{JobError, Result};

/// Refuses a request whose number lies outside its range: the error names key, value, range and hint. A value that is no number lies outside
/// every range.
pub(crate) fn check_ranges(request: &impl Parameters) -> Result<()> {
    let Some(wrong) = request.out_of_range() else { return Ok(()) };
    let OutOfRange { parameter, value } = wrong;
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
    let message = format!("must lie between {} and {}{unit}", short(parameter.min), short(parameter.max));
    // A wavelength in nm or mm is the usual slip: its hint names the number that was meant.
    let hint = match parameter.name {
        "wavelength" | "wavelengths" => wavelength_hint(value),
        _ => parameter.hint.to_owned(),
    };
    Err(JobError::setting(parameter.name, number_text(value), message, hint))
}

/// An end of a range, without a row of zeros.
pub(crate) fn short(end: f64) -> String {
    let is_plain = end == 0.0 || (1e-3..1e7).contains(&end.abs());
    if is_plain { end.to_string() } else { format!("{end:e}") }
}

/// A number that a request holds, as a person would write it: without hundreds of zeros.
pub(crate) fn number_text(value: f64) -> String {
    let is_plain = value == 0.0 || !value.is_finite() || (1e-5..1e15).contains(&value.abs());
    if is_plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::trace;
    use crate::psf;

    #[test]
    fn key_value_range_and_hint_are_named() {
        let wrong = |request: psf::Request| match check_ranges(&request).unwrap_err() {
            JobError::Setting { key, value, message, hint } => (key, value, message, hint),
            other => panic!("{other:?}"),
        };
        let (key, value, message, hint) = wrong(psf::Request { grid: 8, ..Default::default() });
        assert_eq!((key, value.as_str()), ("grid", "8"));
        assert_eq!(message, "must lie between 16 and 1024");
        assert_eq!(hint, "16 to 1024 cells");
        let (_, value, message, _) = wrong(psf::Request { pitch_um: f64::NAN, ..Default::default() });
        assert_eq!((value.as_str(), message.as_str()), ("NaN", "must lie between 1e-6 and 1000 um"));
        for (pitch_um, text) in [(1e-300, "1e-300"), (-2.5e300, "-2.5e300"), (1e7, "10000000")] {
            assert_eq!(wrong(psf::Request { pitch_um, ..Default::default() }).1, text);
        }
        let nm = psf::Request { wavelengths: vec![0.62, 550.0, 0.486], ..Default::default() };
        assert!(wrong(nm).3.contains("did you mean 0.55?"));
        assert!(check_ranges(&trace::Request::default()).is_ok());
    }
}
