//! Trees of arbitrary bits: built in some way, refitted to other bits, asked with tiles and with rays.
#![no_main]

use std::sync::Arc;

use heliostat_kernel::{
    BuildOptions, Hit, KdOptions, KdTree, Layout, Mesh, Object, Ray, RayQuery, Tile, TriangleBvh, World,
    glam::Vec3,
};
use libfuzzer_sys::fuzz_target;

/// Takes numbers off the front of the input; zeros after its end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        first
    }

    /// Any bits, or a small number, which makes shared planes, points and lines likely.
    fn float(&mut self) -> f32 {
        match self.byte() {
            small @ 0..192 => f32::from(small) / 16.0 - 6.0,
            _ => f32::from_bits(u32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()])),
        }
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }
}

fn mesh(bytes: &mut Bytes<'_>, indices: &[[u32; 3]]) -> Mesh {
    let positions: Vec<Vec3> = (0..24).map(|_| bytes.vector()).collect();
    Mesh::new(positions, indices)
}

fn check(ray: &Ray, hit: &Hit, triangles: usize) {
    if !hit.is_hit() {
        assert_eq!(*hit, Hit::MISS);
        return;
    }
    assert!(hit.t > ray.t_min.max(0.0) && hit.t < ray.t_max, "{ray:?} {hit:?}");
    assert!(hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0 + f32::EPSILON, "{hit:?}");
    assert!(hit.geometry == 0 && (hit.primitive as usize) < triangles, "{hit:?}");
}

fn ask(object: Object, bytes: &mut Bytes<'_>, triangles: usize) {
    let world = World::new(Arc::new(object));
    let origin = bytes.vector();
    let mut tile = Tile::new(origin);
    let mut rays = Vec::new();
    for i in 0..40 {
        let from = if i % 2 == 0 { origin } else { bytes.vector() };
        let ray = Ray { origin: from, t_min: bytes.float(), direction: bytes.vector(), t_max: bytes.float(), time: 0.0 };
        tile.push_interval(ray.direction, ray.t_min, ray.t_max);
        rays.push(ray);
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    world.intersect(&rays, &mut hits);
    world.occluded(&rays, &mut occluded);
    rays.iter().zip(&hits).for_each(|(ray, hit)| check(ray, hit, triangles));
    world.intersect_tile(&tile, &mut hits);
    world.occluded_tile(&tile, &mut occluded);
    for (i, hit) in hits.iter().enumerate() {
        check(&tile.ray(i).unwrap(), hit, triangles);
    }
}

fuzz_target!(|data: &[u8]| {
    let mut bytes = Bytes(data);
    let mut options = match bytes.byte() % 3 {
        0 => BuildOptions::default(),
        1 => BuildOptions::fast(),
        _ => BuildOptions::quality(),
    };
    if bytes.byte() % 2 == 1 {
        options.layout = Layout::Compact;
    }
    let count = usize::from(bytes.byte() % 64);
    let indices: Vec<[u32; 3]> =
        (0..count).map(|_| [bytes.byte(), bytes.byte(), bytes.byte()].map(|i| u32::from(i % 24))).collect();
    let before = mesh(&mut bytes, &indices);
    if bytes.byte() % 4 == 0 {
        let tree = KdTree::build(&[before], &KdOptions::default()).unwrap();
        return ask(Object::new(Some(tree.into()), Vec::new()).unwrap(), &mut bytes, count);
    }
    let mut tree = TriangleBvh::build(&[before], &options).unwrap();
    for _ in 0..bytes.byte() % 3 {
        tree.refit(&[mesh(&mut bytes, &indices)]).unwrap();
    }
    ask(Object::new(Some(tree.into()), Vec::new()).unwrap(), &mut bytes, count);
});
