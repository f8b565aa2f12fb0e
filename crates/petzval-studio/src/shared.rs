//! What all connections share.

use crate::calls::Calls;
use crate::connections::Connections;
use crate::folder::Folder;
use crate::gate::Gate;
use crate::opened::{First, Opened};
use crate::uploads::Uploads;

/// What all connections share.
pub struct Shared {
    /// Who is let in.
    pub gate: Gate,
    /// The jobs.
    pub calls: Calls,
    /// The folder.
    pub folder: Folder,
    /// What the studio was started with.
    pub opened: Vec<Opened>,
    /// What the page shows first.
    pub first: First,
    /// Pictures that pages have sent.
    pub uploads: Uploads,
    /// The connections that are open.
    pub connections: Connections,
}
