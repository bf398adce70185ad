//! Two cars of lofted superellipses in a studio, painted with metal flakes: what the shader `carpaint` is for.

mod body;
mod wheel;

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Clearcoat, Edit, Material, MaterialId, ObjectId, SceneBuilder, ShaderUse};

use crate::shape::{Shape, place};
use crate::sky;

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    studio(&mut builder);
    let palette = Palette::new(&mut builder);
    let red = paint(&mut builder, "red", ShaderUse::named("carpaint"));
    let petrol = ShaderUse::named("carpaint")
        .with("base", Vec3::new(0.05, 0.16, 0.20))
        .with("flop", Vec3::new(0.16, 0.05, 0.22))
        .with("flake", Vec3::new(0.45, 0.80, 0.75))
        .with("falloff", 1.1);
    let petrol = paint(&mut builder, "petrol", petrol);
    let front = car(&mut builder, &palette, red);
    let behind = car(&mut builder, &palette, petrol);
    builder.place("red car", front, None, place(Vec3::new(-0.2, 0.0, 0.5), 0.62));
    builder.place("petrol car", behind, None, place(Vec3::new(1.7, 0.0, -3.4), -0.5));
    builder.environment(sky::studio());
    let eye = Vec3::new(-2.6, 1.45, 5.9);
    builder.camera(Camera::look_at("front", eye, Vec3::new(0.15, 0.55, 0.0), Vec3::Y, 0.50));
    let eye = Vec3::new(-1.6, 0.95, 3.3);
    builder.camera(Camera::look_at("close", eye, Vec3::new(-0.95, 0.52, 1.6), Vec3::Y, 0.50));
    builder.finish()
}

/// What all cars are made of, but for the paint.
struct Palette {
    glass: MaterialId,
    black: MaterialId,
    tyre: MaterialId,
    rim: MaterialId,
    chrome: MaterialId,
    head_lamp: MaterialId,
    tail_lamp: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        let tyre = Material::plastic("tyre", Vec3::splat(0.018), 0.75);
        let grip = ShaderUse::named("bump").with("height", 0.002).with("size", 0.02);
        let tyre = Material { shader: Some(Arc::new(grip)), ..tyre };
        let mut metal =
            |name, color, roughness| builder.material(Material::metal(name, Vec3::splat(color), roughness));
        let (rim, chrome) = (metal("rim", 0.72, 0.22), metal("chrome", 0.9, 0.04));
        let flutes =
            ShaderUse::named("ripples").with("wavelength", 0.025).with("height", 0.0012).with("spread", 0.0);
        let head = Material::metal("head lamp", Vec3::new(0.86, 0.88, 0.90), 0.12);
        let head = Material { shader: Some(Arc::new(flutes)), ..head };
        let tail = Vec3::new(0.55, 0.01, 0.01);
        let tail = Material { emissive: tail * 0.2, ..Material::plastic("tail lamp", tail, 0.08) };
        Self {
            glass: builder.material(Material::plastic("window", Vec3::splat(0.012), 0.0)),
            black: builder.material(Material::plastic("trim", Vec3::splat(0.012), 0.45)),
            tyre: builder.material(tyre),
            rim,
            chrome,
            head_lamp: builder.material(head),
            tail_lamp: builder.material(tail),
        }
    }
}

fn paint(builder: &mut SceneBuilder, name: &str, shader: ShaderUse) -> MaterialId {
    let coat = Clearcoat {
        factor: 1.0,
        texture: None,
        roughness: 0.0,
        roughness_texture: None,
        normal_texture: None,
        normal_scale: 1.0,
    };
    builder.material(Material {
        name: name.into(),
        clearcoat: Some(coat),
        shader: Some(Arc::new(shader)),
        ..Material::default()
    })
}

/// A car that stands on the origin and looks along −X.
fn car(builder: &mut SceneBuilder, palette: &Palette, paint: MaterialId) -> ObjectId {
    let body = body::parts();
    let wheel = wheel::parts();
    let parts = [
        (body.painted, paint),
        (body.windows, palette.glass),
        (body.trim, palette.black),
        (body.chrome, palette.chrome),
        (body.head_lamps, palette.head_lamp),
        (body.tail_lamps, palette.tail_lamp),
    ];
    let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
    let car = builder.object("car", parts);
    let parts = [(wheel.tyre, palette.tyre), (wheel.rim, palette.rim), (wheel.brake, palette.black)];
    let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
    let wheel = builder.object("wheel", parts);
    for x in body::AXLES {
        for side in [1.0, -1.0] {
            let outwards = if side > 0.0 { 0.0 } else { std::f32::consts::PI };
            builder.child(car, wheel, place(Vec3::new(x, wheel::RADIUS, side * body::TRACK), outwards));
        }
    }
    car
}

/// A floor that bends up into a wall, polished a little.
fn studio(builder: &mut SceneBuilder) {
    let floor = builder.material(Material::plastic("floor", Vec3::splat(0.20), 0.35));
    let sweep = Shape::patch(1, 48, Vec2::new(40.0, 30.0), |u, v| {
        // Straight floor, a quarter circle of four metres, straight wall.
        let s = v * 30.0 - 16.0;
        let bend = (s / 4.0).clamp(0.0, std::f32::consts::FRAC_PI_2);
        let straight = (s.min(0.0), (s - 4.0 * std::f32::consts::FRAC_PI_2).max(0.0));
        let (sin, cos) = bend.sin_cos();
        Vec3::new(40.0 * (u - 0.5), 4.0 * (1.0 - cos) + straight.1, -6.5 - straight.0 - 4.0 * sin)
    });
    let sweep = builder.mesh(sweep.mesh());
    let object = builder.object("studio", [(sweep, floor)]);
    builder.place("studio", object, None, Affine3A::IDENTITY);
    // Strip lights, whose reflections draw the shape.
    let light = builder.material(Material::emitter("strip", Vec3::new(1.0, 0.97, 0.93) * 7.0));
    for (x, z) in [(-1.3, 1.8), (1.3, 0.0), (-0.4, -2.6)] {
        let strip = Shape::quad(Vec3::new(x - 2.2, 3.6, z - 0.22), Vec3::X * 4.4, Vec3::Z * 0.44);
        let strip = builder.mesh(strip.mesh());
        let object = builder.object("strip light", [(strip, light)]);
        builder.place("strip light", object, None, Affine3A::IDENTITY);
    }
}
