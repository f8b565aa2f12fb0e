//! The modulation transfer function: contrast of sinusoidal patterns in the image, over frequency, field and focus.
//!
//! The transfer functions of the colours, each of unit value at frequency zero, add up about the chief ray of the reference
//! wavelength; the modulation is the modulus of their mean. Geometric curves are the Fourier sum over ray positions, each
//! weighted by its light; diffraction curves are the autocorrelation of the wave (`wave/otf.rs`).

use petzval_fourier::Complex64;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::lens_at_field::{LensAtField, pupil};
use super::options::evenly;
use super::{AnalysisError, AnalysisOptions};
use crate::lens::Lens;
use crate::pupil::Beam;
use crate::trace::Sequence;
use crate::wave::{LineSpread, Overlap, PupilWave, Section, WaveChannel};

/// Modulation in two sections.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MtfCurve {
    /// Lines that point away from the axis (modulation along x), 0..1.
    pub sagittal: Vec<f64>,
    /// Lines across (modulation along y, in the plane of the fields), 0..1.
    pub tangential: Vec<f64>,
}

/// Modulation of a field over frequency.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FieldMtf {
    /// The field, degrees.
    pub field_deg: f64,
    /// Frequencies, cycles/mm on the image plane.
    pub frequency_per_mm: Vec<f64>,
    /// By rays.
    pub geometric: MtfCurve,
    /// By waves; `None` where rays of the stop are lost or the wavefront is too rough for its polynomials.
    pub diffraction: Option<MtfCurve>,
    /// By waves of the same beam without aberrations; `None` like [`FieldMtf::diffraction`].
    pub limit: Option<MtfCurve>,
}

/// Modulation over the field.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct MtfByField {
    /// Fields from the axis outwards, degrees.
    pub field_deg: Vec<f64>,
    /// Frequencies, cycles/mm.
    pub frequency_per_mm: Vec<f64>,
    /// `[frequency]`: over the fields, by rays.
    pub geometric: Vec<MtfCurve>,
    /// `[frequency]`: over the fields, by waves; `None` if some field has none.
    pub diffraction: Option<Vec<MtfCurve>>,
}

/// Modulation of a field over focus.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ThroughFocusMtf {
    /// The field, degrees.
    pub field_deg: f64,
    /// The frequency, cycles/mm.
    pub frequency_per_mm: f64,
    /// Shifts of the image plane along z, mm.
    pub defocus_mm: Vec<f64>,
    /// By rays.
    pub geometric: MtfCurve,
    /// By waves; `None` like [`FieldMtf::diffraction`].
    pub diffraction: Option<MtfCurve>,
}

const SECTIONS: [Section; 2] = [Section::Sagittal, Section::Tangential];

impl MtfByField {
    /// No curves.
    pub(super) fn none() -> Self {
        Self { field_deg: Vec::new(), frequency_per_mm: Vec::new(), geometric: Vec::new(), diffraction: None }
    }
}

impl MtfCurve {
    /// A curve of `modulation` in both sections, at some points.
    fn of<T: Copy>(points: &[T], modulation: impl Fn(Section, T) -> f64) -> Self {
        let [sagittal, tangential] =
            SECTIONS.map(|section| points.iter().map(|p| modulation(section, *p)).collect());
        Self { sagittal, tangential }
    }
}

/// Positions of the rays of a field on the image plane, by colour.
struct Landings {
    colours: Vec<Landing>,
}

/// The rays of one colour: about the reference chief ray, mm; slopes to the axis; shares of light, of unit sum.
struct Landing {
    at_mm: [Vec<f64>; 2],
    slope: [Vec<f64>; 2],
    share: Vec<f64>,
    /// Whether each ray includes its mirror image in x.
    is_half: bool,
}

impl Landings {
    fn new(field: &LensAtField, options: &AnalysisOptions) -> Result<Self, AnalysisError> {
        let beams = field.beams(&pupil(options.pupil_cells))?;
        let colours =
            beams.iter().zip(&field.colours).map(|(beam, colour)| Landing::new(beam, colour, field.chief_mm));
        Ok(Self { colours: colours.collect() })
    }

