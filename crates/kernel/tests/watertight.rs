//! Closed meshes hold every ray that starts inside, aimed exactly at edges and vertices: zero leaks.
mod common;
use std::{f32::consts::TAU, sync::Arc};

use common::{ACCELERATORS, HIERARCHIES, MakeObject, Rng, hunt, kd_object, object};
use heliostat_kernel::{
    Hit, Instance, Isa, Mesh, Object, Ray, RayQuery, Tile, World,
    glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A},
};

/// A sphere of latitude bands with irregular radii, so that no two edges line up; closed, poles are single vertices.
fn bumpy_sphere(rng: &mut Rng, bands: u32, sides: u32, radius: f32, center: Vec3) -> Mesh {
    let mut positions = vec![center + Vec3::Y * radius];
    for band in 1..bands {
        for side in 0..sides {
            let theta = std::f32::consts::PI * band as f32 / bands as f32;
            let phi = TAU * side as f32 / sides as f32;
            let r = radius * (1.0 + 0.1 * rng.unit());
            let p = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            positions.push(center + p * r);
        }
    }
    positions.push(center - Vec3::Y * radius);
    let last = positions.len() as u32 - 1;
    let at = |band: u32, side: u32| 1 + (band - 1) * sides + side % sides;
    let mut indices = Vec::new();
    for side in 0..sides {
        indices.push([0, at(1, side), at(1, side + 1)]);
        indices.push([last, at(bands - 1, side + 1), at(bands - 1, side)]);
        for band in 1..bands - 1 {
            let (a, b) = (at(band, side), at(band, side + 1));
            let (c, d) = (at(band + 1, side), at(band + 1, side + 1));
            indices.extend([[a, c, b], [b, c, d]]);
        }
    }
    Mesh::new(positions, indices)
}

