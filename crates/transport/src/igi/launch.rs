//! Which source sends a photon to which reflector.
//!
//! Reflectors that lie close together are chosen as one. How much each source can send into the sphere around them says how
//! likely it is to be chosen, so that all photons carry about as much: those of a lamp that is seldom chosen would be bright
//! spots.
//!
//! # References
//! Jensen, "Global Illumination using Photon Maps", 1996 (photons sent towards specular objects).

use glam::Vec3;
use heliostat_shading::color::luminance;
use heliostat_shading::sampling::Discrete;
use heliostat_shading::{Reflector, Source};
use rayon::prelude::*;

use super::vpl::Vpl;

/// Reflectors are brought together in at most 2 to this many clusters.
const HALVINGS: u32 = 5;
/// Reflectors of a cluster that are compared for each photon; where there are more, they are chosen by their size alone.
const MOST_COMPARED: usize = 16;
/// Sources times clusters at most: there are fewer clusters where there are many sources.
const MOST_PAIRS: usize = 1 << 20;

/// The choice of sources and reflectors.
pub(super) struct Launches<'a> {
    sources: Vec<&'a Vpl>,
    clusters: Vec<Cluster<'a>>,
    choice: Discrete,
}

/// Reflectors that are chosen as one.
struct Cluster<'a> {
    reflectors: &'a [Reflector],
    /// Among them.
    choice: Discrete,
    /// Among the sources.
    sources: Discrete,
}

/// A source that sends a photon to a reflector.
pub(super) struct Launch<'a> {
    /// Index of the source.
    pub(super) source: u32,
    pub(super) reflector: &'a Reflector,
    /// Of the pair.
    pub(super) probability: f32,
}

impl<'a> Launches<'a> {
    /// From `sources` to `reflectors`, whose order may change; `None` where no light is sent.
    pub(super) fn new(sources: Vec<&'a Vpl>, reflectors: &'a mut [Reflector]) -> Option<Self> {
        let mut groups: Vec<&mut [Reflector]> = vec![reflectors];
        let halvings = (MOST_PAIRS / sources.len().max(1)).max(1).ilog2().min(HALVINGS);
        for _ in 0..halvings {
            groups = groups.into_iter().flat_map(halves).collect();
        }
        let clusters: Vec<Cluster<'_>> =
            groups.into_par_iter().filter_map(|group| Cluster::new(group, &sources)).collect();
        let choice = Discrete::new(clusters.iter().map(|c| c.choice.total() * c.sources.total()));
        (choice.total() > 0.0).then_some(Self { sources, clusters, choice })
    }

    /// A source by its index.
    pub(super) fn source(&self, index: u32) -> &'a Vpl {
        self.sources[index as usize]
    }

    /// Chooses a pair by numbers in [0, 1); `None` is a pair between which no light passes.
    pub(super) fn choose(&self, u_source: f32, u_reflector: f32) -> Option<Launch<'_>> {
        let (cluster, p_cluster, rest) = self.choice.sample(u_reflector)?;
        let cluster = &self.clusters[cluster];
        let (source, p_source, _) = cluster.sources.sample(u_source)?;
        let (reflector, p_reflector) = cluster.member(&self.sources[source].source, rest)?;
        let probability = p_cluster * p_reflector * p_source;
        let reflector = &cluster.reflectors[reflector];
        (probability > 0.0).then_some(Launch { source: source as u32, reflector, probability })
    }
}

/// Both halves of reflectors along the axis on which their centres lie furthest apart; a single one stays.
fn halves(group: &mut [Reflector]) -> Vec<&mut [Reflector]> {
    if group.len() < 2 {
        return vec![group];
    }
    let centers = || group.iter().map(|reflector| reflector.center);
    let extent = centers().fold(Vec3::NEG_INFINITY, Vec3::max) - centers().fold(Vec3::INFINITY, Vec3::min);
    let axis = extent.max_position();
    group.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
    let (low, high) = group.split_at_mut(group.len() / 2);
    vec![low, high]
}

