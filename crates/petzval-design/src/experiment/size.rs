//! Longer and shorter experiments: more steps, the full size, further stages, one variant alone.

use super::{BlockName, Experiment, NetworkRole, TrainingConfig, Variant};

/// Most steps of a camera's network, or of its hardware ISP, in the full size of an experiment, see [`Experiment::to_full_size`].
pub const FULL_STEPS: usize = 40_000;

/// Windows a step in the full size.
pub const FULL_BATCH: usize = 16;

/// Steps between checkpoints in the full size, unless the experiment has more.
const FULL_CHECKPOINT: usize = 2000;

/// Most channels of a network.
const MOST_CHANNELS: usize = 256;

impl Experiment {
    /// Sets the steps of the network, or of the hardware ISP, in every stage that has no number of its own, and changes all other steps in
    /// proportion, rounded up. A longer training of the network has a limit to its gradients.
    pub fn scale_steps(&mut self, steps: usize, role: NetworkRole) {
        let (is_isp, last_block) = (self.isp.is_used(), self.last_block(role));
        let last = match last_block {
            BlockName::Isp => &mut self.isp.steps,
            _ => &mut self.training.steps,
        };
        let share = steps as f64 / (*last).max(1) as f64;
        *last = steps;
        // Longer schedules keep the high rate longer and diverge without gradient clipping.
        if share > 1.0 && last_block == BlockName::Network && self.training.largest_gradient == 0.0 {
            self.training.largest_gradient = TrainingConfig::default().largest_gradient;
        }
        let scaled = |steps: usize| (steps as f64 * share).ceil() as usize;
        self.optics.steps = scaled(self.optics.steps);
        if !self.exposure.vary.is_empty() {
            self.exposure.steps = scaled(self.exposure.steps);
        }
        if is_isp {
            self.isp.proxy_warm_up = scaled(self.isp.proxy_warm_up);
            if last_block != BlockName::Isp {
                self.isp.steps = scaled(self.isp.steps);
            }
        }
        let stages = self.variant.iter_mut().flat_map(|v| &mut v.stage);
        let own = stages.flat_map(|stage| stage.schedule.values_mut());
        own.filter_map(|s| s.steps.as_mut()).for_each(|steps| *steps = scaled(*steps));
    }

    /// Gives the experiment the budget of a night on a GPU in place of minutes on two cores. The camera with the most steps gets
    /// [`FULL_STEPS`] steps of the network or of the hardware ISP; all other steps grow in proportion. Batches have [`FULL_BATCH`] windows,
    /// and the network is twice as wide, which no built-in weights fit. Nothing else changes.
    pub fn to_full_size(&mut self, role: NetworkRole) {
        let last_block = self.last_block(role);
        let own = if last_block == BlockName::Isp { self.isp.steps } else { self.training.steps };
        self.scale_steps((FULL_STEPS * own).div_ceil(self.most_steps_of(last_block).max(1)), role);
        self.training.batch = FULL_BATCH;
        self.network.base_channels = (2 * self.network.base_channels).min(MOST_CHANNELS);
        self.checkpoint.every = self.checkpoint.every.max(FULL_CHECKPOINT);
    }

    /// Most network steps of a camera, or steps of its hardware ISP where that is what is trained last; those of the variants from which it
    /// starts among them.
    pub fn most_steps(&self, role: NetworkRole) -> usize {
        self.most_steps_of(self.last_block(role))
    }

    /// Steps that a block takes for the task in the variant that takes the most, those of the variants from which it starts among them.
    fn most_steps_of(&self, block: BlockName) -> usize {
        let variants = self.variants();
        let with_parents = |variant: &Variant| {
            let chain = std::iter::successors(Some(variant), |child| {
                variants.iter().find(|v| child.from.as_ref() == Some(&v.name))
            });
            chain.map(|v| v.task_steps_of(block)).sum()
        };
        variants.iter().map(with_parents).max().unwrap_or(0)
    }

    /// The experiment with one more stage for each variant, so that its network, or hardware ISP, takes `network_steps` steps in all; the same blocks
    /// move as in the variant's last stage with the network, the lens in proportion. The error is a message and a hint.
    ///
    /// A stage of its own leaves the steps before it as they are: a run that is extended after its end and one that has this
    /// experiment from the beginning make the same cameras.
    pub fn extended_to(&self, network_steps: usize, role: NetworkRole) -> Result<Self, (String, String)> {
        if let Some((name, from)) = self.variant.iter().find_map(|v| Some((&v.name, v.from.as_ref()?))) {
            let message =
                format!("`{name}` starts from the finished `{from}`, which an extension would change");
            return Err((message, "start a new run with more --steps".to_owned()));
        }
        if let Some((name, like)) = self.variant.iter().find_map(|v| Some((&v.name, v.zoomed_like.as_ref()?)))
        {
            let message = format!(
                "`{name}` is zoomed like the finished `{like}`, whose lens an extension would change"
            );
            return Err((message, "start a new run with more --steps".to_owned()));
        }
        let network = self.last_block(role);
        let mut longer = self.clone();
        for (variant, config) in self.variants().iter().zip(&mut longer.variant) {
            let taken = variant.task_steps_of(network);
            let stages = variant.stages.iter().zip(&config.stage);
            let Some((stage, last)) = stages.rev().find(|(stage, _)| stage.task_steps_of(network) > 0) else {
                continue;
            };
            if network_steps < taken {
                let message =
                    format!("the variant `{}` has {taken} {} steps already", variant.name, network.name());
                return Err((message, "give a larger number".to_owned()));
            }
            let further = network_steps - taken;
            if further == 0 {
                continue;
            }
            let mut added = last.clone();
            for block in &last.moves {
                let steps = (stage.steps_of(*block) * further).div_ceil(stage.steps_of(network));
                added.schedule.entry(*block).or_default().steps = Some(steps);
            }
            config.stage.push(added);
        }
        Ok(longer)
    }

    /// The experiment with some variants alone, and those that they need: from which they start, or like whose pictures their own are zoomed.
    /// `None` without names, and if it has none of a name.
    pub fn only(&self, names: &[impl AsRef<str>]) -> Option<Self> {
        let mut wanted: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
        let is_there = |name: &&str| self.variant.iter().any(|variant| variant.name == **name);
        if wanted.is_empty() || !wanted.iter().all(is_there) {
            return None;
        }
        let mut variants = Vec::new();
        // A variant needs earlier ones alone.
        for variant in self.variant.iter().rev() {
            if wanted.contains(&variant.name.as_str()) {
                wanted.extend(variant.from.as_deref());
                wanted.extend(variant.zoomed_like.as_deref());
                variants.insert(0, variant.clone());
            }
        }
        Some(Self { variant: variants, ..self.clone() })
    }
}
