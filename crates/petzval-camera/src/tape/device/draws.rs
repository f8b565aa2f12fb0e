//! Random draws on a device: the words of the CPU's generator to the bit, and its draws in 32 bits.
//!
//! See [`petzval_base::random`] for the methods. Differences near the middle of a distribution are taken from the words before they are
//! rounded, so that tails and rejections keep the precision of 32 bits.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

/// A pair of uniform numbers in (0, 1), as words of 64 bits in halves. The upper 52 bits of each count.
#[derive(CubeType, Clone, Copy)]
pub struct Pair {
    u_high: u32,
    u_low: u32,
    v_high: u32,
    v_low: u32,
}

/// Where a draw lies: seed, frame, stage and place of the CPU's stream.
#[derive(CubeType, Clone, Copy)]
pub struct At {
    pub seed_low: u32,
    pub seed_high: u32,
    pub frame_low: u32,
    pub frame_high: u32,
    pub place: u32,
}

/// The four words of Philox4x32-10.
#[cube]
pub fn pair(at: &At, stage: u32, attempt: u32) -> Pair {
    let mut c0 = at.place;
    let mut c1 = (stage << 24u32) | attempt;
    let mut c2 = at.frame_low;
    let mut c3 = at.frame_high;
    let mut k0 = at.seed_low;
    let mut k1 = at.seed_high;
    for _ in 0..10u32 {
        let high_0 = c0.mul_hi(0xD251_1F53u32);
        let low_0 = c0 * 0xD251_1F53u32;
        let high_1 = c2.mul_hi(0xCD9E_8D57u32);
        let low_1 = c2 * 0xCD9E_8D57u32;
        c0 = high_1 ^ c1 ^ k0;
        c1 = low_1;
        c2 = high_0 ^ c3 ^ k1;
        c3 = low_0;
        k0 += 0x9E37_79B9u32;
        k1 += 0xBB67_AE85u32;
    }
    Pair { u_high: c1, u_low: c0, v_high: c3, v_low: c2 }
}

/// The number in (0, 1) of the upper 52 bits of a word, to the precision of 32 bits also near 0.
#[cube]
fn unit(high: u32, low: u32) -> f32 {
    // The middle of a cell of 2^-52 lies 2^11 units of the last of 64 bits above its start.
    let upper = f32::cast_from(high) * 2.328_306_4e-10f32;
    upper + (f32::cast_from(low & 0xFFFF_F000u32) + 2048.0f32) * 5.421_011e-20f32
}

/// The first number of a pair.
#[cube]
pub fn first(pair: &Pair) -> f32 {
    unit(pair.u_high, pair.u_low)
}

/// The first number's distance from 1.
#[cube]
fn first_below_one(pair: &Pair) -> f32 {
    unit(pair.u_high ^ 0xFFFF_FFFFu32, pair.u_low ^ 0xFFFF_FFFFu32)
}

/// `(atanh(s) - s) / s^3` for `w = s^2 <= 1/9`.
#[cube]
fn atanh_tail(w: f32) -> f32 {
    let mut sum = w / 19.0f32 + 1.0f32 / 17.0f32;
    sum = sum * w + 1.0f32 / 15.0f32;
    sum = sum * w + 1.0f32 / 13.0f32;
    sum = sum * w + 1.0f32 / 11.0f32;
    sum = sum * w + 1.0f32 / 9.0f32;
    sum = sum * w + 1.0f32 / 7.0f32;
    sum = sum * w + 1.0f32 / 5.0f32;
    sum * w + 1.0f32 / 3.0f32
}

/// Twice the inverse hyperbolic tangent.
#[cube]
fn twice_atanh(s: f32) -> f32 {
    let w = s * s;
    2.0f32 * s + 2.0f32 * s * (w * atanh_tail(w))
}

/// Natural logarithm of a positive normal number: `x = 2^e m` with `m` in `[sqrt(1/2), sqrt(2))`.
#[cube]
pub fn ln(x: f32) -> f32 {
    // The bits of sqrt(1/2), and those of 1.
    let above = u32::reinterpret(x) - 0x3F35_04F3u32;
    let m = f32::reinterpret((above & 0x007F_FFFFu32) + 0x3F35_04F3u32);
    let e = f32::cast_from((above + 0x3F80_0000u32) >> 23u32) - 127.0f32;
    let fraction = twice_atanh((m - 1.0f32) / (m + 1.0f32));
    // ln 2 in two parts; the first has few bits.
    e * 0.693_359_4f32 + (fraction + e * -2.121_944_4e-4f32)
}

