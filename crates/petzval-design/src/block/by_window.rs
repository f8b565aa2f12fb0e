//! The windows of a batch on all threads, each with a tape of its own.
//!
//! A window goes forward and back on one thread before the thread takes the next one. Only the tapes of windows in work are in memory, and
//! nothing but the sum of losses and derivatives is serial. Where the loss is one of layers that have seen all windows, they go forward first,
//! then the loss, then they go back. The sums are in the order of the windows: the same bits on any number of threads. No window begins once the
//! batch is cancelled.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use burn::prelude::*;
use burn::tensor::Gradients;
use petzval_camera::sensor::Noise;
use petzval_camera::tape::Frames;
use petzval_learn::loss::NamedLoss;

use super::{Batch, backward, named};
use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};
use crate::in_order::in_order;
use crate::objective::{Objective, WindowsOf};

/// Losses by name.
pub(super) type Losses = BTreeMap<String, f64>;

/// What a loss is differentiated by.
///
/// Tapes that share a leaf are one tape, on which one thread works at a time: every tape has leaves of its own.
pub(super) trait By: Sync {
    /// The leaves of a tape.
    type Leaves: Send;
    /// Derivatives by them.
    type Derivatives: Send + Default;

    /// New leaves.
    fn leaves(&self) -> Self::Leaves;
    /// The camera with these leaves.
    fn camera(&self, leaves: &Self::Leaves) -> Camera;
    /// What that camera takes, with a graph that leads to the leaves.
    fn take(&self, camera: &Camera, leaves: &Self::Leaves, shots: &[Shot], noise: &Noise) -> Result<Frames>;
    /// The derivatives by the leaves.
    fn read(&self, leaves: &Self::Leaves, gradients: Gradients) -> Result<Self::Derivatives>;
    /// The sum of derivatives.
    fn plus(&self, sum: Self::Derivatives, own: Self::Derivatives) -> Self::Derivatives;
    /// Windows that are taken together, so that what is done once for all of them does not take longer than the windows do: by their number of
    /// pixels, never by the number of threads.
    fn windows_together(&self, _pixels: usize) -> usize {
        1
    }
}

/// How a camera takes the windows of a batch. They are taken together where there is a single one, on another device than the CPU, for a loss
/// that looks at all of them, for a network of a user, and where the batch says so.
fn way(batch: &Batch, camera: &Camera, shots: &[Shot]) -> Result<WindowsOf> {
    let way = batch.loss.windows();
    if batch.is_whole || shots.len() < 2 || way == WindowsOf::Whole || !camera.takes_windows_alone() {
        return Ok(WindowsOf::Whole);
    }
    // Otherwise each window would make all of them.
    camera.make_kernels()?;
    Ok(way)
}

/// The losses of a batch and their derivatives; none of a loss that is no number. Fails with [`DesignError::Stopped`] before the next window
/// once the batch is cancelled.
pub(super) fn derivatives<B: By>(batch: &Batch, by: &B) -> Result<(Losses, Option<B::Derivatives>)> {
    let Batch { shots, ref noise, loss: objective, ref cancel, .. } = *batch;
    let of = |shots: &[Shot], share: f64| -> Result<(Losses, Option<B::Derivatives>)> {
        cancel.check()?;
        let leaves = by.leaves();
        let camera = by.camera(&leaves);
        let frames = by.take(&camera, &leaves, shots, noise)?;
        let loss = objective.loss(&camera, &frames, shots)?;
        let losses = named(&loss);
        if !are_finite(&losses) {
            return Ok((losses, None));
        }
        let gradients = backward(NamedLoss { total: loss.total * share, ..loss });
        Ok((losses, Some(by.read(&leaves, gradients)?)))
    };
    let camera = by.camera(&by.leaves());
    let window = shots.first().map_or(1, |shot| {
        let kept = camera.kept(shot);
        kept.height * kept.width
    });
    let together = by.windows_together(window).max(1);
    match way(batch, &camera, shots)? {
        WindowsOf::Whole => of(shots, 1.0),
        WindowsOf::Apart => {
            let add = |sum: Option<_>, own: Option<_>| Some(by.plus(sum?, own?));
            sum_apart(objective, shots, together, Some(B::Derivatives::default()), of, add)
        }
        WindowsOf::Looks => by_looks(batch, by, together),
    }
}

fn are_finite(losses: &Losses) -> bool {
    losses.values().all(|loss| loss.is_finite())
}

/// The losses of all windows, and the sum of what else `of` returns of some windows and their share. Its losses are without the share.
fn sum_apart<T: Send, A: Send>(
    objective: &dyn Objective,
    shots: &[Shot],
    together: usize,
    start: A,
    of: impl Fn(&[Shot], f64) -> Result<(Losses, T)> + Sync,
    add: impl Fn(A, T) -> A + Sync,
) -> Result<(Losses, A)> {
    let shares = objective.shares(shots)?;
    let groups: Vec<(&[Shot], f64)> =
        shots.chunks(together).zip(shares.chunks(together).map(|shares| shares.iter().sum())).collect();
    let make = |i: usize| {
        let (shots, share) = groups[i];
        let (mut losses, rest) = of(shots, share)?;
        losses.values_mut().for_each(|loss| *loss *= share);
        Ok((losses, rest))
    };
    in_order(groups.len(), (Losses::new(), start), make, |(mut losses, sum), (own, rest)| {
        for (name, loss) in own {
            *losses.entry(name).or_default() += loss;
        }
        (losses, add(sum, rest))
    })
}

