//! Surfaces over grids: from canonical bytes and files alone, the same picture.

use field::Op;
use model::{Digest, ImageNumber};
use scene::Description;
use scene::description::AssetRef;

use super::scenes;
use crate::{Assets, EvalSettings, ImageRenderer, RenderError};

/// z − grid(p + (8, 4, 0)): a hill of a file of samples, before the camera.
fn hill() -> (Description, Vec<u8>) {
    let mut bytes = b"flyby-grid 1\n16 16\n".to_vec();
    for y in 0..16u8 {
        for x in 0..16u8 {
            let far = (f32::from(x) - 8.0).abs() + (f32::from(y) - 8.0).abs();
            let height = if far < 4.0 { 1.5 - 0.3 * far } else { 0.0 };
            bytes.extend(height.to_le_bytes());
        }
    }
    let mut scene = scenes::plane();
    let graph = &mut scene.surface.graph;
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    let parts = [8.0, 4.0, 0.0].map(|part| graph.constant(part).unwrap());
    let middle = graph.push(Op::Vector, &parts, &[]).unwrap();
    let place = graph.push(Op::VectorAdd, &[p, middle], &[]).unwrap();
    let height = graph.push(Op::Grid, &[place], &[0.0, 1.0, 3.0]).unwrap();
    let z = graph.push(Op::Z, &[p], &[]).unwrap();
    scene.surface.field = graph.push(Op::Sub, &[z, height], &[]).unwrap();
    scene.surface.bound = scene::description::Bound::Slab {
        low: -1.0,
        high: 2.0,
    };
    scene.assets.push(AssetRef {
        name: "hill.grid".to_owned(),
        digest: Digest([7; 32]),
        bytes: bytes.len() as u64,
    });
    (scene, bytes)
}

fn picture(scene: &Description, assets: &Assets) -> Result<Vec<f32>, RenderError> {
    let renderer = ImageRenderer::new(scene, assets, ImageNumber(0), EvalSettings::default())?;
    Ok(scenes::block(&renderer, scene.film.resolution.rect()).0)
}

#[test]
fn a_worker_sees_what_the_submitter_saw() {
    let (scene, bytes) = hill();
    let mut assets = Assets::new();
    assets.insert(Digest([7; 32]), bytes.into());
    let seen = picture(&scene, &assets).unwrap();
    let sent = Description::from_bytes(&scene.to_bytes().unwrap()).unwrap();
    assert!(sent.surface.graph.files().is_empty());
    assert_eq!(picture(&sent, &assets).unwrap(), seen);
    assert_ne!(picture(&scenes::plane(), &assets).unwrap(), seen);
}

#[test]
fn a_grid_that_is_not_there_is_said_so() {
    let (mut scene, _) = hill();
    let missing = picture(&scene, &Assets::new()).unwrap_err();
    assert!(missing.to_string().contains("hill.grid"), "{missing}");
    // Another digest: files are kept by it.
    scene.assets[0].digest = Digest([8; 32]);
    let mut assets = Assets::new();
    assets.insert(Digest([8; 32]), b"no grid".to_vec().into());
    let refused = picture(&scene, &assets).unwrap_err();
    assert!(refused.to_string().contains("no grid"), "{refused}");
}