/// Exponential of a number in -80..80.
#[cube]
pub fn exp(x: f32) -> f32 {
    let n = (x * std::f32::consts::LOG2_E + 0.5f32).floor();
    let r = (x - n * 0.693_359_4f32) - n * -2.121_944_4e-4f32;
    let mut sum = r / 5040.0f32 + 1.0f32 / 720.0f32;
    sum = sum * r + 1.0f32 / 120.0f32;
    sum = sum * r + 1.0f32 / 24.0f32;
    sum = sum * r + 1.0f32 / 6.0f32;
    sum = sum * r + 0.5f32;
    let power = f32::reinterpret(u32::cast_from(n + 127.0f32) << 23u32);
    ((sum * r) * r + r + 1.0f32) * power
}

/// Two standard normal numbers.
#[derive(CubeType, Clone, Copy)]
pub struct Normals {
    pub cosine: f32,
    pub sine: f32,
}

/// Two independent standard normal numbers, by the transform of Box and Muller.
#[cube]
pub fn normals(pair: &Pair) -> Normals {
    // ln u from its distance to 1 where u is near 1.
    let u = first(pair);
    let far = first_below_one(pair);
    let log = if u < 0.5f32 { ln(u) } else { -twice_atanh(far / (2.0f32 - far)) };
    let radius = (-2.0f32 * log).sqrt();
    // The nearest quarter turn, and the rest as a signed word: at most an eighth of a turn.
    let quarter = (pair.v_high + 0x2000_0000u32) >> 30u32;
    let rest = i32::reinterpret(pair.v_high - (quarter << 30u32));
    let quarters = f32::cast_from(rest) * 9.313_226e-10f32 + f32::cast_from(pair.v_low) * 2.168_404_3e-19f32;
    let x = quarters * std::f32::consts::FRAC_PI_2;
    let w = x * x;
    let mut sine = w / -39_916_800.0f32 + 1.0f32 / 362_880.0f32;
    sine = sine * w - 1.0f32 / 5_040.0f32;
    sine = sine * w + 1.0f32 / 120.0f32;
    sine = sine * w - 1.0f32 / 6.0f32;
    sine = sine * w * x + x;
    let mut cosine = w / -3_628_800.0f32 + 1.0f32 / 40_320.0f32;
    cosine = cosine * w - 1.0f32 / 720.0f32;
    cosine = cosine * w + 1.0f32 / 24.0f32;
    cosine = cosine * w - 0.5f32;
    cosine = cosine * w + 1.0f32;
    let is_odd = quarter & 1u32 == 1u32;
    let s = select(is_odd, cosine, sine);
    let c = select(is_odd, sine, cosine);
    let s = select(quarter & 2u32 == 2u32, -s, s);
    let c = select((quarter + 1u32) & 2u32 == 2u32, -c, c);
    Normals { cosine: radius * c, sine: radius * s }
}

/// An exponentially distributed number of mean 1 with probability `share`, else 0.
#[cube]
pub fn rare_exponential(pair: &Pair, share: f32) -> f32 {
    let mut value = 0.0f32;
    if first(pair) < share {
        let far = unit(pair.v_high ^ 0xFFFF_FFFFu32, pair.v_low ^ 0xFFFF_FFFFu32);
        value =
            if far < 0.5f32 { twice_atanh(far / (2.0f32 - far)) } else { -ln(unit(pair.v_high, pair.v_low)) };
    }
    value
}

/// The error of Stirling's formula for the factorials 0 to 15, which [`poisson`] takes as its table.
pub const CORRECTIONS: [f32; 16] = [
    0.0,
    0.081_061_47,
    0.041_340_696,
    0.027_677_926,
    0.020_790_672,
    0.016_644_69,
    0.013_876_129,
    0.011_896_71,
    0.010_411_265,
    0.009_255_462,
    0.008_330_563,
    0.007_573_676,
    0.006_942_84,
    0.006_408_994,
    0.005_951_37,
    0.005_554_734,
];

