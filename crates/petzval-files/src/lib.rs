//! File formats: bytes in, values out, and every error with its place in the file.

pub mod agf;
pub mod coco;
mod decimal;
mod draft;
mod encoding;
mod export;
mod exr_layers;
mod field_weights;
mod file_schemas;
mod float_file;
mod glass_file;
mod glass_toml;
mod impossible;
pub mod isp_file;
mod label_image;
pub mod lens_toml;
mod limits;
mod loss;
mod npy_array;
mod old_glass;
mod operand_toml;
pub mod optics_proxy_file;
pub mod optiland;
mod picture_file;
mod picture_set;
pub mod psf_file;
pub mod quantum_efficiency;
pub mod raw_file;
pub mod rii;
pub mod sensor;
pub mod seq;
mod spanned;
pub mod spectral_file;
mod tolerance_toml;
mod toml_number;
mod wavelength;
mod yaml;
mod ycbcr_file;
pub mod zmx;

pub use agf::parse_agf;
pub use draft::{Import, with_open_surfaces};
pub use encoding::decode;
pub use export::Export;
pub use field_weights::{MOST_FIELD_WEIGHT, WeightFault, uneven_weights};
pub use file_schemas::{FileSchema, ForeignRecords, file_schemas};
pub use float_file::{exr_bytes, npy_bytes, save_exr, save_npy};
pub use glass_file::{GlassFile, GlassWarning, Refused};
pub use glass_toml::{is_meant_as_catalog, parse_catalog, write_catalog};
pub use label_image::{LabelImage, index_png_bytes, load_label_image};
pub use lens_toml::{
    Expect, Expected, ExpectedSpots, LensFile, lens_schema, parse_lens, parse_lens_start, write_lens,
};
pub use loss::{Effect, Loss};
pub use npy_array::FloatType;
pub use operand_toml::{Figure, Operand, OperandFile, parse_operands};
pub use optiland::{parse_optiland, parse_optiland_start};
pub(crate) use picture_file::undecoded;
pub use picture_file::{
    ImageError, PICTURE_ENDINGS, Picture, PictureNotes, encoded_png_bytes, is_picture_turned, load_image,
    load_image_bytes, picture_size, picture_statements, png_bytes, save_png, save_png16,
};
pub use picture_set::{
    CheckedPicture, CheckedPictures, CheckedSize, FoundPictures, PictureSetError, Stamp, StoredPicture,
    UnreadPicture, check_stored, check_stored_up_to, digests_of_alike, hex_digest, stored_pictures,
};
pub use quantum_efficiency::{parse_quantum_efficiency, parse_quantum_efficiency_toml};
pub use rii::parse_rii;
pub use sensor::parse_sensor;
pub use seq::{parse_seq, parse_seq_start, write_seq};
pub use tolerance_toml::{ToleranceFile, parse_tolerances, write_tolerances};
pub use wavelength::{OPTICAL_UM, wavelength_hint, wavelength_message};
pub use ycbcr_file::{y4m_bytes, yuv_bytes};
pub use zmx::{parse_zmx, parse_zmx_start, write_zmx};
