//! Camera rays against closed forms, one by one and in packets.

use super::*;
use crate::lanes::WIDTH;
use heliostat_kernel::Isa;
use heliostat_scene::Lens;

fn camera(projection: Projection, lens: Option<Lens>) -> CameraRays {
    let mut camera = Camera::look_at("", Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 0.0), Vec3::Y, 1.0);
    camera.projection = projection;
    camera.lens = lens;
    CameraRays::new(&camera, 200, 100)
}

#[test]
fn perspective_spans_the_vertical_field_of_view() {
    let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, None);
    let top = rays.ray(Vec2::new(100.0, 0.0), Vec2::ZERO, 0.0).direction;
    let bottom = rays.ray(Vec2::new(100.0, 100.0), Vec2::ZERO, 0.0).direction;
    assert!((top.angle_between(bottom) - 1.0).abs() < 1e-5);
    assert!(top.y > 0.0, "row 0 is up");
    assert!(rays.ray(Vec2::new(200.0, 50.0), Vec2::ZERO, 0.0).direction.x > 0.0, "columns run to the right");
    assert_eq!(rays.common_origin(), Some(Vec3::new(1.0, 2.0, 3.0)));
}

#[test]
fn points_are_seen_where_their_rays_pass() {
    let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, None);
    for pixel in [Vec2::new(3.0, 97.5), Vec2::new(100.0, 50.0), Vec2::new(-20.0, 130.0)] {
        let ray = rays.ray(pixel, Vec2::ZERO, 0.0);
        let seen = rays.project(ray.origin + 7.0 * ray.direction).expect("before the camera");
        assert!((seen - pixel).length() < 1e-3, "{seen}, expected {pixel}");
        assert_eq!(rays.project(ray.origin - 7.0 * ray.direction), None);
    }
    let flat = camera(Projection::Orthographic { height: 1.0 }, None);
    assert_eq!(flat.project(Vec3::ZERO), None);
}

#[test]
fn lens_rays_meet_in_the_plane_of_focus() {
    let lens = Lens { radius: 0.2, focus_distance: 2.0 };
    let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, Some(lens));
    assert_eq!(rays.common_origin(), None);
    let at_focus = |u: Vec2| {
        let ray = rays.ray(Vec2::new(30.0, 80.0), u, 0.0);
        ray.origin + ray.direction * ((ray.origin.z - 1.0) / -ray.direction.z)
    };
    let spread = at_focus(Vec2::new(0.9, 0.1)).distance(at_focus(Vec2::new(0.2, 0.6)));
    assert!(spread < 1e-5, "{spread}");
}

#[test]
fn orthographic_and_panoramic() {
    let rays = camera(Projection::Orthographic { height: 4.0 }, None);
    let ray = rays.ray(Vec2::new(100.0, 0.0), Vec2::ZERO, 0.0);
    assert!(
        ray.origin.distance(Vec3::new(1.0, 4.0, 3.0)) < 1e-5 && ray.direction.distance(Vec3::NEG_Z) < 1e-6
    );
    let rays = camera(Projection::Panoramic, None);
    assert!(rays.ray(Vec2::new(100.0, 50.0), Vec2::ZERO, 0.0).direction.distance(Vec3::NEG_Z) < 1e-6);
    assert!(rays.ray(Vec2::new(150.0, 50.0), Vec2::ZERO, 0.0).direction.distance(Vec3::X) < 1e-6);
    assert!(rays.ray(Vec2::new(3.0, 0.0), Vec2::ZERO, 0.0).direction.distance(Vec3::Y) < 1e-6);
}

#[test]
fn fisheyes_have_their_angles() {
    let axis = Vec3::NEG_Z;
    for (projection, half) in [
        // At half the radius: half the angle, or half the sine of half the angle.
        (Projection::FisheyeEquidistant { fov: 2.0 }, 0.5),
        (Projection::FisheyeEquisolid { fov: 2.0 }, 2.0 * (0.5 * 0.5_f32.sin()).asin()),
    ] {
        let rays = camera(projection, None);
        let angle = |x: f32, y: f32| rays.ray(Vec2::new(x, y), Vec2::ZERO, 0.0).direction.angle_between(axis);
        assert!((angle(100.0, 0.0) - 1.0).abs() < 1e-5 && (angle(150.0, 50.0) - 1.0).abs() < 1e-5);
        assert!((angle(100.0, 25.0) - half).abs() < 1e-5, "{}", angle(100.0, 25.0));
        assert!(angle(100.0, 50.0) < 1e-3 && rays.common_origin().is_some());
        assert!(rays.ray(Vec2::new(100.0, 10.0), Vec2::ZERO, 0.0).direction.y > 0.0);
    }
    // Equal areas show equal solid angles, and the corner of a full sphere looks straight back.
    let rays = camera(Projection::FisheyeEquisolid { fov: TAU }, None);
    let ring = |r: f32| 1.0 + rays.ray(Vec2::new(100.0 + r, 50.0), Vec2::ZERO, 0.0).direction.z;
    assert!((ring(20.0) / ring(10.0) - 4.0).abs() < 1e-3 && (ring(40.0) / ring(10.0) - 16.0).abs() < 1e-2);
    assert!(rays.ray(Vec2::ZERO, Vec2::ZERO, 0.0).direction.distance(Vec3::Z) < 1e-3);
}

