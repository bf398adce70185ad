//! The shell of the conference room: walls, windows with blinds, lamps, whiteboard, door, sideboard.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_scene::{Material, SceneBuilder, TextureRef};

use super::{HALF, HEIGHT, Lighting, Palette, fixed, object};
use crate::pattern::{self, segment_distance, smooth};
use crate::random::{fbm, hash};
use crate::shape::{Shape, place};
use crate::solid::{cap, circle, cylinder, lathe, loft, rectangle, torus, tube};
use crate::{paint, random::Rng};

/// Where things on the sideboard stand.
pub(super) const SIDEBOARD_HEIGHT: f32 = 0.82;

const WINDOWS: usize = 4;
const SILL: f32 = 0.85;
const LINTEL: f32 = 2.55;
const WINDOW_WIDTH: f32 = 1.9;
const WINDOW_PITCH: f32 = 2.35;
const WALL: f32 = 0.28;

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette, lighting: Lighting) {
    shell(builder, palette);
    lamps(builder, palette, lighting);
    windows(builder, palette, lighting);
    blinds(builder, palette);
    radiators(builder, palette);
    whiteboard(builder, palette);
    door(builder, palette);
    sideboard(builder, palette);
    pictures(builder, palette);
    clock(builder, palette);
}

fn shell(builder: &mut SceneBuilder, palette: &Palette) {
    let carpet = paint::texture(builder, "carpet", 512, |uv| {
        pattern::carpet(uv, [Vec3::new(0.085, 0.10, 0.115), Vec3::new(0.065, 0.085, 0.105)], 3)
    });
    let carpet = paint::textured(builder, "carpet", carpet, Vec2::splat(1.0), 1.0);
    let paint_texture =
        paint::texture(builder, "wall paint", 256, |uv| pattern::plaster(uv, Vec3::new(0.70, 0.67, 0.60), 2));
    let paint = paint::textured(builder, "wall paint", paint_texture, Vec2::splat(2.5), 0.9);
    let tiles =
        paint::texture(builder, "ceiling tiles", 512, |uv| pattern::slabs(uv, 4, [Vec3::splat(0.72); 2], 12));
    let tiles = paint::textured(builder, "ceiling tiles", tiles, Vec2::splat(2.4), 0.95);

    let (x, z) = (Vec3::X * 2.0 * HALF.x, Vec3::Z * 2.0 * HALF.y);
    let corner = Vec3::new(-HALF.x, 0.0, -HALF.y);
    fixed(builder, "floor", [(Shape::quad(corner + z, x, -z), carpet)]);
    fixed(builder, "ceiling", [(Shape::quad(corner + Vec3::Y * HEIGHT, x, z), tiles)]);

    let up = Vec3::Y * HEIGHT;
    let mut walls = Shape::union([
        Shape::quad(corner + z, -z, up),
        Shape::quad(corner + x, z, up),
        Shape::quad(corner + x + z, -x, up),
    ]);
    let block = |x0: f32, x1: f32, y0: f32, y1: f32| {
        Shape::block(Vec3::new(x0, y0, -HALF.y - WALL), Vec3::new(x1, y1, -HALF.y))
    };
    walls.add(&block(-HALF.x, HALF.x, 0.0, SILL));
    walls.add(&block(-HALF.x, HALF.x, LINTEL, HEIGHT));
    let edges: Vec<f32> = (0..WINDOWS)
        .flat_map(|i| [window_center(i) - 0.5 * WINDOW_WIDTH, window_center(i) + 0.5 * WINDOW_WIDTH])
        .collect();
    let piers = std::iter::once(-HALF.x).chain(edges).chain([HALF.x]).collect::<Vec<_>>();
    for pier in piers.chunks_exact(2) {
        walls.add(&block(pier[0], pier[1], SILL, LINTEL));
    }
    fixed(builder, "walls", [(walls, paint)]);

    let skirting = [(0.0, 0.10), (-0.008, 0.10), (-0.016, 0.085), (-0.016, 0.0)];
    let cove = [
        (0.0, HEIGHT),
        (-0.05, HEIGHT),
        (-0.045, HEIGHT - 0.02),
        (-0.02, HEIGHT - 0.045),
        (0.0, HEIGHT - 0.05),
    ];
    let trim = [&skirting[..], &cove[..]].map(|profile| loft(&rectangle(HALF), profile));
    fixed(builder, "trim", [(Shape::union(trim), palette.white)]);
}

