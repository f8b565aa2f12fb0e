//! The blocks of a camera in work.

use super::{Block, ExposureBlock, IspBlock, NetworkBlock, OpticsBlock};
use crate::camera::Camera;
use crate::experiment::BlockName;

/// The blocks of a variant, each with its present numbers.
pub struct Blocks {
    /// The lens.
    pub optics: OpticsBlock,
    /// The exposure.
    pub exposure: ExposureBlock,
    /// The hardware ISP.
    pub isp: IspBlock,
    /// The network.
    pub network: NetworkBlock,
}

impl Blocks {
    /// All blocks, in the order of the light.
    pub fn all(&self) -> [&dyn Block; 4] {
        [&self.optics, &self.exposure, &self.isp, &self.network]
    }

    /// All blocks, in the order of the light.
    pub fn all_mut(&mut self) -> [&mut dyn Block; 4] {
        [&mut self.optics, &mut self.exposure, &mut self.isp, &mut self.network]
    }

    /// A block by its name.
    pub fn get_mut(&mut self, name: BlockName) -> &mut dyn Block {
        match name {
            BlockName::Optics => &mut self.optics,
            BlockName::Exposure => &mut self.exposure,
            BlockName::Isp => &mut self.isp,
            BlockName::Network => &mut self.network,
        }
    }

    /// A camera with exposure, ISP and network as they stand, held.
    pub fn held(&self, camera: &Camera) -> Camera {
        let camera = self.network.attached_to(&camera.exposed_as(&self.exposure.exposure_in_work()));
        let Some(_) = camera.body().chip else { return camera };
        camera.with_chip(self.isp.held(&camera.body().device))
    }

    /// Starts a stage, in which the blocks that `moves` names move.
    pub fn begin_stage(&mut self, moves: impl Fn(BlockName) -> bool) {
        for block in self.all_mut() {
            block.begin_stage(moves(block.name()));
        }
    }
}
