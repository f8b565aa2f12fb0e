//! The plan of a series of captures: gains, exposure times, stacks and light.

use serde::{Deserialize, Serialize};

use super::captures::{CaptureError, Kind};
use super::derived::derived;
use petzval_camera::image::CHANNELS;
use petzval_camera::sensor::{Colour, SensorModel};

/// Least number of exposures from dark to saturation in the series of EMVA 1288 release 4.0 Linear.
const EMVA_EXPOSURES: f64 = 50.0;
/// Step from one of them to the next, ms.
const EMVA_STEP_MS: f64 = 0.5;
/// Light of the longest exposure relative to that of saturation: a saturated signal must be seen not to grow.
const EMVA_BEYOND: f64 = 1.2;
/// Least response of a colour, relative to the brightest, with which the series saturates it too.
const WEAKEST_COLOUR: f64 = 0.5;
/// Frames of a stack: they leave a tenth of the temporal noise in the mean frame.
const EMVA_STACK: usize = 100;
/// Longest exposure times of a series for the dark current, ms, and the number of its equal steps (the standard
/// requires six or more).
const DARK_LONGEST_MS: [f64; 7] = [100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0];
const DARK_STEPS: usize = 10;

/// A sensor under the light of a plan.
#[derive(Debug, Clone)]
pub(super) struct Lit {
    /// The sensor, its colours with their relative response to this light.
    pub sensor: SensorModel,
    /// Photons for each electron of a pixel of response 1, where they are known.
    pub photons_per_e: Option<f64>,
}

/// The settings of a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Linear gains.
    pub gains: Vec<f64>,
    /// Exposure times of pairs of flat and of dark frames, ms.
    pub flat_ms: Vec<f64>,
    /// Exposure times of pairs of dark frames alone, ms.
    pub dark_ms: Vec<f64>,
    /// Frames of a flat and of a dark stack at every gain, at the flat exposure that brings the brightest colour nearest to
    /// half of the range; 0 for none.
    pub stack: usize,
    /// Signal of the brightest colour at the longest flat exposure as a share of the range above black: the light is
    /// weakened with the gain, so that this holds at every gain. Above 1 the series saturates.
    pub level: f64,
    /// Electrons that a photon gives in a green or clear pixel, by which the list states photons. Without it they follow from
    /// the sensor's curves at `wavelength_um`; with neither the list states none.
    pub quantum_efficiency: Option<f64>,
    /// Wavelength of the light, um; white if it is left out. Unless `quantum_efficiency` is given, the colours answer in
    /// proportion to their curves there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelength_um: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Ending of the frames' names: `tiff` or `png`.
    pub format: String,
}

impl Default for Plan {
    /// The series of Tseng et al. 2021, supplement section 2.3, at the full size of their sensor.
    fn default() -> Self {
        Self {
            height: 1200,
            width: 1920,
            gains: vec![1.0, 1.77, 3.16, 5.62, 10.0, 17.78, 31.62],
            flat_ms: vec![2.5, 5.0, 7.5, 10.0],
            dark_ms: (1..=12).map(|i| 2.5 * f64::from(i)).collect(),
            stack: 0,
            level: 0.6,
            quantum_efficiency: None,
            wavelength_um: None,
            seed: 1,
            format: "tiff".to_owned(),
        }
    }
}

/// One setting of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPoint {
    /// Light or none.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Electrons of a pixel of response 1: green or clear in white light, the brightest in light of a wavelength; 0 in the dark.
    pub white_e: f64,
    /// Number of its first frame in the series.
    pub first_frame: u64,
    /// Names of its frames.
    pub names: Vec<String>,
}

