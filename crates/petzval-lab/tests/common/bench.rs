//! Captures of a monochrome sensor that the simulator does not make: noise that lines share, light and offset that drift, a response
//! that bends, black levels that differ by gain.

use std::path::Path;

use petzval_lab::emva::{Captures, Characterization, Options, characterize};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson, StandardNormal};
use tiff::encoder::{TiffEncoder, colortype::Gray16};

/// Correlation of the noise of lines: how many of them share what.
#[derive(Clone, Copy, Debug)]
pub enum Correlation {
    /// Each line has noise of its own.
    Independent,
    /// Groups of so many neighbours share their noise.
    Groups(usize),
    /// Each line has this share of the noise of the line before: AR(1).
    Wanders(f64),
    /// Lines of a period share their noise: converters that take every n-th column.
    Every(usize),
    /// A wave of this length, lines, of random phase.
    Wave(f64),
}

impl Correlation {
    /// Noise of lines of standard deviation one.
    fn draw(self, lines: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let own: Vec<f64> = (0..lines).map(|_| StandardNormal.sample(rng)).collect();
        match self {
            Self::Independent => own,
            Self::Groups(n) => (0..lines).map(|i| own[i / n]).collect(),
            Self::Every(n) => (0..lines).map(|i| own[i % n]).collect(),
            Self::Wanders(share) => {
                let mut state = own[0];
                let next = |fresh: &f64| {
                    state = share * state + (1.0 - share * share).sqrt() * fresh;
                    state
                };
                own.iter().map(next).collect()
            }
            Self::Wave(length) => {
                let turn = |i: usize| std::f64::consts::TAU * i as f64 / length;
                (0..lines).map(|i| own[0] * turn(i).cos() + own[1] * turn(i).sin()).collect()
            }
        }
    }
}

/// A series of captures. Noise is in electrons before the gain; a frame is rounded once.
#[derive(Clone, Debug)]
pub struct Bench {
    pub size: [usize; 2],
    pub linear_gains: Vec<f64>,
    /// DN/e- at linear gain 1.
    pub gain_dn_per_e: f64,
    pub bits: u32,
    /// Colour filter array; all colours see the same light.
    pub cfa: &'static str,
    /// Electrons that a pixel holds.
    pub full_well_e: f64,
    pub read_noise_e: f64,
    /// Noise behind the gain, DN.
    pub electronics_noise_dn: f64,
    pub row_noise_e: f64,
    pub rows: Correlation,
    pub column_noise_e: f64,
    pub columns: Correlation,
    /// Fixed: standard deviation of the offsets of pixels and of rows.
    pub dsnu_e: f64,
    pub dsnu_row_e: f64,
    /// Fixed: standard deviation of the response of pixels, share.
    pub prnu: f64,
    pub dark_current_e_per_s: f64,
    /// Black level at each gain, DN.
    pub black_dn: Vec<f64>,
    /// Whether each point states the black level of its gain; otherwise the sensor states that of the first.
    pub states_black: bool,
    /// Electrons of the flat points, at exposure times in proportion.
    pub flat_e: Vec<f64>,
    /// Whether the list states the photons: two an electron.
    pub has_photons: bool,
    /// Frames of a point.
    pub frames: usize,
    /// Exposure times of the dark points that have no flat ones, s.
    pub dark_s: Vec<f64>,
    /// Frames of a flat and of a dark stack at half of the brightest flat point; none if 0.
    pub stack: usize,
    /// Full scale of the compression: `e (1 - compression e / full)`.
    pub compression: f64,
    /// Standard deviation of the light of a frame, share.
    pub flicker: f64,
    /// Standard deviation of the offset of a frame, DN.
    pub drift_dn: f64,
    pub seed: u64,
}

/// Electrons at full scale.
pub const FULL_E: f64 = 9000.0;
/// Exposure time of one electron of light, s.
const SECONDS_PER_E: f64 = 1e-6;

impl Default for Bench {
    fn default() -> Self {
        Self {
            size: [160, 240],
            linear_gains: vec![1.0],
            gain_dn_per_e: 0.38,
            bits: 12,
            cfa: "mono",
            full_well_e: f64::INFINITY,
            read_noise_e: 3.0,
            electronics_noise_dn: 0.0,
            row_noise_e: 0.0,
            rows: Correlation::Independent,
            column_noise_e: 0.0,
            columns: Correlation::Independent,
            dsnu_e: 0.0,
            dsnu_row_e: 0.0,
            prnu: 0.0,
            dark_current_e_per_s: 5.0,
            black_dn: vec![64.0],
            states_black: false,
            flat_e: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6].map(|share| share * FULL_E).to_vec(),
            has_photons: true,
            frames: 2,
            dark_s: vec![0.02, 0.04, 0.06, 0.08],
            stack: 0,
            compression: 0.0,
            flicker: 0.0,
            drift_dn: 0.0,
            seed: 1,
        }
    }
}

impl Bench {
    /// Writes the captures into a folder and measures them.
    pub fn measured(&self) -> Characterization {
        self.measured_with(&Options::default())
    }

    pub fn measured_with(&self, options: &Options) -> Characterization {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        characterize(&Captures::open(folder.path()).unwrap(), options, &|_| Ok(())).unwrap()
    }

