//! Intel Embree as the peer: finds the library, builds scenes, and traces the same rays in each of its ways.

mod ffi;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use heliostat::kernel::glam::Affine3A;
use heliostat::kernel::{Mesh, Ray};

pub(super) use self::ffi::Device;
use self::ffi::{Api, QueryArguments, RayHit, Valid};
use super::rays::{Item, Query, RaySet};
use crate::measure::{ITEM, Slots, Tracer};

/// The one command that fetches the library.
pub(super) const FETCH: &str = "pip download embreex==4.4.0.post1 --no-deps -d target/peers && unzip -oq -d target/peers 'target/peers/embreex-*.whl'";

/// How a tree is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Build {
    /// 0 low, 1 medium, 2 high, as Embree counts.
    pub(super) quality: u32,
    pub(super) compact: bool,
}

impl Build {
    pub(super) const LOW: Self = Self { quality: 0, compact: false };
    pub(super) const MEDIUM: Self = Self { quality: 1, compact: false };
    pub(super) const HIGH: Self = Self { quality: 2, compact: false };
    pub(super) const MEDIUM_COMPACT: Self = Self { quality: 1, compact: true };
    pub(super) const HIGH_COMPACT: Self = Self { quality: 2, compact: true };
    /// Those whose trees are traced.
    pub(super) const TRACED: [Self; 4] = [Self::MEDIUM, Self::HIGH, Self::MEDIUM_COMPACT, Self::HIGH_COMPACT];
}

impl fmt::Display for Build {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let quality = ["LOW", "MEDIUM", "HIGH"][self.quality as usize];
        write!(f, "{quality}{}", if self.compact { " compact" } else { "" })
    }
}

/// One way to ask for the same rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Way {
    /// Rays per call: 1, 4, 8 or 16.
    pub(super) width: usize,
    pub(super) coherent: bool,
    /// Shadow rays from the surface to the light instead of from the light.
    pub(super) reversed: bool,
}

/// A way and the tree that it asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Variant {
    pub(super) build: Build,
    pub(super) way: Way,
    pub(super) query: Query,
    /// Whether the direction matters at all.
    pub(super) directed: bool,
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let call = if self.query == Query::Closest { "intersect" } else { "occluded" };
        let flag = if self.way.coherent { " coherent" } else { "" };
        let direction = match (self.directed, self.way.reversed) {
            (false, _) => "",
            (true, false) => " light→point",
            (true, true) => " point→light",
        };
        write!(f, "{call}{}{flag}{direction} {}", self.way.width, self.build)
    }
}

/// The loaded library.
pub(super) struct Embree {
    api: &'static Api,
    /// Settings that every device gets.
    isa: Option<&'static str>,
    pub(super) version: String,
    pub(super) native16: bool,
}

impl Embree {
    /// Loads the library that `HELIOSTAT_EMBREE` names or that lies below `target/peers`; `isa` forces an instruction
    /// set.
    ///
    /// # Errors
    /// When it is not there or cannot be used, with what to do.
    pub(super) fn load(isa: Option<&'static str>) -> Result<Self, String> {
        let path = match std::env::var_os("HELIOSTAT_EMBREE") {
            Some(path) => PathBuf::from(path),
            None => {
                find().ok_or_else(|| format!("Embree is not here; in the repository, run\n    {FETCH}"))?
            }
        };
        let mut embree = Self { api: Api::load(&path)?, isa, version: String::new(), native16: false };
        let device = embree.device(1)?;
        (embree.version, embree.native16) = (device.version(), device.native16());
        Ok(embree)
    }

    /// As in the results.
    pub(super) fn name(&self) -> String {
        format!("Embree {}", self.version)
    }

    /// A device that builds with so many threads. No two should live at once: they share the task scheduler.
    pub(super) fn device(&self, threads: usize) -> Result<Arc<Device>, String> {
        let isa = self.isa.map(|isa| format!(",isa={isa}")).unwrap_or_default();
        Device::new(self.api, &format!("threads={threads},set_affinity=0{isa}"))
    }