/// Items one after the other.
fn push<T>(mut all: Vec<T>, one: T) -> Vec<T> {
    all.push(one);
    all
}

/// Each tensor of what layers saw in some windows, joined along the windows.
fn joined<'t>(looks: impl Iterator<Item = &'t Vec<Tensor<4>>> + Clone) -> Vec<Tensor<4>> {
    let count = looks.clone().next().map_or(0, Vec::len);
    (0..count).map(|k| Tensor::cat(looks.clone().map(|look| look[k].clone().detach()).collect(), 0)).collect()
}

/// [`derivatives`] with [`WindowsOf::Looks`].
fn by_looks<B: By>(batch: &Batch, by: &B, together: usize) -> Result<(Losses, Option<B::Derivatives>)> {
    let Batch { shots, ref noise, loss: objective, ref cancel, .. } = *batch;
    let groups: Vec<&[Shot]> = shots.chunks(together).collect();

    // Forward, as far as the layers that see a window alone.
    let forward = |i: usize| -> Result<_> {
        cancel.check()?;
        let leaves = by.leaves();
        let camera = by.camera(&leaves);
        let frames = by.take(&camera, &leaves, groups[i], noise)?;
        let [_, _, height, width] = frames.finished.dims();
        Ok((leaves, objective.look(&camera, &frames)?, [height, width]))
    };
    let seen: Vec<(B::Leaves, Vec<Tensor<4>>, [usize; 2])> =
        in_order(groups.len(), Vec::new(), forward, push)?;

    // The loss of all windows, and back to these layers.
    let picture = seen[0].2;
    let all: Vec<Tensor<4>> =
        joined(seen.iter().map(|(_, look, _)| look)).into_iter().map(Tensor::require_grad).collect();
    let leaves = by.leaves();
    let loss = objective.loss_of_look(&by.camera(&leaves), all.clone(), picture, shots)?;
    let losses = named(&loss);
    if !are_finite(&losses) {
        return Ok((losses, None));
    }
    let mut gradients = backward(loss);
    let by_look: Vec<Option<Tensor<4>>> = all.iter().map(|leaf| leaf.grad_remove(&mut gradients)).collect();
    let start = by.read(&leaves, gradients)?;

    // Back through the layers, whose tapes go one by one.
    let seen: Vec<_> = seen.into_iter().map(|(leaves, look, _)| Mutex::new(Some((leaves, look)))).collect();
    let back = |i: usize| -> Result<_> {
        cancel.check()?;
        let taken = seen[i].lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some((leaves, look)) = taken else { unreachable!("each tape is taken once") };
        let first = i * together;
        let rows = first..first + groups[i].len();
        // The derivative of this sum by what the layers gave is the derivative of the loss by it.
        let sum = look.into_iter().zip(&by_look).filter_map(|(seen, by)| {
            let [_, channels, height, width] = seen.dims();
            let by = by.clone()?.slice([rows.clone(), 0..channels, 0..height, 0..width]);
            Some((seen * Tensor::from_inner(by)).sum())
        });
        match sum.reduce(|sum, one| sum + one).filter(Tensor::is_tracked) {
            Some(sum) => by.read(&leaves, sum.backward()),
            None => Ok(B::Derivatives::default()),
        }
    };
    let sum = in_order(groups.len(), start, back, |sum, own| by.plus(sum, own))?;
    Ok((losses, Some(sum)))
}

/// The losses of what a camera takes of windows, for the goal and with the noise of a batch; without derivatives. Fails with
/// [`DesignError::Stopped`] before the next window once the batch is cancelled.
pub fn losses_of(batch: &Batch, camera: &Camera, shots: &[Shot]) -> Result<BTreeMap<String, f64>> {
    let Batch { ref noise, loss: objective, ref cancel, .. } = *batch;
    let of = |shots: &[Shot]| -> Result<Losses> {
        cancel.check()?;
        let frames = camera.take(shots, noise)?;
        Ok(named(&objective.loss(camera, &frames, shots)?))
    };
    match way(batch, camera, shots)? {
        WindowsOf::Whole => of(shots),
        WindowsOf::Apart => {
            Ok(sum_apart(objective, shots, 1, (), |shots, _| Ok((of(shots)?, ())), |(), ()| ())?.0)
        }
        WindowsOf::Looks => {
            let look = |i: usize| {
                cancel.check()?;
                let frames = camera.take(std::slice::from_ref(&shots[i]), noise)?;
                let [_, _, height, width] = frames.finished.dims();
                Ok::<_, DesignError>((objective.look(camera, &frames)?, [height, width]))
            };
            let seen: Vec<(Vec<Tensor<4>>, [usize; 2])> = in_order(shots.len(), Vec::new(), look, push)?;
            let all = joined(seen.iter().map(|(look, _)| look));
            Ok(named(&objective.loss_of_look(camera, all, seen[0].1, shots)?))
        }
    }
}