fn window_center(i: usize) -> f32 {
    (i as f32 - 0.5 * (WINDOWS - 1) as f32) * WINDOW_PITCH
}

/// Eight framed panels, or one rectangle over the table, or many small lamps.
fn lamps(builder: &mut SceneBuilder, palette: &Palette, lighting: Lighting) {
    let (size, radiance) = match lighting {
        Lighting::Ceiling => (Vec2::new(1.20, 0.60), Vec3::new(8.6, 8.0, 7.0)),
        Lighting::OneLamp => (Vec2::new(3.60, 1.00), Vec3::new(14.0, 13.0, 11.4)),
        Lighting::ManyLamps => return downlights(builder, palette),
    };
    let glow = builder.material(Material::emitter("lamp", radiance));
    let face = Shape::quad(Vec3::new(-0.5 * size.x, 0.0, -0.5 * size.y), Vec3::X * size.x, Vec3::Z * size.y);
    let half = 0.5 * size;
    let rim = [
        (0.045, 0.06),
        (0.05, 0.05),
        (0.05, -0.022),
        (0.042, -0.03),
        (0.012, -0.03),
        (0.002, -0.022),
        (0.0, 0.0),
    ];
    // Downwards along the profile is the inside of the ring; this one is walked the other way round.
    let rim: Vec<_> = rim.into_iter().rev().collect();
    let frame = loft(&rectangle(half), &rim);
    let rim = object(builder, "lamp rim", [(frame, palette.aluminium)]);
    let spots: Vec<Vec2> = match lighting {
        Lighting::Ceiling => {
            (0..8).map(|i| Vec2::new((i / 2) as f32 * 2.4 - 3.6, (i % 2) as f32 * 2.6 - 1.3)).collect()
        }
        Lighting::OneLamp | Lighting::ManyLamps => vec![Vec2::ZERO],
    };
    let spots = spots.into_iter().map(|spot| Vec3::new(spot.x, HEIGHT - 0.055, spot.y));
    // The panels are switched together and are one light: renderers that visit every light need one shadow ray for all.
    let panels = Shape::union(spots.clone().map(|spot| face.clone().moved(spot)));
    let panels = object(builder, "lamps", [(panels, glow)]);
    builder.place("lamps", panels, None, Affine3A::IDENTITY);
    for spot in spots {
        builder.place("lamp rim", rim, None, place(spot, 0.0));
    }
}

/// Twenty by eleven round lamps in collars, switched one by one.
fn downlights(builder: &mut SceneBuilder, palette: &Palette) {
    const COUNT: [u32; 2] = [20, 11];
    // As much light as the eight panels give.
    let glow = builder.material(Material::emitter("lamp", Vec3::new(33.0, 30.7, 26.8)));
    let face = cap(&circle(0.047, 12), 0.0, -0.012, false);
    let face = object(builder, "downlight", [(face, glow)]);
    let collar = lathe(16, &[(0.05, 0.0), (0.05, -0.02), (0.058, -0.02), (0.062, 0.0)]);
    let collar = object(builder, "collar", [(collar, palette.white)]);
    for i in 0..COUNT[0] * COUNT[1] {
        let cell = Vec2::new((i % COUNT[0]) as f32 + 0.5, (i / COUNT[0]) as f32 + 0.5);
        let spot = (cell / Vec2::new(COUNT[0] as f32, COUNT[1] as f32) * 2.0 - 1.0) * HALF;
        let at = place(Vec3::new(spot.x, HEIGHT, spot.y), 0.0);
        builder.place("collar", collar, None, at);
        builder.place("downlight", face, None, at);
    }
}

