//! The table and what lies on it.

use std::f32::consts::PI;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Material, SceneBuilder};

use super::{Palette, TABLE, TABLE_HEIGHT, fixed, object};
use crate::random::Rng;
use crate::shape::{Shape, place};
use crate::solid::{cap, circle, cylinder, lathe, loft, rectangle, solid, sphere, superellipse, tube};

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    table(builder, palette);
    laptops(builder, palette);
    crockery(builder, palette);
    papers(builder, palette);
    telephone(builder, palette);
}

fn table(builder: &mut SceneBuilder, palette: &Palette) {
    let outline = superellipse(TABLE, 3.4, 160);
    let edge: Vec<_> = (0..=10)
        .map(|i| PI * (i as f32 / 10.0 - 0.5))
        .map(|a| (-0.018 + 0.018 * a.cos(), TABLE_HEIGHT - 0.018 + 0.018 * a.sin()))
        .collect();
    let top = Shape::union([
        loft(&outline, &edge),
        cap(&outline, -0.018, TABLE_HEIGHT - 0.036, false),
        cap(&outline, -0.018, TABLE_HEIGHT, true),
    ]);
    let feet = [-1.75, 1.75].map(|x| {
        let panel = superellipse(Vec2::new(0.16, 0.42), 4.0, 48);
        solid(
            &panel,
            &[
                (0.10, 0.0),
                (0.10, 0.03),
                (0.02, 0.06),
                (0.0, 0.12),
                (0.0, 0.60),
                (0.05, TABLE_HEIGHT - 0.036),
            ],
        )
        .moved(Vec3::X * x)
    });
    let beam = Shape::rounded_block(Vec3::new(3.4, 0.09, 0.06), 0.01, 2, 1).moved(Vec3::Y * 0.56);
    let inlay =
        solid(&rectangle(Vec2::new(0.55, 0.09)), &[(0.0, TABLE_HEIGHT - 0.01), (0.0, TABLE_HEIGHT + 0.002)]);
    fixed(
        builder,
        "table",
        [
            (top, palette.walnut),
            (Shape::union(feet), palette.walnut),
            (Shape::union([beam, inlay]), palette.black),
        ],
    );
}

fn laptops(builder: &mut SceneBuilder, palette: &Palette) {
    let base = Shape::rounded_block(Vec3::new(0.32, 0.014, 0.22), 0.006, 2, 1).moved(Vec3::Y * 0.009);
    let mut keys = Shape::default();
    for row in 0..5 {
        for column in 0..14 {
            let at = Vec3::new((column as f32 - 6.5) * 0.0205, 0.0175, -0.075 + row as f32 * 0.021);
            keys.add(&Shape::block_on(at - Vec3::Y * 0.002, Vec3::new(0.017, 0.003, 0.017)));
        }
    }
    keys.add(&Shape::block_on(Vec3::new(0.0, 0.0155, 0.066), Vec3::new(0.10, 0.001, 0.06)));
    // The lid turns about the far edge of the base.
    let hinge = Affine3A::from_translation(Vec3::new(0.0, 0.016, -0.11)) * Affine3A::from_rotation_x(-0.35);
    let lid =
        Shape::rounded_block(Vec3::new(0.32, 0.21, 0.008), 0.0038, 2, 1).moved(Vec3::Y * 0.105).at(hinge);
    let screen = Shape::quad(Vec3::new(-0.15, 0.015, 0.0045), Vec3::X * 0.30, Vec3::Y * 0.185).at(hinge);
    let glass = builder.material(Material::plastic("screen", Vec3::new(0.012, 0.014, 0.018), 0.05));
    let shell = Shape::union([base, lid]);
    let laptop =
        object(builder, "laptop", [(shell, palette.aluminium), (keys, palette.black), (screen, glass)]);
    for (x, z, yaw) in
        [(-2.3, 0.46, 0.1), (-0.75, 0.45, -0.15), (1.6, 0.46, 0.05), (-1.55, -0.46, 3.0), (0.85, -0.45, 3.3)]
    {
        builder.place("laptop", laptop, None, place(Vec3::new(x, TABLE_HEIGHT, z), yaw));
    }
}

