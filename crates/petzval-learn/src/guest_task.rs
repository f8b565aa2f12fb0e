//! An object of a user's class as loss and scores of pictures.

use std::collections::BTreeMap;
use std::sync::Arc;

use burn::prelude::*;
use petzval_camera::tape::{Kernel, View, apply};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::guest::{Call, GuestClass, GuestError, Host, Named, Role};
use crate::score::ScoreDescription;

/// Digits after the decimal point of a score that does not say how many.
const DECIMALS: usize = 4;

/// Loss and scores of a user.
pub struct GuestTask {
    object: Named,
    scores: Vec<ScoreDescription>,
}

/// A score as its class describes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StatedScore {
    higher_is_better: bool,
    #[serde(default)]
    definition: String,
    #[serde(default)]
    title: Option<String>,
    #[serde(default)]
    unit: String,
    #[serde(default)]
    decimals: Option<usize>,
}

/// What an object says of itself.
#[derive(Deserialize)]
struct About {
    scores: BTreeMap<String, StatedScore>,
}

impl GuestTask {
    /// Loss and scores as their class makes them.
    pub fn new(host: &dyn Host, class: &GuestClass) -> Result<Self, GuestError> {
        let (object, about) = Named::make(host, class, Role::Task, Map::new())?;
        let about: About = serde_json::from_value(about).map_err(|e| GuestError::Unusable {
            message: format!("`{}.scores`: {e}", class.class),
            hint: "scores = {\"edge_error\": {\"higher_is_better\": False, \"definition\": \"...\"}}"
                .to_owned(),
        })?;
        let described = |(name, stated): (String, StatedScore)| ScoreDescription {
            title: stated.title.unwrap_or_else(|| name.replace('_', " ")),
            unit: stated.unit,
            definition: stated.definition,
            decimals: stated.decimals.unwrap_or(DECIMALS),
            higher_is_better: stated.higher_is_better,
            name,
        };
        Ok(Self { object, scores: about.scores.into_iter().map(described).collect() })
    }

    /// The scores that it computes.
    pub fn scores(&self) -> &[ScoreDescription] {
        &self.scores
    }

    /// The loss of finished pictures against what they should be, `[batch, 3, height, width]`, sRGB-encoded. Its graph leads to the pictures.
    pub fn loss(&self, finished: Tensor<4>, targets: Tensor<4>) -> Result<Tensor<1>, GuestError> {
        const METHOD: &str = "loss";
        let shape = finished.dims().to_vec();
        let answer = self.compare(METHOD, finished.clone(), targets)?;
        let value = self.number(METHOD, "the loss ", &answer.value)?;
        let [cotangent] = &answer.arrays[..] else {
            return Err(self.object.wrong(METHOD, "gives no cotangent of the pictures"));
        };
        self.object.check(METHOD, "as cotangent ", cotangent, &shape)?;
        let known = Known { value: value as f32, cotangent: cotangent.values.clone() };
        Ok(apply(Arc::new(known), [finished.into_dispatch()]))
    }

    /// Each score of one finished picture against what it should be. Fails if the object leaves one out, or gives one that its class does not
    /// declare.
    pub fn score(&self, finished: Tensor<4>, target: Tensor<4>) -> Result<BTreeMap<String, f64>, GuestError> {
        const METHOD: &str = "score";
        let answer = self.compare(METHOD, finished, target)?;
        let is_declared = |name: &str| self.scores.iter().any(|score| score.name == name);
        let mut given = answer.value.as_object().into_iter().flat_map(Map::keys);
        if let Some(name) = given.find(|name| !is_declared(name)) {
            let hint = "declare it in `scores` of the class, or leave it out";
            let problem = format!("gives `{name}`, a score that the class does not declare; hint: {hint}");
            return Err(self.object.wrong(METHOD, problem));
        }
        let score = |description: &ScoreDescription| {
            let name = &description.name;
            let value = answer.value.get(name).unwrap_or(&Value::Null);
            Ok((name.clone(), self.number(METHOD, &format!("as `{name}` "), value)?))
        };
        self.scores.iter().map(score).collect()
    }

    fn compare(
        &self,
        method: &'static str,
        finished: Tensor<4>,
        targets: Tensor<4>,
    ) -> Result<crate::guest::Answer, GuestError> {
        let read = |tensor: Tensor<4>| {
            let shape = tensor.dims().to_vec();
            let values = tensor.into_data().convert::<f32>().try_to_vec::<f32>();
            values.map(|values| (values, shape)).map_err(|e| GuestError::Gone(format!("{e:?}")))
        };
        let (finished, targets) = (read(finished)?, read(targets)?);
        let views = [&finished, &targets].map(|(values, shape)| View { values, shape: shape.clone() });
        self.object.guest.call(&Call { method, arrays: views.to_vec(), ..Call::default() })
    }

