//! Files for other programs: the two lists of captures, and results as XML as the EMVA 1288 Python library writes them.
//!
//! | file | holds |
//! |---|---|
//! | `manifest` | `captures.toml`: our list of captures |
//! | `descriptor` | `EMVA1288descriptor.txt`: that of the library |
//! | `result_xml` | the [figures](super::figures) as XML, in the library's sections |

pub mod descriptor;
pub mod manifest;
pub mod result_xml;
