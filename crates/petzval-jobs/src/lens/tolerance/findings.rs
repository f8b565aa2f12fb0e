//! What a tolerance analysis found, before it becomes figures and files.

use petzval_optics::lens::Lens;
use petzval_optics::tolerance::{Freedom, MonteCarlo, Sensitivities, Shared, Study};

/// What was found, with the lens and the study that it was found by.
pub struct Findings<'a> {
    /// The lens as drawn.
    pub lens: &'a Lens,
    /// The lens with its tolerances and its merit.
    pub study: &'a Study<'a>,
    /// What each tolerance does.
    pub table: Sensitivities,
    /// Lenses made at random.
    pub random: Option<MonteCarlo>,
    /// Number of the first of them.
    pub first: usize,
    /// Tolerances that share a loss.
    pub shared: Option<Vec<Shared>>,
    /// A merit that lenses have to reach.
    pub limit: Option<f64>,
}

impl Findings<'_> {
    /// Rows of the table, the greatest effect first.
    pub fn by_effect(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.table.rows.len()).collect();
        let loss = |i: &usize| self.table.rows[*i].worst_loss(self.study.better(), self.table.nominal);
        rows.sort_by(|a, b| loss(b).total_cmp(&loss(a)));
        rows
    }

    /// Names of the compensators, in their order.
    pub fn compensators(&self) -> Vec<String> {
        let all = self.study.tolerances().compensators.iter();
        all.map(|(freedom, _)| self.compensator_name(freedom)).collect()
    }

    /// Name of a compensator: the thickness behind the last surface is the image distance.
    pub fn compensator_name(&self, freedom: &Freedom) -> String {
        if *freedom == Freedom::focus(self.lens) { "image distance".to_owned() } else { freedom.name() }
    }
}
