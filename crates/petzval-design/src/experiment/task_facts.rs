//! What a task decides of the experiments that name it. The [tasks](crate::task::Task) state it.

use super::names::{BUILT_IN_PHOTOS, STREET};

/// What a task decides of its experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskFacts {
    /// Its name in experiments.
    pub name: &'static str,
    /// Where the network of its cameras stands.
    pub network: NetworkRole,
    /// What a step of the network moves: `network`, `detector`.
    pub network_name: &'static str,
    /// Whether that network is the detector that the table `detector` describes, which finds boxes.
    pub has_detector: bool,
    /// Whether its loss and scores are those of the class that `python.task` names.
    pub has_python_class: bool,
    /// Which key names its pictures.
    pub pictures: PicturesKey,
    /// Whether the experiment states classes.
    pub has_classes: bool,
    /// What an experiment scores that names no scores; none for the default of its table.
    pub default_scores: Option<&'static [&'static str]>,
    /// The score that an experiment with a few classes of its own has for each of them besides: `ap50`, for `ap50_car`.
    pub class_score: Option<&'static str>,
    /// Of what its scores are: `pictures`, `objects`.
    pub scored: &'static str,
}

/// Where the network of a camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkRole {
    /// It finishes pictures. A hardware ISP takes its place.
    Finishes,
    /// It looks at finished pictures, whoever made them.
    Reads,
}

/// The key of an experiment that names the pictures of its task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PicturesKey {
    /// `photos`: photographs for people to look at.
    Photos,
    /// `data`: scenes with labels.
    Data,
}

impl PicturesKey {
    /// The name of the built-in pictures.
    pub fn built_in(self) -> &'static str {
        match self {
            Self::Photos => BUILT_IN_PHOTOS,
            Self::Data => STREET,
        }
    }

    /// The flag of the command that names them, and what they are.
    pub fn in_words(self) -> [&'static str; 2] {
        match self {
            Self::Photos => ["--photos", "photographs"],
            Self::Data => ["--data", "labelled pictures"],
        }
    }
}
