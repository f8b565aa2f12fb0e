//! An object of a user's class as a network behind the development.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use burn::prelude::*;
use petzval_camera::tape::{Kernel, View, apply};
use serde_json::json;

use super::{NetworkInput, PictureNetwork};
use crate::guest::{Call, GuestClass, GuestError, Host, Named, Role};

/// Planes of a finished picture.
const COLOURS: usize = 3;

/// A network of a user. It owns its weights, its optimiser and its random numbers: clones of a camera share one network.
///
/// Its input has the planes of [`GuestNetwork::channels`]; the tape goes through it by its `forward` and `backward`. A kernel of the tape cannot fail: the
/// first error is kept, and [`GuestNetwork::check`] returns it.
pub struct GuestNetwork {
    object: Named,
    state: Mutex<State>,
}

/// What has happened to a network.
#[derive(Default)]
struct State {
    /// How often `forward` was called.
    forwards: u64,
    /// The first error on the tape.
    fault: Option<GuestError>,
}

impl GuestNetwork {
    /// A network as its class makes it from the number of planes of its input and a seed. It is the same for the same arguments.
    pub fn new(host: &dyn Host, class: &GuestClass, channels: usize, seed: u64) -> Result<Self, GuestError> {
        let own = [("channels", json!(channels)), ("seed", json!(seed))];
        let own = own.map(|(name, value)| (name.to_owned(), value)).into_iter().collect();
        let (object, _) = Named::make(host, class, Role::Network, own)?;
        Ok(Self { object, state: Mutex::default() })
    }

    /// Planes of its input: the picture that it finishes (3), the distance from the axis (1), the noise (1), and, where the camera restores, the
    /// picture before restoration (3).
    pub fn channels(is_restored: bool) -> usize {
        COLOURS + 2 + if is_restored { COLOURS } else { 0 }
    }

    /// The network behind a camera. The tape leads to its weights unless it is held.
    pub fn attached(self: &Arc<Self>, is_held: bool, device: &Device) -> Arc<dyn PictureNetwork> {
        let weights = Tensor::zeros([1], device);
        let weights = if is_held { weights } else { weights.require_grad() };
        Arc::new(Attached { network: self.clone(), weights })
    }

    /// Takes a step down the gradient of the last `backward`.
    pub fn step(&self, rate: f64) -> Result<(), GuestError> {
        self.object.guest.call(&Call { method: "step", number: Some(rate), ..Call::default() })?;
        Ok(())
    }

    /// Everything that it needs to go on with the same bits.
    pub fn save(&self) -> Result<Vec<u8>, GuestError> {
        Ok(self.object.guest.call(&Call { method: "save", ..Call::default() })?.bytes)
    }

    /// Takes over what [`save`](Self::save) returned.
    pub fn load(&self, bytes: &[u8]) -> Result<(), GuestError> {
        self.object.guest.call(&Call { method: "load", bytes: Some(bytes), ..Call::default() })?;
        Ok(())
    }

    /// Fails if it could not do its work on the tape: what it gave there since was no result.
    pub fn check(&self) -> Result<(), GuestError> {
        self.state().fault.clone().map_or(Ok(()), Err)
    }

    /// A state is valid even if a thread has panicked while it held the lock.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The finished pictures, and the number of the call.
    fn forward(&self, state: &mut State, planes: &View) -> Result<(Vec<f32>, u64), GuestError> {
        let call = Call { method: "forward", arrays: vec![planes.clone()], ..Call::default() };
        let finished = self.object.array(&call, &finished_shape(planes))?;
        state.forwards += 1;
        Ok((finished, state.forwards))
    }

    /// The cotangent of the planes of call `number`. An object knows its last call alone: an earlier one is called again.
    fn backward(
        &self,
        state: &mut State,
        planes: &View,
        number: u64,
        cotangent: &[f32],
    ) -> Result<Vec<f32>, GuestError> {
        if state.forwards != number {
            self.forward(state, planes)?;
        }
        let cotangent = View { values: cotangent, shape: finished_shape(planes) };
        let call = Call { method: "backward", arrays: vec![cotangent], ..Call::default() };
        self.object.array(&call, &planes.shape)
    }
}

/// The shape of the pictures that a network makes of planes.
fn finished_shape(planes: &View) -> Vec<usize> {
    let [batch, _, height, width] = planes.dims();
    vec![batch, COLOURS, height, width]
}

/// A network of a user behind a camera.
struct Attached {
    network: Arc<GuestNetwork>,
    /// Stands for its weights on the tape.
    weights: Tensor<1>,
}