/// Frames with a mullion and a transom, sills, and the evening outside.
fn windows(builder: &mut SceneBuilder, palette: &Palette, lighting: Lighting) {
    let (w, h) = (0.5 * WINDOW_WIDTH, LINTEL - SILL);
    let bar = |min: Vec3, size: Vec3| Shape::rounded_block(size, 0.006, 1, 1).moved(min + 0.5 * size);
    let (t, d) = (0.055, 0.07);
    let frame = Shape::union([
        bar(Vec3::new(-w, 0.0, 0.0), Vec3::new(t, h, d)),
        bar(Vec3::new(w - t, 0.0, 0.0), Vec3::new(t, h, d)),
        bar(Vec3::new(-w, 0.0, 0.0), Vec3::new(2.0 * w, t, d)),
        bar(Vec3::new(-w, h - t, 0.0), Vec3::new(2.0 * w, t, d)),
        bar(Vec3::new(-0.5 * t, 0.0, 0.004), Vec3::new(t, h, d - 0.008)),
        bar(Vec3::new(-w, 0.68 * h, 0.008), Vec3::new(2.0 * w, 0.75 * t, d - 0.016)),
    ]);
    let sill = Shape::rounded_block(Vec3::new(WINDOW_WIDTH + 0.1, 0.03, WALL + 0.06), 0.01, 2, 1);
    let sill = sill.moved(Vec3::new(0.0, 0.0, 0.5 * WALL + 0.03));
    let handle = Shape::union([
        cylinder(Vec3::ZERO, 0.012, 0.03, 16).at(Affine3A::from_rotation_x(FRAC_PI_2)),
        tube(&[(Vec3::Z * 0.03, 0.008), (Vec3::new(0.0, -0.11, 0.03), 0.008)], 12, true),
    ]);
    let handle = handle.moved(Vec3::new(0.0, 0.42 * h, d));
    let window =
        object(builder, "window", [(Shape::union([frame, sill]), palette.white), (handle, palette.chrome)]);
    for i in 0..WINDOWS {
        builder.place(
            "window",
            window,
            None,
            place(Vec3::new(window_center(i), SILL, -HALF.y - WALL + 0.02), 0.0),
        );
    }

    let view = paint::decal(builder, "evening", [1024, 256], |uv| evening(uv).extend(1.0));
    let lit = lighting != Lighting::OneLamp;
    let outside = builder.material(Material {
        name: "evening".into(),
        base_color_texture: Some(TextureRef::new(view)),
        unlit: lit,
        specular: 0.0,
        ..Material::default()
    });
    let screen = Shape::quad(Vec3::new(-16.0, -2.0, -HALF.y - 4.0), Vec3::X * 32.0, Vec3::Y * 8.0)
        .with_uvs(|uv| uv / Vec2::new(32.0, 8.0));
    fixed(builder, "outside", [(screen, outside)]);
}

/// Dusk over a line of hills and a town with lit windows.
fn evening(uv: Vec2) -> Vec3 {
    let height = 1.0 - uv.y;
    let sky = Vec3::new(0.95, 0.52, 0.28).lerp(Vec3::new(0.16, 0.27, 0.55), smooth(0.36, 0.85, height));
    let cloud = smooth(0.5, 0.8, fbm(uv * Vec2::new(8.0, 16.0), 8, 5, 3)) * smooth(0.45, 0.6, height);
    let sky = sky.lerp(Vec3::new(0.95, 0.62, 0.50), 0.5 * cloud);
    let hills = 0.40 + 0.07 * fbm(Vec2::new(uv.x * 6.0, 0.5), 6, 4, 8);
    let column = (uv.x * 56.0) as u32;
    let roof = 0.26 + 0.16 * hash(column, 0, 5) * hash(column / 5, 1, 5);
    if height < roof {
        let (wx, wy) = ((uv.x * 56.0 * 4.0).fract(), (uv.y * 110.0).fract());
        let pane = (0.25..0.75).contains(&wx) && (0.3..0.8).contains(&wy);
        let on = hash((uv.x * 224.0) as u32, (uv.y * 110.0) as u32, 2) > 0.62;
        let house = Vec3::new(0.060, 0.055, 0.075) * (0.6 + 0.8 * hash(column, 3, 5));
        if pane && on { Vec3::new(0.95, 0.70, 0.35) } else { house }
    } else if height < hills {
        Vec3::new(0.13, 0.12, 0.17)
    } else {
        sky
    }
}

