//! Exact Poisson counts.
//!
//! Rates below 10 use inversion: the count is the number of steps of the distribution function below a uniform number.
//! Rates from 10 on use transformed rejection (algorithm PTRS of Hörmann, "The transformed rejection method for generating
//! Poisson random variables", Insurance: Mathematics and Economics 12, 1993). A hat function close to the distribution
//! proposes a count. Two comparisons accept most proposals; the others are compared with the probability itself.

use super::Stream;
use super::elementary::{atanh_tail, exp, ln};

/// Smallest rate whose counts are drawn by rejection.
const REJECTION_FROM: f64 = 10.0;

/// Steps of the inversion. At a rate of 10, a larger count has a probability below 1e-60.
const STEPS: usize = 100;

/// Pixels per chunk. A chunk skips the method that none of its rates needs.
const CHUNK: usize = 64;

/// Largest rate. A double does not resolve single counts far above it.
const MAX_RATE: f64 = 1e15;

/// A Poisson count of mean `rate` for one pixel. `rate` is 0..1e15; larger values count as 1e15.
pub fn poisson(rate: f64, shot: Stream, place: u32) -> f64 {
    let rate = rate.min(MAX_RATE);
    let [u, v] = shot.uniforms(place, 0);
    if rate < REJECTION_FROM {
        return invert(rate, u);
    }
    let (mut proposal, mut attempt) = (propose(rate, u, v), 0);
    while !(proposal.sure || accept(rate, &proposal)) {
        attempt += 1;
        let [u, v] = shot.uniforms(place, attempt);
        proposal = propose(rate, u, v);
    }
    proposal.count
}

/// Count by inversion: the number of the values F(0), F(1), ... that lie below `u`.
fn invert(rate: f64, u: f64) -> f64 {
    let mut probability = exp(-rate);
    let (mut sum, mut count) = (probability, 0.0);
    for k in 1..=STEPS {
        if u <= sum {
            break;
        }
        count += 1.0;
        probability *= rate * (1.0 / k as f64);
        sum += probability;
    }
    count
}

/// A count proposed by the hat.
#[derive(Clone, Copy)]
struct Proposal {
    count: f64,
    /// Distance of the uniform number from the nearer end of its interval.
    edge: f64,
    /// The uniform number that decides acceptance.
    v: f64,
    /// Whether the squeeze accepts the count without computing its probability.
    sure: bool,
}

/// Parameters a and b of Hörmann's hat, Table 1 there.
#[inline(always)]
fn hat(rate: f64) -> (f64, f64) {
    let b = 0.931 + 2.53 * rate.sqrt();
    (-0.059 + 0.02483 * b, b)
}

#[inline(always)]
fn propose(rate: f64, u: f64, v: f64) -> Proposal {
    let (a, b) = hat(rate);
    let from_middle = u - 0.5;
    let edge = 0.5 - from_middle.abs();
    let count = ((2.0 * a / edge + b) * from_middle + rate + 0.43).floor();
    let squeeze = 0.9277 - 3.6224 / (b - 2.0);
    Proposal { count, edge, v, sure: edge >= 0.07 && v <= squeeze }
}

/// Whether a proposal is accepted: `v / (alpha (a / edge^2 + b)) <= rate^k exp(-rate) / k!`.
#[inline(always)]
fn accept(rate: f64, proposal: &Proposal) -> bool {
    let Proposal { count, edge, v, .. } = *proposal;
    let (a, b) = hat(rate);
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let below_hat = v * inverse_alpha / (a / (edge * edge) + b);
    // With Stirling's k! the probability is exp(-deviance - correction) / sqrt(2 pi k), and exp(-rate) at k = 0.
    let k = count.max(1.0);
    let stirling = -deviance(k, rate) - correction(k);
    let (scale, log_law) =
        if count < 0.5 { (1.0, -rate) } else { ((std::f64::consts::TAU * k).sqrt(), stirling) };
    // Hörmann's second comparison cuts off the far tail of the hat, where nothing is accepted.
    let far = edge < 0.013 && v > edge;
    (count >= 0.0) & !far & (ln(below_hat * scale) <= log_law)
}

/// `k ln(k / rate) - (k - rate)` without cancellation near `k = rate` (Loader, "Fast and accurate computation of binomial
/// probabilities", 2000): with `s = (k - rate) / (k + rate)` it is `(k - rate) s + 2 k (atanh(s) - s)`.
#[inline(always)]
fn deviance(k: f64, rate: f64) -> f64 {
    let difference = k - rate;
    let s = difference / (k + rate);
    let w = s * s;
    let near = difference * s + 2.0 * k * (s * (w * atanh_tail(w)));
    let far = k * ln(k / rate) - difference;
    if w <= 0.029 { near } else { far }
}

/// The error of Stirling's formula: `ln k! - (k + 1/2) ln k + k - ln(2 pi) / 2`, for whole `k >= 1`.
#[inline(always)]
fn correction(k: f64) -> f64 {
    const SMALL: [f64; 16] = [
        0.0,
        0.08106146679532726,
        0.0413406959554093,
        0.02767792568499834,
        0.020790672103765093,
        0.016644691189821193,
        0.013876128823070748,
        0.01189670994589177,
        0.010411265261972096,
        0.009255462182712733,
        0.00833056343336287,
        0.007573675487951841,
        0.00694284010720953,
        0.006408994188004207,
        0.0059513701127588475,
        0.005554733551962801,
    ];
    let inverse = 1.0 / k;
    let w = inverse * inverse;
    let series = inverse * (1.0 / 12.0 - w * (1.0 / 360.0 - w * (1.0 / 1260.0 - w * (1.0 / 1680.0))));
    // Adding 2^52 moves a whole number into the last bits of the double, which index the table.
    let small = SMALL[((k.min(15.0) + (1u64 << 52) as f64).to_bits() & 15) as usize];
    if k < 16.0 { small } else { series }
}

