//! Weights of the fields of a lens: how much each counts in the merit of an optimisation.

/// Largest weight of a field: the sum of all stays a number.
pub const MOST_FIELD_WEIGHT: f64 = 1e6;

/// Weights as a lens file keeps them: empty if all are the same.
pub fn uneven_weights(weights: Vec<f64>) -> Vec<f64> {
    let is_even = weights.windows(2).all(|pair| pair[0] == pair[1]);
    if is_even { Vec::new() } else { weights }
}

/// What is wrong with weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WeightFault {
    /// The weight at this place is no number from 0 to [`MOST_FIELD_WEIGHT`].
    Range(usize),
    /// All are 0.
    Nothing,
}

impl WeightFault {
    /// The first fault of weights; `None` if there is none.
    pub fn of(weights: &[f64]) -> Option<Self> {
        if let Some(place) = weights.iter().position(|weight| !(0.0..=MOST_FIELD_WEIGHT).contains(weight)) {
            return Some(Self::Range(place));
        }
        (!weights.is_empty() && weights.iter().all(|weight| *weight == 0.0)).then_some(Self::Nothing)
    }

    /// Message and hint.
    pub fn in_words(self) -> (String, &'static str) {
        match self {
            Self::Range(_) => (
                format!("a weight lies between 0 and {MOST_FIELD_WEIGHT}"),
                "a field of weight 0 adds nothing to the merit",
            ),
            Self::Nothing => {
                ("all weights are 0: no field would count".to_owned(), "give one field a weight")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_from_0_to_a_million_and_not_all_0() {
        assert_eq!(WeightFault::of(&[]), None);
        assert_eq!(WeightFault::of(&[0.0, 2.0, 1e6]), None);
        assert_eq!(WeightFault::of(&[1.0, -1.0]), Some(WeightFault::Range(1)));
        assert_eq!(WeightFault::of(&[1.0, 2.0, f64::NAN]), Some(WeightFault::Range(2)));
        // Two of these would have an infinite sum, and no lens a merit.
        assert_eq!(WeightFault::of(&[1e308, 1e308]), Some(WeightFault::Range(0)));
        assert_eq!(WeightFault::of(&[0.0, 0.0]), Some(WeightFault::Nothing));
        assert_eq!(uneven_weights(vec![2.0, 2.0]), Vec::<f64>::new());
        assert_eq!(uneven_weights(vec![2.0, 1.0]), [2.0, 1.0]);
    }
}
