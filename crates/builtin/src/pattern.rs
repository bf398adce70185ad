//! Procedural surfaces: linear RGB as a function of texture coordinates, repeating in both directions.

use glam::{Vec2, Vec3, Vec4};

use crate::random::{fbm, hash, noise};

/// 0 below `low`, 1 above `high`, smooth between.
pub(crate) fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}

/// Wood with its grain along u.
pub(crate) fn wood(uv: Vec2, dark: Vec3, light: Vec3, seed: u32) -> Vec3 {
    let bend = fbm(uv * Vec2::new(2.0, 4.0), 2, 3, seed) + 0.5 * noise(uv * Vec2::new(4.0, 4.0), 4, seed + 9);
    let rings = (uv.y * 9.0 + 3.0 * bend).fract();
    let ring = smooth(0.0, 0.75, rings) - smooth(0.85, 1.0, rings);
    let fibre = fbm(Vec2::new(uv.x * 16.0, uv.y * 256.0), 16, 2, seed + 31);
    mix(dark, light, 0.25 + 0.45 * ring + 0.3 * fibre)
}

/// Marble: veins through a clouded ground.
pub(crate) fn marble(uv: Vec2, ground: Vec3, vein: Vec3, seed: u32) -> Vec3 {
    let warp = Vec2::new(fbm(uv * 4.0, 4, 4, seed), fbm(uv * 4.0, 4, 4, seed + 17)) * 1.5;
    let line = 1.0 - 2.0 * (fbm(uv * 3.0 + warp * 0.8, 3, 4, seed + 40) - 0.5).abs();
    let fine = 1.0 - 2.0 * (fbm(uv * 8.0 + warp, 8, 3, seed + 51) - 0.5).abs();
    let veins = smooth(0.90, 1.0, line) * 0.7 + smooth(0.93, 1.0, fine) * 0.25;
    mix(ground * (0.88 + 0.2 * fbm(uv * 4.0, 4, 4, seed + 60)), vein, veins)
}

/// Square slabs, `count` per side, in two stones as a chequerboard, with grout.
pub(crate) fn slabs(uv: Vec2, count: u32, stones: [Vec3; 2], seed: u32) -> Vec3 {
    let p = uv * count as f32;
    let cell = p.floor();
    let (i, j) = (cell.x as u32, cell.y as u32);
    let stone = stones[((i + j) % 2) as usize] * (0.8 + 0.35 * hash(i, j, seed));
    let offset = Vec2::new(hash(i, j, seed + 1), hash(i, j, seed + 2));
    let speckle = 0.82 + 0.3 * fbm((uv + offset) * 8.0, 8, 5, seed + 3);
    let f = p - cell;
    let edge = f.min(Vec2::ONE - f).min_element();
    mix(Vec3::new(0.20, 0.18, 0.15), stone * speckle, smooth(0.008, 0.022, edge))
}

/// Courses of hewn blocks in running bond, `courses` high and half as many blocks long.
pub(crate) fn ashlar(uv: Vec2, courses: u32, stone: Vec3, seed: u32) -> Vec3 {
    let row = (uv.y * courses as f32) as u32;
    let half = courses / 2;
    let x = uv.x * half as f32 + 0.5 * (row % 2) as f32;
    let block = x as u32 % half;
    let tone = 0.82 + 0.3 * hash(block, row, seed);
    let warm = mix(Vec3::ONE, Vec3::new(1.06, 0.98, 0.86), hash(block, row, seed + 1));
    let (fx, fy) = (x.fract(), (uv.y * courses as f32).fract());
    let edge = (fx.min(1.0 - fx) * 2.0).min(fy.min(1.0 - fy)) - 0.02 * noise(uv * 64.0, 64, seed + 5);
    let grain = 0.78 + 0.4 * fbm(uv * 8.0, 8, 6, seed + 2);
    stone * warm * tone * grain * mix(Vec3::splat(0.55), Vec3::ONE, smooth(0.0, 0.035, edge))
}

/// Painted plaster, slightly stained.
pub(crate) fn plaster(uv: Vec2, paint: Vec3, seed: u32) -> Vec3 {
    let stain = smooth(0.35, 0.75, fbm(uv * 3.0, 3, 5, seed));
    paint
        * (0.9 + 0.1 * fbm(uv * 24.0, 24, 3, seed + 1))
        * mix(Vec3::ONE, Vec3::new(0.82, 0.78, 0.70), 0.5 * stain)
}

