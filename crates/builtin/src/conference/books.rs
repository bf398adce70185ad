//! Book cases and what stands in them.

use glam::{Vec2, Vec3};
use heliostat_scene::{Material, SceneBuilder, TextureRef};

use super::{HALF, Palette, fixed};
use crate::random::Rng;
use crate::shape::Shape;
use crate::solid::lathe;
use crate::{paint, pattern};

const CASE: Vec3 = Vec3::new(1.55, 2.25, 0.34);
const SHELVES: usize = 6;
const BOARD: f32 = 0.025;

/// Three cases against the wall at +Z, filled.
pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    let spines = paint::decal(builder, "spines", [1024, 256], |uv| pattern::spines(uv, 6).extend(1.0));
    let cover = builder.material(Material {
        name: "book cover".into(),
        base_color_texture: Some(TextureRef::new(spines)),
        roughness: 0.55,
        ..Material::default()
    });
    let mut rng = Rng::new(99);
    let (mut cases, mut covers, mut pages, mut vases) =
        (Shape::default(), Shape::default(), Shape::default(), Shape::default());
    for i in 0..3 {
        let corner = Vec3::new(-3.55 + i as f32 * (CASE.x + 0.02), 0.0, HALF.y - CASE.z);
        cases.add(&case().moved(corner));
        for shelf in 0..SHELVES - 1 {
            let floor = corner + Vec3::Y * (shelf_height(shelf) + BOARD);
            fill(&mut rng, floor, &mut covers, &mut pages, &mut vases);
        }
    }
    fixed(builder, "book cases", [(cases, palette.oak)]);
    fixed(builder, "books", [(covers, cover), (pages, palette.paper)]);
    fixed(builder, "vases", [(vases, palette.porcelain)]);
}

fn shelf_height(shelf: usize) -> f32 {
    0.08 + (CASE.y - 0.08 - BOARD) * shelf as f32 / (SHELVES - 1) as f32
}

/// A case with its back at z = depth, open towards −Z.
fn case() -> Shape {
    let board = |min: Vec3, size: Vec3| Shape::rounded_block(size, 0.003, 1, 1).moved(min + 0.5 * size);
    let mut shape = board(Vec3::new(0.0, 0.0, CASE.z - 0.012), Vec3::new(CASE.x, CASE.y, 0.012));
    for x in [0.0, CASE.x - BOARD] {
        shape.add(&board(Vec3::X * x, Vec3::new(BOARD, CASE.y, CASE.z)).with_uvs(|uv| Vec2::new(uv.y, uv.x)));
    }
    for shelf in 0..SHELVES {
        let size = Vec3::new(CASE.x - 2.0 * BOARD, BOARD, CASE.z - 0.01);
        shape.add(&board(Vec3::new(BOARD, shelf_height(shelf), 0.004), size));
    }
    shape.add(&board(Vec3::new(BOARD, 0.0, 0.03), Vec3::new(CASE.x - 2.0 * BOARD, 0.08, 0.02)));
    shape
}

/// Runs of books with gaps, the last of a run leaning; now and then a vase.
fn fill(rng: &mut Rng, floor: Vec3, covers: &mut Shape, pages: &mut Shape, vases: &mut Shape) {
    let end = CASE.x - BOARD - 0.03;
    let mut x = BOARD + 0.01;
    while x < end - 0.05 {
        let event = rng.unit();
        if event < 0.06 && x < end - 0.30 {
            vases.add(&vase(rng).moved(floor + Vec3::new(x + 0.13, 0.0, 0.15)));
            x += 0.27;
            continue;
        }
        let size = Vec3::new(rng.range(0.018, 0.055), rng.range(0.21, 0.34), rng.range(0.16, 0.23));
        let lean = if event > 0.93 { 0.22 } else { 0.0 };
        let foot = size.x + lean * size.y;
        if x + foot > end {
            break;
        }
        let (cover, leaves) = book(size, rng.below(16));
        let tilt = glam::Affine3A::from_rotation_z(lean);
        // Turned about its left lower edge; leaning to the left, it needs room on that side.
        let at = floor + Vec3::new(x + lean * size.y, 0.0, 0.03 + rng.range(0.0, 0.03));
        covers.add(&cover.at(tilt).moved(at));
        pages.add(&leaves.at(tilt).moved(at));
        x += foot + 0.002;
    }
}

/// A bound book standing on the origin with its spine towards −Z: cover and pages.
fn book(size: Vec3, style: usize) -> (Shape, Shape) {
    let column = style as f32 / 16.0;
    let board = 0.003;
    let round = 0.006;
    // u runs from left to right as one looks at the spine, that is along −X.
    let spine = Shape::patch(6, 1, Vec2::ONE, |u, v| {
        Vec3::new(size.x * (1.0 - u), size.y * v, -round * (std::f32::consts::PI * u).sin())
    });
    let mut cover = spine.with_uvs(|uv| Vec2::new(column + (0.04 + 0.92 * uv.x) / 16.0, uv.y));
    let plain = Vec2::new(column + 0.03 / 16.0, 0.5);
    for x in [0.0, size.x - board] {
        let side = Shape::block(Vec3::new(x, 0.0, 0.0), Vec3::new(x + board, size.y, size.z));
        cover.add(&side.with_uvs(|_| plain));
    }
    let inset = Vec3::new(board, 0.004, 0.001);
    (cover, Shape::block(inset, size - Vec3::new(board, 0.004, 0.005)))
}

fn vase(rng: &mut Rng) -> Shape {
    let (r, h) = (rng.range(0.06, 0.10), rng.range(0.16, 0.30));
    let neck = rng.range(0.25, 0.5);
    let profile: Vec<_> = [
        (0.0, 0.0),
        (0.55, 0.0),
        (0.62, 0.04),
        (0.85, 0.20),
        (1.0, 0.40),
        (0.90, 0.60),
        (neck + 0.15, 0.78),
        (neck, 0.88),
        (neck + 0.08, 0.98),
        (neck + 0.05, 1.0),
        (neck - 0.05, 0.9),
        (neck, 0.75),
    ]
    .iter()
    .map(|&(x, y)| (x * r, y * h))
    .collect();
    lathe(28, &profile)
}
