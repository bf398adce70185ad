//! Spheres and cones against closed forms and the brute-force oracle.
mod common;

use std::sync::Arc;

use common::{Rng, hunt, rays, soup};
use heliostat_kernel::{
    BuildOptions, Hit, Instance, Isa, Mesh, Object, Oracle, Quadric, Quadrics, Ray, RayQuery, Tile,
    TriangleBvh, World,
    glam::{Affine3A, Mat3A, Vec3, Vec3A},
};

fn sphere(center: Vec3, radius: f32) -> Quadric {
    Quadric::Sphere { center, radius }
}

fn object(shapes: &[Quadric]) -> Object {
    with(Object::empty(), Quadrics::build([(0, shapes)]).unwrap())
}

fn with(mut object: Object, quadrics: Quadrics) -> Object {
    object.set_quadrics(Some(Arc::new(quadrics)));
    object
}

fn world(shapes: &[Quadric]) -> World {
    World::new(Arc::new(object(shapes)))
}

fn closest(query: &impl RayQuery, ray: Ray) -> Hit {
    let mut hits = [Hit::MISS];
    query.intersect(&[ray], &mut hits);
    hits[0]
}

/// Shapes of all kinds and signs in a cube of half edge 1.
fn shapes(rng: &mut Rng, count: usize) -> Vec<Quadric> {
    (0..count)
        .map(|i| {
            let (p, sign) = (rng.vec(), rng.signed().signum());
            let radius = |rng: &mut Rng| sign * (0.02 + 0.2 * rng.unit());
            let (a, b) = (radius(rng), radius(rng));
            match i % 4 {
                0 | 1 => sphere(p, a),
                2 => Quadric::Cone { base: p, base_radius: a, apex: p + 0.5 * rng.vec(), apex_radius: a },
                _ => Quadric::Cone {
                    base: p,
                    base_radius: a,
                    apex: p + 0.5 * rng.vec(),
                    apex_radius: if i % 8 == 3 { 0.0 } else { b },
                },
            }
        })
        .collect()
}

#[test]
fn a_sphere_is_met_where_it_is() {
    let world = world(&[sphere(Vec3::new(1.0, 2.0, 3.0), 2.0), sphere(Vec3::new(1.0, 2.0, -9.0), -1.0)]);
    let hit = closest(&world, Ray::new(Vec3::new(1.0, 2.0, 10.0), Vec3::NEG_Z));
    assert_eq!((hit.t, hit.ng, hit.geometry, hit.primitive), (5.0, Vec3::Z, 0, 0));
    assert_eq!((hit.u, hit.v), (0.25, 0.5));
    // From within, and the sphere that is turned inside out.
    let hit = closest(&world, Ray::new(Vec3::new(1.0, 2.0, 3.0), Vec3::NEG_Z));
    assert_eq!((hit.t, hit.ng), (2.0, Vec3::NEG_Z));
    let hit = closest(&world, Ray::new(Vec3::new(1.0, 2.0, 0.0), 2.0 * Vec3::NEG_Z));
    assert_eq!((hit.t, hit.ng, hit.primitive), (4.0, Vec3::NEG_Z, 1));
    assert!(!closest(&world, Ray::new(Vec3::new(1.0, 4.1, 10.0), Vec3::NEG_Z)).is_hit());
}

#[test]
fn a_cylinder_is_open_and_a_cone_has_its_slope() {
    let cylinder =
        Quadric::Cone { base: Vec3::ZERO, base_radius: 1.0, apex: 2.0 * Vec3::Y, apex_radius: 1.0 };
    let cone = Quadric::Cone {
        base: 10.0 * Vec3::X,
        base_radius: 1.0,
        apex: Vec3::new(10.0, 1.0, 0.0),
        apex_radius: 0.0,
    };
    let world = world(&[cylinder, cone]);
    let hit = closest(&world, Ray::new(Vec3::new(0.0, 1.5, 5.0), Vec3::NEG_Z));
    assert_eq!((hit.t, hit.ng, hit.v), (4.0, Vec3::Z, 0.75));
    assert!(!closest(&world, Ray::new(Vec3::new(0.5, 9.0, 0.0), Vec3::NEG_Y)).is_hit(), "no caps");
    assert!(!closest(&world, Ray::new(Vec3::new(0.0, 2.1, 5.0), Vec3::NEG_Z)).is_hit(), "it ends");
    let hit = closest(&world, Ray::new(Vec3::new(10.0, 0.5, 5.0), Vec3::NEG_Z));
    assert!((hit.t - 4.5).abs() < 1e-6 && hit.ng.abs_diff_eq(Vec3::new(0.0, 1.0, 1.0).normalize(), 1e-6));
}