    /// A finite number that a method gave.
    fn number(&self, method: &'static str, what: &str, value: &Value) -> Result<f64, GuestError> {
        match value.as_f64() {
            Some(number) if number.is_finite() => Ok(number),
            _ if value.is_null() => Err(self.object.wrong(method, format!("gives {what}no number"))),
            // JSON has no word for what is not finite: it comes as text.
            _ => {
                let found = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                Err(self.object.wrong(method, format!("gives {what}{found}, which is no finite number")))
            }
        }
    }
}

/// A number of which the derivative is known.
#[derive(Debug)]
struct Known {
    value: f32,
    cotangent: Vec<f32>,
}

impl Kernel for Known {
    fn forward(&self, _: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        (vec![self.value], vec![1])
    }

    fn backward(&self, _: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        vec![self.cotangent.iter().map(|c| gradient[0] * c).collect()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guest::{Answer, Array, Guest};
    use serde_json::json;

    /// The mean square of the difference of the first values, scaled by what breaks it.
    struct Square(f32);

    impl Guest for Square {
        fn call(&self, call: &Call) -> Result<Answer, GuestError> {
            let difference: Vec<f32> = (call.arrays[0].values.iter().zip(call.arrays[1].values))
                .map(|(a, b)| (a - b) * self.0)
                .collect();
            let sum: f32 = difference.iter().map(|d| d * d).sum();
            let cotangent = difference.iter().map(|d| 2.0 * d).collect();
            Ok(match call.method {
                "loss" => Answer {
                    value: json!(sum),
                    arrays: vec![Array { values: cotangent, shape: call.arrays[0].shape.clone() }],
                    ..Answer::default()
                },
                _ => Answer { value: json!({"error": sum}), ..Answer::default() },
            })
        }
    }

    impl Host for Square {
        fn make(
            &self,
            _: &str,
            _: Role,
            options: &Map<String, Value>,
        ) -> Result<(Arc<dyn Guest>, Value), GuestError> {
            Ok((Arc::new(Self(self.0)), options["about"].clone()))
        }
    }

    fn task(scale: f32, about: Value) -> Result<GuestTask, GuestError> {
        let options = Map::from_iter([("about".to_owned(), about)]);
        GuestTask::new(&Square(scale), &GuestClass { class: "tasks:Square".to_owned(), options })
    }

    fn error() -> Value {
        json!({"scores": {"error": {"higher_is_better": false, "unit": "DN"}}})
    }

    #[test]
    fn the_loss_leads_to_the_pictures_and_scores_have_their_words() {
        let device = Device::flex().autodiff();
        let task = task(1.0, error()).unwrap();
        let finished = Tensor::<4>::full([2, 3, 1, 1], 3.0, &device).require_grad();
        let targets = Tensor::<4>::full([2, 3, 1, 1], 1.0, &device);
        let loss = task.loss(finished.clone(), targets.clone()).unwrap();
        assert_eq!(loss.clone().into_data().try_to_vec::<f32>().unwrap(), [24.0]);
        let gradients = (loss * 0.5).backward();
        let by_picture = finished.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap();
        assert_eq!(by_picture, [2.0; 6]);
        assert_eq!(task.score(finished, targets).unwrap()["error"], 24.0);
        let score = &task.scores()[0];
        assert_eq!(
            (score.title.as_str(), score.unit.as_str(), score.higher_is_better),
            ("error", "DN", false)
        );
    }

    #[test]
    fn what_it_may_not_give_is_refused_by_name() {
        let device = Device::flex().autodiff();
        let picture = |of: f32| Tensor::<4>::full([1, 3, 1, 1], of, &device);
        let broken = task(f32::INFINITY, error()).unwrap();
        let refused = broken.loss(picture(3.0), picture(1.0)).unwrap_err().to_string();
        // JSON has no infinity: it is null.
        assert!(refused.contains("`tasks:Square.loss` gives the loss no number"), "{refused}");
        let refused = broken.score(picture(3.0), picture(1.0)).unwrap_err().to_string();
        assert!(refused.contains("`tasks:Square.score` gives as `error` no number"), "{refused}");
        let undeclared = task(1.0, json!({"scores": {}})).unwrap();
        let refused = undeclared.score(picture(3.0), picture(1.0)).unwrap_err().to_string();
        assert!(
            refused.contains("`tasks:Square.score` gives `error`, a score that the class does not declare; hint: declare it"),
            "{refused}"
        );
        let unstated = task(1.0, json!({"scores": {"error": {"unit": "DN"}}})).err().unwrap().to_string();
        assert!(
            unstated.contains("higher_is_better") && unstated.contains("tasks:Square.scores"),
            "{unstated}"
        );
    }
}
