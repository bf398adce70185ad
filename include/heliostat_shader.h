/* The interface between Heliostat and surface shaders in shared libraries: all that their authors need.
 *
 * Generated from crates/plugins/src/abi.rs, and compiles as C11 and C++17. docs/plugins.md is the guide. */

#pragma once

#include <assert.h>
#include <stdint.h>

// Points in a packet.
#define HELIOSTAT_WIDTH 16

// The version of this interface. Versions grow at the end of the tables that plug-ins are given: the engine takes plug-ins of
// this version and of those before, and refuses later ones.
#define HELIOSTAT_ABI_VERSION 2

// Most parameters of one shader.
#define HELIOSTAT_MAX_PARAMETERS 32

// A parameter that is a number.
#define HELIOSTAT_FLOAT 0

// A parameter that is a linear Rec. 709 RGB colour.
#define HELIOSTAT_COLOR 1

// A parameter that is a vector.
#define HELIOSTAT_VECTOR 2

// The shader may give diffuse reflection to materials that have none, such as metals.
#define HELIOSTAT_ADDS_DIFFUSE 1

// The shader may give gloss to materials that have none: those with neither metal nor specular strength.
#define HELIOSTAT_ADDS_SPECULAR 2

// The shader may give a clear coat to materials that have none.
#define HELIOSTAT_ADDS_COAT 4

// The shader may make holes in opaque materials: it writes an opacity below 1.
#define HELIOSTAT_SEE_THROUGH 8

// A parameter of a shader. Strings are UTF-8 and end with a zero.
typedef struct HeliostatParameter {
    // Small letters, digits and `_`, a letter first.
    const char *name;
    // HELIOSTAT_FLOAT, HELIOSTAT_COLOR or HELIOSTAT_VECTOR.
    uint32_t kind;
    // The value unless set; numbers take the first component.
    float default_value[3];
    // Smallest and largest value that makes sense; values beyond are moved to the nearer end.
    float range[2];
    // Such as `m` or `1/m`; empty for pure numbers.
    const char *unit;
    // One line on what it does.
    const char *about;
} HeliostatParameter;

// What a parameter is set to in one material.
typedef struct HeliostatConstant {
    // The value, or what the texture or the attribute is multiplied by; three equal components for numbers.
    float value[3];
    // 1 if a texture or an attribute makes it vary from point to point, else 0.
    uint32_t textured;
} HeliostatConstant;

// One number for each point of a packet.
typedef struct HeliostatFloats {
    // Point by point.
    float lane[HELIOSTAT_WIDTH];
} HeliostatFloats;

// One vector or colour for each point of a packet.
typedef struct HeliostatVectors {
    // First components.
    struct HeliostatFloats x;
    // Second components.
    struct HeliostatFloats y;
    // Third components.
    struct HeliostatFloats z;
} HeliostatVectors;

// Where light is asked for: points of surfaces of one material. All pointers are valid, aligned to 64 bytes, and
// for reading only. Lanes from `count` on hold anything; to compute them with the others does no harm.
typedef struct HeliostatPoints {
    // World space, metres.
    const struct HeliostatVectors *position;
    // Object space.
    const struct HeliostatVectors *object_position;
    // Unit geometric normal in world space, on the front side.
    const struct HeliostatVectors *geometric_normal;
    // Unit normal interpolated between the vertices, in world space, on the front side.
    const struct HeliostatVectors *normal;
    // Unit vector towards the viewer, world space. The viewer sees the front where its product with the geometric
    // normal is positive.
    const struct HeliostatVectors *to_viewer;
    // Three columns of the matrix that takes directions from world to object space.
    const struct HeliostatVectors *object_from_world;
    // The mesh's linear colour; 1 where it has none.
    const struct HeliostatVectors *color;
    // The mesh's alpha; 1 where it has none.
    const struct HeliostatFloats *alpha;
    // First set of texture coordinates, along the width of the picture.
    const struct HeliostatFloats *u;
    // First set of texture coordinates, along the height of the picture, from its top.
    const struct HeliostatFloats *v;
    // log2 of the width of the footprint in those coordinates; 0 where the mesh has none.
    const struct HeliostatFloats *uv_lod;
    // Width of the footprint across the ray, metres: detail finer than this should fade out.
    const struct HeliostatFloats *width;
    // Distance along the ray that arrived, metres.
    const struct HeliostatFloats *distance;
    // Edges between the camera and this point, from 1.
    const struct HeliostatFloats *level;
    // Unit vector towards the camera of the frame, world space, whatever ray arrived: the same for light and in mirrors.
    // Where there is no frame, as when lamps are measured, it is `to_viewer`. Since version 2: a plug-in that says it is of
    // version 1 must not read it, since engines of that version do not give it.
    const struct HeliostatVectors *to_camera;
} HeliostatPoints;

// The values of the shader's parameters at the points.
typedef struct HeliostatInputs {
    // One packet for each parameter, in the order of the shader's table, textures included. Numbers are in `x`.
    const struct HeliostatVectors *const *values;
    // How many there are.
    uint32_t count;
} HeliostatInputs;

