//! Which plane cuts a cell best: the sweep over sorted events, or simply the middle.
use super::event::{Event, Kind};
use crate::aabb::Aabb;

/// A plane that cuts a cell, and what lies on either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    pub axis: usize,
    pub position: f32,
    /// Where triangles in the plane itself go.
    pub planar_left: bool,
    /// Triangles on either side; those that cross the plane count on both.
    pub left: u32,
    pub right: u32,
    /// Expected cost · half the cell's surface area.
    pub cost: f64,
}

/// The constants of the cost function.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costs {
    pub traversal: f64,
    pub intersection: f64,
    /// Factor for planes that cut off empty space.
    pub empty: f64,
}

/// Half the surface area of a box, in double precision: it must not vanish for tiny boxes.
pub(super) fn half_area(cell: &Aabb) -> f64 {
    let s = cell.max.as_dvec3() - cell.min.as_dvec3();
    s.x * s.y + s.y * s.z + s.z * s.x
}

/// The cheapest plane along `axis` through `cell` by the surface area heuristic, if there is any plane.
///
/// # References
/// Wald and Havran 2006, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)", algorithm 5.
pub(super) fn best_on_axis(
    events: &[Event],
    triangles: u32,
    cell: &Aabb,
    axis: usize,
    costs: &Costs,
) -> Option<Split> {
    let (lo, hi) = (cell.min[axis], cell.max[axis]);
    let size = cell.max.as_dvec3() - cell.min.as_dvec3();
    let (across, along) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
    // Half area of a slice of the cell = ends + rim · its thickness.
    let (ends, rim) = (across * along, across + along);
    let fixed = costs.traversal * half_area(cell);
    let mut best: Option<Split> = None;
    let mut best_cost = f64::INFINITY;
    let (mut left, mut right) = (0, triangles);
    let mut rest = events;
    while let Some(&first) = rest.first() {
        let key = first.key();
        let mut count = [0_u32; 3];
        let mut same = 0;
        for event in rest.iter().take_while(|event| event.key() == key) {
            count[event.kind() as usize] += 1;
            same += 1;
        }
        rest = &rest[same..];
        let [ending, planar, starting] = count;
        right -= planar + ending;
        let position = first.position();
        // A plane at an end of the cell may cut off a flat cell for the triangles that lie in it.
        let (inside_left, inside_right) = (lo < position, position < hi);
        if (inside_left && inside_right) || (planar > 0 && inside_left != inside_right) {
            let area_left = ends + rim * (f64::from(position) - f64::from(lo));
            let area_right = ends + rim * (f64::from(hi) - f64::from(position));
            let cost = |l: u32, r: u32| {
                let sum = fixed + costs.intersection * (area_left * f64::from(l) + area_right * f64::from(r));
                if l == 0 || r == 0 { sum * costs.empty } else { sum }
            };
            let into_left = if inside_right { cost(left + planar, right) } else { f64::INFINITY };
            let into_right = if inside_left { cost(left, right + planar) } else { f64::INFINITY };
            let planar_left = into_left <= into_right;
            let cost = into_left.min(into_right);
            if cost < best_cost {
                best_cost = cost;
                let (to_left, to_right) = if planar_left { (planar, 0) } else { (0, planar) };
                let (left, right) = (left + to_left, right + to_right);
                best = Some(Split { axis, position, planar_left, left, right, cost });
            }
        }
        left += planar + starting;
    }
    best
}

/// The plane through the middle of the cell's longest edge, if it has a middle.
pub(super) fn middle(events: &[Vec<Event>; 3], cell: &Aabb) -> Option<Split> {
    let axis = cell.size().max_position();
    let position = cell.center()[axis];
    if !(cell.min[axis] < position && position < cell.max[axis]) {
        return None;
    }
    let mut split = Split { axis, position, planar_left: true, left: 0, right: 0, cost: 0.0 };
    for event in &events[axis] {
        match event.kind() {
            Kind::Start => split.left += u32::from(event.position() < position),
            Kind::End => split.right += u32::from(event.position() > position),
            Kind::Planar if event.position() <= position => split.left += 1,
            Kind::Planar => split.right += 1,
        }
    }
    Some(split)
}
