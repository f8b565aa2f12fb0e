//! Waiting for what another program does.

use std::time::{Duration, Instant};

/// Looks again and again until something holds. Afterwards it is an error that says what has not come.
pub fn until(
    what: &str,
    patience: Duration,
    mut holds: impl FnMut() -> Result<bool, String>,
) -> Result<(), String> {
    let began = Instant::now();
    while !holds()? {
        if began.elapsed() > patience {
            return Err(format!("waited {} s in vain for {what}", patience.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}