/// Venetian blinds, each let down to its own height.
fn blinds(builder: &mut SceneBuilder, palette: &Palette) {
    let slat = Shape::patch(2, 8, Vec2::ONE, |u, v| {
        let a = (v - 0.5) * 1.1;
        Vec3::new((u - 0.5) * (WINDOW_WIDTH - 0.16), 0.026 * a.cos(), -0.026 * a.sin())
    });
    let slat = object(builder, "slat", [(slat, palette.white)]);
    let rail = Shape::rounded_block(Vec3::new(WINDOW_WIDTH - 0.12, 0.045, 0.05), 0.008, 2, 1);
    let rail = object(builder, "blind rail", [(rail, palette.white)]);
    let mut cords = Shape::default();
    for (i, slats) in [14usize, 36, 9, 22].into_iter().enumerate() {
        let top = Vec3::new(window_center(i), LINTEL - 0.07, -HALF.y - 0.13);
        builder.place("blind rail", rail, None, place(top, 0.0));
        let step = 0.044;
        for k in 0..slats {
            let at = place(top - Vec3::Y * (0.045 + step * k as f32), 0.0);
            builder.place("slat", slat, None, at * Affine3A::from_rotation_x(0.35));
        }
        let length = 0.05 + step * slats as f32;
        builder.place("blind rail", rail, None, place(top - Vec3::Y * length, 0.0));
        for x in [-0.6, 0.6] {
            let cord = top + Vec3::new(x, 0.0, 0.027);
            cords.add(&tube(&[(cord, 0.002), (cord - Vec3::Y * length, 0.002)], 6, false));
        }
    }
    fixed(builder, "cords", [(cords, palette.white)]);
}

fn radiators(builder: &mut SceneBuilder, palette: &Palette) {
    let fins = (0..20).map(|i| {
        Shape::rounded_block(Vec3::new(0.05, 0.56, 0.10), 0.02, 2, 1).moved(Vec3::new(
            i as f32 * 0.062 - 0.59,
            0.40,
            0.0,
        ))
    });
    let pipe = |y: f32| tube(&[(Vec3::new(-0.66, y, 0.0), 0.02), (Vec3::new(0.66, y, 0.0), 0.02)], 16, true);
    let valve = cylinder(Vec3::new(0.66, 0.17, 0.0), 0.026, 0.09, 20);
    let shape = Shape::union(fins.chain([pipe(0.16), pipe(0.64), valve]));
    let radiator = object(builder, "radiator", [(shape, palette.white)]);
    for i in 0..WINDOWS {
        builder.place(
            "radiator",
            radiator,
            None,
            place(Vec3::new(window_center(i), 0.0, -HALF.y + 0.10), 0.0),
        );
    }
}

fn whiteboard(builder: &mut SceneBuilder, palette: &Palette) {
    const SIZE: Vec2 = Vec2::new(3.0, 1.3);
    let drawing = paint::decal(builder, "drawing", [1024, 448], |uv| sketch(uv * SIZE).extend(1.0));
    let board = builder.material(Material {
        name: "whiteboard".into(),
        base_color_texture: Some(TextureRef::new(drawing)),
        roughness: 0.2,
        ..Material::default()
    });
    // Modelled facing +Z with its lower left corner at the origin.
    let face = Shape::quad(Vec3::Z * 0.02, Vec3::X * SIZE.x, Vec3::Y * SIZE.y).with_uvs(|uv| uv / SIZE);
    let bar = |min: Vec3, size: Vec3| Shape::rounded_block(size, 0.008, 2, 1).moved(min + 0.5 * size);
    let frame = Shape::union([
        bar(Vec3::new(-0.03, -0.03, 0.0), Vec3::new(0.035, SIZE.y + 0.06, 0.035)),
        bar(Vec3::new(SIZE.x - 0.005, -0.03, 0.0), Vec3::new(0.035, SIZE.y + 0.06, 0.035)),
        bar(Vec3::new(-0.03, -0.03, 0.0), Vec3::new(SIZE.x + 0.06, 0.035, 0.035)),
        bar(Vec3::new(-0.03, SIZE.y - 0.005, 0.0), Vec3::new(SIZE.x + 0.06, 0.035, 0.035)),
        bar(Vec3::new(0.6, -0.045, 0.02), Vec3::new(1.8, 0.018, 0.09)),
    ]);
    let marker = |x: f32| {
        let profile = [(0.0, 0.0), (0.008, 0.0), (0.009, 0.01), (0.009, 0.10), (0.007, 0.11), (0.0, 0.115)];
        lathe(16, &profile).at(Affine3A::from_rotation_z(-FRAC_PI_2)).moved(Vec3::new(x, -0.018, 0.07))
    };
    let tools = Shape::union([
        marker(0.8),
        marker(1.05),
        marker(1.3),
        bar(Vec3::new(1.7, -0.027, 0.04), Vec3::new(0.14, 0.035, 0.05)),
    ]);
    let board =
        object(builder, "whiteboard", [(face, board), (frame, palette.aluminium), (tools, palette.black)]);
    let at = place(Vec3::new(-HALF.x, 0.95, 0.5 * SIZE.x), FRAC_PI_2);
    builder.place("whiteboard", board, None, at);
}

