//! Keys of an experiment that its task or its pictures leave without effect.

use super::{Experiment, PicturesKey, STREET, TaskFacts};

/// Keys that act in some experiments alone.
struct Partial {
    /// Keys and tables by their paths.
    keys: &'static [&'static str],
    /// Whether they act in an experiment.
    act: fn(&Experiment, &TaskFacts) -> bool,
    /// Why they do not act in others.
    reason: &'static str,
}

/// All of them. The first row that leaves a key without effect says why.
const PARTIAL: &[Partial] = &[
    Partial {
        keys: &["photos"],
        act: |_, facts| facts.pictures == PicturesKey::Photos,
        reason: "the task looks at labelled scenes, which `data` names",
    },
    Partial {
        keys: &["data", "street"],
        act: |_, facts| facts.pictures == PicturesKey::Data,
        reason: "the task makes pictures of photographs, which `photos` names",
    },
    Partial { keys: &["detector"], act: |_, facts| facts.has_detector, reason: "the task has no detector" },
    Partial {
        keys: &[
            "street.busy",
            "street.families",
            "street.held_out_families",
            "street.least_visible",
            "street.light",
            "street.samples",
            "street.white_cd_m2",
        ],
        act: |experiment, _| experiment.data == STREET,
        reason: "`data` names pictures, and no streets are generated",
    },
    Partial {
        keys: &["street.least_side_px"],
        act: |experiment, facts| experiment.data == STREET || facts.has_detector,
        reason: "label images have no boxes",
    },
];

impl Experiment {
    /// The keys that differ from their defaults and have no effect for the task and the pictures, with the reason, in words; none where all act.
    pub fn idle_keys(&self, facts: &TaskFacts) -> Option<String> {
        let changed = Self::default().differences(self);
        let mut parts = Vec::new();
        let mut is_said = vec![false; changed.len()];
        for Partial { keys, reason, .. } in PARTIAL.iter().filter(|partial| !(partial.act)(self, facts)) {
            let mut idle = Vec::new();
            for ((key, value), is_said) in changed.iter().zip(&mut is_said) {
                if !*is_said && keys.iter().any(|of| is_at_or_below(key, of)) {
                    *is_said = true;
                    idle.push(format!("{key} = {value}"));
                }
            }
            if !idle.is_empty() {
                parts.push(format!("{} ({reason})", idle.join(", ")));
            }
        }
        (!parts.is_empty()).then(|| format!("without effect in this experiment: {}", parts.join("; ")))
    }
}

/// Whether the path of a key is this one, or one below it.
fn is_at_or_below(key: &str, path: &str) -> bool {
    key.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Task;
    use crate::task::objects::Objects;
    use crate::task::pictures::Pictures;
    use crate::task::segments::Segments;

    /// An experiment with each of the keys that act in some experiments alone.
    fn experiment(data: &str) -> Experiment {
        let keys = "photos = \"mine\"\n[street]\nlight = \"night\"\nfamilies = \"first\"\non_objects = 0.5\nleast_side_px = 9.0\n\
                    [detector]\nkind = \"fcos\"\n";
        Experiment::read(&format!("data = \"{data}\"\n{keys}")).unwrap()
    }

    #[test]
    fn keys_without_effect_are_named_with_the_reason() {
        let own = experiment("folder");
        let said = own.idle_keys(&Segments.facts()).unwrap();
        for needle in [
            "photos = \"mine\" (",
            "detector.kind = \"fcos\" (",
            "street.light = \"night\"",
            "street.families",
        ] {
            assert_eq!(said.matches(needle).count(), 1, "{needle}: {said}");
        }
        assert!(
            said.contains("street.least_side_px") && said.contains("label images have no boxes"),
            "{said}"
        );
        // It is the share of windows on a class that is drawn first.
        assert!(!said.contains("on_objects"), "{said}");
        // Boxes of a folder have sizes, and a detector looks for them.
        let of_objects = own.idle_keys(&Objects.facts()).unwrap();
        assert!(of_objects.contains("street.light") && !of_objects.contains("detector"), "{of_objects}");
        assert!(!of_objects.contains("least_side_px"), "{of_objects}");
        // Whatever a task calls its detector.
        let of_finder = TaskFacts { network_name: "finder", ..Objects.facts() };
        assert_eq!(own.idle_keys(&of_finder), Some(of_objects));
        let of_pictures = own.idle_keys(&Pictures.facts()).unwrap();
        assert!(of_pictures.contains("street.on_objects") && !of_pictures.contains("mine"), "{of_pictures}");
        let of_streets = experiment(STREET).idle_keys(&Segments.facts()).unwrap();
        assert!(of_streets.contains("photos") && !of_streets.contains("street."), "{of_streets}");
        assert_eq!(Experiment::default().idle_keys(&Segments.facts()), None);
    }

    #[test]
    fn every_key_that_acts_in_some_experiments_is_one() {
        let values = Experiment::default().values();
        for key in PARTIAL.iter().flat_map(|partial| partial.keys) {
            assert!(values.keys().any(|known| is_at_or_below(known, key)), "{key}");
        }
    }
}