impl Plan {
    /// The series that EMVA 1288 release 4.0 Linear prescribes, of the whole sensor at the gain nearest to 1. The light is of
    /// `wavelength_um`. If neither that nor `quantum_efficiency` is given, it is of the wavelength at which the sensor's curve is highest
    /// (of green, if there is green). The series has:
    ///
    /// - pairs of flat and dark frames at equal steps of exposure time, 50 of them up to the saturation of the brightest
    ///   colour and more until every colour that answers at least half as much is saturated;
    /// - dark pairs at ten equal steps more, up to the time in which the dark current adds as much variance as the dark has
    ///   (`mu_I t = sigma_d^2`; 0.1 to 10 s), so that its mean and its noise both show;
    /// - a flat stack at half of saturation and a dark one.
    pub fn emva(sensor: &SensorModel, quantum_efficiency: Option<f64>, wavelength_um: Option<f64>) -> Self {
        let brightest = || {
            let curves = sensor.quantum_efficiency.as_ref()?;
            let colours = sensor.cfa.colours();
            let green = colours.iter().copied().filter(|c| *c == Colour::Green).find_map(|c| curves.peak(c));
            let any = || colours.iter().filter_map(|c| curves.peak(*c)).max_by(|a, b| a.1.total_cmp(&b.1));
            Some(green.or_else(any)?.0)
        };
        let gain = sensor.nearest_gain(1.0);
        let plan = Self {
            height: sensor.height,
            width: sensor.width,
            gains: vec![gain],
            stack: EMVA_STACK,
            wavelength_um: wavelength_um.or_else(|| brightest().filter(|_| quantum_efficiency.is_none())),
            quantum_efficiency,
            ..Self::default()
        };
        let responses = responses(&plan.lit(sensor).map_or_else(|_| sensor.clone(), |lit| lit.sensor));
        let most = responses.iter().copied().fold(1e-9, f64::max);
        let is_strong = |response: &f64| *response >= WEAKEST_COLOUR * most;
        let least = responses.into_iter().filter(is_strong).fold(most, f64::min);
        let level = EMVA_BEYOND * most / least;
        let flats = (EMVA_EXPOSURES * level - 1e-9).ceil() as usize;
        let dark_s = derived(sensor, gain).dark_noise_e.powi(2) / sensor.dark_current_e_per_s;
        let [shortest, ..] = DARK_LONGEST_MS;
        let longest = DARK_LONGEST_MS.into_iter().rfind(|ms| *ms <= 1e3 * dark_s).unwrap_or(shortest);
        let step_ms = longest / DARK_STEPS as f64;
        Self {
            flat_ms: (1..=flats).map(|i| EMVA_STEP_MS * i as f64).collect(),
            dark_ms: (1..=DARK_STEPS).map(|i| step_ms * i as f64).collect(),
            level,
            ..plan
        }
    }

    /// Bytes of the frames of all points as TIFF, without headers.
    pub fn bytes(&self, points: &[PlannedPoint]) -> u64 {
        let frames: usize = points.iter().map(|p| p.names.len()).sum();
        (frames * self.height * self.width * size_of::<u16>()) as u64
    }

