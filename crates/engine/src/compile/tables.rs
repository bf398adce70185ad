//! Shader tables brought up to date: only the entries that changed, unless the hierarchy itself did.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Affine3A;
use heliostat_kernel as kernel;
use heliostat_scene::{
    ApplyReport, BackendError, InstanceId, MaterialId, MaterialOverride, Object, ObjectId, Scene, SceneBounds,
};
use heliostat_shading::{Placement, ShadedPart, ShadingScene, SurfaceMaterial, Sweep};

use super::Compiled;
use super::changes::{Changes, Holder};
use super::world::Touched;

/// Most objects in the fully expanded tree of instances: each has an entry in the shader tables.
const MAX_PLACEMENTS: u64 = 1 << 22;
/// Moved instances per task.
const CHUNK: usize = 512;

impl Compiled {
    /// Refuses hierarchies that the tables cannot hold.
    pub(super) fn check_size(&self) -> Result<(), BackendError> {
        match self.world.path_count() {
            count if count > MAX_PLACEMENTS => Err(BackendError::Limit(format!(
                "{count} placed objects once nested instances are expanded; the limit is {MAX_PLACEMENTS}"
            ))),
            _ => Ok(()),
        }
    }

    /// Brings the shader tables up to date with everything else.
    pub(super) fn update_tables(
        &mut self,
        scene: &Scene,
        changes: &Changes,
        touched: &Touched,
        report: &mut ApplyReport,
    ) {
        self.overridden = None;
        let same_materials = scene.materials().keys().eq(&self.materials);
        let anew = touched.structure || !same_materials;
        let relight = if anew {
            self.materials = scene.materials().keys().copied().collect();
            self.shading = self.tables(scene);
            report.problems.extend(self.shading.materials().iter().filter_map(problem));
            true
        } else {
            let materials = self.patch_materials(scene, changes, report);
            let shapes = self.patch_shapes(scene, touched);
            self.patch_attributes(scene, changes);
            shapes | self.patch_placements(touched) | materials
        };
        let (new_materials, lost) = (&changes.materials, &changes.lost_attributes);
        report.problems.extend(self.shading.missing_attributes(|material, geometry| {
            anew || new_materials.contains(&material) || lost.contains(&geometry)
        }));
        let bounds = self.bounds();
        if relight || changes.lights || changes.environment || bounds != self.lit_bounds {
            self.lit_bounds = bounds;
            self.shading.relight(self.lights.values().cloned(), self.environment.clone(), bounds);
        }
        self.interfaces.retain(|_, tables| Arc::strong_count(tables) > 1);
    }

    /// The tables for materials that replace those of the scene; made anew when another override is asked for.
    /// Says what these materials miss, once.
    pub(crate) fn prepare_override(&mut self, scene: &Scene, materials: &MaterialOverride) -> Vec<String> {
        if self.overridden.as_ref().is_none_or(|(made_for, _)| made_for != materials) {
            let compiled = self.compile_materials(scene, materials);
            let parts = self.shading.parts().to_vec();
            let mut tables = ShadingScene::new(compiled, parts, self.shading.placements().clone());
            tables.set_lane_mode(self.lanes);
            tables.relight(self.lights.values().cloned(), self.environment.clone(), self.bounds());
            let problems = tables.missing_attributes(|_, _| true);
            self.overridden = Some((materials.clone(), tables));
            return problems;
        }
        Vec::new()
    }

    fn bounds(&self) -> Option<SceneBounds> {
        let bounds = self.world.bounds();
        (!bounds.is_empty()).then_some(SceneBounds { min: bounds.min, max: bounds.max })
    }

    fn compile_materials(&mut self, scene: &Scene, materials: &MaterialOverride) -> Vec<SurfaceMaterial> {
        let compile = |(&id, material)| {
            let material = SurfaceMaterial::overridden(material, materials);
            SurfaceMaterial::new(id, &material, &self.textures, &mut self.interfaces, &self.shaders)
        };
        scene.materials().iter().map(compile).collect()
    }

