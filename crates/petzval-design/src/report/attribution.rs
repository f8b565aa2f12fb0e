//! What each coordinate of a lens did to the loss: the first-order decreases of all its steps for the task, summed.

use petzval_report::design_report::Attribution;

use crate::lens::numbers::{name, surface_name};
use crate::lens::start::Start;
use crate::run::Event;

/// One entry for each coordinate of the lens: its variables, and last the image plane. Empty if no event is a lens step.
pub fn attribution<'e>(start: &Start, events: impl Iterator<Item = &'e Event>) -> Vec<Attribution> {
    let mut lowered: Vec<f64> = Vec::new();
    for event in events {
        lowered.resize(lowered.len().max(event.lowered.len()), 0.0);
        lowered.iter_mut().zip(&event.lowered).for_each(|(sum, step)| *sum += step);
    }
    let lens = &start.lens_file.lens;
    let variables = start.space.space().variables().iter();
    let of_variables = variables.map(|v| (surface_name(lens, v.surface), name(lens, v.surface, v.number)));
    let names = of_variables.chain([("image plane".to_owned(), "defocus".to_owned())]);
    let entry =
        |((surface, number), lowered): ((String, String), f64)| Attribution { surface, number, lowered };
    names.zip(lowered).map(entry).collect()
}
