//! Materials made ready for shading: textures resolved, interfaces tabulated, parameters to lobes.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::{AlphaMode, Material, MaterialId, MaterialOverride, ShaderRef, TextureId, TextureRef};

use crate::albedo::InterfaceTables;
use crate::attribute::AttributeInput;
use crate::closure::Closure;
use crate::color::Rgba;
use crate::lanes::{Real, Vector};
use crate::lobe_set::Lobes;
use crate::lobes::effective_ior;
use crate::microfacet::SMOOTH_ALPHA;
use crate::shader::{Bound, ShaderProblem, ShaderRegistry};
use crate::texture::{Footprint, MipMap};

/// A texture in use: the pyramid and how coordinates map to it.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    map: Arc<MipMap>,
    pub(crate) reference: TextureRef,
    /// log2 of the texels along a unit of the mesh's coordinates.
    scale: f32,
}

/// A material with everything it refers to.
#[derive(Clone, Debug)]
pub struct SurfaceMaterial {
    /// The handle, for identifier planes.
    pub id: MaterialId,
    source: Arc<Material>,
    base_color: Option<Slot>,
    metallic_roughness: Option<Slot>,
    pub(crate) normal: Option<Slot>,
    emissive: Option<Slot>,
    specular: Option<Slot>,
    specular_color: Option<Slot>,
    transmission: Option<Slot>,
    coat: Option<Slot>,
    coat_roughness: Option<Slot>,
    pub(crate) coat_normal: Option<Slot>,
    pub(crate) interface: Option<Arc<InterfaceTables>>,
    textured: bool,
    /// Which sets of texture coordinates it looks at.
    uv_sets: [bool; 2],
    /// The lobes that may have energy somewhere.
    lobes: Lobes,
    pub(crate) shader: Option<Bound>,
    problem: Option<ShaderProblem>,
}

/// Texture coordinates at a point: both sets, and the footprint per set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TextureCoordinates<F> {
    pub(crate) uv: [[F; 2]; 2],
    /// log2 of a probe's width in texture space; anything where nothing is looked up.
    pub(crate) lod: [F; 2],
    /// The footprint's longer axis, over which probes are spread.
    pub(crate) along: [[F; 2]; 2],
    /// Number of probes; 1 is a square footprint.
    pub(crate) probes: F,
    /// Of the mesh.
    pub(crate) color: Rgba<F>,
}

impl TextureCoordinates<f32> {
    /// With square footprints.
    pub(crate) fn square(uv: [[f32; 2]; 2], lod: [f32; 2], color: Rgba<f32>) -> Self {
        Self { uv, lod, along: [[0.0; 2]; 2], probes: 1.0, color }
    }
}

/// Shared tables of interfaces, by the bits of their index.
pub type InterfaceCache = BTreeMap<u32, Arc<InterfaceTables>>;

impl SurfaceMaterial {
    /// Resolves a material's textures, which must be in `textures`; missing ones read as white. A shader that is not in
    /// `shaders` is replaced by a placeholder of a loud colour.
    pub fn new(
        id: MaterialId,
        source: &Arc<Material>,
        textures: &BTreeMap<TextureId, Arc<MipMap>>,
        interfaces: &mut InterfaceCache,
        shaders: &ShaderRegistry,
    ) -> Self {
        let slot = |reference: &Option<TextureRef>| {
            let reference = (*reference)?;
            Some(Slot::new(textures.get(&reference.texture)?.clone(), reference))
        };
        let coat = source.clearcoat.as_ref();
        let solid = source.transmission > 0.0 && source.volume.is_some() && !source.unlit;
        let interface = solid.then(|| {
            let ior = effective_ior(source.ior);
            interfaces.entry(ior.to_bits()).or_insert_with(|| Arc::new(InterfaceTables::new(ior))).clone()
        });
        let mut lobes = possible_lobes(source);
        let mut problem = None;
        let shader = source.shader.as_ref().filter(|_| !source.unlit).map(|wanted| {
            let (bound, why) = shaders.bind(wanted, textures);
            lobes = lobes.union(bound.info.lobes);
            problem = why;
            bound
        });
        Self {
            id,
            source: source.clone(),
            base_color: slot(&source.base_color_texture),
            metallic_roughness: slot(&source.metallic_roughness_texture),
            normal: slot(&source.normal_texture),
            emissive: slot(&source.emissive_texture),
            specular: slot(&source.specular_texture),
            specular_color: slot(&source.specular_color_texture),
            transmission: slot(&source.transmission_texture),
            coat: coat.and_then(|c| slot(&c.texture)),
            coat_roughness: coat.and_then(|c| slot(&c.roughness_texture)),
            coat_normal: coat.and_then(|c| slot(&c.normal_texture)),
            interface,
            textured: source.textures().next().is_some() || shader.is_some(),
            uv_sets: [0, 1].map(|set| {
                shader.is_some() || source.textures().any(|(_, t)| usize::from(t.uv_set.min(1)) == set)
            }),
            lobes,
            shader,
            problem,
        }
    }

