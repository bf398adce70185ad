//! The scenes that are measured, flattened to one mesh in world space, with a view and sometimes a light.

use std::path::{Path, PathBuf};

use heliostat::formats::{Limits, load};
use heliostat::framing::frame_scene;
use heliostat::kernel::glam::Vec3;
use heliostat::kernel::{Mesh, World};
use heliostat::scene::{Camera, Projection, Scene, SceneBounds};

use crate::flatten::Flattened;

/// Vertical field of view of views placed by hand, degrees.
const FOV: f32 = 45.0;

/// A square perspective picture: a pixel at (x, y) ∈ [−1, 1]² is seen along `forward + x·right + y·up`.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) eye: Vec3,
    pub(super) forward: Vec3,
    pub(super) right: Vec3,
    pub(super) up: Vec3,
}

impl View {
    fn new(camera: &Camera) -> Self {
        let Projection::Perspective { vertical_fov } = camera.projection else {
            // The picture of another projection has no common origin; the place and direction still make a view.
            return Self::new(&Camera {
                projection: Projection::Perspective { vertical_fov: FOV.to_radians() },
                ..camera.clone()
            });
        };
        let axes = camera.world_from_camera.matrix3;
        let slope = (0.5 * vertical_fov).tan();
        let axis = |a: heliostat::kernel::glam::Vec3A| Vec3::from(a).normalize_or_zero();
        Self {
            eye: camera.world_from_camera.translation.into(),
            forward: -axis(axes.z_axis),
            right: slope * axis(axes.x_axis),
            up: slope * axis(axes.y_axis),
        }
    }

    pub(super) fn look_at(eye: Vec3, target: Vec3, fov: f32) -> Self {
        Self::new(&Camera::look_at("", eye, target, Vec3::Y, fov.to_radians()))
    }
}

/// One of the standard scenes or a file of the user's.
#[derive(Clone, Debug)]
pub(super) struct Spec {
    pub(super) name: String,
    pub(super) source: Origin,
    /// Eye, target and vertical field of view in degrees, instead of the scene's own.
    pub(super) view: Option<(Vec3, Vec3, f32)>,
    pub(super) light: Option<Vec3>,
}

impl Spec {
    /// A terrain that is named by its size.
    pub(super) fn terrain(triangles: usize) -> Self {
        let name = format!("terrain-{triangles}");
        Self { name, source: Origin::Terrain(triangles), view: None, light: None }
    }
}

/// Where a scene comes from.
#[derive(Clone, Debug)]
pub(super) enum Origin {
    Builtin(&'static str),
    File(PathBuf),
    /// All PLY files of a folder together.
    Folder(PathBuf),
    /// A fractal height field of about so many triangles.
    Terrain(usize),
}

/// A scene ready for both engines.
pub(super) struct Flat {
    pub(super) name: String,
    pub(super) mesh: Mesh,
    view: Option<View>,
    camera: Option<Camera>,
    bounds: SceneBounds,
    pub(super) light: Option<Vec3>,
}

impl Flat {
    /// The view asked for, the scene's own, or one that shows it well.
    pub(super) fn view(&self, world: &World) -> View {
        self.view.unwrap_or_else(|| match &self.camera {
            Some(camera) => View::new(camera),
            None => View::new(&frame_scene(world, &self.bounds, 1.0, None)),
        })
    }
}

/// The folder of real scenes: `HELIOSTAT_SCENES`, or where the tests look for it.
pub(crate) fn scenes_folder() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    std::env::var_os("HELIOSTAT_SCENES").map_or_else(beside, PathBuf::from)
}