    /// Modulation of a section at a frequency, on an image plane shifted along z.
    fn modulation(&self, section: Section, frequency_per_mm: f64, defocus_mm: f64) -> f64 {
        let all = self.colours.iter().map(|c| c.transfer(section, frequency_per_mm, defocus_mm));
        all.sum::<Complex64>().norm() / self.colours.len() as f64
    }
}

impl Landing {
    fn new(beam: &Beam, colour: &Sequence, chief_mm: [f64; 2]) -> Self {
        let lit: Vec<usize> = (0..beam.weight.len()).filter(|i| beam.weight[*i] > 0.0).collect();
        let light = beam.light();
        let about = |of: &[f64], chief: f64| lit.iter().map(|i| of[*i] - chief).collect();
        let slope = |axis: usize| {
            lit.iter().map(|i| beam.direction(*i)).map(|direction| direction[axis] / direction[2]).collect()
        };
        Self {
            at_mm: [about(&beam.x_mm, chief_mm[0]), about(&beam.y_mm, chief_mm[1])],
            slope: [slope(0), slope(1)],
            share: lit.iter().map(|i| beam.weight[*i] / light).collect(),
            is_half: colour.is_mirror_symmetric,
        }
    }

    fn transfer(&self, section: Section, frequency_per_mm: f64, defocus_mm: f64) -> Complex64 {
        let turn = -std::f64::consts::TAU * frequency_per_mm;
        let axis = if section == Section::Sagittal { 0 } else { 1 };
        let places = self.at_mm[axis].iter().zip(&self.slope[axis]).zip(&self.share);
        let phases = places.map(|((at, slope), share)| (turn * (at + defocus_mm * slope), *share));
        match (axis, self.is_half) {
            (0, true) => Complex64::new(phases.map(|(p, share)| share * p.cos()).sum(), 0.0),
            _ => phases.map(|(p, share)| Complex64::cis(p) * share).sum(),
        }
    }
}

/// Waves of a field by colour; `None` where one of them has no polynomial description.
fn waves(field: &LensAtField) -> Option<Vec<WaveChannel>> {
    let mut channels: Vec<WaveChannel> = Vec::new();
    for colour in &field.colours {
        channels.push(field.wave(colour, channels.last())?);
    }
    Some(channels)
}

/// Line-spread functions of the colours in both sections.
struct Spreads([Vec<LineSpread>; 2]);

impl Spreads {
    fn new(waves: &[PupilWave]) -> Self {
        Self(SECTIONS.map(|section| waves.iter().map(|wave| wave.line_spread(section)).collect()))
    }

    fn modulation(&self, section: Section, frequency_per_mm: f64) -> f64 {
        let spreads = &self.0[if section == Section::Sagittal { 0 } else { 1 }];
        let sum: Complex64 = spreads.iter().map(|s| s.transfer(frequency_per_mm)).sum();
        sum.norm() / spreads.len() as f64
    }
}

/// Modulation of a field over frequency.
pub fn field_mtf(lens: &Lens, field_deg: f64, options: &AnalysisOptions) -> Result<FieldMtf, AnalysisError> {
    let frequencies = evenly(0.0, options.highest_frequency(lens), options.frequency_points.max(2));
    mtf_at(lens, field_deg, &frequencies, options)
}

/// Modulation of a field at frequencies in cycles/mm.
pub fn mtf_at(
    lens: &Lens,
    field_deg: f64,
    frequency_per_mm: &[f64],
    options: &AnalysisOptions,
) -> Result<FieldMtf, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let landings = Landings::new(&field, options)?;
    let channels = waves(&field);
    let waves: Option<Vec<PupilWave>> = channels.as_ref().map(|c| c.iter().map(WaveChannel::wave).collect());
    let by_waves = |waves: Option<Vec<PupilWave>>| {
        let spreads = Spreads::new(&waves?);
        Some(MtfCurve::of(frequency_per_mm, |section, f| spreads.modulation(section, f)))
    };
    let ideal = waves.as_ref().map(|waves| waves.iter().map(PupilWave::ideal).collect());
    Ok(FieldMtf {
        field_deg,
        geometric: MtfCurve::of(frequency_per_mm, |section, f| landings.modulation(section, f, 0.0)),
        diffraction: by_waves(waves),
        limit: by_waves(ideal),
        frequency_per_mm: frequency_per_mm.to_vec(),
    })
}