    /// Why it has a placeholder instead of its shader.
    pub fn problem(&self) -> Option<&ShaderProblem> {
        self.problem.as_ref()
    }

    /// The lobes that may have energy somewhere.
    pub fn lobes(&self) -> Lobes {
        self.lobes
    }

    /// The material as it is or as `materials` makes it.
    pub fn overridden(material: &Arc<Material>, materials: &MaterialOverride) -> Arc<Material> {
        match materials {
            MaterialOverride::None => material.clone(),
            MaterialOverride::Diffuse => Arc::new(Material {
                base_color: material.base_color,
                base_color_texture: material.base_color_texture,
                normal_texture: material.normal_texture,
                normal_scale: material.normal_scale,
                emissive: material.emissive,
                emissive_texture: material.emissive_texture,
                double_sided: material.double_sided,
                ..Material::diffuse(material.name.clone(), Vec3::ONE)
            }),
            MaterialOverride::Shader { mirrors: true, .. } if is_mirror(material) => material.clone(),
            // Holes stay holes; what is unlit would stay its own colour.
            MaterialOverride::Shader { shader, .. } => Arc::new(Material {
                shader: Some(Arc::new(shader.clone())),
                unlit: false,
                ..Material::clone(material)
            }),
        }
    }

    /// The description it was made from.
    pub fn source(&self) -> &Material {
        &self.source
    }

    /// Whether it looks at a set of texture coordinates.
    #[inline(always)]
    pub(crate) fn uses_uvs(&self, set: usize) -> bool {
        self.uv_sets[set]
    }

    /// Whether it has maps of normals, which take axes of tangent space.
    pub(crate) fn has_normal_maps(&self) -> bool {
        self.normal.is_some() || self.coat_normal.is_some()
    }

    /// The parameters of its shader that take their values from attributes.
    #[inline]
    pub(crate) fn attribute_inputs(&self) -> impl Iterator<Item = &AttributeInput> {
        let inputs = self.shader.iter().flat_map(|shader| &shader.inputs);
        inputs.filter_map(|input| input.attribute())
    }

    /// Whether points need texture coordinates.
    pub(crate) fn is_textured(&self) -> bool {
        self.textured
    }

    /// Whether light can pass straight through: such surfaces do not simply occlude.
    pub fn is_see_through(&self) -> bool {
        let m = &self.source;
        // A texture may make any place smooth.
        let may_be_smooth =
            m.roughness * m.roughness <= SMOOTH_ALPHA || m.metallic_roughness_texture.is_some();
        m.alpha_mode != AlphaMode::Opaque
            || self.shader.as_ref().is_some_and(|shader| shader.info.see_through)
            || (m.transmission > 0.0 && m.volume.is_none() && may_be_smooth && !m.unlit)
    }

    /// Radiance emitted where `at`, towards the front (`front`) or the back.
    #[inline(always)]
    pub(crate) fn emission<F: Real>(&self, at: &TextureCoordinates<F>, front: F::Mask) -> Vector<F> {
        let token = at.color.a.token();
        if self.source.emissive == Vec3::ZERO {
            return Vector::constant(token, Vec3::ZERO);
        }
        let emission = Vector::constant(token, self.source.emissive) * lookup(&self.emissive, at).rgb;
        if self.source.double_sided { emission } else { emission.only(front) }
    }

