//! A scene as one mesh in world space.

use heliostat::kernel::Mesh;
use heliostat::kernel::glam::{Affine3A, Vec3};
use heliostat::scene::{ObjectId, Scene};

/// Triangles in world space, all in one list.
#[derive(Default)]
pub(crate) struct Flattened {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) indices: Vec<[u32; 3]>,
}

/// All visible triangles of a scene.
///
/// # Errors
/// When there are too many vertices for one mesh, or shapes that are no triangles.
pub(crate) fn scene(scene: &Scene) -> Result<Mesh, String> {
    let mut flattened = Flattened::default();
    flattened.add(scene)?;
    Ok(Mesh::new(flattened.positions, flattened.indices))
}

impl Flattened {
    /// Adds all visible triangles of a scene.
    ///
    /// # Errors
    /// As for [`scene`].
    pub(crate) fn add(&mut self, scene: &Scene) -> Result<(), String> {
        self.add_children(scene, None, Affine3A::IDENTITY)
    }

    fn add_children(
        &mut self,
        scene: &Scene,
        parent: Option<ObjectId>,
        world_from_parent: Affine3A,
    ) -> Result<(), String> {
        for id in scene.placed_in(parent) {
            let instance = &scene.instances()[&id];
            if !instance.visible {
                continue;
            }
            let world_from_object = world_from_parent * instance.parent_from_object;
            for part in &scene.objects()[&instance.object].parts {
                let mesh = scene.geometries()[&part.geometry]
                    .as_mesh()
                    .ok_or("the scene has spheres or cones, which peers do not take")?;
                let first = u32::try_from(self.positions.len() + mesh.positions.len())
                    .map(|end| end - mesh.positions.len() as u32)
                    .map_err(|_| "the flattened scene has more than 2³² vertices")?;
                let placed = mesh.positions.iter().map(|&p| world_from_object.transform_point3(p));
                self.positions.extend(placed);
                self.indices.extend(mesh.indices.iter().map(|t| t.map(|i| i + first)));
            }
            self.add_children(scene, Some(instance.object), world_from_object)?;
        }
        Ok(())
    }
}