// What the engine does for a shader while it shades, and not after.
typedef struct HeliostatCallbacks {
    // The engine's own.
    const void *context;
    // Samples a parameter at texture coordinates of the shader's own making: `rgb` gets the value times the texture for
    // the first `count` lanes, and `alpha`, unless it is NULL, the texture's alpha. Each is filtered over `width` of the
    // coordinates; 0 is the sharpest. Parameters without a texture give their value. Returns 0, or another number if
    // nothing was written, since an argument was NULL, `count` above 16, or there is no such parameter.
    int32_t (*sample)(const struct HeliostatCallbacks *callbacks,
                      uint32_t parameter,
                      const struct HeliostatFloats *u,
                      const struct HeliostatFloats *v,
                      const struct HeliostatFloats *width,
                      uint32_t count,
                      struct HeliostatVectors *rgb,
                      struct HeliostatFloats *alpha);
    // Gradient noise (Perlin, "Improving Noise", 2002) of about one feature per unit, the same as the engine's own
    // shaders use: `value` gets -1 to 1 with mean 0 for the first `count` positions, and `gradient`, unless it is NULL, its
    // derivatives. Another seed gives other noise. Returns 0, or another number if nothing was written, since an argument
    // was NULL or `count` above 16.
    int32_t (*noise)(const struct HeliostatVectors *position,
                     uint32_t seed,
                     uint32_t count,
                     struct HeliostatFloats *value,
                     struct HeliostatVectors *gradient);
    // NULL. Kept for what there is not yet: rays of the shader's own and loops over lights.
    const void *reserved[5];
} HeliostatCallbacks;

// How the surface looks at the points, in the terms of the metallic-roughness model of glTF 2.0. A shader finds the
// material's own values here and changes what it wants. Values that are not finite or clearly out of range make the
// point glow in magenta, and the user is told once.
typedef struct HeliostatClosures {
    // Linear reflectance, 0 to 1.
    struct HeliostatVectors *base_color;
    // Share of light that meets the surface, 0 to 1; the rest passes straight through (see HELIOSTAT_SEE_THROUGH).
    struct HeliostatFloats *opacity;
    // 0 = dielectric, 1 = metal.
    struct HeliostatFloats *metallic;
    // Perceptual roughness, 0 to 1.
    struct HeliostatFloats *roughness;
    // Strength of the dielectric reflection, 0 to 1.
    struct HeliostatFloats *specular;
    // Tint of the dielectric reflection at normal incidence, from 0.
    struct HeliostatVectors *specular_color;
    // Share of the dielectric's base that transmits, 0 to 1; counts where the material transmits at all.
    struct HeliostatFloats *transmission;
    // Coverage of the clear coat, 0 to 1.
    struct HeliostatFloats *coat;
    // Its perceptual roughness, 0 to 1.
    struct HeliostatFloats *coat_roughness;
    // Emitted radiance towards the viewer, from 0. It shines on others where paths find it by chance.
    struct HeliostatVectors *emission;
    // Radiance of the classical ambient term, from 0.
    struct HeliostatVectors *ambient;
    // Unit shading normal in world space, on the front side.
    struct HeliostatVectors *normal;
    // The clear coat's.
    struct HeliostatVectors *coat_normal;
} HeliostatClosures;

// A shader. Its functions are called on several threads at once, for one instance too.
typedef struct HeliostatShader {
    // Small letters, digits, `-` and `_`, a letter first.
    const char *name;
    // One line on what it looks like.
    const char *about;
    // The sum of HELIOSTAT_ADDS_DIFFUSE and the like.
    uint32_t flags;
    // At most HELIOSTAT_MAX_PARAMETERS.
    uint32_t parameter_count;
    // May be NULL if there are none.
    const struct HeliostatParameter *parameters;
    // Prepares the shader for one material and sets `*instance` to whatever it likes. Returns 0, or another number if it
    // cannot; it may then explain itself in `message`, which has room for `size` bytes with the final zero. NULL if
    // there is nothing to prepare: instances are then NULL.
    int32_t (*create)(const struct HeliostatConstant *constants,
                      uint32_t count,
                      void **instance,
                      char *message,
                      uint32_t size);
    // Frees what `create` made, after the last `shade`. NULL if there is nothing to free.
    void (*destroy)(void *instance);
    // Changes the first `count` closures (1 to 16). Must be there. The same arguments must always give the same result,
    // and no lane may depend on another: pictures do not depend on which points share a packet.
    void (*shade)(const void *instance,
                  const struct HeliostatPoints *points,
                  const struct HeliostatInputs *inputs,
                  const struct HeliostatCallbacks *callbacks,
                  const struct HeliostatClosures *closures,
                  uint32_t count);
} HeliostatShader;

// What a plug-in consists of. It stays where it is, unchanged, for as long as the library is loaded.
typedef struct HeliostatPlugin {
    // HELIOSTAT_ABI_VERSION, or an earlier version of which the plug-in needs no more.
    uint32_t abi_version;
    // sizeof(HeliostatShader).
    uint32_t shader_size;
    // sizeof(HeliostatParameter).
    uint32_t parameter_size;
    // How many shaders there are, at least 1.
    uint32_t shader_count;
    // The shaders, one after the other.
    const struct HeliostatShader *shaders;
} HeliostatPlugin;

/* The engine asserts the same. */
static_assert(sizeof(HeliostatFloats) == 64, "packets are tightly packed");
static_assert(sizeof(HeliostatVectors) == 192, "packets are tightly packed");
static_assert(sizeof(HeliostatPoints) == 15 * sizeof(void *), "a table of pointers");
static_assert(sizeof(HeliostatClosures) == 13 * sizeof(void *), "a table of pointers");
static_assert(sizeof(HeliostatInputs) == 2 * sizeof(void *), "a pointer and a number");
static_assert(sizeof(HeliostatCallbacks) == 8 * sizeof(void *), "a table of pointers");
static_assert(sizeof(HeliostatConstant) == 16, "four numbers");

#if defined(_WIN32)
#define HELIOSTAT_EXPORT __declspec(dllexport)
#else
#define HELIOSTAT_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The function that a plug-in defines: what it consists of, or NULL if it does not know the version that it is asked for.
 * The engine asks for its own version first and for earlier ones then. */
HELIOSTAT_EXPORT const HeliostatPlugin *heliostat_plugin(uint32_t abi_version);

#ifdef __cplusplus
}
#endif
