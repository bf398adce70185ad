/* Shows its texture with u and v exchanged, as a glow; a glow of 9 says that a callback did not keep its word. */
#include "heliostat_shader.h"

#include <stddef.h>

static const HeliostatParameter parameters[] = {
    {"picture", HELIOSTAT_COLOR, {1.0f, 1.0f, 1.0f}, {0.0f, 1.0f}, "", "what to show"},
};

/* Whether noise vanishes at whole numbers, stays in its range, and has the slope that it says. */
static int keeps_noise(const HeliostatCallbacks *callbacks)
{
    HeliostatVectors near = {0}, far = {0}, slope;
    HeliostatFloats here, there;
    const float step = 1e-2f;
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        near.x.lane[i] = (float)i * 0.25f;
        near.y.lane[i] = near.z.lane[i] = i % 4 ? 0.4f : 3.0f;
        far.x.lane[i] = near.x.lane[i] + step;
        far.y.lane[i] = near.y.lane[i];
        far.z.lane[i] = near.z.lane[i];
    }
    int kept = callbacks->noise(&near, 7, HELIOSTAT_WIDTH, &here, &slope) == 0;
    kept &= callbacks->noise(&far, 7, HELIOSTAT_WIDTH, &there, NULL) == 0;
    kept &= callbacks->noise(&near, 7, HELIOSTAT_WIDTH + 1, &here, NULL) != 0;
    kept &= callbacks->noise(NULL, 7, 1, &here, NULL) != 0;
    float most = 0.0f;
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        float error = (there.lane[i] - here.lane[i]) / step - slope.x.lane[i];
        /* The curvature of the noise is below 10. */
        kept &= error < 0.1f && error > -0.1f && here.lane[i] <= 1.0f && here.lane[i] >= -1.0f;
        kept &= i % 4 || (here.lane[i] < 1e-6f && here.lane[i] > -1e-6f);
        most = here.lane[i] > most ? here.lane[i] : most;
    }
    return kept && most > 0.0f;
}

static void shade(const void *instance, const HeliostatPoints *points, const HeliostatInputs *inputs,
                  const HeliostatCallbacks *callbacks, const HeliostatClosures *closures, uint32_t count)
{
    (void)instance, (void)inputs;
    HeliostatFloats width, alpha;
    HeliostatVectors rgb;
    for (int i = 0; i < HELIOSTAT_WIDTH; i++) {
        width.lane[i] = 0.0f;
    }
    int kept = callbacks->sample(callbacks, 0, points->v, points->u, &width, count, &rgb, &alpha) == 0;
    kept &= callbacks->sample(callbacks, 0, points->v, points->u, &width, count, &rgb, NULL) == 0;
    kept &= callbacks->sample(callbacks, 1, points->v, points->u, &width, count, &rgb, NULL) != 0;
    kept &= callbacks->sample(callbacks, 0, points->v, NULL, &width, count, &rgb, NULL) != 0;
    kept &= callbacks->sample(callbacks, 0, points->v, points->u, &width, 17, &rgb, NULL) != 0;
    kept &= keeps_noise(callbacks);
    for (uint32_t i = 0; i < count; i++) {
        closures->emission->x.lane[i] = kept ? rgb.x.lane[i] : 9.0f;
        closures->emission->y.lane[i] = kept ? rgb.y.lane[i] : 9.0f;
        closures->emission->z.lane[i] = kept ? alpha.lane[i] : 9.0f;
    }
}

static const HeliostatShader shader = {"swapped", "", 0, 1, parameters, NULL, NULL, shade};

static const HeliostatPlugin plugin = {
    HELIOSTAT_ABI_VERSION, sizeof(HeliostatShader), sizeof(HeliostatParameter), 1, &shader,
};

const HeliostatPlugin *heliostat_plugin(uint32_t abi_version)
{
    return abi_version == HELIOSTAT_ABI_VERSION ? &plugin : NULL;
}
