/* A checkerboard in C: the engine's own `checker`, written again with nothing but the header. The loops over all lanes have
 * no branches, so that compilers turn them into vector instructions. docs/plugins.md has the command to compile it. */
#include "heliostat_shader.h"

#include <math.h>
#include <stddef.h>

enum { FIRST, SECOND, SIZE, PARAMETERS };

static const HeliostatParameter parameters[PARAMETERS] = {
    {"first", HELIOSTAT_COLOR, {0.8f, 0.8f, 0.8f}, {0.0f, 1.0f}, "", "colour of the cubes around the origin"},
    {"second", HELIOSTAT_COLOR, {0.1f, 0.1f, 0.1f}, {0.0f, 1.0f}, "", "colour of their neighbours"},
    {"size", HELIOSTAT_FLOAT, {0.25f, 0.25f, 0.25f}, {1e-6f, 1e6f}, "m", "edge of a cube, object space"},
};

/* Beyond this floats have no fraction. */
#define LIMIT 4e6f
/* How far below the surface the cubes are looked up, in cubes. */
#define INSIDE 1e-3f

static inline float clamped(float x, float low, float high)
{
    x = x > low ? x : low;
    return x < high ? x : high;
}

/* The integral from 0 of the square wave of period 2 that is 1 on [0, 1) and -1 on [1, 2). */
static inline float integral(float x)
{
    float half = x * 0.5f;
    float t = half - floorf(half);
    return 1.0f - fabsf(t * 2.0f - 1.0f);
}

/* That square wave, averaged over a width. */
static inline float wave(float x, float width)
{
    /* Beyond ten thousand cells the mean is zero; below, what is left of a cell must not reach back over its border. */
    width = clamped(width, INSIDE, 1e4f);
    x = clamped(x, -LIMIT, LIMIT);
    return clamped((integral(x + width * 0.5f) - integral(x - width * 0.5f)) / width, -1.0f, 1.0f);
}

/* What a unit of the footprint is along the axes of object space, from two tangents of the surface (Duff et al., "Building an
 * Orthonormal Basis, Revisited", 2017), and the normal there. */
static void in_object(const HeliostatPoints *points, float extent[restrict 3][HELIOSTAT_WIDTH],
                      float normal[restrict 3][HELIOSTAT_WIDTH])
{
    const HeliostatVectors *restrict n = points->normal;
    const HeliostatVectors *restrict m = points->object_from_world;
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        float nx = n->x.lane[i], ny = n->y.lane[i], nz = n->z.lane[i];
        float sign = copysignf(1.0f, nz);
        float a = -(1.0f / (sign + nz));
        float b = nx * ny * a;
        float tx = sign * nx * nx * a + 1.0f, ty = sign * b, tz = -(sign * nx);
        float sx = b, sy = sign + ny * ny * a, sz = -ny;
        float ux = m[0].x.lane[i] * tx + m[1].x.lane[i] * ty + m[2].x.lane[i] * tz;
        float uy = m[0].y.lane[i] * tx + m[1].y.lane[i] * ty + m[2].y.lane[i] * tz;
        float uz = m[0].z.lane[i] * tx + m[1].z.lane[i] * ty + m[2].z.lane[i] * tz;
        float vx = m[0].x.lane[i] * sx + m[1].x.lane[i] * sy + m[2].x.lane[i] * sz;
        float vy = m[0].y.lane[i] * sx + m[1].y.lane[i] * sy + m[2].y.lane[i] * sz;
        float vz = m[0].z.lane[i] * sx + m[1].z.lane[i] * sy + m[2].z.lane[i] * sz;
        float ox = uy * vz - uz * vy, oy = uz * vx - ux * vz, oz = ux * vy - uy * vx;
        float length = sqrtf(ox * ox + oy * oy + oz * oz);
        float inverse = length > 0.0f ? 1.0f / length : 0.0f;
        extent[0][i] = sqrtf(ux * ux + vx * vx);
        extent[1][i] = sqrtf(uy * uy + vy * vy);
        extent[2][i] = sqrtf(uz * uz + vz * vz);
        normal[0][i] = ox * inverse;
        normal[1][i] = oy * inverse;
        normal[2][i] = oz * inverse;
    }
}

static void shade(const void *instance, const HeliostatPoints *points, const HeliostatInputs *inputs,
                  const HeliostatCallbacks *callbacks, const HeliostatClosures *closures, uint32_t count)
{
    (void)instance, (void)callbacks, (void)count;
    const HeliostatVectors *restrict p = points->object_position;
    const float *restrict width = points->width->lane;
    const float *restrict size = inputs->values[SIZE]->x.lane;
    const HeliostatVectors *restrict first = inputs->values[FIRST];
    const HeliostatVectors *restrict second = inputs->values[SECOND];
    HeliostatVectors *restrict color = closures->base_color;
    float extent[3][HELIOSTAT_WIDTH], normal[3][HELIOSTAT_WIDTH];
    in_object(points, extent, normal);
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        float per_cell = 1.0f / size[i];
        float w = width[i] * per_cell;
        /* A little below the surface, so that faces on a border between cubes show the cubes behind them. */
        float x = wave(p->x.lane[i] * per_cell - normal[0][i] * INSIDE, extent[0][i] * w);
        float y = wave(p->y.lane[i] * per_cell - normal[1][i] * INSIDE, extent[1][i] * w);
        float z = wave(p->z.lane[i] * per_cell - normal[2][i] * INSIDE, extent[2][i] * w);
        float t = x * y * z * 0.5f + 0.5f;
        color->x.lane[i] = second->x.lane[i] + (first->x.lane[i] - second->x.lane[i]) * t;
        color->y.lane[i] = second->y.lane[i] + (first->y.lane[i] - second->y.lane[i]) * t;
        color->z.lane[i] = second->z.lane[i] + (first->z.lane[i] - second->z.lane[i]) * t;
    }
}

static const HeliostatShader shader = {
    .name = "checker",
    .about = "cubes of two colours in object space, like a board carved from a block",
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
