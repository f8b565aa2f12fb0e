//! Where a panic began. Only the hook of panics knows it, in the thread where it happens; the caller gets its text alone.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{PanicHookInfo, set_hook, take_hook};
use std::sync::{Mutex, Once, PoisonError};

/// Panics whose places are remembered: as many as may happen at once in different threads.
const REMEMBERED: usize = 64;

/// Text and place of the last panics, the newest at the end.
static LAST: Mutex<VecDeque<(String, String)>> = Mutex::new(VecDeque::new());

/// From now on remembers where panics begin. The hook that was there before is called as well.
pub(crate) fn keep() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            remember(info);
            before(info);
        }));
    });
}

fn remember(info: &PanicHookInfo) {
    let Some(place) = info.location() else { return };
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if last.len() == REMEMBERED {
        last.pop_front();
    }
    last.push_back((text(info.payload()), place.to_string()));
}

/// The text of a panic, and where it began if that is remembered.
pub(crate) fn of(panic: &(dyn Any + Send)) -> (String, Option<String>) {
    let message = text(panic);
    let last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let place = last.iter().rev().find(|(other, _)| *other == message).map(|(_, place)| place.clone());
    (message, place)
}

fn text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given").to_owned()
}
