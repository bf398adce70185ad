/* Shaders with a fault, one at a time by macro, to see that the engine catches it. Without a macro there is none, nor with
 * FIRST_VERSION. */
#include "heliostat_shader.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#ifdef BAD_RANGE
#define DEFAULT 2.0f
#else
#define DEFAULT 0.5f
#endif

#ifdef BAD_NAME
#define NAME "Not a name"
#else
#define NAME "faulty"
#endif

static const HeliostatParameter parameters[] = {
    {"amount", HELIOSTAT_FLOAT, {DEFAULT, 0.0f, 0.0f}, {0.0f, 1.0f}, "", "how much"},
#ifdef TWICE
    {"amount", HELIOSTAT_FLOAT, {0.5f, 0.0f, 0.0f}, {0.0f, 1.0f}, "", "how much"},
#endif
};

static int32_t create(const HeliostatConstant *constants, uint32_t count, void **instance, char *message, uint32_t size)
{
    (void)count, (void)instance;
    if (constants[0].value[0] > 0.9f && size > 32) {
        strcpy(message, "`amount` is too much");
        return 1;
    }
    return 0;
}

static void shade(const void *instance, const HeliostatPoints *points, const HeliostatInputs *inputs,
                  const HeliostatCallbacks *callbacks, const HeliostatClosures *closures, uint32_t count)
{
    (void)instance, (void)points, (void)callbacks;
    for (uint32_t i = 0; i < count; i++) {
        float amount = inputs->values[0]->x.lane[i];
#if defined(ANSWERS_NAN)
        closures->roughness->lane[i] = sqrtf(-amount);
#elif defined(ANSWERS_INFINITY)
        closures->emission->y.lane[i] = INFINITY * amount;
#elif defined(ANSWERS_BEYOND)
        closures->opacity->lane[i] = 1.0f + amount;
#elif defined(ANSWERS_NO_NORMAL)
        closures->normal->x.lane[i] = closures->normal->y.lane[i] = closures->normal->z.lane[i] = 0.0f;
#else
        closures->base_color->x.lane[i] = amount;
#endif
    }
}

static const HeliostatShader shaders[] = {
#ifdef NO_SHADE
    {NAME, "", 0, 1, parameters, create, NULL, NULL},
#elif defined(BAD_FLAGS)
    {NAME, "", 1024, 1, parameters, create, NULL, shade},
#elif defined(NO_TEXT)
    {NAME, NULL, 0, 1, parameters, create, NULL, shade},
#elif defined(NO_PARAMETERS)
    {NAME, "", 0, 1, NULL, create, NULL, shade},
#elif defined(MANY_PARAMETERS)
    {NAME, "", 0, 4000000000u, parameters, create, NULL, shade},
#else
    {NAME, "", 0, sizeof parameters / sizeof *parameters, parameters, create, NULL, shade},
#endif
};

static const HeliostatPlugin plugin = {
#ifdef OTHER_VERSION
    .abi_version = 77,
#elif defined(FIRST_VERSION)
    .abi_version = 1,
#else
    .abi_version = HELIOSTAT_ABI_VERSION,
#endif
#ifdef OTHER_SIZE
    .shader_size = 12,
#else
    .shader_size = sizeof(HeliostatShader),
#endif
    .parameter_size = sizeof(HeliostatParameter),
#ifndef NO_SHADERS
    .shader_count = 1,
#endif
#ifndef NULL_SHADERS
    .shaders = shaders,
#endif
};

#ifdef NO_ENTRY
#define heliostat_plugin something_else
const HeliostatPlugin *heliostat_plugin(uint32_t abi_version);
#endif

#ifdef UNRESOLVED
int nowhere_to_be_found(void);
#endif

const HeliostatPlugin *heliostat_plugin(uint32_t abi_version)
{
#ifdef UNRESOLVED
    if (nowhere_to_be_found()) {
        return NULL;
    }
#endif
#ifdef OLDER
    return abi_version == 0 ? &plugin : NULL;
#elif defined(FIRST_VERSION)
    return abi_version == 1 ? &plugin : NULL;
#else
    (void)abi_version;
    return &plugin;
#endif
}