    /// Writes the frames and their list.
    pub fn write(&self, folder: &Path) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let [height, width] = self.size;
        let mut normal = |sigma: f64, count: usize| -> Vec<f64> {
            (0..count).map(|_| sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect()
        };
        let (of_pixels, of_rows) = (normal(self.dsnu_e, height * width), normal(self.dsnu_row_e, height));
        // Offsets and responses are about their mean in each place of a tile of two by two: R and the black level are those of the pixels.
        let mut of_response = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5eed);
        let mut response = || self.prnu * Distribution::<f64>::sample(&StandardNormal, &mut of_response);
        let mut fixed: Vec<[f64; 2]> =
            (0..height * width).map(|i| [of_pixels[i] + of_rows[i / width], 1.0 + response()]).collect();
        for place in 0..4 {
            let is_here = |i: &usize| (i / width % 2, i % width % 2) == (place / 2, place % 2);
            let here: Vec<usize> = (0..height * width).filter(is_here).collect();
            for (k, centre) in [0.0, 1.0].into_iter().enumerate() {
                let mean = here.iter().map(|i| fixed[*i][k]).sum::<f64>() / here.len() as f64;
                here.iter().for_each(|i| fixed[*i][k] += centre - mean);
            }
        }
        let mut list = format!(
            "[sensor]\nname = \"bench\"\nbits = {}\ncfa = \"{}\"\nblack_level_dn = {:?}\n",
            self.bits, self.cfa, self.black_dn[0]
        );
        for (i, gain) in self.linear_gains.iter().enumerate() {
            let black_dn = self.black_dn[i % self.black_dn.len()];
            let black =
                if self.states_black { format!("black_level_dn = {black_dn:?}\n") } else { String::new() };
            let mut take = |kind: &str, electrons: f64, exposure_s: f64, frames: usize| {
                let names: Vec<String> =
                    (0..frames).map(|k| format!("{kind}-{i}-{exposure_s}-{frames}-{k}.tiff")).collect();
                for name in &names {
                    let dn = self.frame(&mut rng, &fixed, *gain, black_dn, electrons, exposure_s);
                    let mut file = std::fs::File::create(folder.join(name)).unwrap();
                    let mut tiff = TiffEncoder::new(&mut file).unwrap();
                    tiff.write_image::<Gray16>(width as u32, height as u32, &dn).unwrap();
                }
                let photons = match kind {
                    "flat" if self.has_photons => format!("photons = {:?}\n", 2.0 * electrons),
                    _ => String::new(),
                };
                list += &format!(
                    "[[point]]\nkind = \"{kind}\"\nlinear_gain = {gain:?}\nexposure_ms = {:?}\n{photons}{black}frames = {names:?}\n",
                    1e3 * exposure_s
                );
            };
            for electrons in self.flat_e.iter().map(|e| e / gain) {
                take("flat", electrons, electrons * SECONDS_PER_E, self.frames);
                take("dark", 0.0, electrons * SECONDS_PER_E, self.frames);
            }
            for exposure_s in &self.dark_s {
                take("dark", 0.0, *exposure_s, self.frames);
            }
            if self.stack > 0 && i == 0 {
                let half = 0.5 * self.flat_e.iter().copied().fold(0.0, f64::max);
                take("flat", half, half * SECONDS_PER_E, self.stack);
                take("dark", 0.0, half * SECONDS_PER_E, self.stack);
            }
        }
        std::fs::write(folder.join("captures.toml"), list).unwrap();
    }

    /// One frame, DN.
    fn frame(
        &self,
        rng: &mut ChaCha8Rng,
        fixed: &[[f64; 2]],
        linear_gain: f64,
        black_dn: f64,
        electrons: f64,
        exposure_s: f64,
    ) -> Vec<u16> {
        let [height, width] = self.size;
        let k = self.gain_dn_per_e * linear_gain;
        let mut one = || Distribution::<f64>::sample(&StandardNormal, rng);
        let (light, drift_dn) = (electrons * (1.0 + self.flicker * one()), self.drift_dn * one());
        let rows = self.rows.draw(height, rng);
        let columns = self.columns.draw(width, rng);
        let dark = self.dark_current_e_per_s * exposure_s + 1e-9;
        let mut collected = Poisson::new(light + dark).unwrap();
        let read = Normal::new(0.0, self.read_noise_e).unwrap();
        let electronics = Normal::new(0.0, self.electronics_noise_dn).unwrap();
        let max_dn = f64::from((1u32 << self.bits) - 1);
        (0..height * width)
            .map(|i| {
                let [offset, response] = fixed[i];
                if self.prnu > 0.0 {
                    collected = Poisson::new(light * response.max(0.0) + dark).unwrap();
                }
                let e = Distribution::<f64>::sample(&collected, rng).min(self.full_well_e);
                let bent = e * (1.0 - self.compression * e / FULL_E);
                let lines = self.row_noise_e * rows[i / width] + self.column_noise_e * columns[i % width];
                let dn = black_dn + drift_dn + k * (bent + offset + lines + read.sample(rng));
                let behind = if electronics.std_dev() > 0.0 { electronics.sample(rng) } else { 0.0 };
                (dn + behind).round().clamp(0.0, max_dn) as u16
            })
            .collect()
    }
}