    /// All tables anew, without lights.
    fn tables(&mut self, scene: &Scene) -> ShadingScene {
        let compiled = self.compile_materials(scene, &MaterialOverride::None);
        let slots: BTreeMap<MaterialId, u32> = self.materials.iter().copied().zip(0..).collect();
        let parts = |object| shaded_parts(scene, object, |id| slots[&id]);
        // The world itself, which has no parts of its own, comes first.
        let parts = std::iter::once([].into()).chain(scene.objects().values().map(parts)).collect();
        self.slots = scene.objects().keys().copied().zip(1..).collect();
        self.users.clear();
        for (&id, object) in scene.objects() {
            for part in &object.parts {
                self.users.entry(part.geometry).or_default().insert(id);
            }
        }
        let mut placements = Vec::with_capacity(self.world.path_count() as usize);
        self.world.for_each_path(&mut |_, _, ids, _| {
            let (object, instance, slot) = match ids.last() {
                Some(&id) => {
                    let object = scene.instances()[&InstanceId(id)].object;
                    (object, InstanceId(id), self.slots[&object])
                }
                None => (ObjectId(u32::MAX), InstanceId(u32::MAX), 0),
            };
            placements.push(Placement::new(Affine3A::IDENTITY, 0.0, object, instance, slot));
        });
        place_children(self.world.root(), &Way::default(), &mut placements);
        let mut shading = ShadingScene::new(compiled, parts, placements.into());
        shading.set_lane_mode(self.lanes);
        shading
    }

    /// Recompiles materials that changed, or whose textures did. Says whether lights did.
    fn patch_materials(&mut self, scene: &Scene, changes: &Changes, report: &mut ApplyReport) -> bool {
        let mut dirty: BTreeSet<MaterialId> = changes.materials.clone();
        if !changes.textures.is_empty() {
            let users = scene.materials().iter().filter(|(_, material)| {
                material.textures().any(|(_, reference)| changes.textures.contains(&reference.texture))
            });
            dirty.extend(users.map(|(id, _)| *id));
        }
        let replaced: Vec<_> = dirty
            .iter()
            .filter_map(|id| Some((self.materials.binary_search(id).ok()?, scene.materials().get(id)?)))
            .map(|(index, material)| {
                let id = self.materials[index];
                let shaders = &self.shaders;
                let material =
                    SurfaceMaterial::new(id, material, &self.textures, &mut self.interfaces, shaders);
                (index, material)
            })
            .collect();
        report.problems.extend(replaced.iter().filter_map(|(_, material)| problem(material)));
        let shines = |material: &SurfaceMaterial| material.source().is_emissive();
        let lights =
            replaced.iter().any(|(index, now)| shines(now) || shines(&self.shading.materials()[*index]));
        if !replaced.is_empty() {
            self.shading.replace_materials(replaced);
        }
        lights
    }

    /// Hands over the meshes of deformed objects. Says whether lights are among them.
    fn patch_shapes(&mut self, scene: &Scene, touched: &Touched) -> bool {
        let mut lights = false;
        for id in &touched.reshaped {
            let slot = self.slots[id];
            let materials = |id| self.materials.binary_search(&id).unwrap_or_default() as u32;
            self.shading.reshape(slot, shaded_parts(scene, &scene.objects()[id], materials));
            lights |= self.shading.emits(slot);
        }
        lights
    }

    /// Hands over the attributes of geometries.
    fn patch_attributes(&mut self, scene: &Scene, changes: &Changes) {
        for id in &changes.attributes {
            let attributes = scene.attributes().get(id).cloned().unwrap_or_default();
            for object in self.users.get(id).into_iter().flatten() {
                self.shading.set_attributes(self.slots[object], *id, &attributes);
            }
        }
    }

    /// Moves the placements below moved instances. Says whether lights are among them.
    fn patch_placements(&mut self, touched: &Touched) -> bool {
        if touched.moved.values().all(Vec::is_empty) {
            return false;
        }
        let emits: Vec<bool> =
            (0..self.shading.parts().len() as u32).map(|slot| self.shading.emits(slot)).collect();
        let patch = Patch { touched, emits: &emits };
        patch.descend(self.world.root(), None, &Way::default(), self.shading.placements_mut())
    }
}

/// What a material has to complain about.
fn problem(material: &SurfaceMaterial) -> Option<String> {
    let problem = material.problem()?;
    Some(format!("material `{}`: {}; a placeholder takes its place", material.source().name, problem.0))
}

fn shaded_parts(scene: &Scene, object: &Object, slot: impl Fn(MaterialId) -> u32) -> Arc<[ShadedPart]> {
    let part = |part: &heliostat_scene::Part| {
        let attributes = scene.attributes().get(&part.geometry).cloned().unwrap_or_default();
        let shape = scene.geometries()[&part.geometry].clone();
        ShadedPart::new(shape, slot(part.material), part.geometry, attributes)
    };
    object.parts.iter().map(part).collect()
}