impl PictureNetwork for Attached {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        let mut planes = vec![input.picture(), input.field.clone(), input.noise.clone()];
        if input.restored.is_some() {
            planes.push(input.developed.clone());
        }
        let pass = Pass { network: self.network.clone(), number: AtomicU64::new(0) };
        let planes = Tensor::cat(planes, 1).into_dispatch();
        apply(Arc::new(pass), [planes, self.weights.clone().into_dispatch()])
    }

    fn takes_whole_batches(&self) -> bool {
        true
    }

    fn check(&self) -> Result<(), GuestError> {
        self.network.check()
    }
}

/// One pass through a network. Unlike other kernels it depends on the weights that the object has at the time.
struct Pass {
    network: Arc<GuestNetwork>,
    /// The number of its `forward` among those of the network.
    number: AtomicU64,
}

impl fmt::Debug for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Pass").field(&self.network.object.class).finish()
    }
}

impl Pass {
    /// What a call gives, or zeros. After a fault nothing is called any more.
    fn or_zeros(
        &self,
        count: usize,
        call: impl FnOnce(&mut State) -> Result<Vec<f32>, GuestError>,
    ) -> Vec<f32> {
        let mut state = self.network.state();
        let found = match &state.fault {
            None => call(&mut state),
            Some(fault) => Err(fault.clone()),
        };
        found.unwrap_or_else(|fault| {
            state.fault = Some(fault);
            vec![0.0; count]
        })
    }
}

