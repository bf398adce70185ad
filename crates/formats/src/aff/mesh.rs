//! Triangles: indexed meshes `m`, textured triangles `tt` and `ttp`, animated ones `tpa`.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use heliostat_scene::MaterialId;

use crate::context::Context;
use crate::error::LoadError;
use crate::nff::shapes::Growing;
use crate::nff::tokens::Tokens;

/// A mesh as it is written: each attribute has indices of its own.
pub(super) struct Written {
    positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) texture: Option<String>,
    /// Per corner: position, normal, texture coordinate; 0 for what is absent.
    triangles: Vec<[[u32; 3]; 3]>,
}

impl Written {
    /// `m` after the keyword.
    pub(super) fn parse(context: &mut Context<'_>, tokens: &mut Tokens<'_>) -> Result<Self, LoadError> {
        let mut mesh = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            texture: None,
            triangles: Vec::new(),
        };
        if !tokens.take(b"vertices") {
            tokens.word();
            return Err(tokens.error("a mesh begins with `vertices`", "write for example `m vertices 3`"));
        }
        mesh.positions = vectors(context, tokens)?;
        if tokens.take(b"normals") {
            mesh.normals = vectors(context, tokens)?;
        }
        if tokens.take(b"texturecoords") {
            let count = tokens.count("the number of texture coordinates", 1)?;
            mesh.texture = Some(tokens.name("the texture's name")?);
            for _ in 0..count {
                context.charge(8, &tokens.place())?;
                mesh.uvs.push(Vec2::new(tokens.float("u")?, tokens.float("v")?));
            }
        }
        if !tokens.take(b"triangles") {
            tokens.word();
            let hint = "a mesh has `vertices`, perhaps `normals` and `texturecoords`, and `triangles`";
            return Err(tokens.error("`triangles` should follow here", hint));
        }
        let count = tokens.count("the number of triangles", 0)?;
        for _ in 0..count {
            context.charge(36, &tokens.place())?;
            let mut corners = [[0; 3]; 3];
            let lists = [mesh.positions.len(), mesh.normals.len(), mesh.uvs.len()];
            for (attribute, &length) in lists.iter().enumerate() {
                for corner in corners.iter_mut().filter(|_| length > 0) {
                    corner[attribute] = index(tokens, length)?;
                }
            }
            mesh.triangles.push(corners);
        }
        Ok(mesh)
    }

    /// Appends the triangles, with a vertex for every combination of attributes that they use.
    pub(super) fn append(
        &self,
        context: &mut Context<'_>,
        tokens: &Tokens<'_>,
        to: &mut Growing,
    ) -> Result<(), LoadError> {
        let mut known: HashMap<[u32; 3], u32> = HashMap::new();
        let before = to.positions.len();
        for triangle in &self.triangles {
            let corners = triangle.map(|corner| {
                *known.entry(corner).or_insert_with(|| {
                    let [position, normal, uv] = corner.map(|i| i as usize);
                    to.positions.push(self.positions[position]);
                    to.normals.extend(self.normals.get(normal));
                    to.uvs.extend(self.uvs.get(uv));
                    to.positions.len() as u32 - 1
                })
            });
            to.indices.push(corners);
        }
        context.count_mesh(to.positions.len() - before, self.triangles.len(), &tokens.place())
    }
}

fn vectors(context: &mut Context<'_>, tokens: &mut Tokens<'_>) -> Result<Vec<Vec3>, LoadError> {
    let count = tokens.count("their number", 1)?;
    let mut vectors = Vec::new();
    for _ in 0..count {
        context.charge(12, &tokens.place())?;
        vectors.push(tokens.vector("a coordinate")?);
    }
    Ok(vectors)
}

fn index(tokens: &mut Tokens<'_>, length: usize) -> Result<u32, LoadError> {
    let value = tokens.integer("an index")?;
    u32::try_from(value).ok().filter(|&i| (i as usize) < length).ok_or_else(|| {
        let problem = format!("the index {value} is not among {length} values");
        tokens.error(problem, "indices count from 0")
    })
}

/// `tt` and `ttp` after the texture's name.
pub(super) fn textured_triangle(
    context: &mut Context<'_>,
    tokens: &mut Tokens<'_>,
    smooth: bool,
    to: &mut Growing,
) -> Result<(), LoadError> {
    let first = to.positions.len() as u32;
    context.count_mesh(3, 1, &tokens.place())?;
    for _ in 0..3 {
        let position = tokens.vector("a coordinate")?;
        let normal = if smooth { Some(tokens.vector("a normal")?) } else { None };
        let uv = Vec2::new(tokens.float("u")?, tokens.float("v")?);
        to.positions.push(position);
        to.normals.extend(normal);
        to.uvs.push(uv);
    }
    to.indices.push([first, first + 1, first + 2]);
    Ok(())
}

/// Animated triangles of one material that have keys at the same times: three vertices each.
#[derive(Default)]
pub(super) struct Deforming {
    pub(super) times: Vec<f32>,
    /// Per time: positions and normals of all vertices.
    pub(super) frames: Vec<(Vec<Vec3>, Vec<Vec3>)>,
}

/// The animated triangles of a node.
#[derive(Default)]
pub(super) struct DeformingMeshes {
    pub(super) meshes: Vec<(MaterialId, Deforming)>,
    known: HashMap<(MaterialId, Vec<u32>), usize>,
}

impl DeformingMeshes {
    /// `tpa` after the keyword.
    pub(super) fn parse(
        &mut self,
        context: &mut Context<'_>,
        tokens: &mut Tokens<'_>,
        material: MaterialId,
    ) -> Result<(), LoadError> {
        let count = tokens.count("the number of times", 1)?;
        let place = tokens.place();
        let mut times: Vec<f32> = Vec::new();
        let mut keys = Vec::new();
        for _ in 0..count {
            context.charge(3 * 24 + 4, &place)?;
            let time = tokens.float("the time")?;
            if !time.is_finite() || times.last().is_some_and(|last| *last > time) {
                return Err(
                    tokens.error(format!("the time is {time}"), "times are finite and do not decrease")
                );
            }
            times.push(time);
            let mut corner = || Ok((tokens.vector("a coordinate")?, tokens.vector("a normal")?));
            keys.push([corner()?, corner()?, corner()?]);
        }
        context.count_mesh(3, 1, &place)?;
        let bits = times.iter().map(|time| time.to_bits()).collect();
        let index = *self.known.entry((material, bits)).or_insert_with(|| {
            let frames = vec![(Vec::new(), Vec::new()); times.len()];
            self.meshes.push((material, Deforming { times, frames }));
            self.meshes.len() - 1
        });
        for ((positions, normals), corners) in self.meshes[index].1.frames.iter_mut().zip(keys) {
            for (position, normal) in corners {
                positions.push(position);
                normals.push(normal);
            }
        }
        Ok(())
    }
}
