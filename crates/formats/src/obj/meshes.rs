//! From polygons with separate index streams to one indexed triangle mesh per material.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use heliostat_scene::Mesh;

use super::parse::{Corner, NONE, Obj, Polygon};
use crate::context::Context;
use crate::error::LoadError;
use crate::normals::corner_normals;
use crate::place::{Place, Snippet};
use crate::text::Lines;
use crate::triangulate::Triangulator;

/// Where a vertex has its normal from; corners that agree in this, position and coordinates are one vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum NormalSource {
    /// The mesh has no normals at all.
    None,
    /// `vn` of this index.
    Given(u32),
    /// The smoothing group.
    Group(u32),
    /// The polygon of this number, flat.
    Flat(u32),
}

/// A polygon with what follows from those before it.
#[derive(Clone, Copy)]
struct Numbered {
    polygon: Polygon,
    number: u32,
    /// Of its first triangle.
    triangle: usize,
}

/// The meshes by material, in order of first use, with the material's index in `obj.uses`.
pub(super) fn build(
    context: &mut Context<'_>,
    file: &Arc<str>,
    bytes: &[u8],
    obj: &Obj,
) -> Result<Vec<(usize, Mesh)>, LoadError> {
    check_indices(file, bytes, obj)?;
    let triangles = triangulate(context, file, obj)?;
    let smooth = smooth_normals(context, file, obj, &triangles)?;
    let mut by_material: Vec<Vec<Numbered>> = vec![Vec::new(); obj.uses.len()];
    context.charge_array(obj.polygons.len(), size_of::<Numbered>(), &Place::whole(file))?;
    for polygon in numbered(obj) {
        by_material[polygon.polygon.material as usize].push(polygon);
    }
    let mut meshes = Vec::new();
    for (used, polygons) in by_material.into_iter().enumerate().filter(|(_, p)| !p.is_empty()) {
        let part = Part::new(obj, &polygons);
        meshes.push((used, part.build(context, &obj.uses[used].place, &polygons, &triangles, &smooth)?));
    }
    Ok(meshes)
}

fn numbered(obj: &Obj) -> impl Iterator<Item = Numbered> {
    let mut triangle = 0;
    obj.polygons.iter().enumerate().map(move |(number, &polygon)| {
        let this = Numbered { polygon, number: number as u32, triangle };
        triangle += polygon.corners as usize - 2;
        this
    })
}

/// Refuses indices beyond the end of their array.
fn check_indices(file: &Arc<str>, bytes: &[u8], obj: &Obj) -> Result<(), LoadError> {
    let counts = [obj.positions.len(), obj.uvs.len(), obj.normals.len()];
    let beyond = |corner: &Corner| {
        let indices = [corner.position, corner.uv, corner.normal];
        (0..3)
            .find(|&i| indices[i] as usize >= counts[i] && (i == 0 || indices[i] != NONE))
            .map(|i| (i, indices[i]))
    };
    let mut first = 0;
    for polygon in &obj.polygons {
        let corners = &obj.corners[first..first + polygon.corners as usize];
        first += polygon.corners as usize;
        if let Some((kind, index)) = corners.iter().find_map(beyond) {
            let what = ["vertex", "texture coordinate", "normal"][kind];
            let problem =
                format!("the face refers to {what} {}, the file has {}", u64::from(index) + 1, counts[kind]);
            let error = LoadError::input(Place::text(file, polygon.line, 1), problem, "correct the index");
            let line = Lines::new(bytes).find(|line| line.number == polygon.line);
            return Err(match line {
                Some(line) => error.with_snippet(Snippet::new(&line.bytes, 0, line.bytes.len())),
                None => error,
            });
        }
    }
    Ok(())
}

/// Triangles of corner numbers, those of each polygon after those of the one before it.
fn triangulate(context: &mut Context<'_>, file: &Arc<str>, obj: &Obj) -> Result<Vec<[u32; 3]>, LoadError> {
    let count = obj.corners.len() - 2 * obj.polygons.len();
    context.charge_array(count, size_of::<[u32; 3]>(), &Place::whole(file))?;
    let mut triangles = Vec::with_capacity(count);
    let mut triangulator = Triangulator::default();
    let mut points = Vec::new();
    let mut first = 0u32;
    for polygon in &obj.polygons {
        let corners = &obj.corners[first as usize..(first + polygon.corners) as usize];
        points.clear();
        points.extend(corners.iter().map(|corner| obj.positions[corner.position as usize]));
        triangulator.triangulate(&points, |t| triangles.push(t.map(|i| first + i)));
        first += polygon.corners;
    }
    Ok(triangles)
}

