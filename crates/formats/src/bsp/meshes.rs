//! Faces to meshes: one per model and texture, and one per lamp.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use glam::{Vec3, Vec4};
use heliostat_scene::Mesh;

use super::baked;
use super::lumps::{Face, FaceKind, Lumps, Vertex};
use super::patch::{Point, pieces};
use super::units;
use crate::context::Context;
use crate::error::LoadError;
use crate::normals::smooth_normals;
use crate::place::Place;

/// What becomes of the faces with a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Shown; whether light falls on it, and whether it is a source of light.
    Shown { lit: bool, lamp: bool },
    /// A hole through which the environment is seen; whether a veil of its light is shown there.
    Sky { veiled: bool },
    /// Never drawn in the game.
    NotDrawn,
}

/// Faces of a map by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) polygons: usize,
    pub(super) patches: usize,
    pub(super) meshes: usize,
    pub(super) flares: usize,
    pub(super) sky: usize,
    pub(super) not_drawn: usize,
}

/// Most faces of a lamp's texture that become meshes of their own, so that each lamp is found by itself.
const MOST_LAMPS: usize = 64;

/// Longest edge of a small lamp, units: a few texels.
const LAMP_EDGE: f32 = 4.0;
/// Most edges along the side of a large one.
const LAMP_CUTS: f32 = 32.0;

/// Vertices and triangles so far.
#[derive(Default)]
struct Heap {
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

/// The meshes of a model by texture.
pub(super) struct Meshes<'a> {
    pub(super) lumps: &'a Lumps<'a>,
    /// By texture.
    pub(super) uses: &'a [Use],
    /// Whether vertices get the light of the light maps.
    pub(super) baked: bool,
}

impl Meshes<'_> {
    /// Makes the meshes of these faces.
    ///
    /// # Errors
    /// When a face is broken or the limits are exceeded.
    pub(super) fn build(
        &self,
        context: &mut Context<'_>,
        place: &Place,
        faces: Range<usize>,
        tally: &mut Tally,
    ) -> Result<Vec<(usize, Mesh)>, LoadError> {
        let mut heaps: BTreeMap<(usize, usize), Heap> = BTreeMap::new();
        let lamps = self.lamps(faces.clone())?;
        for index in faces {
            let face = self.lumps.face(index)?;
            if face.kind == FaceKind::Flare {
                tally.flares += 1;
                continue;
            }
            let (lit, is_sky) = match self.uses[face.texture] {
                Use::Shown { lit, .. } => (lit, false),
                Use::Sky { veiled } => {
                    tally.sky += 1;
                    if !veiled {
                        continue;
                    }
                    (false, true)
                }
                Use::NotDrawn => {
                    tally.not_drawn += 1;
                    continue;
                }
            };
            match face.kind {
                _ if is_sky => {}
                FaceKind::Polygon => tally.polygons += 1,
                FaceKind::Patch(_) => tally.patches += 1,
                _ => tally.meshes += 1,
            }
            let place = Place { spot: crate::place::Spot::Byte(face.offset as u64), ..place.clone() };
            let mut heap = self.face(context, &place, &face)?;
            if self.baked {
                self.light(context, &place, &face, lit, &mut heap)?;
            }
            let alone = lamps.get(&face.texture).is_some_and(|&count| count <= MOST_LAMPS);
            if alone && !is_sky {
                refine_lamp(context, &place, &mut heap)?;
            }
            append(heaps.entry((face.texture, if alone { index } else { 0 })).or_default(), heap);
        }
        let full = heaps.into_iter().filter(|(_, heap)| !heap.triangles.is_empty());
        Ok(full.map(|((texture, _), heap)| (texture, self.mesh(heap))).collect())
    }

    /// How many faces have the texture of a lamp, by texture.
    fn lamps(&self, faces: Range<usize>) -> Result<BTreeMap<usize, usize>, LoadError> {
        let mut lamps = BTreeMap::new();
        for index in faces {
            let texture = self.lumps.face(index)?.texture;
            if let Use::Shown { lamp: true, .. } | Use::Sky { veiled: true } = self.uses[texture] {
                *lamps.entry(texture).or_default() += 1;
            }
        }
        Ok(lamps)
    }

    fn face(&self, context: &mut Context<'_>, place: &Place, face: &Face) -> Result<Heap, LoadError> {
        let mut heap = Heap::default();
        let vertices = face.vertices.clone().map(|index| self.point(&self.lumps.vertex(index)));
        if let FaceKind::Patch(size) = face.kind {
            context.charge_array(face.vertices.len(), size_of::<Point>(), place)?;
            let control: Vec<Point> = vertices.collect();
            for piece in pieces(&control, size) {
                count(context, place, piece.vertices(), piece.triangles())?;
                piece.triangulate(&mut heap.points, &mut heap.triangles);
            }
            smooth(&mut heap);
        } else {
            count(context, place, face.vertices.len(), face.mesh_vertices.len() / 3)?;
            heap.points.extend(vertices);
            for first in face.mesh_vertices.clone().step_by(3) {
                heap.triangles.push(self.lumps.triangle(face, first)?);
            }
        }
        Ok(heap)
    }

    /// In units of the game; colours hold the vertex's own light.
    fn point(&self, vertex: &Vertex) -> Point {
        Point {
            position: vertex.position,
            normal: vertex.normal,
            uvs: [vertex.texture, vertex.lightmap],
            color: if self.baked { baked::vertex_light(vertex.color) } else { Vec4::ONE },
        }
    }

    /// Gives the points of a face the light of its light map.
    fn light(
        &self,
        context: &mut Context<'_>,
        place: &Place,
        face: &Face,
        lit: bool,
        heap: &mut Heap,
    ) -> Result<(), LoadError> {
        if !lit {
            heap.points.iter_mut().for_each(|point| point.color = Vec4::ONE);
            return Ok(());
        }
        let room = |vertices, triangles| count(context, place, vertices, triangles);
        baked::subdivide(&mut heap.points, &mut heap.triangles, baked::EDGE, room)?;
        if let Some(page) = face.lightmap {
            let page = self.lumps.lightmap(page);
            heap.points.iter_mut().for_each(|p| p.color = baked::lookup(page, p.uvs[1]).extend(1.0));
        }
        Ok(())
    }

    fn mesh(&self, heap: Heap) -> Mesh {
        let Heap { points, triangles } = heap;
        let positions = points.iter().map(|point| units::metres(point.position)).collect();
        // The game's front sides run clockwise.
        let indices = triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect();
        let mut mesh = Mesh::new(positions, indices);
        let usable = |normal: Vec3| if normal.is_finite() { units::direction(normal) } else { Vec3::ZERO };
        mesh.normals = points.iter().map(|point| usable(point.normal)).collect();
        mesh.uvs = [0, 1].map(|set| points.iter().map(|point| point.uvs[set]).collect());
        if self.baked {
            mesh.colors = points.iter().map(|point| point.color).collect();
        }
        mesh
    }
}