    /// Emission of the share of the surface that is there; nothing comes from its holes.
    pub(crate) fn visible_emission(&self, at: &TextureCoordinates<f32>, front: bool) -> Vec3 {
        let coverage = match self.source.alpha_mode {
            AlphaMode::Opaque => 1.0,
            _ => self.coverage(self.base_color(at).a),
        };
        (self.emission(at, front) * coverage).into()
    }

    /// Mean of the emission over the texture.
    pub(crate) fn mean_emission(&self) -> Vec3 {
        let texture = self.emissive.as_ref().map_or(Vec3::ONE, |slot| slot.map.mean().truncate());
        self.source.emissive * texture
    }

    /// Absorption per metre inside the solid that this material bounds.
    pub(crate) fn absorption(&self) -> Vec3 {
        let Some(volume) = self.source.volume.filter(|_| self.source.transmission > 0.0) else {
            return Vec3::ZERO;
        };
        // −ln c / d; a channel that lets nothing through is given a transmittance of 1e-6.
        volume.attenuation_color.max(Vec3::splat(1e-6)).map(|c| -c.ln()) / volume.attenuation_distance
    }

    /// Base colour with alpha, mesh colours included.
    #[inline(always)]
    pub(crate) fn base_color<F: Real>(&self, at: &TextureCoordinates<F>) -> Rgba<F> {
        let token = at.color.a.token();
        let factor = self.source.base_color;
        let texel = lookup(&self.base_color, at);
        Rgba {
            rgb: (Vector::constant(token, factor.truncate()) * texel.rgb * at.color.rgb).clamp(0.0, 1.0),
            a: (texel.a * at.color.a * factor.w).clamp(0.0, 1.0),
        }
    }

    /// Radiance of the classical ambient term.
    #[inline(always)]
    fn ambient<F: Real>(&self, at: &TextureCoordinates<F>) -> Vector<F> {
        let ambient = Vector::constant(at.color.a.token(), self.source.ambient);
        if self.source.ambient == Vec3::ZERO { ambient } else { ambient * lookup(&self.base_color, at).rgb }
    }

    /// Share of light that meets the surface, from the base colour's alpha.
    #[inline(always)]
    pub(crate) fn coverage<F: Real>(&self, alpha: F) -> F {
        let one = alpha.splat(1.0);
        match self.source.alpha_mode {
            AlphaMode::Opaque => one,
            AlphaMode::Mask { cutoff } => one.only(alpha.ge(alpha.splat(cutoff))),
            AlphaMode::Blend => alpha,
        }
    }

    /// The material's parameters at points of mesh coordinates `at`, with the normals of its maps.
    #[inline(always)]
    pub(crate) fn closure<F: Real>(
        &self,
        at: &TextureCoordinates<F>,
        (normal, coat_normal): (Vector<F>, Vector<F>),
        front: F::Mask,
    ) -> Closure<F> {
        let m = &*self.source;
        let base = self.base_color(at);
        let zero = base.a.splat(0.0);
        let one = base.a.splat(1.0);
        let (mut coat, mut coat_roughness) = (zero, zero);
        if let Some(layer) = &m.clearcoat {
            coat = (lookup(&self.coat, at).rgb.x * layer.factor).clamp(0.0, 1.0);
            coat_roughness = (lookup(&self.coat_roughness, at).rgb.y * layer.roughness).clamp(0.0, 1.0);
        }
        let metallic_roughness = lookup(&self.metallic_roughness, at).rgb;
        let glossy = self.lobes.contains(Lobes::SPECULAR);
        let white = Vector::grey(one);
        Closure {
            base_color: base.rgb,
            opacity: self.coverage(base.a),
            metallic: (metallic_roughness.z * m.metallic).clamp(0.0, 1.0),
            roughness: (metallic_roughness.y * m.roughness).clamp(0.0, 1.0),
            specular: match glossy {
                true => (lookup(&self.specular, at).a * m.specular).clamp(0.0, 1.0),
                false => zero,
            },
            specular_color: match glossy {
                true => {
                    Vector::constant(zero.token(), m.specular_color) * lookup(&self.specular_color, at).rgb
                }
                false => white,
            },
            transmission: match m.transmission > 0.0 {
                true => (lookup(&self.transmission, at).rgb.x * m.transmission).clamp(0.0, 1.0),
                false => zero,
            },
            coat,
            coat_roughness,
            emission: self.emission(at, front),
            ambient: self.ambient(at),
            normal,
            coat_normal,
        }
    }
}