impl Kernel for Pass {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let shape = finished_shape(&inputs[0]);
        let finished = self.or_zeros(shape.iter().product(), |state| {
            let (finished, number) = self.network.forward(state, &inputs[0])?;
            self.number.store(number, Ordering::Relaxed);
            Ok(finished)
        });
        (finished, shape)
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let planes = &inputs[0];
        let cotangent = self.or_zeros(planes.values.len(), |state| {
            self.network.backward(state, planes, self.number.load(Ordering::Relaxed), gradient)
        });
        // The object keeps the gradients by its weights to itself.
        vec![if wanted[0] { cotangent } else { Vec::new() }, vec![0.0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guest::{Answer, Array, Guest};
    use serde_json::{Map, Value};

    /// `gain * picture`, whose gain moves by plain descent.
    #[derive(Default)]
    struct Gain(Mutex<Inner>);

    #[derive(Default)]
    struct Inner {
        gain: f32,
        seen: Vec<f32>,
        shape: Vec<usize>,
        gradient: f32,
        calls: Vec<&'static str>,
        breaks: Option<Array>,
    }

    impl Guest for Arc<Gain> {
        fn call(&self, call: &Call) -> Result<Answer, GuestError> {
            let mut inner = self.0.lock().unwrap();
            inner.calls.push(call.method);
            let plane = |shape: &[usize]| shape[2] * shape[3];
            let array = |values: Vec<f32>, shape: Vec<usize>| Answer {
                arrays: vec![Array { values, shape }],
                ..Answer::default()
            };
            match call.method {
                "forward" => {
                    if let Some(wrong) = inner.breaks.take() {
                        return Ok(Answer { arrays: vec![wrong], ..Answer::default() });
                    }
                    let x = &call.arrays[0];
                    (inner.seen, inner.shape) = (x.values.to_vec(), x.shape.clone());
                    let picture = &x.values[..3 * plane(&x.shape)];
                    let finished = picture.iter().map(|v| inner.gain * v).collect();
                    Ok(array(finished, vec![1, 3, x.shape[2], x.shape[3]]))
                }
                "backward" => {
                    let cotangent = call.arrays[0].values;
                    inner.gradient = cotangent.iter().zip(&inner.seen).map(|(c, x)| c * x).sum();
                    let mut back: Vec<f32> = cotangent.iter().map(|c| inner.gain * c).collect();
                    back.resize(inner.seen.len(), 0.0);
                    Ok(array(back, inner.shape.clone()))
                }
                "step" => {
                    inner.gain -= call.number.unwrap() as f32 * inner.gradient;
                    Ok(Answer::default())
                }
                "save" => Ok(Answer { bytes: inner.gain.to_le_bytes().to_vec(), ..Answer::default() }),
                _ => {
                    inner.gain = f32::from_le_bytes(call.bytes.unwrap().try_into().unwrap());
                    Ok(Answer::default())
                }
            }
        }
    }

    struct Home(Arc<Gain>);

    impl Host for Home {
        fn make(
            &self,
            _: &str,
            role: Role,
            arguments: &Map<String, Value>,
        ) -> Result<(Arc<dyn Guest>, Value), GuestError> {
            assert_eq!((role, &arguments["channels"]), (Role::Network, &json!(8)));
            self.0.0.lock().unwrap().gain = arguments["gain"].as_f64().unwrap() as f32;
            Ok((Arc::new(self.0.clone()), Value::Null))
        }
    }

    fn class(options: Value) -> GuestClass {
        let Value::Object(options) = options else { panic!() };
        GuestClass { class: "nets:Gain".to_owned(), options }
    }

    fn network(gain: f32) -> (Arc<Gain>, Arc<GuestNetwork>) {
        let home = Home(Arc::default());
        let made = GuestNetwork::new(&home, &class(json!({"gain": gain})), GuestNetwork::channels(true), 1);
        (home.0, Arc::new(made.unwrap()))
    }

    fn input(device: &Device) -> NetworkInput {
        let plane = |channels: usize, of: f32| Tensor::<4>::full([1, channels, 2, 2], of, device);
        NetworkInput {
            developed: plane(3, 0.5),
            restored: Some(plane(3, 2.0)),
            field: plane(1, 0.1),
            noise: plane(1, 0.2),
        }
    }

    #[test]
    fn weights_learn_on_the_tape_and_come_back_from_their_bytes() {
        let device = Device::flex().autodiff();
        let (gain, network) = network(1.0);
        let seen = input(&device);
        let kept = network.save().unwrap();
        // Only the weights are on the tape.
        let loss = network.attached(false, &device).finish(&seen).sum();
        assert_eq!(loss.clone().into_data().try_to_vec::<f32>().unwrap(), [24.0]);
        loss.backward();
        network.step(0.5).unwrap();
        network.check().unwrap();
        // dL/dgain is the sum of the picture, 24.
        assert_eq!(gain.0.lock().unwrap().gain, 1.0 - 12.0);
        network.load(&kept).unwrap();
        assert_eq!(gain.0.lock().unwrap().gain, 1.0);
        // The planes in their order.
        let planes: Vec<f32> = gain.0.lock().unwrap().seen.iter().step_by(4).copied().collect();
        assert_eq!(planes, [2.0, 2.0, 2.0, 0.1, 0.2, 0.5, 0.5, 0.5]);
    }

    #[test]
    fn a_held_network_leads_to_the_picture_alone_and_an_earlier_pass_is_made_again() {
        let device = Device::flex().autodiff();
        let (gain, network) = network(3.0);
        let mut seen = input(&device);
        let held = network.attached(true, &device);
        let _untracked = held.finish(&seen);
        assert_eq!(gain.0.lock().unwrap().calls, ["forward"]);
        let restored = seen.restored.take().unwrap().require_grad();
        seen.restored = Some(restored.clone());
        let loss = held.finish(&seen).sum();
        let _later = held.finish(&input(&device));
        let gradients = loss.backward();
        let by_picture = restored.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap();
        assert_eq!(by_picture, [3.0; 12]);
        let calls = gain.0.lock().unwrap().calls.clone();
        assert_eq!(calls, ["forward", "forward", "forward", "forward", "backward"]);
    }

    #[test]
    fn what_it_may_not_give_is_kept_as_the_first_fault() {
        let device = Device::flex().autodiff();
        let nan = Array { values: [&[0.0; 11][..], &[f32::NAN]].concat(), shape: vec![1, 3, 2, 2] };
        let small = Array { values: vec![0.0; 4], shape: vec![1, 1, 2, 2] };
        for (wrong, says) in [(nan, "NaN at element 11"), (small, "shape [1, 1, 2, 2], not [1, 3, 2, 2]")] {
            let (gain, network) = network(1.0);
            gain.0.lock().unwrap().breaks = Some(wrong);
            let attached = network.attached(false, &device);
            let loss = attached.finish(&input(&device)).sum();
            let fault = network.check().unwrap_err().to_string();
            assert!(fault.starts_with("`nets:Gain.forward` gives") && fault.contains(says), "{fault}");
            // Nothing is called after it.
            loss.backward();
            assert_eq!(gain.0.lock().unwrap().calls, ["forward"]);
            assert_eq!(attached.check().unwrap_err().to_string(), fault);
        }
    }

    #[test]
    fn an_option_may_not_repeat_what_is_given_anyway() {
        let home = Home(Arc::default());
        let made = GuestNetwork::new(&home, &class(json!({"seed": 3})), 8, 1);
        assert!(made.err().unwrap().to_string().contains("itself gives the argument `seed`"));
    }
}
