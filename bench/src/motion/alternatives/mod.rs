//! The alternatives to objects that move as wholes, of which the report speaks: a list outside, a new tree in every frame,
//! the hierarchical grid. The same rays, the same pictures, one table.
//!
//! # References
//! Parker et al., "Interactive Ray Tracing", 1999 (the list). Wald et al., "Realtime Ray Tracing and its use for
//! Interactive Global Illumination", 2003, section 6.

mod grid;
mod triangle;

use std::sync::Arc;

use heliostat::kernel::glam::{Affine3A, Quat, Vec3};
use heliostat::kernel::{
    BuildOptions, Hit, Instance, InstanceChange, Mesh, Object, Ray, RayQuery, TriangleBvh, World,
};
use heliostat::scene::{Scene, SceneBounds};

use self::grid::Grid;
use self::triangle::Triangle;
use crate::measure::median;
use crate::result;

const SIZE: (u32, u32) = (320, 240);
const FRAMES: usize = 5;
/// Moving objects; each has 80 triangles.
const COUNTS: [usize; 4] = [1, 10, 100, 1000];
/// The list is tested triangle by triangle: more would take minutes.
const LONGEST_LIST: usize = 100;

/// What stands still, what moves, and how it is looked at.
struct Setting {
    room: Mesh,
    ball: Mesh,
    bounds: SceneBounds,
    rays: Vec<Ray>,
}

/// One way to keep a scene up to date and to trace it.
trait Method {
    /// Takes over where the moving objects stand.
    fn update(&mut self, places: &[Affine3A]) -> Result<(), String>;

    /// Distances to the closest hits, +∞ where there is none.
    fn trace(&self, rays: &[Ray]) -> Vec<f32>;
}

pub(super) fn run() -> Result<(), String> {
    let setting = Setting::new()?;
    result(&format!(
        "The conference room with balls of 80 triangles that fly about; {} primary rays one by one, one thread",
        setting.rays.len()
    ));
    result("balls   method               update ms   trace ms   rays that disagree");
    for count in COUNTS {
        let mut methods: Vec<(&str, Box<dyn Method>)> = vec![
            ("instances", Box::new(Instances::new(&setting, count)?)),
            ("new tree (SAH)", Box::new(Rebuild::new(&setting, BuildOptions::default())?)),
            ("new tree (fast)", Box::new(Rebuild::new(&setting, BuildOptions::fast())?)),
            ("hierarchical grid", Box::new(Gridded::new(&setting))),
        ];
        if count <= LONGEST_LIST {
            methods.push(("list outside", Box::new(Outside::new(&setting)?)));
        }
        let mut expected: Vec<Vec<f32>> = Vec::new();
        for (name, method) in &mut methods {
            let (mut update, mut trace, mut differ) = (Vec::new(), Vec::new(), 0);
            for frame in 0..FRAMES {
                let places = setting.places(count, frame);
                update.push(super::milliseconds(|| method.update(&places))?.0);
                let (time, distances) = super::milliseconds(|| Ok(method.trace(&setting.rays)))?;
                trace.push(time);
                match expected.get(frame) {
                    Some(expected) => differ += disagreements(expected, &distances),
                    None => expected.push(distances),
                }
            }
            let (update, trace) = (median(&mut update), median(&mut trace));
            result(&format!("{count:5}   {name:18}  {update:10.3}  {trace:9.1}   {differ}"));
        }
    }
    Ok(())
}

/// Rays whose distances differ by more than rounding.
fn disagreements(a: &[f32], b: &[f32]) -> usize {
    a.iter().zip(b).filter(|(a, b)| *a != *b && (*a - *b).abs() > 1e-4 * a.abs()).count()
}

impl Setting {
    fn new() -> Result<Self, String> {
        let edits = super::scene("conference")?.edits;
        let mut scene = Scene::default();
        scene.apply(&edits).map_err(|error| error.to_string())?;
        let bounds = scene.bounds().ok_or("an empty room")?;
        let camera = scene.cameras().values().next().ok_or("no camera")?;
        let rays = heliostat::shading::CameraRays::new(camera, SIZE.0, SIZE.1);
        let pixels = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
        let middle = heliostat::kernel::glam::Vec2::splat(0.5);
        let rays = pixels
            .map(|(x, y)| {
                let at = heliostat::kernel::glam::Vec2::new(x as f32, y as f32) + middle;
                let ray = rays.ray(at, heliostat::kernel::glam::Vec2::ZERO, 0.0);
                Ray::new(ray.origin, ray.direction)
            })
            .collect();
        Ok(Self { room: crate::flatten::scene(&scene)?, ball: ball(), bounds, rays })
    }