#[test]
fn coordinates_lead_back_to_the_point() {
    let mut rng = Rng::new(1);
    let shapes = shapes(&mut rng, 64);
    let world = world(&shapes);
    for ray in rays(&mut rng, 2000, 1.0, Vec3::ZERO) {
        let hit = closest(&world, ray);
        if hit.is_hit() {
            let point = shapes[hit.primitive as usize].at(hit.u, hit.v);
            assert!(point.position.distance(ray.at(hit.t)) < 4e-6, "{ray:?} {hit:?} {point:?}");
            assert!(point.tangents.iter().all(|t| t.dot(hit.ng).abs() < 1e-5 && t.is_normalized()));
            assert!(point.tangents[0].dot(point.tangents[1]).abs() < 1e-5);
        }
    }
}

#[test]
fn densities_add_up_to_the_area() {
    for shape in shapes(&mut Rng::new(2), 32) {
        let n = 64;
        let at = |i: usize| (i as f32 + 0.5) / n as f32;
        let sum: f32 = (0..n * n).map(|i| shape.at(at(i / n), at(i % n)).density).sum();
        assert!((sum / (n * n) as f32 / shape.area() - 1.0).abs() < 1e-3, "{shape:?}");
    }
}

#[test]
fn nothing_shadows_itself_from_a_few_roundings_away() {
    let mut rng = Rng::new(3);
    for _ in 0..hunt(20_000) {
        let scale = 10.0_f32.powf(3.0 * rng.signed());
        let shape = sphere(rng.vec() * 10.0, scale);
        let point = shape.at(rng.unit(), rng.unit());
        let Quadric::Sphere { center, .. } = shape else { return };
        let normal = (point.position - center).normalize();
        let error = 8.0 * f32::EPSILON * (center.abs().max_element() + scale);
        let direction = rng.vec();
        // Outside a sphere no ray away from it returns.
        let direction = if direction.dot(normal) < 0.0 { -direction } else { direction };
        let ray = Ray::new(point.position + normal * error, direction);
        assert!(!closest(&world(&[shape]), ray).is_hit(), "{shape:?} {ray:?}");
    }
}

#[test]
fn a_flat_list_agrees_with_the_oracle() {
    let mut rng = Rng::new(4);
    for round in 0..hunt(8) {
        // Far from the origin, single-precision boxes and rays have less to say.
        let list = shapes(&mut rng, 1 + 20 * round as usize);
        let world = world(&list);
        let oracle = Oracle::new(&world);
        for ray in rays(&mut rng, 4000, 1.0, Vec3::ZERO) {
            let (ours, theirs) = (closest(&world, ray), closest(&oracle, ray));
            assert_eq!(ours.is_hit(), theirs.is_hit(), "{ray:?} {ours:?} {theirs:?}");
            if ours.is_hit() {
                let name = |hit: &Hit| (hit.geometry, hit.primitive, hit.path);
                assert_eq!(name(&ours), name(&theirs), "{ray:?}");
                assert!((ours.t - theirs.t).abs() <= 1e-6 * theirs.t, "{ours:?} {theirs:?}");
                assert!(ours.ng.abs_diff_eq(theirs.ng, 1e-5), "{ours:?} {theirs:?}");
            }
            let mut occluded = [false];
            world.occluded(&[ray], &mut occluded);
            assert_eq!(occluded[0], theirs.is_hit());
        }
    }
}