/// A box whose faces are grids: all triangles of a face are coplanar and face planes are axis-aligned.
fn tessellated_box(cells: u32, half: f32, center: Vec3) -> Mesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for face in 0..6_usize {
        let axis = face / 2;
        let start = positions.len() as u32;
        for j in 0..=cells {
            for i in 0..=cells {
                let along = |k: u32| half * (2.0 * k as f32 / cells as f32 - 1.0);
                let mut p = [0.0; 3];
                p[axis] = if face % 2 == 0 { -half } else { half };
                p[(axis + 1) % 3] = along(i);
                p[(axis + 2) % 3] = along(j);
                positions.push(center + Vec3::from_array(p));
            }
        }
        for j in 0..cells {
            for i in 0..cells {
                let a = start + j * (cells + 1) + i;
                let (b, c, d) = (a + 1, a + cells + 1, a + cells + 2);
                indices.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
    Mesh::new(positions, indices)
}

/// Points on the surface where leaks would be: vertices, edge midpoints, and odd points of edges.
fn seams(rng: &mut Rng, mesh: &Mesh) -> Vec<Vec3> {
    let mut points = mesh.positions.to_vec();
    for triangle in mesh.indices.iter() {
        for k in 0..3 {
            let a = mesh.positions[triangle[k] as usize];
            let b = mesh.positions[triangle[(k + 1) % 3] as usize];
            points.push((a + b) * 0.5);
            points.push(a + (b - a) * rng.unit());
        }
    }
    points
}

fn assert_no_leak(accelerators: &[MakeObject], mesh: &Mesh, origins: &[Vec3], targets: &[Vec3]) {
    for object in accelerators {
        assert_no_leak_in(&object(std::slice::from_ref(mesh)), origins, targets);
    }
}

fn assert_no_leak_in(root: &Arc<Object>, origins: &[Vec3], targets: &[Vec3]) {
    for isa in Isa::available() {
        let world = World::with_isa(root.clone(), isa).expect("available");
        for &origin in origins {
            let rays: Vec<Ray> = targets.iter().map(|&p| Ray::new(origin, p - origin)).collect();
            let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
            world.intersect(&rays, &mut hits);
            world.occluded(&rays, &mut occluded);
            for (i, ray) in rays.iter().enumerate() {
                assert!(hits[i].is_hit(), "{isa}: batch ray leaks: {ray:?}");
                assert!(occluded[i], "{isa}: batch shadow ray leaks: {ray:?}");
            }
            let mut tile = Tile::new(origin);
            for chunk in targets.chunks(Tile::CAPACITY) {
                tile.clear();
                for &p in chunk {
                    tile.push(p - origin, f32::INFINITY);
                }
                let (mut hits, mut occluded) = (vec![Hit::MISS; chunk.len()], vec![false; chunk.len()]);
                world.intersect_tile(&tile, &mut hits);
                world.occluded_tile(&tile, &mut occluded);
                for i in 0..chunk.len() {
                    assert!(hits[i].is_hit(), "{isa}: tile ray leaks: {:?}", tile.ray(i));
                    assert!(occluded[i], "{isa}: tile shadow ray leaks: {:?}", tile.ray(i));
                }
            }
        }
    }
}

fn inner_points(rng: &mut Rng, count: usize, radius: f32, center: Vec3) -> Vec<Vec3> {
    (0..count).map(|i| if i == 0 { center } else { center + rng.vec() * radius * 0.5 }).collect()
}

#[test]
fn spheres_hold_rays_at_their_seams() {
    let mut rng = Rng::new(21);
    for (radius, center) in
        [(1.0, Vec3::ZERO), (1.0e-4, Vec3::splat(0.3)), (2.0e4, Vec3::new(1e4, -3e3, 77.0))]
    {
        let mesh = bumpy_sphere(&mut rng, 24, 31, radius, center);
        let targets = seams(&mut rng, &mesh);
        let origins = inner_points(&mut rng, 6, radius, center);
        assert_no_leak(&ACCELERATORS, &mesh, &origins, &targets);
    }
}

#[test]
fn coarse_and_fine_solids_hold_rays() {
    let mut rng = Rng::new(22);
    for ((bands, sides), object) in
        [(2, 3), (3, 4), (80, 90), (20, 30), (40, 20)].into_iter().zip(HIERARCHIES.into_iter().cycle())
    {
        let mesh = bumpy_sphere(&mut rng, bands, sides, 3.0, Vec3::new(5.0, 6.0, -7.0));
        let mut targets = seams(&mut rng, &mesh);
        if targets.len() > 20_000 {
            targets = (0..20_000).map(|_| targets[rng.below(targets.len())]).collect();
        }
        let origins = inner_points(&mut rng, 2, 1.0, Vec3::new(5.0, 6.0, -7.0));
        assert_no_leak(&[object, kd_object], &mesh, &origins, &targets);
    }
}

#[test]
fn boxes_hold_rays_along_their_axes_and_seams() {
    let mut rng = Rng::new(23);
    let solids = [
        (1, 1.0, Vec3::ZERO),
        (10, 1.0, Vec3::ZERO),
        (7, 0.3, Vec3::new(100.0, 2.0, -9.0)),
        (9, 20.0, Vec3::new(-3.0, 2.0, 1.0)),
    ];
    for ((cells, half, center), object) in solids.into_iter().zip(HIERARCHIES.into_iter().cycle()) {
        let mesh = tessellated_box(cells, half, center);
        let targets = seams(&mut rng, &mesh);
        let mut origins = inner_points(&mut rng, 4, half, center);
        // On the grid lines themselves: rays run exactly along edges' planes and axes.
        let step = 2.0 * half / cells as f32;
        origins.push(center + Vec3::new(0.0, step * (cells / 4) as f32, 0.0));
        assert_no_leak(&[object, kd_object], &mesh, &origins, &targets);
    }
}

#[test]
fn placed_solids_hold_rays() {
    let mut rng = Rng::new(24);
    let mesh = bumpy_sphere(&mut rng, 16, 19, 1.0, Vec3::ZERO);
    let shear =
        Mat3A::from_cols(Vec3A::new(2.0, 0.3, 0.0), Vec3A::new(-0.4, 0.7, 0.1), Vec3A::new(0.0, 0.2, -1.5));
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::new(3.0, 4.0, 5.0));
    let place = turn * Affine3A { matrix3: shear, translation: Vec3A::ZERO };
    let targets: Vec<Vec3> = seams(&mut rng, &mesh).into_iter().map(|p| place.transform_point3(p)).collect();
    let origins: Vec<Vec3> =
        inner_points(&mut rng, 4, 1.0, Vec3::ZERO).into_iter().map(|p| place.transform_point3(p)).collect();
    for object in ACCELERATORS {
        let inner = object(std::slice::from_ref(&mesh));
        let placed = vec![Instance { object: inner, parent_from_object: place, motion: None, id: 9 }];
        assert_no_leak_in(&Arc::new(Object::new(None, placed).expect("valid")), &origins, &targets);
    }
}

/// Solids of many shapes, sizes and places, a few of them; `HELIOSTAT_HUNT` sets how many, to hunt for rare leaks.
#[test]
fn many_solids_hold_rays() {
    let mut rng = Rng::new(25);
    for (_, object) in (0..hunt(8)).zip(HIERARCHIES.into_iter().cycle()) {
        let radius = 10.0_f32.powf(rng.signed() * 5.0);
        let center = rng.vec() * radius * 10.0_f32.powf(rng.signed() * 1.5);
        let mesh = if rng.unit() < 0.7 {
            let bands = 2 + rng.below(40) as u32;
            bumpy_sphere(&mut rng, bands, 40, radius, center)
        } else {
            tessellated_box(12, radius, center)
        };
        let targets = seams(&mut rng, &mesh);
        // Few bands make a double cone: stay well inside that too.
        let origins = inner_points(&mut rng, 4, radius * 0.4, center);
        assert_no_leak(&[object, kd_object], &mesh, &origins, &targets);
    }
}

/// Rays that leave a convex body of slivers never meet it again, although the distances to a sliver are mostly rounding.
#[test]
fn slivers_do_not_stop_what_leaves_them() {
    let mut rng = Rng::new(21);
    let (sides, length) = (1024_u32, 6.0);
    let point = |i: u32| {
        let (s, c) = ((i / 2) as f32 * TAU / sides as f32).sin_cos();
        Vec3::new(if i.is_multiple_of(2) { 0.0 } else { length }, c, s)
    };
    let indices: Vec<_> = (0..sides)
        .flat_map(|i| {
            let [a, b] = [2 * i, 2 * ((i + 1) % sides)];
            [[a, b, b + 1], [a, b + 1, a + 1]]
        })
        .collect();
    let mesh = Mesh::new((0..2 * sides).map(point).collect::<Vec<_>>(), indices);
    for isa in Isa::available() {
        let world = World::with_isa(object(std::slice::from_ref(&mesh)), isa).expect("available");
        let mut rays = Vec::new();
        while rays.len() < 4096 {
            let triangle = mesh.indices[rng.below(mesh.indices.len())];
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let (u, v) = (rng.unit(), rng.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let out = Vec3::new(0.0, a.y + b.y + c.y, a.z + b.z + c.z).normalize();
            let direction = rng.vec().normalize();
            // As far off the surface as the rounding of a position on it.
            let origin = a + (b - a) * u + (c - a) * v + out * 4.0e-6;
            // Steep enough that the neighbours, which bend away, are no matter of rounding either.
            if direction.dot(out) > 0.02 {
                rays.push(Ray::new(origin, direction));
            }
        }
        let mut hits = vec![Hit::MISS; rays.len()];
        world.intersect(&rays, &mut hits);
        let met = hits.iter().filter(|hit| hit.is_hit()).count();
        let mut alone = vec![false; rays.len()];
        for (ray, dark) in rays.chunks(1).zip(alone.chunks_mut(1)) {
            world.occluded(ray, dark);
        }
        let mut tiles = 0;
        for ray in rays.iter().take(512) {
            let mut tile = Tile::new(ray.origin);
            (0..8).for_each(|i| _ = tile.push(ray.direction * (1.0 + i as f32), f32::INFINITY));
            let mut dark = [false; 8];
            world.occluded_tile(&tile, &mut dark);
            tiles += dark.iter().filter(|dark| **dark).count();
        }
        assert_eq!((met, alone.iter().filter(|dark| **dark).count(), tiles), (0, 0, 0), "{isa}");
    }
}
