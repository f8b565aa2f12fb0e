//! The Jacobian of the landing points of a bundle by the numbers of the lens: two backward sweeps a ray, one for x and
//! one for y.

use pulp::{Simd, WithSimd};

use super::aim::AimedRays;
use super::backward::{From, Reaim, ReaimLanes, Sums, from_image, sweep};
use super::forward::{load, trace_rays};
use crate::lanes::{Lanes, width};
use crate::number::Number;
use crate::trace::fate::Fate;
use crate::trace::ray::RayBundle;
use crate::trace::sequence::Sequence;
use petzval_base::simd::dispatch;

/// Landing points of rays that are aimed at points of the stop, and their derivatives; arrays are padded.
#[derive(Clone, Debug)]
pub struct LandingJacobian {
    /// x and y on the image plane, mm.
    pub landing: [Vec<f64>; 2],
    /// d(x, y) by each of the numbers, and last by the relative growth of the stop, mm: `[number][x or y][ray]`.
    pub by: Vec<[Vec<f64>; 2]>,
    /// Whether each ray reaches the image.
    pub arrives: Vec<bool>,
}

/// The cotangent of the glass behind a surface, which is also behind the mirrors that follow it.
#[inline(always)]
fn index_sum<S: Simd>(sequence: &Sequence, surface: usize, sums: &[Sums<S>], zero: Lanes<S>) -> Lanes<S> {
    let mut total = zero;
    for (i, sums) in sums.iter().enumerate() {
        let share = sequence.glass_index_bar(surface, |j| if i == j { 1.0 } else { 0.0 });
        total += sums.get(Number::Index, zero) * share;
    }
    total
}

struct Jacobian<'a> {
    sequence: &'a Sequence,
    launched: &'a RayBundle,
    aimed: &'a AimedRays,
    numbers: &'a [(usize, Number)],
    out: &'a mut LandingJacobian,
}

impl WithSimd for Jacobian<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sequence, launched, aimed, numbers, out } = self;
        let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
        let last = sequence.surfaces.len() - 1;
        let mut sums = Sums::of(sequence, zero);
        let mut tape = Vec::with_capacity(last + 1);
        let nothing = vec![0.0; RayBundle::padded(launched.len())];
        let mut fates = nothing.clone();
        let reaim = Reaim { aimed, launch_bar: [&nothing, &nothing] };
        for at in (0..launched.len()).step_by(width::<S>()) {
            let fate = Lanes::load(simd, &launched.fate[at..]);
            let arrival = trace_rays::<S, true>(sequence, load(simd, launched, at), fate, &mut tape);
            arrival.fate.store(&mut fates[at..]);
            let reaim = ReaimLanes::load(simd, &reaim, at);
            // One sweep for x and one for y: the sums of each ray are its derivatives, so they are stored and cleared.
            for axis in 0..2 {
                arrival.ray.position[axis].store(&mut out.landing[axis][at..]);
                for sums in &mut sums {
                    sums.clear(zero);
                }
                let seed = if axis == 0 { [one, zero] } else { [zero, one] };
                let (point_bar, direction_bar, thickness_bar) = from_image(&arrival, seed, None);
                sums[last].add(Number::Thickness, thickness_bar);
                let bars = (point_bar, direction_bar);
                let swept =
                    sweep(sequence, &tape, From::Behind, bars, None, &[], None, Some(&reaim), &mut sums);
                for (by, (surface, number)) in out.by.iter_mut().zip(numbers) {
                    let sum = match (*number, &sequence.surfaces[*surface].frame) {
                        (Number::Index, _) => index_sum(sequence, *surface, &sums, zero),
                        (Number::Tilt(axis), Some(frame)) => sums[*surface].by_tilt(frame, axis, zero),
                        _ => sums[*surface].get(*number, zero),
                    };
                    sum.store(&mut by[axis][at..]);
                }
                if let Some(by_stop) = out.by.last_mut() {
                    swept.stop_bar.store(&mut by_stop[axis][at..]);
                }
            }
        }
        out.arrives =
            fates[..launched.len()].iter().map(|code| Fate::of_code(*code).reaches_image()).collect();
    }
}

/// The Jacobian of the landing points of aimed rays by some numbers of the lens. The rays keep their points of the stop.
pub fn landing_jacobian(
    sequence: &Sequence,
    aimed: &AimedRays,
    numbers: &[(usize, Number)],
) -> LandingJacobian {
    let launched = aimed.bundle(sequence);
    let zero = || vec![0.0; RayBundle::padded(launched.len())];
    let mut out = LandingJacobian {
        landing: [zero(), zero()],
        by: (0..=numbers.len()).map(|_| [zero(), zero()]).collect(),
        arrives: Vec::new(),
    };
    dispatch(Jacobian { sequence, launched: &launched, aimed, numbers, out: &mut out });
    // Set the padding to zero.
    for column in out.landing.iter_mut().chain(out.by.iter_mut().flatten()) {
        column[launched.len()..].fill(0.0);
    }
    out
}