#[test]
fn eyes_see_the_same_at_the_distance_of_convergence() {
    let eyes = |projection, view| {
        let mut camera = Camera::look_at("", Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 1.0);
        camera.projection = projection;
        camera.stereo = Some(heliostat_scene::Stereo { separation: 0.5, convergence: 4.0, view });
        CameraRays::new(&camera, 200, 100)
    };
    let perspective = Projection::Perspective { vertical_fov: 1.0 };
    let [left, right] = [StereoView::Left, StereoView::Right].map(|view| eyes(perspective, view));
    let at = |rays: &CameraRays, x: f32, y: f32| rays.ray(Vec2::new(x, y), Vec2::ZERO, 0.0);
    let (a, b) = (at(&left, 30.0, 20.0), at(&right, 30.0, 20.0));
    assert!((a.origin - Vec3::new(-0.25, 0.0, 0.0)).length() < 1e-6);
    assert_eq!((left.common_origin(), right.common_origin()), (Some(a.origin), Some(b.origin)));
    let reach = |ray: CameraRay| ray.origin + ray.direction * (4.0 / -ray.direction.z);
    assert!(reach(a).distance(reach(b)) < 1e-5);
    // Side by side: each half is the picture of an eye, here of half the width.
    let both = eyes(perspective, StereoView::SideBySide);
    assert_eq!(both.common_origin(), None);
    assert!(at(&both, 50.0, 50.0).origin.x < 0.0 && at(&both, 150.0, 50.0).origin.x > 0.0);
    let seen = reach(at(&both, 50.0, 50.0)).distance(reach(at(&both, 150.0, 50.0)));
    assert!(seen < 1e-5, "{seen}");
    // A panorama's eyes lie beside each other whichever way one looks.
    let both = eyes(Projection::Panoramic, StereoView::OverUnder);
    for x in [10.0, 100.0, 170.0] {
        let (above, below) = (at(&both, x, 25.0), at(&both, x, 75.0));
        assert!(above.direction.distance(below.direction) < 1e-6);
        let way = below.origin - above.origin;
        assert!((way.length() - 0.5).abs() < 1e-6 && way.dot(above.direction).abs() < 1e-6);
        assert!(above.direction.cross(Vec3::Y).dot(way) > 0.0, "the right eye is on the right");
    }
}

/// The equidistant fisheye once more.
#[derive(Debug)]
struct Fisheye;

impl CameraShader for Fisheye {
    fn info(&self) -> CameraInfo {
        let fov = crate::Parameter::float("fov", 1.0, [0.1, 6.0], "radians", "over the picture's height");
        CameraInfo { name: "fisheye".into(), about: String::new(), parameters: vec![fov] }
    }

    #[inline(always)]
    fn ray<F: Real>(&self, at: &PicturePlace<F>, values: &crate::Constants<'_, F>) -> [Vector<F>; 2] {
        let r = (at.x * at.x + at.y * at.y).sqrt();
        let (cos, sin) = cos_sin_turns(r * values.float(0) * (1.0 / TAU));
        let across = (sin / r).only(r.gt(r.splat(0.0))) * 2.0;
        [Vector::grey(r.splat(0.0)), Vector::new(at.x * across, at.y * across, cos * -2.0)]
    }
}

fn registry() -> ShaderRegistry {
    let mut registry = ShaderRegistry::default();
    registry.register_camera(Fisheye);
    registry
}

fn fisheye(fov: f32) -> std::sync::Arc<heliostat_scene::ShaderUse> {
    heliostat_scene::ShaderUse::named("fisheye").with("fov", fov).into()
}