/// What the last meeting drew: a field of mirrors, the sun, the tower, and a curve. `p` in metres from the top left.
fn sketch(p: Vec2) -> Vec3 {
    let line = |a: [f32; 2], b: [f32; 2]| segment_distance(p, a.into(), b.into());
    let near = |distance: f32| 1.0 - smooth(0.005, 0.009, distance);
    let mut black = near(line([0.15, 1.10], [1.75, 1.10]));
    // The tower and its receiver.
    for (a, b) in [([1.45, 1.1], [1.50, 0.45]), ([1.62, 1.1], [1.57, 0.45]), ([1.47, 0.45], [1.60, 0.45])] {
        black = black.max(near(line(a, b)));
    }
    let sun = Vec2::new(0.35, 0.28);
    let mut red = near((p.distance(sun) - 0.11).abs());
    for i in 0..12 {
        let ray = Vec2::from_angle(i as f32 / 12.0 * TAU);
        red = red.max(near(segment_distance(p, sun + 0.14 * ray, sun + 0.19 * ray)));
    }
    let mut blue = 0.0f32;
    for i in 0..5 {
        let x = 0.30 + 0.22 * i as f32;
        black = black.max(near(line([x, 1.10], [x, 0.98])));
        blue = blue.max(near(line(
            [x - 0.06, 0.945 + 0.02 * i as f32 * 0.5],
            [x + 0.06, 1.0 - 0.02 * i as f32 * 0.5],
        )));
        red = red.max(near(line([x, 0.97], [1.53, 0.42])) * 0.75);
    }
    // Axes and a curve on the right.
    black = black.max(near(line([1.95, 1.05], [1.95, 0.25]))).max(near(line([1.95, 1.05], [2.85, 1.05])));
    let x = (p.x - 1.95) / 0.9;
    if (0.0..0.95).contains(&x) {
        blue = blue.max(near((p.y - 0.34 - 0.66 * (-3.2 * x).exp()).abs() * 0.55));
        red = red.max(near((p.y - 0.95 + 0.45 * x * x).abs() * 0.8));
    }
    // Lines of writing.
    for row in 0..3 {
        let y = 0.14 + 0.09 * row as f32;
        let wave = 0.016 * (p.x * 130.0 + 9.0 * (p.x * 7.0).sin()).sin();
        let word = hash((p.x * 11.0) as u32, row, 4) > 0.22;
        if (0.72..1.35 + 0.1 * row as f32).contains(&p.x) && word {
            black = black.max(near((p.y - y - wave).abs() * 0.5));
        }
    }
    let ink = Vec3::splat(0.80)
        .lerp(Vec3::new(0.03, 0.03, 0.035), black)
        .lerp(Vec3::new(0.55, 0.04, 0.03), red)
        .lerp(Vec3::new(0.03, 0.08, 0.45), blue);
    ink * (0.97 + 0.03 * fbm(p, 4, 3, 5))
}