impl<'a> Cluster<'a> {
    /// `None` if there are no reflectors.
    fn new(reflectors: &'a [Reflector], sources: &[&Vpl]) -> Option<Self> {
        let corners = |sign: f32| reflectors.iter().map(move |r| r.center + sign * Vec3::splat(r.radius));
        let (low, high) = (corners(-1.0).reduce(Vec3::min)?, corners(1.0).reduce(Vec3::max)?);
        let center = 0.5 * (low + high);
        let radius = reflectors.iter().map(|r| center.distance(r.center) + r.radius).fold(0.0, f32::max);
        Some(Self {
            reflectors,
            choice: Discrete::new(reflectors.iter().map(|r| r.weight)),
            sources: Discrete::new(sources.iter().map(|vpl| most(&vpl.source, center, radius))),
        })
    }
}

impl Cluster<'_> {
    /// Chooses one of the reflectors for a source, by a number in [0, 1): its index and probability.
    fn member(&self, source: &Source, u: f32) -> Option<(usize, f32)> {
        if self.reflectors.len() > MOST_COMPARED {
            return self.choice.sample(u).map(|(index, probability, _)| (index, probability));
        }
        // One beside the source receives more than the sphere around all of them tells.
        let weight = |r: &Reflector| r.weight * most(source, r.center, r.radius);
        let total: f32 = self.reflectors.iter().map(weight).sum();
        let mut rest = u * total;
        let mut chosen = None;
        // Rounding may leave the last one open.
        for (index, weight) in self.reflectors.iter().map(weight).enumerate().filter(|&(_, w)| w > 0.0) {
            chosen = Some((index, weight / total));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
        chosen
    }
}

/// About the most that a source sends into a sphere, by its cross-section: irradiance.
fn most(source: &Source, center: Vec3, radius: f32) -> f32 {
    let Some(origin) = source.origin() else {
        return luminance(source.light(center).radiance);
    };
    let way = center - origin;
    let distance2 = way.length_squared();
    let intensity = match *source {
        Source::Patch { normal, radiance, ref gloss, .. } => {
            // Gloss is smooth enough for its value at the centre, or its mean if that is more.
            let radiance = match gloss {
                Some(_) => luminance(source.light(center).radiance).max(mean(source)),
                None => luminance(radiance),
            };
            radiance * largest_cosine(normal.dot(way), distance2.sqrt(), radius)
        }
        // Their intensity may be anything: the largest of some places on the sphere.
        _ => {
            let place = |i: usize| {
                let sign = |bit: usize| if (i >> bit) & 1 == 0 { -1.0 } else { 1.0 };
                match i {
                    0..8 => center + Vec3::new(sign(0), sign(1), sign(2)).normalize() * radius,
                    8..14 => center + sign(0) * Vec3::AXES[(i - 8) / 2] * radius,
                    _ => center,
                }
            };
            (0..15).map(|i| intensity(source, place(i))).fold(0.0, f32::max)
        }
    };
    intensity / (distance2 + radius * radius)
}

/// Radiance times area of a patch in the mean over directions, as luminance.
fn mean(source: &Source) -> f32 {
    source.patch_radiance().map_or(0.0, luminance)
}

/// Radiant intensity towards a point, as luminance.
fn intensity(source: &Source, at: Vec3) -> f32 {
    let light = source.light(at);
    let distance2 = source.origin().map_or(1.0, |origin| origin.distance_squared(at));
    luminance(light.radiance) * light.facing * distance2
}

