/* Cartoon bands in C: the engine's own `toon`, written again with nothing but the header. Shows what `to_camera` is for: where
 * the camera sees a band, mirrors and light see the same one. docs/plugins.md has the command to compile it. */
#include "heliostat_shader.h"

#include <math.h>
#include <stddef.h>

enum { LIT, SHADE, BANDS, OUTLINE, OUTLINE_WIDTH, PARAMETERS };

static const HeliostatParameter parameters[PARAMETERS] = {
    {"lit", HELIOSTAT_COLOR, {0.95f, 0.55f, 0.12f}, {0.0f, 1.0f}, "", "colour of the band that faces the camera"},
    {"shade", HELIOSTAT_COLOR, {0.32f, 0.06f, 0.10f}, {0.0f, 1.0f}, "", "colour of the band at the rim"},
    {"bands", HELIOSTAT_FLOAT, {4.0f, 4.0f, 4.0f}, {1.0f, 16.0f}, "", "number of bands"},
    {"outline", HELIOSTAT_COLOR, {0.01f, 0.01f, 0.015f}, {0.0f, 1.0f}, "", "colour of the outline"},
    {"outline_width", HELIOSTAT_FLOAT, {0.3f, 0.3f, 0.3f}, {0.0f, 1.0f}, "",
     "largest cosine of the angle to the camera that is outline"},
};

/* The share of the lit colour at a cosine of the angle to the camera. */
static inline float band(float facing, float bands)
{
    bands = floorf(bands);
    float whole = floorf(facing * bands);
    float last = bands - 1.0f;
    whole = whole < last ? whole : last;
    return whole / (last > 1.0f ? last : 1.0f);
}

static inline float channel(float lit, float shade, float outline, float share, int inside)
{
    float color = shade + (lit - shade) * share;
    return inside ? color : outline;
}

static void shade(const void *instance, const HeliostatPoints *points, const HeliostatInputs *inputs,
                  const HeliostatCallbacks *callbacks, const HeliostatClosures *closures, uint32_t count)
{
    (void)instance, (void)callbacks, (void)count;
    const HeliostatVectors *restrict eye = points->to_camera;
    const HeliostatVectors *restrict normal = closures->normal;
    const HeliostatVectors *restrict lit = inputs->values[LIT];
    const HeliostatVectors *restrict dark = inputs->values[SHADE];
    const HeliostatVectors *restrict outline = inputs->values[OUTLINE];
    const float *restrict bands = inputs->values[BANDS]->x.lane;
    const float *restrict width = inputs->values[OUTLINE_WIDTH]->x.lane;
    HeliostatVectors *restrict color = closures->base_color;
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        float cosine = normal->x.lane[i] * eye->x.lane[i] + normal->y.lane[i] * eye->y.lane[i] +
                       normal->z.lane[i] * eye->z.lane[i];
        float facing = fabsf(cosine) < 1.0f ? fabsf(cosine) : 1.0f;
        float share = band(facing, bands[i]);
        int inside = facing >= width[i];
        color->x.lane[i] = channel(lit->x.lane[i], dark->x.lane[i], outline->x.lane[i], share, inside);
        color->y.lane[i] = channel(lit->y.lane[i], dark->y.lane[i], outline->y.lane[i], share, inside);
        color->z.lane[i] = channel(lit->z.lane[i], dark->z.lane[i], outline->z.lane[i], share, inside);
    }
    /* Diffuse reflection and nothing else. */
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        closures->roughness->lane[i] = 1.0f;
        closures->specular->lane[i] = 0.0f;
        closures->metallic->lane[i] = 0.0f;
        closures->coat->lane[i] = 0.0f;
        closures->transmission->lane[i] = 0.0f;
    }
}

static const HeliostatShader shader = {
    .name = "toon",
    .about = "flat bands of colour by the angle to the camera, with an outline",
    .flags = HELIOSTAT_ADDS_DIFFUSE,
    .parameter_count = PARAMETERS,
    .parameters = parameters,
    .shade = shade,
};

static const HeliostatPlugin plugin = {
    .abi_version = HELIOSTAT_ABI_VERSION,
    .shader_size = sizeof(HeliostatShader),
    .parameter_size = sizeof(HeliostatParameter),
    .shader_count = 1,
    .shaders = &shader,
};

const HeliostatPlugin *heliostat_plugin(uint32_t abi_version)
{
    return abi_version == HELIOSTAT_ABI_VERSION ? &plugin : NULL;
}
