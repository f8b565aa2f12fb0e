//! Black level: from digital numbers to light, 1 = white. Values below the black level stay, so that noise keeps its mean.
//!
//! `light = (dn - black - offset) / (white - black)`, after companded digital numbers are expanded.

use burn::prelude::*;

use crate::isp::RawInput;
use crate::isp::fixed::{LINEAR, shift_round_wide};
use crate::isp::tape_grid::{Theta, constant};

petzval_base::parameters! {
    /// Black level: what is subtracted from the raw frame.
    pub struct BlackLevel {
        /// Offset of each pixel of the 2x2 tile (in the order of a frame's first rows) from the calibrated black level.
        offset_dn: [f64; 4] = [0.0; 4], "DN", -64.0..64.0, Linear, "0 is the calibrated level";
    }
}

/// Bits behind the point of black levels.
const LEVEL_BITS: u32 = 8;

/// What a driver writes into the stage for a frame.
pub struct Registers {
    /// Black level of each pixel of the tile, 8 bits behind the point.
    black: [i64; 4],
    /// Light of a step of the level, `shift` bits behind the point of [`LINEAR`].
    scale: i64,
    shift: u32,
}

impl BlackLevel {
    pub fn registers(&self, frame: &RawInput) -> Registers {
        let (black_dn, range_dn) = (frame.about.black_dn, frame.about.white_dn - frame.about.black_dn);
        // As many bits as leave the product of a 24-bit number inside 64 bits.
        let shift = range_dn.log2().floor() as u32 + 12;
        let steps = f64::from(LINEAR.one()) / f64::from(1 << LEVEL_BITS);
        Registers {
            black: self
                .offset_dn
                .map(|offset| ((black_dn + offset) * f64::from(1 << LEVEL_BITS)).round() as i64),
            scale: (steps * f64::from(shift).exp2() / range_dn).round() as i64,
            shift,
        }
    }

    /// The light of digital numbers on the tape.
    pub fn smooth(frame: &RawInput, dn: Tensor<4>, theta: &Theta) -> Tensor<4> {
        let (black, white) = (frame.about.black_dn, frame.about.white_dn);
        let [_, _, height, width] = dn.dims();
        let mut light = dn.clone() - black;
        for tile in 0..4 {
            let at = |i: usize| f32::from(u8::from(i / width % 2 * 2 + i % width % 2 == tile));
            let mask: Tensor<4> = constant((0..height * width).map(at).collect(), [1, 1, height, width], &dn);
            light = light - mask * theta.number(&format!("black_level.offset_dn[{tile}]"));
        }
        (light / (white - black)).clamp(LINEAR.value(LINEAR.min), LINEAR.value(LINEAR.max))
    }
}

impl Registers {
    /// The light of a row of digital numbers, [`LINEAR`].
    #[inline(always)]
    pub fn row(&self, row: usize, dn: impl Fn(usize) -> u32, out: &mut [i32]) {
        let black = [self.black[row % 2 * 2], self.black[row % 2 * 2 + 1]];
        for (c, out) in out.iter_mut().enumerate() {
            let level = (i64::from(dn(c)) << LEVEL_BITS) - if c % 2 == 0 { black[0] } else { black[1] };
            *out = LINEAR.narrow(shift_round_wide(level * self.scale, self.shift));
        }
    }
}