/// Gives a patch the normals of its surface, as the game does: those of its control points are missing in many maps.
/// Vertices in one place share theirs, across the seams of pieces and of closed pipes.
fn smooth(heap: &mut Heap) {
    let mut places = HashMap::new();
    let mut positions = Vec::new();
    let places: Vec<u32> = heap
        .points
        .iter()
        .map(|point| {
            let bits = (point.position + Vec3::ZERO).to_array().map(f32::to_bits);
            *places.entry(bits).or_insert_with(|| {
                positions.push(point.position);
                positions.len() as u32 - 1
            })
        })
        .collect();
    let front: Vec<[u32; 3]> =
        heap.triangles.iter().map(|&[a, b, c]| [a, c, b].map(|i| places[i as usize])).collect();
    let normals = smooth_normals(&positions, &front);
    for (point, place) in heap.points.iter_mut().zip(places) {
        point.normal = normals[place as usize];
    }
}

/// Cuts a lamp until its triangles show its picture: renderers choose bright ones more often, and a lamp is mostly a small
/// bright spot on a dark frame.
fn refine_lamp(context: &mut Context<'_>, place: &Place, heap: &mut Heap) -> Result<(), LoadError> {
    let corner = |pick: fn(Vec3, Vec3) -> Vec3| heap.points.iter().map(|p| p.position).reduce(pick);
    let extent = corner(Vec3::max).zip(corner(Vec3::min)).map_or(0.0, |(max, min)| (max - min).max_element());
    let edge = LAMP_EDGE.max(extent / LAMP_CUTS);
    let room = |vertices, triangles| count(context, place, vertices, triangles);
    baked::subdivide(&mut heap.points, &mut heap.triangles, edge, room)
}

/// Counts vertices, with all that they carry, and triangles.
fn count(
    context: &mut Context<'_>,
    place: &Place,
    vertices: usize,
    triangles: usize,
) -> Result<(), LoadError> {
    context.count_mesh(vertices, triangles, place)?;
    context.charge_array(vertices, size_of::<Point>(), place)
}

fn append(all: &mut Heap, more: Heap) {
    let first = all.points.len() as u32;
    all.points.extend(more.points);
    all.triangles.extend(more.triangles.into_iter().map(|triangle| triangle.map(|index| first + index)));
}