/// Whether a material is one of mirrors or glass, as far as its factors and its shader's name tell.
fn is_mirror(m: &Material) -> bool {
    /// Roughest that counts: duller surfaces show no picture of others.
    const ROUGHEST: f32 = 0.2;
    match &m.shader {
        Some(shader) => match &shader.shader {
            ShaderRef::Named(name) => ["mirror", "glass"].contains(&name.as_str()),
            ShaderRef::Plugin { .. } => false,
        },
        None => m.roughness <= ROUGHEST && (m.metallic >= 0.5 || m.transmission >= 0.5),
    }
}

/// The lobes that a material may have anywhere, by its constants.
fn possible_lobes(m: &Material) -> Lobes {
    if m.unlit {
        return Lobes::NONE;
    }
    let solid = m.volume.is_some();
    // The constants are multiplied by textures of values up to 1: those below 1 may reach anything, those of 1 too.
    let all_metal = m.metallic >= 1.0 && m.metallic_roughness_texture.is_none();
    let all_transmitted = m.transmission >= 1.0 && m.transmission_texture.is_none();
    let present = [
        (Lobes::DIFFUSE, !all_metal && !all_transmitted),
        (Lobes::SPECULAR, m.metallic > 0.0 || (m.specular > 0.0 && !(solid && all_transmitted))),
        (Lobes::COAT, m.clearcoat.as_ref().is_some_and(|coat| coat.factor > 0.0)),
        (Lobes::GLASS_REFLECT.union(Lobes::GLASS_TRANSMIT), m.transmission > 0.0 && solid && !all_metal),
        (Lobes::THIN_TRANSMIT, m.transmission > 0.0 && !solid && !all_metal),
    ];
    present.into_iter().filter(|(_, is)| *is).fold(Lobes::NONE, |set, (lobe, _)| set.union(lobe))
}

#[inline(always)]
pub(crate) fn lookup<F: Real>(slot: &Option<Slot>, at: &TextureCoordinates<F>) -> Rgba<F> {
    match slot {
        Some(slot) => slot.lookup(at),
        None => Rgba::white(at.color.a),
    }
}

impl Slot {
    pub(crate) fn new(map: Arc<MipMap>, reference: TextureRef) -> Self {
        let texels = map.size();
        let area = reference.transform.0.matrix2.determinant().abs() * texels.x * texels.y;
        Self { map, reference, scale: 0.5 * area.max(1e-20).log2() }
    }

    /// The texel under the footprint.
    #[inline(always)]
    pub(crate) fn lookup<F: Real>(&self, at: &TextureCoordinates<F>) -> Rgba<F> {
        let set = usize::from(self.reference.uv_set.min(1));
        self.filtered(Footprint { uv: at.uv[set], lod: at.lod[set], along: at.along[set], probes: at.probes })
    }

    /// The texel under a footprint in the mesh's coordinates, `lod` being log2 of a square's width in them.
    #[inline(always)]
    pub(crate) fn filtered<F: Real>(&self, footprint: Footprint<F>) -> Rgba<F> {
        let Footprint { uv: [u, v], lod, along: [along_u, along_v], probes } = footprint;
        let transform = &self.reference.transform.0;
        let (x, y, origin) = (transform.x_axis, transform.y_axis, transform.translation);
        let along = [along_u * x.x + along_v * y.x, along_u * x.y + along_v * y.y];
        // Within a texel there is nothing to be seen more sharply.
        let [width, height] = self.map.size().to_array();
        let is_long = lod.splat(1.0).lt((along[0] * width).squared() + (along[1] * height).squared());
        let [r, g, b, a] = self.map.filtered(Footprint {
            uv: [u * x.x + v * y.x + origin.x, u * x.y + v * y.y + origin.y],
            lod: lod + self.scale,
            along,
            probes: probes.only(is_long),
        });
        Rgba { rgb: Vector::new(r, g, b), a }
    }
}
