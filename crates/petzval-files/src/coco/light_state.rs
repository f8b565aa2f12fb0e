//! The states of a traffic light, as classes and the attribute `state` name them.

/// The states of a traffic light.
pub const LIGHT_STATES: [&str; 4] = ["red", "yellow", "green", "off"];

/// The place in [`LIGHT_STATES`] of the state that a text names: an attribute (`red`), or a class (`traffic light red`).
pub fn light_state(text: &str) -> Option<usize> {
    let mut words = text.split(|c: char| !c.is_alphanumeric());
    words.find_map(|word| LIGHT_STATES.iter().position(|state| word.eq_ignore_ascii_case(state)))
}