#[test]
fn shaders_stand_in_for_projections() {
    let lens = Some(Lens { radius: 0.1, focus_distance: 3.0 });
    let stereo = heliostat_scene::Stereo { separation: 0.07, convergence: 2.0, view: StereoView::SideBySide };
    for (lens, stereo) in [(None, None), (lens, None), (lens, Some(stereo))] {
        let mut camera = Camera::look_at("", Vec3::ONE, Vec3::ZERO, Vec3::Y, 1.0);
        (camera.projection, camera.lens, camera.stereo) =
            (Projection::FisheyeEquidistant { fov: 2.5 }, lens, stereo);
        let own = CameraRays::new(&camera, 64, 48);
        // The projection does not matter then.
        camera.projection = Projection::Perspective { vertical_fov: 1.0 };
        camera.shader = Some(fisheye(2.5));
        let shaded = CameraRays::with_shaders(&camera, (64, 48), &registry()).expect("registered");
        for i in 0..100 {
            let [a, b, c, d] = crate::Sampler::along(i, 3).set(0);
            let ray = |rays: &CameraRays| rays.ray(Vec2::new(a * 64.0, b * 48.0), Vec2::new(c, d), 0.0);
            let (expected, ray) = (ray(&own), ray(&shaded));
            assert!(ray.origin.distance(expected.origin) < 1e-5, "{ray:?}, expected {expected:?}");
            assert!(ray.direction.distance(expected.direction) < 1e-5, "{ray:?}, expected {expected:?}");
        }
        let spread = shaded.cone().spread / own.cone().spread;
        assert!((spread - 1.0).abs() < 0.01 && shaded.cone().width < 1e-5, "{:?}", shaded.cone());
        assert_eq!((shaded.common_origin(), shaded.project(Vec3::ZERO)), (None, None));
    }
}

#[test]
fn mistakes_in_camera_shaders_are_named() {
    let problem = |shader| {
        let mut camera = Camera::look_at("", Vec3::ONE, Vec3::ZERO, Vec3::Y, 1.0);
        camera.shader = Some(shader);
        CameraRays::with_shaders(&camera, (64, 48), &registry()).expect_err("refused").0
    };
    let unknown = heliostat_scene::ShaderUse::named("periscope").into();
    assert_eq!(problem(unknown), "there is no camera shader `periscope`; there are: fisheye");
    assert!(problem(fisheye(7.0)).contains("`fov` of camera shader `fisheye` is [7, 7, 7]"));
}

#[test]
fn packets_of_rays_have_the_bits_of_single_rays() {
    let lens = Some(Lens { radius: 0.1, focus_distance: 3.0 });
    let stereo = |view| heliostat_scene::Stereo { separation: 0.07, convergence: 2.0, view };
    for projection in [
        Projection::Perspective { vertical_fov: 1.0 },
        Projection::Orthographic { height: 3.0 },
        Projection::Panoramic,
        Projection::FisheyeEquidistant { fov: 3.0 },
        Projection::FisheyeEquisolid { fov: 6.0 },
    ] {
        for (lens, view) in [
            (None, None),
            (lens, None),
            (None, Some(StereoView::SideBySide)),
            (lens, Some(StereoView::Right)),
        ] {
            let mut camera = Camera::look_at("", Vec3::ONE, Vec3::ZERO, Vec3::Y, 1.0);
            let turned = Affine3A::from_rotation_y(0.3) * camera.world_from_camera;
            (camera.projection, camera.lens, camera.stereo) = (projection, lens, view.map(stereo));
            camera.motion = Some(turned);
            let plain = CameraRays::new(&camera, 64, 48);
            camera.shader = Some(fisheye(3.0));
            let shaded = CameraRays::with_shaders(&camera, (64, 48), &registry()).expect("registered");
            let mut points = PicturePoints::default();
            for lane in 0..WIDTH {
                let [a, b, c, d] = crate::Sampler::along(lane as u32, 3).set(0);
                let time = if lane % 3 == 0 { 0.0 } else { a * d };
                points.set(lane, ([a * 64.0, b * 48.0], [c, d], time));
            }
            let levels = Isa::available().into_iter().filter_map(Isa::level);
            for (level, rays) in levels.flat_map(|level| [(level, &plain), (level, &shaded)]) {
                let mut packet = RayPacket::default();
                rays.rays(LaneMode::Packets(level), &points, WIDTH, &mut packet);
                for lane in 0..WIDTH {
                    let pixel = Vec2::new(points.pixel[0].0[lane], points.pixel[1].0[lane]);
                    let u_lens = Vec2::new(points.lens[0].0[lane], points.lens[1].0[lane]);
                    let ray = rays.ray(pixel, u_lens, points.time.0[lane]);
                    assert_eq!(
                        (packet.origin.get(lane), packet.direction.get(lane)),
                        (ray.origin, ray.direction)
                    );
                }
            }
        }
    }
}
