//! Cuts a mesh into objects: connected parts, of which large ones are cut up and small neighbours go together.

use std::collections::HashMap;

use heliostat::kernel::Mesh;
use heliostat::kernel::glam::Vec3;

/// Triangles that belong together.
struct Part {
    triangles: Vec<u32>,
    center: Vec3,
}

/// About `count` meshes that together are `mesh`, in an order that depends on it alone. Parts that share vertex
/// positions stay together unless they have more than twice their share of the triangles.
pub(crate) fn objects(mesh: &Mesh, count: usize) -> Vec<Mesh> {
    let most = 2 * mesh.indices.len().div_ceil(count.max(1)).max(1);
    let mut parts = Vec::new();
    for triangles in connected(mesh) {
        cut(mesh, triangles, most, &mut parts);
    }
    let mut groups = Vec::new();
    group(parts, count.max(1), &mut groups);
    groups.iter().map(|triangles| extract(mesh, triangles)).collect()
}

/// Triangles that hang together by vertices at equal positions.
fn connected(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut at_position = HashMap::new();
    let mut root: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for (vertex, p) in (0..).zip(mesh.positions.iter()) {
        let first = *at_position.entry(p.to_array().map(f32::to_bits)).or_insert(vertex);
        root[vertex as usize] = first;
    }
    for &[a, b, c] in mesh.indices.iter() {
        for (x, y) in [(a, b), (b, c)] {
            let (x, y) = (find(&mut root, x), find(&mut root, y));
            root[x.max(y) as usize] = x.min(y);
        }
    }
    let mut parts: Vec<Vec<u32>> = Vec::new();
    let mut number = HashMap::new();
    for (triangle, &[a, ..]) in (0..).zip(mesh.indices.iter()) {
        let next = parts.len();
        let part = *number.entry(find(&mut root, a)).or_insert(next);
        if part == next {
            parts.push(Vec::new());
        }
        parts[part].push(triangle);
    }
    parts
}

fn find(root: &mut [u32], mut vertex: u32) -> u32 {
    while root[vertex as usize] != vertex {
        root[vertex as usize] = root[root[vertex as usize] as usize];
        vertex = root[vertex as usize];
    }
    vertex
}

fn center(mesh: &Mesh, triangle: u32) -> Vec3 {
    mesh.corners(triangle as usize).map_or(Vec3::ZERO, |[a, b, c]| (a + b + c) / 3.0)
}

/// Halves by count, along the widest axis, what is larger than `most`.
fn cut(mesh: &Mesh, mut triangles: Vec<u32>, most: usize, parts: &mut Vec<Part>) {
    let middle = triangles.iter().map(|&t| center(mesh, t)).sum::<Vec3>() / triangles.len() as f32;
    if triangles.len() <= most {
        parts.push(Part { triangles, center: middle });
        return;
    }
    let spread = triangles.iter().map(|&t| (center(mesh, t) - middle).powf(2.0)).sum::<Vec3>();
    let axis = spread.max_position();
    let half = triangles.len() / 2;
    let key = |t: u32| (center(mesh, t)[axis], t);
    triangles.sort_unstable_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(a.cmp(&b)));
    let rest = triangles.split_off(half);
    cut(mesh, triangles, most, parts);
    cut(mesh, rest, most, parts);
}

/// Divides parts in space until each of `count` groups has some.
fn group(mut parts: Vec<Part>, count: usize, groups: &mut Vec<Vec<u32>>) {
    if count == 1 || parts.len() <= 1 {
        groups.push(parts.into_iter().flat_map(|part| part.triangles).collect());
        return;
    }
    let middle = parts.iter().map(|part| part.center).sum::<Vec3>() / parts.len() as f32;
    let spread = parts.iter().map(|part| (part.center - middle).powf(2.0)).sum::<Vec3>();
    let axis = spread.max_position();
    parts.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
    let half = (parts.len() * (count / 2) / count).max(1);
    let rest = parts.split_off(half);
    group(parts, count / 2, groups);
    group(rest, count - count / 2, groups);
}

/// A mesh of some triangles, with the vertices that they need.
fn extract(mesh: &Mesh, triangles: &[u32]) -> Mesh {
    let mut number = HashMap::new();
    let mut positions = Vec::new();
    let indices = triangles.iter().map(|&triangle| {
        mesh.indices[triangle as usize].map(|vertex| {
            *number.entry(vertex).or_insert_with(|| {
                positions.push(mesh.positions[vertex as usize]);
                positions.len() as u32 - 1
            })
        })
    });
    let indices: Vec<_> = indices.collect();
    Mesh::new(positions, indices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_goes_to_one_object() {
        let (positions, indices) = super::super::terrain::make(2000);
        let mesh = Mesh::new(positions, indices);
        let sorted = |meshes: &[Mesh]| {
            let corners =
                |mesh: &Mesh| (0..mesh.indices.len()).filter_map(|i| mesh.corners(i)).collect::<Vec<_>>();
            let mut all: Vec<_> = meshes.iter().flat_map(corners).collect();
            all.sort_by_key(|t| t.map(|p| p.to_array().map(f32::to_bits)));
            all
        };
        for count in [1, 7, 100] {
            let objects = objects(&mesh, count);
            // None has more than twice its share.
            assert!((count.div_ceil(2)..=count).contains(&objects.len()), "{count}: {}", objects.len());
            assert_eq!(sorted(&objects), sorted(std::slice::from_ref(&mesh)));
        }
    }
}