/// Modulation over the field at some frequencies.
pub fn mtf_by_field(lens: &Lens, options: &AnalysisOptions) -> Result<MtfByField, AnalysisError> {
    let field_deg = options.fields_deg(lens);
    let frequency_per_mm = options.frequencies_by_field(lens);
    // `[field]`: curves over the frequencies, by rays and by waves.
    let of_field = |deg: &f64| -> Result<(MtfCurve, Option<MtfCurve>), AnalysisError> {
        let field = LensAtField::new(lens, *deg)?;
        let landings = Landings::new(&field, options)?;
        let geometric = MtfCurve::of(&frequency_per_mm, |section, f| landings.modulation(section, f, 0.0));
        let diffraction = waves(&field).map(|channels| {
            let waves: Vec<PupilWave> = channels.iter().map(WaveChannel::wave).collect();
            let spreads = Spreads::new(&waves);
            MtfCurve::of(&frequency_per_mm, |section, f| spreads.modulation(section, f))
        });
        Ok((geometric, diffraction))
    };
    let (geometric, diffraction): (Vec<MtfCurve>, Vec<Option<MtfCurve>>) =
        field_deg.par_iter().map(of_field).collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let diffraction: Option<Vec<MtfCurve>> = diffraction.into_iter().collect();
    let over_fields = |by_field: &[MtfCurve]| -> Vec<MtfCurve> {
        (0..frequency_per_mm.len())
            .map(|k| MtfCurve {
                sagittal: by_field.iter().map(|curve| curve.sagittal[k]).collect(),
                tangential: by_field.iter().map(|curve| curve.tangential[k]).collect(),
            })
            .collect()
    };
    let diffraction = diffraction.as_deref().map(over_fields);
    Ok(MtfByField { geometric: over_fields(&geometric), diffraction, field_deg, frequency_per_mm })
}

/// Modulation of a field over focus at one frequency.
pub fn through_focus_mtf(
    lens: &Lens,
    field_deg: f64,
    options: &AnalysisOptions,
) -> Result<ThroughFocusMtf, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let frequency_per_mm = options.frequency_through_focus(lens);
    let defocus_mm = options.defocus_mm(lens);
    let landings = Landings::new(&field, options)?;
    // On a shifted plane rays move apart by the differences of their slopes.
    let range = defocus_mm.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let cone = |axis: usize| {
        let slopes = landings.colours.iter().flat_map(|c| &c.slope[axis]);
        let (low, high) = slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| (a.min(*s), b.max(*s)));
        high - low
    };
    let further_mm = range * cone(0).max(cone(1));
    let diffraction = overlaps(&field, frequency_per_mm, further_mm).map(|colours| {
        let colours: Vec<Vec<[Complex64; 2]>> = colours.iter().map(|c| c.over_focus(&defocus_mm)).collect();
        let modulation = |axis: usize| {
            let mean =
                |i: usize| colours.iter().map(|c| c[i][axis]).sum::<Complex64>() / colours.len() as f64;
            (0..defocus_mm.len()).map(|i| mean(i).norm()).collect()
        };
        MtfCurve { sagittal: modulation(0), tangential: modulation(1) }
    });
    Ok(ThroughFocusMtf {
        field_deg,
        frequency_per_mm,
        geometric: MtfCurve::of(&defocus_mm, |section, dz| {
            landings.modulation(section, frequency_per_mm, dz)
        }),
        diffraction,
        defocus_mm,
    })
}

/// Overlaps of the waves of a field at a frequency, by colour, of light that a shift of the image plane spreads by `further_mm`; `None` where one of
/// them has none.
fn overlaps(field: &LensAtField, frequency_per_mm: f64, further_mm: f64) -> Option<Vec<Overlap>> {
    let mut colours: Vec<Overlap> = Vec::new();
    for colour in &field.colours {
        let (stop_mm, range) = (field.stop_radius_mm, (frequency_per_mm, further_mm));
        colours.push(Overlap::new(colour, field.field_rad, stop_mm, field.chief_mm, range, colours.last())?);
    }
    Some(colours)
}