fn door(builder: &mut SceneBuilder, palette: &Palette) {
    // Modelled facing +Z, hinged at the left, standing on the origin.
    let (w, h) = (0.95, 2.10);
    let bar = |min: Vec3, size: Vec3, r: f32| Shape::rounded_block(size, r, 2, 1).moved(min + 0.5 * size);
    let mut leaf =
        bar(Vec3::new(0.0, 0.005, 0.0), Vec3::new(w, h, 0.04), 0.004).with_uvs(|uv| Vec2::new(uv.y, uv.x));
    for (y, height) in [(0.18, 0.62), (0.92, 1.05)] {
        for x in [0.12, 0.52] {
            let panel = bar(Vec3::new(x, y, 0.03), Vec3::new(0.32, height, 0.022), 0.010);
            leaf.add(&panel.with_uvs(|uv| Vec2::new(uv.y + 0.3, uv.x)));
        }
    }
    let casing = Shape::union([
        bar(Vec3::new(-0.10, 0.0, -0.01), Vec3::new(0.09, h + 0.10, 0.06), 0.008),
        bar(Vec3::new(w + 0.01, 0.0, -0.01), Vec3::new(0.09, h + 0.10, 0.06), 0.008),
        bar(Vec3::new(-0.10, h + 0.01, -0.01), Vec3::new(w + 0.20, 0.09, 0.06), 0.008),
    ]);
    let lever: Vec<_> = [(0.0, 0.04), (0.0, 0.085), (-0.02, 0.095), (-0.12, 0.095)]
        .map(|(x, z)| (Vec3::new(w - 0.07 + x, 1.04, z), 0.009))
        .into();
    let rose = cylinder(Vec3::ZERO, 0.026, 0.01, 24).at(Affine3A::from_rotation_x(FRAC_PI_2));
    let handle = Shape::union([tube(&lever, 14, true), rose.moved(Vec3::new(w - 0.07, 1.04, 0.04))]);
    let door =
        object(builder, "door", [(leaf, palette.oak), (casing, palette.white), (handle, palette.chrome)]);
    builder.place("door", door, None, place(Vec3::new(HALF.x, 0.0, 1.35), -FRAC_PI_2));
}

fn sideboard(builder: &mut SceneBuilder, palette: &Palette) {
    let (w, d) = (2.2, 0.46);
    let bar = |min: Vec3, size: Vec3, r: f32| Shape::rounded_block(size, r, 2, 1).moved(min + 0.5 * size);
    let mut wood = bar(Vec3::new(-0.5 * w, SIDEBOARD_HEIGHT - 0.035, 0.0), Vec3::new(w, 0.035, d), 0.01);
    wood.add(&bar(
        Vec3::new(-0.5 * w + 0.03, 0.10, 0.03),
        Vec3::new(w - 0.06, SIDEBOARD_HEIGHT - 0.135, d - 0.04),
        0.004,
    ));
    let mut knobs = Shape::default();
    for i in 0..4 {
        let x = -0.5 * w + 0.05 + i as f32 * 0.53;
        wood.add(&bar(Vec3::new(x, 0.13, 0.015), Vec3::new(0.51, 0.62, 0.02), 0.006));
        let knob = [(0.0, 0.0), (0.008, 0.0), (0.007, 0.012), (0.015, 0.02), (0.014, 0.028), (0.0, 0.031)];
        let side = if i % 2 == 0 { 0.46 } else { 0.05 };
        knobs.add(&lathe(20, &knob).at(Affine3A::from_rotation_x(-FRAC_PI_2)).moved(Vec3::new(
            x + side,
            0.5,
            0.015,
        )));
    }
    for x in [-0.5 * w + 0.1, 0.5 * w - 0.1] {
        for z in [0.08, d - 0.08] {
            knobs.add(&cylinder(Vec3::new(x, 0.0, z), 0.018, 0.11, 16));
        }
    }
    let urn = [
        (0.0, 0.0),
        (0.085, 0.0),
        (0.09, 0.01),
        (0.085, 0.03),
        (0.10, 0.06),
        (0.105, 0.22),
        (0.095, 0.27),
        (0.05, 0.30),
        (0.045, 0.32),
        (0.015, 0.33),
        (0.02, 0.345),
        (0.0, 0.36),
    ];
    let urn = lathe(40, &urn).moved(Vec3::new(-0.75, SIDEBOARD_HEIGHT, 0.24));
    let tray = Shape::union([
        cylinder(Vec3::new(-0.2, SIDEBOARD_HEIGHT, 0.2), 0.2, 0.008, 48),
        torus(Vec3::new(-0.2, SIDEBOARD_HEIGHT + 0.012, 0.2), 0.2, 0.008, [48, 10]),
    ]);
    let metal = Shape::union([knobs, urn, tray]);
    let sideboard = object(builder, "sideboard", [(wood, palette.walnut), (metal, palette.chrome)]);
    builder.place("sideboard", sideboard, None, place(Vec3::new(2.6, 0.0, HALF.y - d), 0.0));
}

