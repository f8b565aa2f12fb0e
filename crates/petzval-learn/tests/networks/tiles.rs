//! Tests of frames in tiles.

use burn::prelude::*;
use petzval_learn::network::NetworkKind;
use petzval_learn::network::{NetworkInput, PictureNetwork, Reach, Segmenter, in_tiles, in_tiles_of};

use crate::support::{largest_difference, random, shaken};

#[test]
fn a_frame_in_tiles_is_that_of_the_whole() {
    let device = Device::flex();
    let (height, width) = (150, 97);
    let input = NetworkInput {
        developed: random([2, 3, height, width], 1, &device),
        restored: Some(random([2, 3, height, width], 2, &device)),
        field: random([2, 1, height, width], 3, &device),
        noise: random([2, 1, height, width], 4, &device) * 0.02,
    };
    for kind in [NetworkKind::UNet, NetworkKind::Restoration, NetworkKind::RestorationNaf] {
        let network = shaken(kind.init(8, 2, 5, &device).unwrap(), 0.2);
        let whole = network.finish(&input);
        let reach = network.reach().unwrap();
        let tiled = |side, reach| in_tiles(&input, side, reach, |tile| network.finish(tile));
        for side in [40, 64, 1000] {
            let apart = largest_difference(tiled(side, reach), whole.clone());
            assert!(apart < 1e-5, "{kind:?}, tiles of {side}: {apart}");
        }
        // Tiles that see less have seams.
        let seams = largest_difference(tiled(40, Reach { pixels: 0, ..reach }), whole);
        assert!(seams > 1e-2, "{kind:?}: {seams}");
    }
}

#[test]
fn the_classes_of_a_frame_in_tiles_are_those_of_the_whole() {
    let device = Device::flex();
    let pictures = random([2, 3, 150, 97], 1, &device);
    let network = shaken(Segmenter::init(5, 8, 2, 5, &device).unwrap(), 0.2);
    let whole = network.forward(pictures.clone());
    assert_eq!(whole.dims(), [2, 5, 150, 97]);
    let tiled = in_tiles_of(pictures.clone(), 40, network.reach(), |tile| network.forward(tile));
    assert!(largest_difference(tiled, whole.clone()) < 1e-5);
    assert!(largest_difference(network.forward_in_tiles(pictures), whole) < 1e-6);
}