/// An exact Poisson count of mean `rate`, as the CPU draws it: by inversion below 10, else by transformed rejection.
///
/// Counts are taken from the whole part of the rate on, so that their distances from it do not lose bits.
#[cube]
pub fn poisson(rate: f32, at: &At, stage: u32, corrections: &[f32]) -> f32 {
    let drawn = pair(at, stage, 0u32);
    if rate < 10.0f32 { inverted(rate, first(&drawn)) } else { rejected(rate, drawn, at, stage, corrections) }
}

/// The number of the values F(0), F(1), ... that lie below `u`.
#[cube]
fn inverted(rate: f32, u: f32) -> f32 {
    let mut probability = exp(-rate);
    let mut sum = probability;
    let mut count = 0.0f32;
    // Probabilities behind the mode that no longer change the sum end the search.
    while u > sum && (count < rate || probability > 1e-8f32) {
        count += 1.0f32;
        probability *= rate / count;
        sum += probability;
    }
    count
}

#[cube]
fn rejected(rate: f32, drawn: Pair, at: &At, stage: u32, corrections: &[f32]) -> f32 {
    let whole = rate.floor();
    let part = rate - whole;
    // Hörmann's hat.
    let b = 0.931f32 + 2.53f32 * rate.sqrt();
    let a = -0.059f32 + 0.024_83f32 * b;
    let squeeze = 0.9277f32 - 3.6224f32 / (b - 2.0f32);
    let inverse_alpha = 1.1239f32 + 1.1328f32 / (b - 3.4f32);
    let mut u_high = drawn.u_high;
    let mut u_low = drawn.u_low;
    let mut v = unit(drawn.v_high, drawn.v_low);
    let mut count = 0.0f32;
    let mut attempt = 0u32;
    let mut is_open = 1u32;
    while is_open == 1u32 {
        // A proposal under the hat, counted from the whole part of the rate.
        let is_low = u_high < 0x8000_0000u32;
        let mask = select(is_low, 0u32, 0xFFFF_FFFFu32);
        let edge = unit(u_high ^ mask, u_low ^ mask);
        let from_middle = select(is_low, edge - 0.5f32, 0.5f32 - edge);
        let ahead = ((2.0f32 * a / edge + b) * from_middle + part + 0.43f32).floor();
        count = whole + ahead;
        let is_sure = edge >= 0.07f32 && v <= squeeze;
        let is_far = edge < 0.013f32 && v > edge;
        let mut is_taken = is_sure;
        if !is_sure && !is_far && count >= 0.0f32 {
            let below_hat = v * inverse_alpha / (a / (edge * edge) + b);
            let mut scale = 1.0f32;
            let mut log_law = -rate;
            if count >= 0.5f32 {
                scale = (std::f32::consts::TAU * count).sqrt();
                log_law = -deviance(count, ahead - part, rate) - correction(count, corrections);
            }
            is_taken = ln(below_hat * scale) <= log_law;
        }
        attempt += 1u32;
        if is_taken || attempt == 4096u32 {
            is_open = 0u32;
        } else {
            let next = pair(at, stage, attempt);
            u_high = next.u_high;
            u_low = next.u_low;
            v = unit(next.v_high, next.v_low);
        }
    }
    count
}

/// `k ln(k / rate) - (k - rate)`, where `difference` is `k - rate`.
#[cube]
fn deviance(k: f32, difference: f32, rate: f32) -> f32 {
    let s = difference / (k + rate);
    let w = s * s;
    let mut value = k * ln(k / rate) - difference;
    if w <= 0.029f32 {
        value = difference * s + 2.0f32 * k * (s * (w * atanh_tail(w)));
    }
    value
}

/// The error of Stirling's formula for whole `k >= 1`.
#[cube]
fn correction(k: f32, corrections: &[f32]) -> f32 {
    let inverse = 1.0f32 / k;
    let w = inverse * inverse;
    let mut value = inverse * (1.0f32 / 12.0f32 - w * (1.0f32 / 360.0f32 - w * (1.0f32 / 1260.0f32)));
    if k < 16.0f32 {
        value = corrections[u32::cast_from(k) as usize];
    }
    value
}