    /// Checks the plan against the sensor.
    pub fn validate(&self, sensor: &SensorModel) -> Result<(), CaptureError> {
        let wrong = |what, problem: String| Err(CaptureError::Plan { what, problem });
        if !(2..=sensor.height).contains(&self.height) || !(2..=sensor.width).contains(&self.width) {
            let (h, w) = (sensor.height, sensor.width);
            return wrong("size", format!("{}x{} does not fit on {h}x{w} pixels", self.height, self.width));
        }
        let all = |values: &[f64], low: f64, high: f64| values.iter().all(|v| (low..=high).contains(v));
        if self.gains.is_empty() || !all(&self.gains, 1e-3, 1e4) {
            return wrong("gains", format!("{:?}; give numbers from 0.001 to 10000", self.gains));
        }
        if let Some(no) = self.gains.iter().find(|g| !sensor.gain_steps.is_empty() && !offers(sensor, **g)) {
            return wrong("gains", format!("{no} is none of the sensor's gains {:?}", sensor.gain_steps));
        }
        if self.flat_ms.is_empty() && self.dark_ms.is_empty() {
            return wrong("exposures", "there are none".to_owned());
        }
        if !all(&self.flat_ms, 1e-6, 1e6) || !all(&self.dark_ms, 0.0, 1e6) {
            return wrong("exposures", "exposure times are positive milliseconds, at most 1e6".to_owned());
        }
        for (what, values) in
            [("gains", &self.gains), ("exposures", &self.flat_ms), ("exposures", &self.dark_ms)]
        {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
                return wrong(what, format!("{} is there twice", twice[0]));
            }
        }
        if (1..3).contains(&self.stack) || self.stack > 4096 {
            return wrong("stack", format!("{} frames; a stack has 3 to 4096", self.stack));
        }
        if !(1e-4..=10.0).contains(&self.level) {
            return wrong("level", format!("{} is outside 0.0001..10", self.level));
        }
        if self.quantum_efficiency.is_some_and(|q| !(1e-4..=1.0).contains(&q)) {
            return wrong("quantum efficiency", "it is a share, above 0 and at most 1".to_owned());
        }
        if let Some(um) = self.wavelength_um.filter(|um| !(0.01..=100.0).contains(um)) {
            return wrong("wavelength", format!("{um} um is outside 0.01..100"));
        }
        self.lit(sensor)?;
        if !["tiff", "png"].contains(&self.format.as_str()) {
            return wrong("format", format!("`{}`; tiff or png", self.format));
        }
        Ok(())
    }

    /// The points in the order of their frames. `sensor` is the sensor under the light of the plan.
    pub(super) fn points_lit(&self, sensor: &SensorModel) -> Vec<PlannedPoint> {
        let longest = self.flat_ms.iter().fold(0.0_f64, |a, b| a.max(*b));
        // Distance of a stack's exposure from half of the range; of two equal ones the first is taken.
        let off_half = |ms: &f64| (1e9 * (self.level * ms / longest - 0.5).abs()).round();
        let half = self.flat_ms.iter().min_by(|a, b| off_half(a).total_cmp(&off_half(b)));
        let mut points = Vec::new();
        let mut frames = 0;
        for gain in &self.gains {
            let white_e = |ms: f64| self.level * self.full_range_e(sensor, *gain) * ms / longest;
            let mut add = |kind, ms: f64, count: usize| {
                let (name, white_e) = match kind {
                    Kind::Flat => ("flat", white_e(ms)),
                    Kind::Dark => ("dark", 0.0),
                };
                let stack = if count > 2 { "-stack" } else { "" };
                let names =
                    (0..count).map(|i| format!("gain-{gain}/{name}-{ms}ms{stack}-{i}.{}", self.format));
                let names = names.collect();
                let (linear_gain, first_frame) = (*gain, frames);
                points.push(PlannedPoint { kind, linear_gain, exposure_ms: ms, white_e, first_frame, names });
                frames += count as u64;
            };
            self.flat_ms.iter().for_each(|ms| add(Kind::Flat, *ms, 2));
            let mut dark: Vec<f64> = self.flat_ms.iter().chain(&self.dark_ms).copied().collect();
            dark.sort_by(f64::total_cmp);
            dark.dedup();
            dark.iter().for_each(|ms| add(Kind::Dark, *ms, 2));
            if let (true, Some(half)) = (self.stack > 0, half) {
                add(Kind::Flat, *half, self.stack);
                add(Kind::Dark, *half, self.stack);
            }
        }
        points
    }

    /// The points in the order of their frames.
    pub fn points(&self, sensor: &SensorModel) -> Result<Vec<PlannedPoint>, CaptureError> {
        Ok(self.points_lit(&self.lit(sensor)?.sensor))
    }

    /// The sensor under the light of the plan. White light does not change it. Under light of one wavelength the colour
    /// with the highest efficiency `Q` has response 1, and every other its share of that: `N` photons give `Q_c N`
    /// electrons.
    pub(super) fn lit(&self, sensor: &SensorModel) -> Result<Lit, CaptureError> {
        let wrong = |problem: String| CaptureError::Plan { what: "wavelength", problem };
        let (Some(um), None) = (self.wavelength_um, self.quantum_efficiency) else {
            let photons_per_e = self.quantum_efficiency.map(|q| 1.0 / q);
            return Ok(Lit { sensor: sensor.clone(), photons_per_e });
        };
        let colours = sensor.cfa.colours();
        let curve = |c: &Colour| Some((*c, sensor.quantum_efficiency.as_ref()?.curve(*c)?.at(um)));
        let efficiencies: Vec<(Colour, f64)> =
            colours.iter().map(curve).collect::<Option<_>>().ok_or_else(|| {
                wrong(
                    "the sensor has no quantum efficiency of every colour; give one number for it".to_owned(),
                )
            })?;
        let most = efficiencies.iter().fold(0.0_f64, |most, (_, q)| most.max(*q));
        if most <= 0.0 {
            return Err(wrong(format!("no pixel of the sensor answers light of {um} um")));
        }
        let mut lit = sensor.clone();
        for (colour, efficiency) in efficiencies {
            match colour.plane() {
                Some(plane) => lit.relative_qe[plane] = efficiency / most,
                None => lit.clear_response = [efficiency / most / CHANNELS as f64; CHANNELS],
            }
        }
        lit.validate().map_err(|range| wrong(format!("{um} um is hardly seen by every colour: {range}")))?;
        Ok(Lit { sensor: lit, photons_per_e: Some(1.0 / most) })
    }

    /// Electrons of a pixel of response 1 with which the brightest colour reaches the end of the range: of the converter, or the
    /// full well if that comes first.
    fn full_range_e(&self, sensor: &SensorModel, linear_gain: f64) -> f64 {
        let brightest = responses(sensor).into_iter().fold(1e-9, f64::max);
        let converter = (sensor.max_dn() - sensor.black_level_dn) / (sensor.gain_dn_per_e * linear_gain);
        converter.min(sensor.full_well_e) / brightest
    }
}

