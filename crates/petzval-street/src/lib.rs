//! Streets by seed, shown to a camera: data on which detectors are trained and lenses are designed, made when needed and never
//! stored.
//!
//! A [`Street`] is a place in metres and candela: a road with houses, trees, vehicles, people and traffic lights, in daylight, at
//! dusk or at night. [`Street::see`] looks at it through the [`Projection`] of a lens and returns linear light, with exact boxes
//! of everything a detector looks for. A shorter lens makes things smaller and the field wider.
//!
//! | module | holds |
//! |---|---|
//! | `plan`, `make/` | what stands where, by seed and moment; generators of objects in families of shapes |
//! | `shape`, `object` | convex solids, and objects put together from them |
//! | [`SurfaceClass`] | what a surface is to a segmentation |
//! | `surface`, `material`, `texture`, `facade`, `road` | reflectance, gloss and light of surfaces |
//! | `sky`, `light`, `lamps`, `shadow`, `contact` | what lights them |
//! | `projection`, `pose`, `window` | the camera |
//! | `see`, `shade`, `seen` | the picture, and what is in it |
//!
//! ```
//! use petzval_street::{Light, Projection, Street, StreetSettings, Window};
//!
//! let street = Street::new(&StreetSettings::new(7, Light::Day));
//! let projection = Projection::rectilinear(4266.0, 1200.0, 1200, 1920)?;
//! let window = Window { row: 600, col: 900, height: 8, width: 8 };
//! let seen = street.see(&projection, &street.pose(), window, 2)?;
//! assert_eq!(seen.planes.len(), 3 * 8 * 8);
//! # Ok::<(), petzval_street::StreetError>(())
//! ```

mod colour;
mod contact;
mod error;
mod facade;
mod families;
mod lamps;
mod light;
mod make;
mod material;
mod noise;
mod object;
mod plan;
mod pose;
mod projection;
mod road;
mod see;
mod seen;
mod settings;
mod shade;
mod shadow;
mod shape;
mod sky;
mod street;
mod surface;
mod surface_class;
mod texture;
mod vector;
mod window;

pub use error::StreetError;
pub use families::Families;
pub use light::{LampColours, LampState, Light};
pub use object::ObjectKind;
pub use pose::Pose;
pub use projection::Projection;
pub use seen::{NearObject, Seen, SeenObject};
pub use settings::StreetSettings;
pub use street::Street;
pub use surface_class::SurfaceClass;
pub use window::Window;