    /// Where the balls are in a frame: on circles of their own through the room.
    fn places(&self, count: usize, frame: usize) -> Vec<Affine3A> {
        let (middle, half) = (self.bounds.center(), 0.42 * (self.bounds.max - self.bounds.min));
        let place = |i: usize| {
            let share = |k: f32| (i as f32 * k + 0.37).fract();
            let angle = std::f32::consts::TAU * (share(0.754_877_7) + 0.01 * frame as f32);
            let far = Vec3::new(angle.cos(), 2.0 * share(0.569_840_3) - 1.0, angle.sin())
                * half
                * share(0.33).sqrt();
            let size = 0.05 + 0.1 * share(0.71);
            Affine3A::from_scale_rotation_translation(
                Vec3::splat(size),
                Quat::from_rotation_y(angle),
                middle + far,
            )
        };
        (0..count).map(place).collect()
    }

    fn triangles(&self, places: &[Affine3A]) -> impl Iterator<Item = Triangle> {
        let corners = |mesh: &Mesh, t: usize| mesh.indices[t].map(|i| mesh.positions[i as usize]);
        let of_ball = move |place: Affine3A| {
            (0..self.ball.indices.len())
                .map(move |t| Triangle(corners(&self.ball, t).map(|p| place.transform_point3(p))))
        };
        places.iter().copied().flat_map(of_ball)
    }
}

/// An icosahedron whose faces are divided by four and pushed out onto the unit sphere.
fn ball() -> Mesh {
    let (a, b) = (0.525_731_1, 0.850_650_8);
    let axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1)];
    let corner = |(_, y, z): (usize, usize, usize), s: f32, t: f32| {
        let mut p = [0.0; 3];
        (p[y], p[z]) = (s * a, t * b);
        Vec3::from(p)
    };
    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let points: Vec<Vec3> =
        axes.iter().flat_map(|&axis| signs.map(move |(s, t)| corner(axis, s, t))).collect();
    let near = |p: Vec3, q: Vec3| p.distance(q) < 1.1;
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let mut face = |corners: [Vec3; 3]| {
        let first = positions.len() as u32;
        positions.extend(corners.map(Vec3::normalize));
        indices.push([first, first + 1, first + 2]);
    };
    for i in 0..points.len() {
        for j in i + 1..points.len() {
            for k in j + 1..points.len() {
                let (p, mut q, mut r) = (points[i], points[j], points[k]);
                if !(near(p, q) && near(q, r) && near(p, r)) {
                    continue;
                }
                if (q - p).cross(r - p).dot(p) < 0.0 {
                    std::mem::swap(&mut q, &mut r);
                }
                let (pq, qr, rp) = (p + q, q + r, r + p);
                [[p, pq, rp], [pq, q, qr], [rp, qr, r], [pq, qr, rp]].into_iter().for_each(&mut face);
            }
        }
    }
    Mesh::new(positions, indices)
}

fn tree(mesh: &Mesh, options: &BuildOptions) -> Result<TriangleBvh, String> {
    TriangleBvh::build(std::slice::from_ref(mesh), options).map_err(|error| error.to_string())
}

fn distances(world: &World, rays: &[Ray]) -> Vec<f32> {
    let mut hits = vec![Hit::MISS; rays.len()];
    // One at a time: the other methods know no packets.
    for (ray, hit) in rays.iter().zip(&mut hits) {
        world.intersect(std::slice::from_ref(ray), std::slice::from_mut(hit));
    }
    hits.into_iter().map(|hit| hit.t).collect()
}

/// Our way: a tree for each thing, and one over where they stand.
struct Instances(World);

impl Instances {
    fn new(setting: &Setting, count: usize) -> Result<Self, String> {
        let object = |mesh| -> Result<Arc<Object>, String> {
            let tree = tree(mesh, &BuildOptions::default())?;
            Ok(Arc::new(Object::new(Some(tree.into()), Vec::new()).map_err(|error| error.to_string())?))
        };
        let (room, ball) = (object(&setting.room)?, object(&setting.ball)?);
        let placed = |object: &Arc<Object>, place: Affine3A| Instance {
            object: object.clone(),
            parent_from_object: place,
            motion: None,
            id: 0,
        };
        let mut instances = vec![placed(&room, Affine3A::IDENTITY)];
        instances.extend(setting.places(count, 0).into_iter().map(|place| placed(&ball, place)));
        let root = Object::new(None, instances).map_err(|error| error.to_string())?;
        Ok(Self(World::new(Arc::new(root))))
    }
}

impl Method for Instances {
    fn update(&mut self, places: &[Affine3A]) -> Result<(), String> {
        let root = self.0.root_mut();
        let change = |(index, &parent_from_object): (usize, &Affine3A)| {
            let before = root.instance(index)?.clone();
            Some(InstanceChange { index, instance: Instance { parent_from_object, ..before } })
        };
        let mut changes: Vec<_> = (1..).zip(places).filter_map(change).collect();
        root.update(&mut changes).map(drop).map_err(|error| error.to_string())
    }