/// Mean normals by position and smoothing group, over polygons with a group and without normals of their own.
fn smooth_normals(
    context: &mut Context<'_>,
    file: &Arc<str>,
    obj: &Obj,
    triangles: &[[u32; 3]],
) -> Result<HashMap<(u32, u32), Vec3>, LoadError> {
    let mut normals = HashMap::new();
    for Numbered { polygon, triangle, .. } in numbered(obj) {
        if polygon.smoothing == 0 {
            continue;
        }
        let of_polygon = &triangles[triangle..triangle + polygon.corners as usize - 2];
        if of_polygon.iter().flatten().all(|&i| obj.corners[i as usize].normal != NONE) {
            continue;
        }
        for triangle in of_polygon {
            let indices = triangle.map(|i| obj.corners[i as usize].position);
            let shares = corner_normals(indices.map(|i| obj.positions[i as usize]));
            for (index, share) in indices.into_iter().zip(shares) {
                *normals.entry((index, polygon.smoothing)).or_insert(Vec3::ZERO) += share;
            }
        }
    }
    normals.values_mut().for_each(|normal: &mut Vec3| *normal = normal.normalize_or_zero());
    context.charge_array(normals.len(), 32, &Place::whole(file))?;
    Ok(normals)
}

/// One material's mesh in the making.
struct Part<'o> {
    obj: &'o Obj,
    has_normals: bool,
    has_uvs: bool,
    vertices: HashMap<(u32, u32, NormalSource), u32>,
    mesh: Mesh,
    positions: Vec<Vec3>,
}

impl<'o> Part<'o> {
    fn new(obj: &'o Obj, polygons: &[Numbered]) -> Self {
        let smooth = polygons.iter().any(|p| p.polygon.smoothing != 0);
        // Whether the file has any at all; a part that uses none of them gets flat ones, which is the same picture.
        let has_normals = smooth || !obj.normals.is_empty();
        Self {
            obj,
            has_normals,
            has_uvs: !obj.uvs.is_empty(),
            vertices: HashMap::new(),
            mesh: Mesh::default(),
            positions: Vec::new(),
        }
    }

    fn build(
        mut self,
        context: &mut Context<'_>,
        place: &Place,
        polygons: &[Numbered],
        triangles: &[[u32; 3]],
        smooth: &HashMap<(u32, u32), Vec3>,
    ) -> Result<Mesh, LoadError> {
        let mut indices = Vec::new();
        let mut counted = (0, 0);
        for polygon in polygons {
            let last = polygon.triangle + polygon.polygon.corners as usize - 2;
            for triangle in &triangles[polygon.triangle..last] {
                indices.push(triangle.map(|corner| self.vertex(corner, polygon, *triangle, smooth)));
            }
            if self.positions.len() > counted.0 + 65536 {
                context.count_mesh(self.positions.len() - counted.0, indices.len() - counted.1, place)?;
                counted = (self.positions.len(), indices.len());
            }
        }
        context.count_mesh(self.positions.len() - counted.0, indices.len() - counted.1, place)?;
        let attributes = 12 * usize::from(self.has_normals) + 8 * usize::from(self.has_uvs) + 24;
        context.charge_array(self.positions.len(), attributes, place)?;
        self.mesh.positions = self.positions.into();
        self.mesh.indices = indices.into();
        Ok(self.mesh)
    }

    fn vertex(
        &mut self,
        corner: u32,
        polygon: &Numbered,
        triangle: [u32; 3],
        smooth: &HashMap<(u32, u32), Vec3>,
    ) -> u32 {
        let Corner { position, uv, normal } = self.obj.corners[corner as usize];
        let group = polygon.polygon.smoothing;
        let source = match normal {
            _ if !self.has_normals => NormalSource::None,
            NONE if group == 0 => NormalSource::Flat(polygon.number),
            NONE => NormalSource::Group(group),
            given => NormalSource::Given(given),
        };
        let next = self.positions.len() as u32;
        let vertex = *self.vertices.entry((position, uv, source)).or_insert(next);
        if vertex != next {
            return vertex;
        }
        self.positions.push(self.obj.positions[position as usize]);
        if self.has_normals {
            self.mesh.normals.push(match source {
                NormalSource::Given(index) => self.obj.normals[index as usize],
                NormalSource::Group(group) => smooth.get(&(position, group)).copied().unwrap_or_default(),
                NormalSource::Flat(_) | NormalSource::None => {
                    let [a, b, c] =
                        triangle.map(|i| self.obj.positions[self.obj.corners[i as usize].position as usize]);
                    (b - a).cross(c - a).normalize_or_zero()
                }
            });
        }
        if self.has_uvs {
            self.mesh.uvs[0].push(self.obj.uvs.get(uv as usize).copied().unwrap_or(Vec2::ZERO));
        }
        if let Some(color) = self.obj.colors.get(position as usize) {
            self.mesh.colors.push(color.extend(1.0));
        }
        vertex
    }
}