fn crockery(builder: &mut SceneBuilder, palette: &Palette) {
    let cup = [
        (0.0, 0.004),
        (0.022, 0.004),
        (0.024, 0.0),
        (0.027, 0.0),
        (0.028, 0.006),
        (0.036, 0.02),
        (0.040, 0.045),
        (0.042, 0.075),
        (0.0405, 0.0765),
        (0.039, 0.075),
        (0.037, 0.045),
        (0.033, 0.022),
        (0.024, 0.010),
        (0.0, 0.008),
    ];
    let handle: Vec<_> = (0..=14)
        .map(|i| PI * (i as f32 / 14.0 - 0.5))
        .map(|a| (Vec3::new(0.038 + 0.024 * a.cos(), 0.042 + 0.022 * a.sin(), 0.0), 0.0042))
        .collect();
    let saucer = [
        (0.0, 0.003),
        (0.034, 0.003),
        (0.036, 0.0),
        (0.040, 0.0),
        (0.060, 0.007),
        (0.074, 0.014),
        (0.0735, 0.016),
        (0.058, 0.010),
        (0.038, 0.005),
        (0.0, 0.005),
    ];
    let china = Shape::union([lathe(40, &cup), tube(&handle, 10, false)]).moved(Vec3::Y * 0.005);
    let china = Shape::union([china, lathe(40, &saucer)]);
    let coffee = cap(&circle(0.0385, 32), 0.0, 0.066, true);
    let brown = builder.material(Material::plastic("coffee", Vec3::new(0.030, 0.012, 0.005), 0.05));
    let cup = object(builder, "cup", [(china, palette.porcelain), (coffee, brown)]);
    for (i, (x, z)) in [
        (-2.75, 0.30),
        (-1.2, 0.36),
        (0.1, 0.50),
        (1.1, 0.34),
        (2.25, 0.42),
        (-2.2, -0.34),
        (-0.6, -0.50),
        (0.3, -0.4),
        (1.5, -0.36),
        (2.5, -0.38),
        (2.95, 0.02),
        (2.0, 3.1),
        (2.2, 3.22),
    ]
    .into_iter()
    .enumerate()
    {
        let y = if z > 1.0 { super::room::SIDEBOARD_HEIGHT } else { TABLE_HEIGHT };
        builder.place("cup", cup, None, place(Vec3::new(x, y, z), i as f32 * 2.4));
    }

    let wall = [
        (0.0, 0.0),
        (0.030, 0.0),
        (0.033, 0.004),
        (0.037, 0.11),
        (0.0362, 0.112),
        (0.0354, 0.11),
        (0.0315, 0.010),
        (0.0, 0.008),
    ];
    let clear = builder.material(Material::glass("glass", 1.5));
    let tumbler = object(builder, "tumbler", [(lathe(40, &wall), clear)]);
    let decanter = [
        (0.0, 0.0),
        (0.060, 0.0),
        (0.065, 0.005),
        (0.066, 0.14),
        (0.056, 0.19),
        (0.032, 0.225),
        (0.030, 0.26),
        (0.038, 0.29),
        (0.0365, 0.291),
        (0.0275, 0.26),
        (0.0295, 0.224),
        (0.053, 0.188),
        (0.063, 0.139),
        (0.062, 0.010),
        (0.0, 0.008),
    ];
    let decanter = object(builder, "decanter", [(lathe(48, &decanter), clear)]);
    for x in [-1.9, 1.35] {
        builder.place("decanter", decanter, None, place(Vec3::new(x, TABLE_HEIGHT, 0.02), 0.0));
        for i in 0..4 {
            let at = Vec3::new(x + 0.16 + 0.09 * (i % 2) as f32, TABLE_HEIGHT, 0.09 * (i / 2) as f32 - 0.05);
            builder.place("tumbler", tumbler, None, place(at, 0.0));
        }
    }
}

/// Stacks of paper, not quite aligned, each with a pen.
fn papers(builder: &mut SceneBuilder, palette: &Palette) {
    let mut rng = Rng::new(41);
    let (mut sheets, mut pens) = (Shape::default(), Shape::default());
    let spots = [
        (-1.6, 0.50),
        (0.55, 0.46),
        (2.55, 0.45),
        (-2.4, -0.47),
        (-0.1, -0.46),
        (1.9, -0.48),
        (2.75, -0.15),
        (-0.9, 0.1),
    ];
    for (x, z) in spots {
        for sheet in 0..1 + rng.below(6) {
            let at = Vec3::new(x, TABLE_HEIGHT + 0.0012 * sheet as f32, z);
            let leaf = Shape::block_on(Vec3::ZERO, Vec3::new(0.21, 0.001, 0.297));
            sheets.add(&leaf.at(place(at, rng.range(-0.2, 0.2))));
        }
        let pen = [
            (0.0, 0.0),
            (0.0012, 0.002),
            (0.0045, 0.014),
            (0.005, 0.03),
            (0.005, 0.13),
            (0.004, 0.138),
            (0.0, 0.14),
        ];
        let lying = Affine3A::from_rotation_y(rng.range(0.0, 6.0)) * Affine3A::from_rotation_z(-0.5 * PI);
        pens.add(&lathe(14, &pen).at(lying).moved(Vec3::new(x + 0.17, TABLE_HEIGHT + 0.005, z)));
    }
    fixed(builder, "papers", [(sheets, palette.paper), (pens, palette.black)]);
}

/// A three-legged conference telephone.
fn telephone(builder: &mut SceneBuilder, palette: &Palette) {
    let body = Shape::patch(72, 12, Vec2::ONE, |u, v| {
        let a = 2.0 * PI * u;
        let reach = 0.085 + 0.045 * (3.0 * a).cos();
        let r = reach * (0.5 * PI * v).cos();
        Vec3::new(r * a.cos(), 0.008 + 0.035 * (0.5 * PI * v).sin(), -r * a.sin())
    });
    let keys = (0..12).map(|i| {
        let at = Vec3::new((i % 3) as f32 * 0.016 - 0.016, 0.0425, (i / 3) as f32 * 0.014 - 0.02);
        cylinder(at, 0.005, 0.003, 12)
    });
    let dot = sphere(Vec3::new(0.0, 0.042, -0.034), 0.004, 12);
    let phone = Shape::union(keys.chain([dot]));
    let phone = object(builder, "telephone", [(body, palette.black), (phone, palette.aluminium)]);
    builder.place("telephone", phone, None, place(Vec3::new(-0.25, TABLE_HEIGHT, 0.0), 0.4));
}
