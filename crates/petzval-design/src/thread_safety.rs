//! What outlives a call may go from thread to thread: a server keeps it. The compiler checks this.

use crate::camera::Camera;
use crate::cameras::Cameras;
use crate::scoring::Scorer;
use crate::setup::Setup;

const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<Camera>();
    is_shared::<Cameras>();
    is_shared::<Scorer>();
    is_shared::<Setup>();
};