    /// The ways that this library and processor trace natively.
    pub(super) fn ways(&self, directed: bool) -> Vec<Way> {
        let widths = if self.native16 { &[1, 4, 8, 16][..] } else { &[1, 4, 8] };
        let reversed = if directed { &[false, true][..] } else { &[false] };
        let mut ways = Vec::new();
        for &width in widths {
            for coherent in [true, false] {
                ways.extend(reversed.iter().map(|&reversed| Way { width, coherent, reversed }));
            }
        }
        ways
    }
}

fn find() -> Option<PathBuf> {
    let peers = |root: &Path| root.join("target/peers");
    let here = peers(Path::new(""));
    let home = peers(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."));
    [here, home].iter().find_map(|folder| find_below(folder, 3))
}

fn find_below(folder: &Path, depth: usize) -> Option<PathBuf> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).ok()?.filter_map(|e| e.ok().map(|e| e.path())).collect();
    entries.sort();
    let library = |path: &&PathBuf| {
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        path.is_file() && name.starts_with("libembree4") && name.contains(".so")
    };
    entries.iter().find(library).cloned().or_else(|| {
        let mut folders = entries.iter().filter(|path| depth > 0 && path.is_dir());
        folders.find_map(|folder| find_below(folder, depth - 1))
    })
}

/// A mesh of Embree's with its tree.
pub(super) struct Tree {
    pub(super) build: Build,
    scene: ffi::Scene,
}

impl Tree {
    /// Copies the mesh and leaves the tree to [`Tree::build`].
    pub(super) fn new(device: &Arc<Device>, mesh: &Mesh, build: Build) -> Result<Self, String> {
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.to_array()).collect();
        let scene = ffi::Scene::new(device, &positions, &mesh.indices, build.quality, build.compact)?;
        Ok(Self { build, scene })
    }

    /// Trees of their own for placed meshes, and one over them; all built.
    pub(super) fn instanced<'m>(
        device: &Arc<Device>,
        objects: impl Iterator<Item = (&'m Mesh, Affine3A)>,
        build: Build,
    ) -> Result<Self, String> {
        let mut scene = ffi::Scene::empty(device, build.quality, build.compact);
        for (mesh, world_from_object) in objects {
            let mut tree = Self::new(device, mesh, build)?;
            tree.build()?;
            scene.add_instance(&tree.scene, &world_from_object.to_cols_array());
        }
        scene.commit()?;
        Ok(Self { build, scene })
    }

    /// Builds the tree: the part that is timed.
    pub(super) fn build(&mut self) -> Result<(), String> {
        self.scene.commit()
    }
}

/// Rays as structure of arrays in chunks of 16, so that loading a packet is copying.
pub(super) struct Packets {
    query: Query,
    /// First chunk and number of rays of each item.
    items: Vec<(u32, u32)>,
    chunks: Vec<Chunk>,
}

const LANES: usize = 16;

/// Origin, least parameter, direction, largest parameter.
#[repr(align(64))]
#[derive(Clone)]
struct Chunk([[f32; LANES]; 8]);

impl Packets {
    pub(super) fn new(set: &RaySet, reversed: bool) -> Self {
        let mut packets = Self { query: set.kind.query(), items: Vec::new(), chunks: Vec::new() };
        for item in &set.items {
            let rays = item.rays();
            packets.items.push((packets.chunks.len() as u32, rays.len() as u32));
            for some in rays.chunks(LANES) {
                let mut chunk = Chunk([[0.0; LANES]; 8]);
                for (lane, ray) in
                    some.iter().map(|ray| if reversed { reverse(ray) } else { *ray }).enumerate()
                {
                    let [o, d] = [ray.origin, ray.direction];
                    let values = [o.x, o.y, o.z, ray.t_min, d.x, d.y, d.z, ray.t_max];
                    (0..8).for_each(|k| chunk.0[k][lane] = values[k]);
                }
                packets.chunks.push(chunk);
            }
        }
        packets
    }
}