/// Woven cloth.
pub(crate) fn fabric(uv: Vec2, dye: Vec3, seed: u32) -> Vec3 {
    let thread = uv * 96.0;
    let over = ((thread.x as u32) + (thread.y as u32)) % 2;
    let t = if over == 0 { thread.x.fract() } else { thread.y.fract() };
    let round = 0.65 + 0.35 * (std::f32::consts::PI * t).sin();
    dye * round * (0.85 + 0.3 * hash(thread.x as u32, thread.y as u32, seed))
}

/// Short-pile carpet in squares of two tones.
pub(crate) fn carpet(uv: Vec2, dyes: [Vec3; 2], seed: u32) -> Vec3 {
    let p = uv * 2.0;
    let square = (p.x as u32 + p.y as u32) % 2;
    let pile = uv * 256.0;
    let tuft = hash(pile.x as u32, pile.y as u32, seed);
    let stripe =
        noise(if square == 0 { uv * Vec2::new(96.0, 6.0) } else { uv * Vec2::new(6.0, 96.0) }, 192, seed);
    dyes[square as usize] * (0.6 + 0.45 * tuft + 0.3 * stripe)
}

/// A pointed leaf with its stem at the bottom: colour and coverage. u across, v down.
pub(crate) fn leaf(uv: Vec2, green: Vec3, seed: u32) -> Vec4 {
    let along = 1.0 - uv.y;
    let across = (uv.x - 0.5).abs() * 2.0;
    let width = 1.9 * (along + 0.01).powf(0.6) * (1.0 - along).powf(0.75);
    let rib = 1.0 - smooth(0.01, 0.05, across);
    let side_ribs = smooth(0.86, 1.0, ((along * 9.0 - across * 2.2).fract() - 0.5).abs() * 2.0) * 0.35;
    let tone = 0.75 + 0.5 * fbm(uv * 6.0, 6, 4, seed);
    let color = mix(green * tone, Vec3::new(0.40, 0.48, 0.16), (rib * 0.6 + side_ribs * 0.5).min(1.0));
    color.extend(if across < width { 1.0 } else { 0.0 })
}

/// Sixteen book spines side by side over u: bands, a title field, worn edges.
pub(crate) fn spines(uv: Vec2, seed: u32) -> Vec3 {
    const DYES: [Vec3; 8] = [
        Vec3::new(0.30, 0.035, 0.03),
        Vec3::new(0.03, 0.07, 0.20),
        Vec3::new(0.03, 0.12, 0.06),
        Vec3::new(0.45, 0.33, 0.14),
        Vec3::new(0.08, 0.06, 0.055),
        Vec3::new(0.55, 0.50, 0.40),
        Vec3::new(0.10, 0.22, 0.26),
        Vec3::new(0.36, 0.13, 0.04),
    ];
    let book = (uv.x * 16.0) as u32;
    let x = (uv.x * 16.0).fract();
    let style = hash(book, 1, seed);
    let dye = DYES[(book as usize * 5 + 3) % 8] * (0.8 + 0.4 * hash(book, 2, seed));
    let foil = if style < 0.6 { Vec3::new(0.70, 0.52, 0.20) } else { Vec3::splat(0.75) };
    let at = |center: f32, half: f32| (uv.y - center).abs() < half;
    let bands = [0.07, 0.10, 0.90, 0.93].into_iter().any(|c| at(c, 0.006)) && style < 0.75;
    let title = at(0.30, 0.14 + 0.05 * style) && (x - 0.5).abs() < 0.28;
    // Letters run along the spine: strokes and gaps, with word spaces.
    let letter = (uv.y * 90.0) as u32;
    let ink = hash(letter, book, seed + 7) > 0.3 && hash((uv.x * 160.0) as u32, letter, seed + 8) > 0.35;
    let emblem = at(0.78, 0.03) && (x - 0.5).abs() < 0.22 && style > 0.3;
    let worn = 0.85 + 0.25 * fbm(uv * 16.0, 16, 3, seed + 11);
    if bands || emblem || (title && ink) { foil * worn } else { dye * worn }
}

/// How far `p` is from the segment a–b.
pub(crate) fn segment_distance(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let ab = b - a;
    let t = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * ab)
}