/// The way from the world down to an object.
#[derive(Clone, Copy, Debug, Default)]
struct Way<'a> {
    world_from_object: Affine3A,
    /// See [`Placement::detour`]: the sum over all levels, which counts from the second on.
    detour: f32,
    /// The last step, at both ends of the shutter interval, and the way before it.
    last: Option<([Affine3A; 2], &'a Way<'a>)>,
    /// Whether something on the way moves while the shutter is open.
    moves: bool,
}

impl<'a> Way<'a> {
    fn down(&'a self, instance: &kernel::Instance) -> Self {
        let open = instance.parent_from_object;
        let close = instance.motion.unwrap_or(open);
        let step = |place: Affine3A| self.world_from_object.transform_vector3a(place.translation).length();
        Self {
            world_from_object: self.world_from_object * open,
            detour: self.detour + step(open).max(step(close)),
            last: Some(([open, close], self)),
            moves: self.moves || instance.motion.is_some(),
        }
    }

    fn sweep(&self) -> Vec<[Affine3A; 2]> {
        let Some((step, before)) = self.last else { return Vec::new() };
        let mut steps = before.sweep();
        steps.push(step);
        steps
    }

    fn place(&self, placement: &mut Placement) {
        let deep = self.last.is_some_and(|(_, before)| before.last.is_some());
        let detour = if deep { self.detour } else { 0.0 };
        let Placement { object, instance, parts, .. } = *placement;
        *placement = Placement::new(self.world_from_object, detour, object, instance, parts);
        placement.motion = self.moves.then(|| Arc::new(Sweep(self.sweep())));
    }
}

/// Places everything below an object, with whose own placement `placements` begin.
fn place_children(object: &kernel::Object, way: &Way<'_>, placements: &mut [Placement]) {
    for (index, instance) in object.instances().enumerate() {
        let Some(offset) = object.path_offset(index) else { continue };
        place_below(instance, way, &mut placements[offset as usize..]);
    }
}

/// Places an instance, with whose placement `placements` begin, and everything below it.
fn place_below(instance: &kernel::Instance, way: &Way<'_>, placements: &mut [Placement]) {
    let way = way.down(instance);
    way.place(&mut placements[0]);
    place_children(&instance.object, &way, placements);
}

/// Moves what is below moved instances and leaves the rest alone.
struct Patch<'a> {
    touched: &'a Touched,
    /// By place in the table of parts.
    emits: &'a [bool],
}

impl Patch<'_> {
    /// `placements` begin with the object's own. Says whether something that emits was moved.
    fn descend(
        &self,
        object: &kernel::Object,
        holder: Holder,
        way: &Way<'_>,
        placements: &mut [Placement],
    ) -> bool {
        let moved = self.touched.moved.get(&holder).map_or(&[][..], Vec::as_slice);
        let mut lights = self.move_all(object, moved, way, 0, placements);
        for &index in self.touched.below.get(&holder).into_iter().flatten() {
            let (Some(instance), Some(offset)) = (object.instance(index), object.path_offset(index)) else {
                continue;
            };
            let placements = &mut placements[offset as usize..];
            let id = placements[0].object;
            if self.touched.has_moves(id) {
                lights |= self.descend(&instance.object, Some(id), &way.down(instance), placements);
            }
        }
        lights
    }

    /// Moves the instances of these indices, in parallel where there are many. `placements` begin `first` paths after
    /// the object's own.
    fn move_all(
        &self,
        object: &kernel::Object,
        moved: &[usize],
        way: &Way<'_>,
        first: usize,
        placements: &mut [Placement],
    ) -> bool {
        if moved.len() > CHUNK {
            let (low, high) = moved.split_at(moved.len() / 2);
            let Some(border) = object.path_offset(high[0]) else { return false };
            let (below, above) = placements.split_at_mut(border as usize - first);
            let (a, b) = rayon::join(
                || self.move_all(object, low, way, first, below),
                || self.move_all(object, high, way, border as usize, above),
            );
            return a | b;
        }
        let mut lights = false;
        for &index in moved {
            let (Some(instance), Some(offset)) = (object.instance(index), object.path_offset(index)) else {
                continue;
            };
            let start = offset as usize - first;
            let moved = &mut placements[start..start + instance.object.path_count() as usize];
            place_below(instance, way, moved);
            lights |= moved.iter().any(|placement| self.emits[placement.parts as usize]);
        }
        lights
    }
}
