//! Takes connections, and gives each a thread.

use std::net::{Shutdown, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use crate::routes;
use crate::shared::Shared;

/// Serves every connection until the connections are stopped, and one more comes.
pub fn serve(listener: &TcpListener, shared: &Arc<Shared>) {
    for (number, stream) in (0_u64..).zip(listener.incoming()) {
        if shared.connections.are_stopped() {
            return;
        }
        let Ok(stream) = stream else {
            // No descriptor may be free for the moment.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        if shared.connections.add(number, &stream).is_err() {
            continue;
        }
        let served = shared.clone();
        let work = move || {
            // A browser that has gone meanwhile is no failure.
            let _gone = routes::answer(&stream, number, &served);
            let _gone = stream.shutdown(Shutdown::Both);
            served.connections.remove(number);
        };
        if std::thread::Builder::new().name("studio page".to_owned()).spawn(work).is_err() {
            shared.connections.remove(number);
        }
    }
}