/// Triangles and quadrics in one object, placed several times, once squeezed and mirrored.
fn mixed(rng: &mut Rng) -> Arc<Object> {
    let meshes = [Mesh::default(), soup(rng, 40, 1.0, 0.3, Vec3::ZERO)];
    let tree = TriangleBvh::build(&meshes, &BuildOptions::default()).unwrap();
    let list = shapes(rng, 40);
    let quadrics = Quadrics::build([(0, &list[..]), (2, &list[..3])]).unwrap();
    let object = Arc::new(with(Object::new(Some(tree.into()), Vec::new()).unwrap(), quadrics));
    let squeeze = Mat3A::from_diagonal(Vec3::new(-1.0, 0.5, 2.0)) * Mat3A::from_rotation_y(0.4);
    let places = [Affine3A::IDENTITY, Affine3A { matrix3: squeeze, translation: Vec3A::new(0.5, 0.0, 0.0) }];
    let instances = places.map(|parent_from_object| Instance {
        object: object.clone(),
        parent_from_object,
        motion: None,
        id: 0,
    });
    Arc::new(Object::new(None, instances.to_vec()).unwrap())
}

#[test]
fn instances_agree_with_the_oracle_but_for_grazing_rays() {
    let mut rng = Rng::new(5);
    let root = mixed(&mut rng);
    let world = World::new(root);
    let oracle = Oracle::new(&world);
    let mut differ = 0;
    let all = rays(&mut rng, 20_000, 1.0, Vec3::ZERO);
    for &ray in &all {
        let (ours, theirs) = (closest(&world, ray), closest(&oracle, ray));
        let same = (ours.geometry, ours.primitive) == (theirs.geometry, theirs.primitive)
            && (!ours.is_hit() || (ours.t - theirs.t).abs() <= 1e-4 * theirs.t);
        differ += usize::from(!same);
    }
    // Placements round rays to single precision: those within 1e-6 of an outline may go either way.
    assert!(differ <= 4, "{differ} of {}", all.len());
}

#[test]
fn tiles_answer_as_single_rays_do_on_every_instruction_set() {
    let mut rng = Rng::new(6);
    let root = mixed(&mut rng);
    for isa in Isa::available() {
        let world = World::with_isa(root.clone(), isa).unwrap();
        for _ in 0..40 {
            let mut tile = Tile::new(rng.vec() * 2.0);
            let target = rng.vec();
            for _ in 0..200 {
                tile.push(target + 0.5 * rng.vec() - tile.origin(), f32::INFINITY);
            }
            let mut hits = vec![Hit::MISS; tile.len()];
            let mut occluded = vec![false; tile.len()];
            world.intersect_tile(&tile, &mut hits);
            world.occluded_tile(&tile, &mut occluded);
            for i in 0..tile.len() {
                let Some(ray) = tile.ray(i) else { continue };
                let single = closest(&world, ray);
                assert_eq!(hits[i].is_hit(), single.is_hit());
                assert_eq!(occluded[i], single.is_hit());
                assert_eq!((hits[i].geometry, hits[i].primitive), (single.geometry, single.primitive));
                // Tiles and single rays round triangles differently.
                let slack = if single.geometry == 1 { 1e-4 } else { 0.0 };
                assert!(!single.is_hit() || (hits[i].t - single.t).abs() <= slack * single.t);
            }
        }
    }
}

#[test]
fn shapes_without_extent_or_with_nonsense_are_never_hit() {
    let cone = |base_radius: f32, apex: Vec3, apex_radius: f32| Quadric::Cone {
        base: Vec3::ZERO,
        base_radius,
        apex,
        apex_radius,
    };
    let list = [
        sphere(Vec3::ZERO, 0.0),
        sphere(Vec3::NAN, 1.0),
        sphere(Vec3::ZERO, f32::INFINITY),
        sphere(Vec3::splat(2e10), 1.0),
        cone(1.0, Vec3::ZERO, 1.0),
        cone(0.0, Vec3::Y, 0.0),
        cone(1.0, Vec3::Y, -1.0),
        cone(1.0, Vec3::new(0.0, f32::NAN, 0.0), 1.0),
    ];
    let world = world(&list);
    assert!(world.bounds().is_empty());
    for ray in rays(&mut Rng::new(7), 200, 1.0, Vec3::ZERO) {
        assert!(!closest(&world, ray).is_hit());
    }
    assert!(list.iter().all(|shape| shape.bounds().is_empty()));
}