/// Working memory of [`poisson_row`], reused from row to row.
#[derive(Debug, Default)]
pub struct PoissonScratch {
    u: Vec<f64>,
    v: Vec<f64>,
    open: Vec<u32>,
    rate: Vec<f64>,
    count: Vec<f64>,
    accepted: Vec<u64>,
}

/// [`poisson`] of consecutive pixels of a row, from the counter `first` on. Each pixel gets one proposal; the few pixels
/// without an accepted count then try again together until none is left.
#[inline(always)]
pub fn poisson_row(
    rates: &[f64],
    shot: Stream,
    first: u32,
    scratch: &mut PoissonScratch,
    counts: &mut [f64],
) {
    let n = rates.len();
    for values in [&mut scratch.u, &mut scratch.v, &mut scratch.rate, &mut scratch.count] {
        values.resize(n, 0.0);
    }
    scratch.open.resize(n, 0);
    scratch.accepted.resize(n, 0);
    let PoissonScratch { u, v, open, rate, count, accepted } = scratch;
    // Draw a first proposal for every pixel.
    shot.uniforms_row(first, u, v);
    for at in (0..n).step_by(CHUNK) {
        let part = at..(at + CHUNK).min(n);
        first_proposals(&rates[part.clone()], &mut u[part.clone()], &v[part.clone()], &mut counts[part]);
    }

    // Gather the pixels whose proposal the squeeze did not accept, and compare each proposal with its probability.
    let mut left = 0;
    for i in 0..n {
        open[left] = i as u32;
        left += (u[i] > 0.0) as usize;
    }
    for j in 0..left {
        let i = open[j] as usize;
        (rate[j], count[j]) = (rates[i].min(MAX_RATE), counts[i]);
        // In place: j <= i, so no unread value is overwritten.
        (u[j], v[j]) = (u[i], v[i]);
    }
    let judged = rate[..left].iter().zip(&count[..left]).zip(&u[..left]).zip(&v[..left]);
    for ((((&rate, &count), &edge), &v), accepted) in judged.zip(&mut accepted[..left]) {
        *accepted = accept(rate, &Proposal { count, edge, v, sure: false }) as u64;
    }
    let mut attempt = 0;
    loop {
        // Store the accepted counts, and try the other pixels again with their next uniform numbers.
        let mut still = 0;
        for j in 0..left {
            let i = open[j];
            if accepted[j] != 0 {
                counts[i as usize] = count[j];
            }
            (open[still], rate[still]) = (i, rate[j]);
            still += (accepted[j] == 0) as usize;
        }
        left = still;
        if left == 0 {
            return;
        }
        attempt += 1;
        let tried = rate[..left].iter().zip(&open[..left]).zip(&mut count[..left]);
        for (((&rate, &i), count), accepted) in tried.zip(&mut accepted[..left]) {
            let [u, v] = shot.uniforms(first.wrapping_add(i), attempt);
            let proposal = propose(rate, u, v);
            *count = proposal.count;
            *accepted = (proposal.sure | accept(rate, &proposal)) as u64;
        }
    }
}

/// First proposals of a chunk. `u` holds uniform numbers on entry. On return it is zero where the count is final; elsewhere
/// it is the distance of the uniform number from the nearer end of its interval.
#[inline(always)]
fn first_proposals(rates: &[f64], u: &mut [f64], v: &[f64], counts: &mut [f64]) {
    let n = rates.len();
    let (u, v, counts) = (&mut u[..n], &v[..n], &mut counts[..n]);
    let (mut some_small, mut some_large) = (false, false);
    for &rate in rates {
        some_small |= rate < REJECTION_FROM;
        some_large |= rate >= REJECTION_FROM;
    }
    if some_small {
        invert_chunk(rates, u, counts);
    }
    if some_large {
        for i in 0..n {
            let large = rates[i] >= REJECTION_FROM;
            let proposal = propose(rates[i].clamp(REJECTION_FROM, MAX_RATE), u[i], v[i]);
            counts[i] = if large { proposal.count } else { counts[i] };
            u[i] = if large & !proposal.sure { proposal.edge } else { 0.0 };
        }
    } else {
        u.fill(0.0);
    }
}

/// [`invert`] of the small rates of a chunk, one step for all of them at a time.
#[inline(always)]
fn invert_chunk(rates: &[f64], u: &[f64], counts: &mut [f64]) {
    let n = rates.len();
    let (mut rate, mut probability, mut sum) = ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
    let (rate, probability, sum) = (&mut rate[..n], &mut probability[..n], &mut sum[..n]);
    let (u, counts) = (&u[..n], &mut counts[..n]);
    for i in 0..n {
        // Pixels of large rates are drawn by rejection; rate 0 ends their loop at once.
        rate[i] = if rates[i] < REJECTION_FROM { rates[i] } else { 0.0 };
        probability[i] = exp(-rate[i]);
        sum[i] = probability[i];
        counts[i] = 0.0;
    }
    for k in 1..=STEPS {
        let inverse = 1.0 / k as f64;
        let mut open = 0u64;
        for i in 0..n {
            let above = u[i] > sum[i];
            counts[i] += if above { 1.0 } else { 0.0 };
            probability[i] *= rate[i] * inverse;
            sum[i] += probability[i];
            open |= above as u64;
        }
        if open == 0 {
            return;
        }
    }
}
