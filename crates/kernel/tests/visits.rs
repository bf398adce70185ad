//! How much of the trees a ray looks at: bounds that hold for any tree, and exact counts where they are known.
mod common;

use std::sync::Arc;

use common::{ACCELERATORS, Rng, kd_object, object, rays, soup};
use heliostat_kernel::{
    Hit, Instance, Mesh, Object, Quadric, Quadrics, Ray, RayQuery, Visits, World,
    glam::{Affine3A, Quat, Vec3},
};

fn closest(world: &World, ray: &Ray) -> Hit {
    let mut hit = [Hit::MISS];
    world.intersect(&[*ray], &mut hit);
    hit[0]
}

fn no_more(a: Visits, b: Visits) -> bool {
    a.nodes <= b.nodes && a.primitives <= b.primitives && a.instances <= b.instances
}

/// A triangle around the origin, facing the z axis.
fn facing(z: f32) -> Mesh {
    Mesh::new([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z)), vec![[0, 1, 2]])
}

/// What is hit has been visited, and so has all that a shorter ray visits.
#[test]
fn counts_cover_the_hit_and_grow_with_the_ray() {
    let mut rng = Rng::new(7);
    let mesh = soup(&mut rng, 3000, 1.0, 0.1, Vec3::ZERO);
    for make in ACCELERATORS {
        let object = make(std::slice::from_ref(&mesh));
        let turned = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.6), Vec3::splat(0.3));
        let instance =
            |parent_from_object| Instance { object: object.clone(), parent_from_object, motion: None, id: 0 };
        let placed = Object::new(None, vec![instance(Affine3A::IDENTITY), instance(turned)]).expect("valid");
        for root in [object.clone(), Arc::new(placed)] {
            let nested = root.path_count() > 1;
            let world = World::new(root);
            for ray in rays(&mut rng, 200, 1.0, Vec3::ZERO) {
                let (hit, visits) = (closest(&world, &ray), world.visits(&ray));
                if hit.is_hit() {
                    assert!(visits.primitives > 0 && visits.nodes > 0, "{visits:?}");
                    assert_eq!(visits.instances > 0, nested);
                    let short = world.visits(&Ray { t_max: 0.5 * hit.t, ..ray });
                    assert!(no_more(short, visits), "{short:?} {visits:?}");
                }
                let most = if nested { 2 } else { 1 };
                assert!(visits.instances <= 2 * 8 && visits.primitives <= 4 * 3000 * most, "{visits:?}");
            }
        }
    }
}

#[test]
fn counts_are_exact_where_they_are_known() {
    let ahead = Ray::new(Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z);
    let count = |root: Arc<Object>, ray: &Ray| {
        let Visits { nodes, primitives, instances } = World::new(root).visits(ray);
        [nodes, primitives, instances]
    };
    // One leaf in one node; the kd-tree is one leaf, or a few cells of which a ray needs one that is full.
    assert_eq!(count(object(&[facing(0.0)]), &ahead), [1, 1, 0]);
    let [nodes, primitives, _] = count(kd_object(&[facing(0.0)]), &ahead);
    assert!(nodes >= 1 && primitives == 1, "{nodes} {primitives}");
    // Far enough apart for leaves of their own: what lies behind the hit is not looked at.
    let spread: Vec<Mesh> = (0..64).map(|i| facing(-100.0 * i as f32)).collect();
    let many = object(&spread);
    let past = Ray { t_min: 5.5, ..ahead };
    let (first, all) = (count(many.clone(), &ahead), count(many.clone(), &Ray { t_max: 1.0, ..ahead }));
    assert!(first[1] < 64 && all == [1, 0, 0], "{first:?} {all:?}");
    assert!(count(many, &past)[0] >= 1);
    // An instance: the tree over instances has a node of its own, and what is inside costs the same.
    let placed = |by: Vec3| Instance {
        object: object(&[facing(0.0)]),
        parent_from_object: Affine3A::from_translation(by),
        motion: None,
        id: 0,
    };
    let two = Arc::new(Object::new(None, vec![placed(Vec3::ZERO), placed(Vec3::X * 100.0)]).expect("valid"));
    assert_eq!(count(two.clone(), &ahead), [2, 1, 1]);
    assert_eq!(count(two.clone(), &Ray::new(Vec3::splat(500.0), Vec3::Y)), [1, 0, 0]);
    // A ray that can hit nothing visits nothing.
    assert_eq!(count(two, &Ray::new(Vec3::splat(f32::NAN), Vec3::Y)), [0, 0, 0]);
    assert_eq!(count(Arc::new(Object::empty()), &ahead), [0, 0, 0]);
    let mut ball = Object::empty();
    let spheres = [Quadric::Sphere { center: Vec3::ZERO, radius: 1.0 }];
    ball.set_quadrics(Some(Arc::new(Quadrics::build([(0, &spheres[..])]).expect("one"))));
    assert_eq!(count(Arc::new(ball), &ahead), [1, 1, 0]);
}