/// The scenes measured when none is named: those that are there, and the names of those that are not.
pub(super) fn standard(terrain: usize) -> (Vec<Spec>, Vec<String>) {
    let folder = scenes_folder();
    let file = |name: &str, path: &str, view| {
        let path = folder.join(path);
        let source = if path.extension().is_some() { Origin::File(path) } else { Origin::Folder(path) };
        Spec { name: name.into(), source, view, light: None }
    };
    let v = Vec3::new;
    let all = vec![
        Spec { name: "conference".into(), source: Origin::Builtin("conference"), view: None, light: None },
        file("sponza", "sponza-dabrovic/sponza.obj", Some((v(-12.0, 2.5, 0.3), v(0.0, 3.6, -0.4), 65.0))),
        file("dragon", "stanford-dragon/dragon_vrip.ply.gz", None),
        file("office", "office-mgf/office.obj", Some((v(-1.84, 2.39, 2.14), v(-1.13, 1.83, 0.36), 60.0))),
        file("helmet", "gltf/FlightHelmet/FlightHelmet.gltf", None),
        file("palm", "gltf/PalmTree/PalmTree.gltf", Some((v(2.0, 2.8, 3.2), v(0.0, 2.7, -0.6), 50.0))),
        file("city", "sionna-etoile/meshes", None),
        Spec { name: "terrain".into(), source: Origin::Terrain(terrain), view: None, light: None },
    ];
    let there = |spec: &Spec| match &spec.source {
        Origin::File(path) | Origin::Folder(path) => path.exists(),
        Origin::Builtin(_) | Origin::Terrain(_) => true,
    };
    let (here, missing): (Vec<_>, Vec<_>) = all.into_iter().partition(there);
    (here, missing.into_iter().map(|spec| spec.name).collect())
}

/// Reads or makes a scene.
///
/// # Errors
/// When it cannot be read or has nothing in it.
pub(super) fn prepare(spec: &Spec) -> Result<Flat, String> {
    let mut meshes = Flattened::default();
    let mut camera = None;
    match &spec.source {
        Origin::Builtin(name) => {
            let edits =
                heliostat::builtin::build(name).ok_or_else(|| format!("no built-in scene `{name}`"))?;
            camera = add_edits(&mut meshes, &edits)?;
        }
        Origin::File(path) => camera = add_file(&mut meshes, path)?,
        Origin::Folder(path) => {
            let entries = std::fs::read_dir(path).map_err(|e| format!("{}: {e}", path.display()))?;
            let mut files: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
            files.retain(|file| file.extension().is_some_and(|e| e == "ply"));
            files.sort();
            for file in files {
                add_file(&mut meshes, &file)?;
            }
        }
        Origin::Terrain(triangles) => (meshes.positions, meshes.indices) = super::terrain::make(*triangles),
    }
    let finite = || meshes.positions.iter().copied().filter(|p| p.is_finite());
    let Some(bounds) = finite()
        .map(|p| SceneBounds { min: p, max: p })
        .reduce(|a, b| SceneBounds { min: a.min.min(b.min), max: a.max.max(b.max) })
    else {
        return Err(format!("{}: the scene has no triangles", spec.name));
    };
    let placed = spec.view.map(|(eye, target, fov)| View::look_at(eye, target, fov));
    let view = placed.or(match spec.source {
        Origin::Terrain(_) => Some(super::terrain::view()),
        _ => None,
    });
    let mesh = Mesh::new(meshes.positions, meshes.indices);
    Ok(Flat { name: spec.name.clone(), mesh, view, camera, bounds, light: spec.light })
}

fn add_file(meshes: &mut Flattened, path: &Path) -> Result<Option<Camera>, String> {
    let loaded = load(path, &Limits::default()).map_err(|e| format!("{}: {e}", path.display()))?;
    add_edits(meshes, &loaded.edits)
}

/// Returns the scene's first camera.
fn add_edits(meshes: &mut Flattened, edits: &[heliostat::scene::Edit]) -> Result<Option<Camera>, String> {
    let mut scene = Scene::default();
    scene.apply(edits).map_err(|e| e.to_string())?;
    meshes.add(&scene)?;
    Ok(scene.cameras().values().next().cloned())
}