/// Electrons of each colour of a flat field where a green pixel has 1.
fn responses(sensor: &SensorModel) -> Vec<f64> {
    sensor.cfa.colours().into_iter().map(|c| sensor.response(c).iter().sum()).collect()
}

fn offers(sensor: &SensorModel, gain: f64) -> bool {
    sensor.gain_steps.iter().any(|step| (step - gain).abs() <= 1e-6 * step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_camera::sensor::QuantumEfficiency;

    fn imx249() -> SensorModel {
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap()
    }

    fn mono() -> SensorModel {
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx273-mono.toml"))
            .unwrap()
    }

    /// Signal of the points of a kind and number of frames as shares of the range, for the weakest and the brightest colour.
    fn shares(plan: &Plan, sensor: &SensorModel) -> Vec<(f64, [f64; 2])> {
        let lit = plan.lit(sensor).unwrap().sensor;
        let all = responses(&lit);
        let ends = [all.iter().copied().fold(f64::MAX, f64::min), all.iter().copied().fold(0.0, f64::max)];
        let range = derived(&lit, plan.gains[0]).saturation_e;
        let points = plan.points(sensor).unwrap();
        let flat = points.into_iter().filter(|p| p.kind == Kind::Flat && p.names.len() == 2);
        flat.map(|p| (p.exposure_ms, ends.map(|e| e * p.white_e / range))).collect()
    }

    #[test]
    fn the_series_of_the_standard_goes_beyond_saturation_in_fifty_steps_and_more() {
        for sensor in [imx249(), mono()] {
            let plan = Plan::emva(&sensor, Some(0.6), None);
            plan.validate(&sensor).unwrap();
            let shares = shares(&plan, &sensor);
            let steps: Vec<f64> = shares.windows(2).map(|w| w[1].0 - w[0].0).collect();
            assert!(steps.iter().all(|s| (s - shares[0].0).abs() < 1e-9), "equal steps from dark");
            assert!(shares.iter().filter(|(_, [_, most])| *most < 1.005).count() >= 50);
            let (_, [least, _]) = shares[shares.len() - 1];
            assert!((1.1..1.3).contains(&least), "the weakest colour ends at {least} of its range");
            let points = plan.points(&sensor).unwrap();
            let stacks: Vec<&PlannedPoint> = points.iter().filter(|p| p.names.len() > 2).collect();
            let [flat, dark] = stacks[..] else { panic!("a flat and a dark stack") };
            assert_eq!((flat.kind, dark.kind, flat.exposure_ms), (Kind::Flat, Kind::Dark, dark.exposure_ms));
            let (_, [_, half]) = shares.iter().find(|(ms, _)| *ms == flat.exposure_ms).unwrap();
            assert!((half - 0.5).abs() < 0.02, "the stack is at {half} of saturation");
            // Every flat point has a dark one of its time; the dark series goes on from there.
            let dark = |ms: f64| points.iter().any(|p| p.kind == Kind::Dark && p.exposure_ms == ms);
            assert!(shares.iter().all(|(ms, _)| dark(*ms)) && plan.dark_ms.len() >= 6);
            assert_eq!(
                plan.bytes(&points),
                2 * (sensor.height * sensor.width) as u64
                    * points.iter().map(|p| p.names.len() as u64).sum::<u64>()
            );
        }
    }

    #[test]
    fn the_dark_series_ends_where_dark_current_adds_the_dark_variance() {
        let longest = |dark_current_e_per_s: f64| {
            let sensor = SensorModel { dark_current_e_per_s, ..imx249() };
            Plan::emva(&sensor, None, None).dark_ms.into_iter().fold(0.0, f64::max)
        };
        // The variance in the dark is 7.9646^2 = 63.4 e-^2: 2.5 s of 25 e-/s.
        assert_eq!([25.0, 0.0, 200.0, 1e5].map(longest), [2000.0, 10_000.0, 200.0, 100.0]);
    }

    #[test]
    fn a_sensor_with_gain_steps_is_captured_at_the_step_nearest_to_1() {
        let sensor = SensorModel { gain_steps: vec![0.5, 1.2, 4.0], ..mono() };
        let plan = Plan::emva(&sensor, None, None);
        assert_eq!(plan.gains, [1.2]);
        plan.validate(&sensor).unwrap();
    }

    #[test]
    fn the_response_to_a_wavelength_follows_the_curves() {
        let text = include_str!("../../../petzval-data/data/quantum-efficiency/imx219.toml");
        let curves =
            QuantumEfficiency { scale: 0.5, ..petzval_files::parse_quantum_efficiency_toml(text).unwrap() };
        let sensor = SensorModel { quantum_efficiency: Some(curves.clone()), ..imx249() };
        let at = |colour, um| curves.curve(colour).unwrap().at(um);
        let plan = Plan { wavelength_um: Some(0.6), ..Plan::default() };
        let lit = plan.lit(&sensor).unwrap();
        let (red, blue) = (at(Colour::Red, 0.6), at(Colour::Blue, 0.6));
        let most = red.max(at(Colour::Green, 0.6));
        assert!((lit.photons_per_e.unwrap() * most - 1.0).abs() < 1e-12);
        assert!((lit.sensor.relative_qe[0] - red / most).abs() < 1e-12);
        assert!((lit.sensor.relative_qe[2] - blue / most).abs() < 1e-12);
        // Left to itself, the series takes the light that green sees best; a stated efficiency leaves the light white.
        let (peak, _) = curves.peak(Colour::Green).unwrap();
        let emva = Plan::emva(&sensor, None, None);
        assert_eq!(emva.wavelength_um, Some(peak));
        // Red and blue answer it with less than half of green: the series ends where green is saturated.
        assert!((emva.level - EMVA_BEYOND).abs() < 1e-12 && emva.flat_ms.len() == 60, "{}", emva.level);
        assert_eq!(Plan::emva(&sensor, Some(0.5), None).wavelength_um, None);
        let stated = Plan { quantum_efficiency: Some(0.5), ..plan.clone() }.lit(&sensor).unwrap();
        assert_eq!((stated.photons_per_e, stated.sensor), (Some(2.0), sensor.clone()));
        for (um, of, says) in [(0.6, imx249(), "no quantum efficiency"), (5.0, sensor, "no pixel")] {
            let error = Plan { wavelength_um: Some(um), ..plan.clone() }.validate(&of).unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}