/// The same segment from its far end; the gap before the far end comes first then.
fn reverse(ray: &Ray) -> Ray {
    let origin = ray.origin + ray.direction;
    Ray { origin, t_min: 1.0 - ray.t_max, direction: -ray.direction, t_max: 1.0, ..*ray }
}

/// Whether a set's rays can be reversed: all end at a point.
pub(super) fn directed(set: &RaySet) -> bool {
    set.kind.query() == Query::Any && matches!(set.items.first(), Some(Item::Tile(_)))
}

/// A tree and the rays to ask it with, in one way.
pub(super) struct EmbreeRays<'a> {
    pub(super) tree: &'a Tree,
    pub(super) packets: &'a Packets,
    pub(super) way: Way,
}

impl Tracer for EmbreeRays<'_> {
    fn items(&self) -> usize {
        self.packets.items.len()
    }

    fn trace(&self, first: usize, count: usize, out: Slots<'_>) {
        match self.way.width {
            1 => self.packets_of::<1>(first, count, out),
            4 => self.packets_of::<4>(first, count, out),
            8 => self.packets_of::<8>(first, count, out),
            _ => self.packets_of::<16>(first, count, out),
        }
    }
}

impl EmbreeRays<'_> {
    fn packets_of<const N: usize>(&self, first: usize, count: usize, out: Slots<'_>) {
        match self.packets.query {
            Query::Closest => self.closest::<N>(first, count, out),
            Query::Any => self.any::<N>(first, count, out),
        }
    }

    fn closest<const N: usize>(&self, first: usize, count: usize, out: Slots<'_>) {
        let mut arguments = QueryArguments::new(self.way.coherent);
        let mut rays = RayHit::<N>::EMPTY;
        let slots = out.t.chunks_mut(ITEM).zip(out.primitive.chunks_mut(ITEM));
        for (&item, (t, primitive)) in self.packets.items[first..first + count].iter().zip(slots) {
            for start in (0..item.1 as usize).step_by(N) {
                let valid = self.load(item, start, &mut rays);
                rays.geometry = [ffi::INVALID; N];
                rays.primitive = [ffi::INVALID; N];
                self.tree.scene.intersect(&valid, &mut rays, &mut arguments);
                t[start..start + N].copy_from_slice(&rays.far);
                primitive[start..start + N].copy_from_slice(&rays.primitive);
            }
        }
    }

    fn any<const N: usize>(&self, first: usize, count: usize, out: Slots<'_>) {
        let mut arguments = QueryArguments::new(self.way.coherent);
        let mut rays = RayHit::<N>::EMPTY;
        let items = &self.packets.items[first..first + count];
        for (&item, occluded) in items.iter().zip(out.occluded.chunks_mut(ITEM)) {
            for start in (0..item.1 as usize).step_by(N) {
                let valid = self.load(item, start, &mut rays);
                self.tree.scene.occluded(&valid, &mut rays, &mut arguments);
                occluded[start..start + N].copy_from_slice(&rays.far.map(|far| far < 0.0));
            }
        }
    }

    /// Copies N rays of an item, from the `start`th on, into a packet.
    #[inline(always)]
    fn load<const N: usize>(&self, item: (u32, u32), start: usize, rays: &mut RayHit<N>) -> Valid<N> {
        let chunk = &self.packets.chunks[item.0 as usize + start / LANES];
        let lane = start % LANES;
        let part = |k: usize| -> [f32; N] {
            let mut lanes = [0.0; N];
            lanes.copy_from_slice(&chunk.0[k][lane..lane + N]);
            lanes
        };
        rays.origin = [part(0), part(1), part(2)];
        rays.near = part(3);
        rays.direction = [part(4), part(5), part(6)];
        rays.far = part(7);
        let left = item.1 as usize - start;
        Valid(if left >= N { [-1; N] } else { std::array::from_fn(|i| if i < left { -1 } else { 0 }) })
    }
}
