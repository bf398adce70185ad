/* Shows its texture with u and v exchanged, as a glow; a glow of 9 says that a callback did not keep its word. */
#include "heliostat_shader.h"

#include <stddef.h>

static const HeliostatParameter parameters[] = {
    {"picture", HELIOSTAT_COLOR, {1.0f, 1.0f, 1.0f}, {0.0f, 1.0f}, "", "what to show"},
};

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