/// Two framed abstracts over the sideboard.
fn pictures(builder: &mut SceneBuilder, palette: &Palette) {
    let mut rng = Rng::new(3);
    for x in [2.05, 3.25] {
        let seed = rng.below(100) as u32;
        let warm = Vec3::new(0.62, 0.16, 0.06);
        let cold = Vec3::new(0.05, 0.20, 0.32);
        let canvas = paint::decal(builder, "abstract", [128, 160], |uv| {
            let field = fbm(uv * 3.0, 64, 5, seed);
            let bands = (field * 7.0).fract();
            let ground = cold.lerp(warm, smooth(0.3, 0.7, field));
            let color = ground.lerp(Vec3::new(0.85, 0.74, 0.50), smooth(0.80, 0.95, bands));
            Vec4::from((color * (0.85 + 0.3 * fbm(uv * 32.0, 32, 2, seed)), 1.0))
        });
        let canvas = builder.material(Material {
            name: "abstract".into(),
            base_color_texture: Some(TextureRef::new(canvas)),
            roughness: 0.8,
            ..Material::default()
        });
        let half = Vec2::new(0.40, 0.50);
        let face =
            Shape::quad(Vec3::new(-half.x, -half.y, 0.01), Vec3::X * 2.0 * half.x, Vec3::Y * 2.0 * half.y);
        let face = face.with_uvs(|uv| uv / (2.0 * half));
        let ring = [(0.0, 0.01), (0.0, 0.022), (0.01, 0.028), (0.03, 0.028), (0.04, 0.02), (0.04, 0.0)];
        // The ring is lofted lying down, inside first, and then stood up.
        let ring: Vec<_> = ring.into_iter().rev().collect();
        let frame = loft(&rectangle(half), &ring).at(Affine3A::from_rotation_x(FRAC_PI_2));
        let picture = object(builder, "picture", [(face, canvas), (frame, palette.black)]);
        builder.place("picture", picture, None, place(Vec3::new(x, 1.72, HALF.y), PI));
    }
}

fn clock(builder: &mut SceneBuilder, palette: &Palette) {
    let face = cylinder(Vec3::ZERO, 0.17, 0.02, 64);
    let mut marks = torus(Vec3::Y * 0.02, 0.17, 0.012, [64, 10]);
    for i in 0..12 {
        let size = Vec3::new(0.008, 0.004, if i % 3 == 0 { 0.035 } else { 0.02 });
        let mark = Shape::block_on(Vec3::new(0.0, 0.019, 0.135), size);
        marks.add(&mark.at(Affine3A::from_rotation_y(i as f32 / 12.0 * TAU)));
    }
    for (angle, length, width) in [(-0.9f32, 0.08, 0.012), (1.2, 0.125, 0.008)] {
        let hand = Shape::block_on(Vec3::new(0.0, 0.021, -0.4 * length), Vec3::new(width, 0.003, length));
        marks.add(&hand.at(Affine3A::from_rotation_y(angle)));
    }
    let clock = object(builder, "clock", [(face, palette.porcelain), (marks, palette.black)]);
    // Over the whiteboard: +Y of the model looks into the room.
    let turn = Affine3A::from_rotation_y(FRAC_PI_2) * Affine3A::from_rotation_x(FRAC_PI_2);
    builder.place("clock", clock, None, Affine3A::from_translation(Vec3::new(-HALF.x, 2.62, 0.0)) * turn);
}
