//! The hierarchical grid: every primitive lies in cells of about its own size, so that inserting and removing one touches
//! a handful of cells whatever else is there.
//!
//! Unlike the paper's, this grid does not grow by wrapping around: what leaves its box is refused.
//!
//! # References
//! Reinhard, Smits and Hansen, "Dynamic Acceleration Structures for Interactive Ray Tracing", 2000.

use heliostat::kernel::Ray;
use heliostat::kernel::glam::{IVec3, Vec3};

use super::triangle::Triangle;

/// Cells per axis within a cell of the level above.
const FACTOR: i32 = 4;
const CHILDREN: usize = (FACTOR * FACTOR * FACTOR) as usize;
/// Levels below the whole box.
const LEVELS: u32 = 6;

/// A cell: what is about as large as it, and what is smaller, further down.
#[derive(Default)]
struct Cell {
    primitives: Vec<u32>,
    children: Option<Box<[Cell; CHILDREN]>>,
    /// Entries here and below: empty cells are passed over.
    entries: u32,
}

/// A grid over triangles.
pub(super) struct Grid {
    min: Vec3,
    /// Edge of the whole, a cube.
    size: f32,
    root: Cell,
    triangles: Vec<Option<Triangle>>,
}

impl Grid {
    /// An empty grid over the cube around a box, slightly enlarged.
    pub(super) fn new(min: Vec3, max: Vec3) -> Self {
        let size = (max - min).max_element() * 1.02;
        let middle = 0.5 * (min + max);
        let min = middle - Vec3::splat(0.5 * size);
        Self { min, size, root: Cell::default(), triangles: Vec::new() }
    }

    /// Puts a triangle in the place of number `index`, or takes it out.
    pub(super) fn set(&mut self, index: usize, triangle: Option<Triangle>) {
        if index >= self.triangles.len() {
            self.triangles.resize(index + 1, None);
        }
        if let Some(before) = self.triangles[index] {
            self.visit(
                &before,
                &mut |cell| cell.primitives.retain(|&p| p != index as u32),
                u32::wrapping_sub,
            );
        }
        self.triangles[index] = triangle;
        if let Some(now) = triangle {
            self.visit(&now, &mut |cell| cell.primitives.push(index as u32), u32::wrapping_add);
        }
    }

    /// Calls `change` with all cells that a triangle lies in, and counts it there and above.
    fn visit(&mut self, triangle: &Triangle, change: &mut dyn FnMut(&mut Cell), count: fn(u32, u32) -> u32) {
        let (low, high) = triangle.bounds();
        let (low, high) = ((low - self.min) / self.size, (high - self.min) / self.size);
        let extent = (high - low).max_element();
        let mut level = 0;
        let mut cells = 1;
        while level < LEVELS && extent * (cells * FACTOR) as f32 <= 1.0 {
            level += 1;
            cells *= FACTOR;
        }
        let last = IVec3::splat(cells - 1);
        let at = |p: Vec3| (p * cells as f32).as_ivec3().clamp(IVec3::ZERO, last);
        let (first, end) = (at(low), at(high));
        for z in first.z..=end.z {
            for y in first.y..=end.y {
                for x in first.x..=end.x {
                    descend(&mut self.root, IVec3::new(x, y, z), level, change, count);
                }
            }
        }
    }

    /// The closest hit, as ray parameter and triangle.
    pub(super) fn intersect(&self, ray: &Ray) -> Option<(f32, u32)> {
        let reciprocal = ray.direction.recip();
        let (a, b) = ((self.min - ray.origin) * reciprocal, (self.min + self.size - ray.origin) * reciprocal);
        let enter = a.min(b).max_element().max(ray.t_min);
        let leave = a.max(b).min_element().min(ray.t_max);
        let mut best = (ray.t_max, u32::MAX);
        if enter <= leave {
            self.walk(&self.root, self.min, self.size, ray, (enter, leave), &mut best);
        }
        (best.1 != u32::MAX).then_some(best)
    }

    /// Everything in a cell along the interval in which the ray crosses it: the digital differential analyser, one level
    /// at a time.
    fn walk(
        &self,
        cell: &Cell,
        min: Vec3,
        size: f32,
        ray: &Ray,
        (enter, leave): (f32, f32),
        best: &mut (f32, u32),
    ) {
        for &index in &cell.primitives {
            if let Some(t) = self.triangles[index as usize].and_then(|triangle| triangle.intersect(ray))
                && (t < best.0 || (t == best.0 && index < best.1))
            {
                *best = (t, index);
            }
        }
        let Some(children) = &cell.children else { return };
        let step = size / FACTOR as f32;
        let last = IVec3::splat(FACTOR - 1);
        let mut at = ((ray.at(enter) - min) / step).as_ivec3().clamp(IVec3::ZERO, last);
        let sign = ray.direction.signum().as_ivec3();
        let reciprocal = ray.direction.recip();
        let mut start = enter;
        while start <= leave.min(best.0) {
            // Where the ray leaves this cell, and through which side.
            let side = min + (at + (sign + IVec3::ONE) / 2).as_vec3() * step;
            let ends = (side - ray.origin) * reciprocal;
            let ends = Vec3::select(ends.is_nan_mask(), Vec3::INFINITY, ends);
            let axis = ends.min_position();
            let end = ends[axis].min(leave);
            let child = &children[index(at)];
            if child.entries > 0 {
                let corner = min + at.as_vec3() * step;
                self.walk(child, corner, step, ray, (start, end.max(start)), best);
            }
            at[axis] += sign[axis];
            if at[axis] < 0 || at[axis] >= FACTOR || sign[axis] == 0 {
                return;
            }
            start = end.max(start);
        }
    }
}

fn index(at: IVec3) -> usize {
    ((at.z * FACTOR + at.y) * FACTOR + at.x) as usize
}

/// Down to the cell at `at` of a level below `cell`, counting on the way.
fn descend(
    cell: &mut Cell,
    at: IVec3,
    level: u32,
    change: &mut dyn FnMut(&mut Cell),
    count: fn(u32, u32) -> u32,
) {
    cell.entries = count(cell.entries, 1);
    if level == 0 {
        return change(cell);
    }
    let below = FACTOR.pow(level - 1);
    let children = cell.children.get_or_insert_with(|| Box::new(std::array::from_fn(|_| Cell::default())));
    descend(&mut children[index(at / below)], at % below, level - 1, change, count);
}
