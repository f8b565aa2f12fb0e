//! What a task knows of the window of a shot. The camera carries it and does not look at it.

use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// The labels of a window, of the type that its task gave them. Cheap to clone.
#[derive(Clone, Default)]
pub struct Labels(Option<Arc<dyn Any + Send + Sync>>);

impl Labels {
    /// These labels.
    pub fn new<T: Any + Send + Sync>(labels: T) -> Self {
        Self(Some(Arc::new(labels)))
    }

    /// The labels, if they are of this type.
    pub fn of<T: Any>(&self) -> Option<&T> {
        self.0.as_ref()?.downcast_ref()
    }
}

impl fmt::Debug for Labels {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Labels(..)" } else { "Labels(none)" })
    }
}