    fn trace(&self, rays: &[Ray]) -> Vec<f32> {
        distances(&self.0, rays)
    }
}

/// All triangles in one tree, made anew.
struct Rebuild<'a> {
    setting: &'a Setting,
    options: BuildOptions,
    world: World,
}

impl<'a> Rebuild<'a> {
    fn new(setting: &'a Setting, options: BuildOptions) -> Result<Self, String> {
        Ok(Self { setting, options, world: World::empty() })
    }
}

impl Method for Rebuild<'_> {
    fn update(&mut self, places: &[Affine3A]) -> Result<(), String> {
        let mut positions = self.setting.room.positions.to_vec();
        let mut indices = self.setting.room.indices.to_vec();
        for triangle in self.setting.triangles(places) {
            let first = positions.len() as u32;
            positions.extend(triangle.0);
            indices.push([first, first + 1, first + 2]);
        }
        let tree = tree(&Mesh::new(positions, indices), &self.options)?;
        let root = Object::new(Some(tree.into()), Vec::new()).map_err(|error| error.to_string())?;
        self.world = World::new(Arc::new(root));
        Ok(())
    }

    fn trace(&self, rays: &[Ray]) -> Vec<f32> {
        distances(&self.world, rays)
    }
}

/// What stands still in a tree, what moves in a list that every ray goes through.
struct Outside<'a> {
    setting: &'a Setting,
    world: World,
    list: Vec<Triangle>,
}

impl<'a> Outside<'a> {
    fn new(setting: &'a Setting) -> Result<Self, String> {
        let tree = tree(&setting.room, &BuildOptions::default())?;
        let root = Object::new(Some(tree.into()), Vec::new()).map_err(|error| error.to_string())?;
        Ok(Self { setting, world: World::new(Arc::new(root)), list: Vec::new() })
    }
}

impl Method for Outside<'_> {
    fn update(&mut self, places: &[Affine3A]) -> Result<(), String> {
        self.list = self.setting.triangles(places).collect();
        Ok(())
    }

    fn trace(&self, rays: &[Ray]) -> Vec<f32> {
        let mut nearest = distances(&self.world, rays);
        for (ray, nearest) in rays.iter().zip(&mut nearest) {
            for t in self.list.iter().filter_map(|triangle| triangle.intersect(ray)) {
                *nearest = nearest.min(t);
            }
        }
        nearest
    }
}

/// Everything in the hierarchical grid.
struct Gridded<'a> {
    setting: &'a Setting,
    grid: Grid,
}

impl<'a> Gridded<'a> {
    fn new(setting: &'a Setting) -> Self {
        let mut grid = Grid::new(setting.bounds.min, setting.bounds.max);
        for (index, triangle) in setting.room.indices.iter().enumerate() {
            let corners = triangle.map(|i| setting.room.positions[i as usize]);
            grid.set(index, Some(Triangle(corners)));
        }
        Self { setting, grid }
    }
}

impl Method for Gridded<'_> {
    fn update(&mut self, places: &[Affine3A]) -> Result<(), String> {
        let first = self.setting.room.indices.len();
        for (i, triangle) in self.setting.triangles(places).enumerate() {
            self.grid.set(first + i, Some(triangle));
        }
        Ok(())
    }

    fn trace(&self, rays: &[Ray]) -> Vec<f32> {
        rays.iter().map(|ray| self.grid.intersect(ray).map_or(f32::INFINITY, |(t, _)| t)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_closed_and_round() {
        let ball = ball();
        assert_eq!(ball.indices.len(), 80);
        assert!(ball.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn a_grid_finds_what_a_list_finds_also_after_moves() {
        let ball = ball();
        let mut grid = Grid::new(Vec3::splat(-2.0), Vec3::splat(2.0));
        for step in 0..3 {
            let offset = Vec3::X * 0.4 * step as f32;
            let triangle = |t: usize| Triangle(ball.indices[t].map(|i| ball.positions[i as usize] + offset));
            (0..80).for_each(|t| grid.set(t, Some(triangle(t))));
            for i in 0..2000 {
                let share = |k: f32| 2.0 * (i as f32 * k).fract() - 1.0;
                let from = 3.0 * Vec3::new(share(0.618), share(0.414), share(0.732));
                let to = Vec3::new(share(0.236), share(0.449), share(0.645));
                let ray = Ray::new(from, to - from);
                let list = (0..80).filter_map(|t| triangle(t).intersect(&ray)).fold(f32::INFINITY, f32::min);
                let found = grid.intersect(&ray).map_or(f32::INFINITY, |(t, _)| t);
                assert_eq!(found, list, "ray {i} after {step} moves");
            }
        }
        (0..80).for_each(|t| grid.set(t, None));
        assert!(grid.intersect(&Ray::new(Vec3::splat(-3.0), Vec3::ONE)).is_none());
    }
}