/// The largest cosine between a normal and a direction into a sphere at a distance, whose centre lies `along` the normal.
fn largest_cosine(along: f32, distance: f32, radius: f32) -> f32 {
    if distance <= radius {
        return 1.0;
    }
    let (cos, sin_cap) = (along / distance, radius / distance);
    let cos_cap = (1.0 - sin_cap * sin_cap).sqrt();
    if cos >= cos_cap {
        return 1.0;
    }
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    (cos * cos_cap + sin * sin_cap).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_shading::Sampler;

    fn patch(position: Vec3, normal: Vec3) -> Vpl {
        let source = Source::Patch {
            position,
            error: 0.0,
            normal,
            radiance: Vec3::ONE,
            rim: 0.0,
            gloss: None,
            density: 0.0,
        };
        Vpl { source, bounces: 1 }
    }

    fn reflectors() -> Vec<Reflector> {
        let at = |i: u32| {
            let [x, y, z, size] = Sampler::along(i, 5).set(0);
            let center = 4.0 * Vec3::new(x, y, z);
            Reflector { placement: i, part: 0, center, radius: 0.02 + 0.3 * size, weight: 1.0 + size }
        };
        (0..100).map(at).collect()
    }

    #[test]
    fn every_pair_that_light_may_join_is_chosen_as_often_as_said() {
        let vpls: Vec<Vpl> = (0..20)
            .map(|i| {
                let [x, y, z, w] = Sampler::along(i, 9).set(0);
                patch(4.0 * Vec3::new(x, y, z), (Vec3::new(w, z, x) - 0.5).normalize())
            })
            .collect();
        let mut reflectors = reflectors();
        let launches = Launches::new(vpls.iter().collect(), &mut reflectors).expect("light is sent");
        let (n, mut found, mut sum) = (200_000, std::collections::BTreeMap::new(), 0.0);
        // Sources that see the sphere around a cluster and none of its reflectors send nothing.
        let mut none = 0.0;
        for i in 0..n {
            let [u, v, ..] = Sampler::along(i, 1).set(0);
            let Some(launch) = launches.choose(u, v) else {
                none += 1.0;
                continue;
            };
            let pair = (launch.source, launch.reflector.placement);
            *found.entry(pair).or_insert((0.0, launch.probability)) = {
                let (count, probability) = *found.get(&pair).unwrap_or(&(0.0, launch.probability));
                assert_eq!(probability, launch.probability);
                (count + 1.0, probability)
            };
        }
        for (count, probability) in found.values() {
            sum += probability;
            let expected = probability * n as f32;
            assert!((count - expected).abs() < 6.0 * expected.sqrt() + 6.0, "{count} for {expected}");
        }
        assert!(none < 0.2 * n as f32, "{none}");
        assert!((sum + none / n as f32 - 1.0).abs() < 1e-2, "{sum}");
        // Whatever can be lit is not left out.
        for (index, vpl) in (0..).zip(&vpls) {
            let Source::Patch { position, normal, .. } = vpl.source else { continue };
            let lit = |r: &&Reflector| {
                let way = r.center - position;
                way.dot(normal) > 0.3 * way.length() && way.length() < 2.0 && way.length() > 1.0
            };
            for reflector in reflectors_of(&launches).filter(lit) {
                assert!(found.contains_key(&(index, reflector.placement)), "{vpl:?} {reflector:?}");
            }
        }
    }

    fn reflectors_of<'a>(launches: &'a Launches<'_>) -> impl Iterator<Item = &'a Reflector> {
        launches.clusters.iter().flat_map(|cluster| cluster.reflectors)
    }

    #[test]
    fn no_photon_carries_far_more_than_others() {
        // From beside the reflectors, away from their centre, and from far.
        let places = [0.0, 0.29, 0.31, 1.0, 30.0].into_iter().flat_map(|x| {
            [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::new(0.1, 1.0, 0.0).normalize()]
                .map(|n| patch(Vec3::X * x, n))
        });
        for vpl in places {
            let most = most(&vpl.source, Vec3::ZERO, 0.3);
            for i in 0..500 {
                let [u, v, w, _] = Sampler::along(i, 3).set(0);
                let at = 0.3 * (2.0 * Vec3::new(u, v, w) - 1.0).clamp_length_max(1.0);
                let (origin, sent) = (vpl.source.origin().expect("a patch"), intensity(&vpl.source, at));
                let solid_angle = match origin.length() / 0.3 {
                    far if far > 1.0 => std::f32::consts::TAU * (1.0 - (1.0 - far.powi(-2)).sqrt()),
                    _ => 2.0 * std::f32::consts::TAU,
                };
                let flux = sent * solid_angle / most;
                assert!(sent == 0.0 || flux <= 9.0 * std::f32::consts::PI * 0.3 * 0.3, "{vpl:?}: {flux}");
            }
        }
    }
}
