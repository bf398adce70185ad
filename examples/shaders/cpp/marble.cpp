// Marble in C++: veins where a ramp through the block, shaken by noise, turns around. Shows what `create` is for: the
// random table of the noise is made once for each material.
#include "heliostat_shader.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <new>
#include <utility>

namespace {

enum Parameter : std::uint32_t { GROUND, VEIN, SPACING, SHAKE, SEED, PARAMETERS };

const HeliostatParameter parameters[PARAMETERS] = {
    {"ground", HELIOSTAT_COLOR, {0.9f, 0.88f, 0.84f}, {0.0f, 1.0f}, "", "colour between the veins"},
    {"vein", HELIOSTAT_COLOR, {0.2f, 0.22f, 0.25f}, {0.0f, 1.0f}, "", "colour of the veins"},
    {"spacing", HELIOSTAT_FLOAT, {0.3f, 0.0f, 0.0f}, {1e-3f, 1e3f}, "m", "distance between veins, object space"},
    {"shake", HELIOSTAT_FLOAT, {1.5f, 0.0f, 0.0f}, {0.0f, 10.0f}, "", "how far noise moves the veins, in spacings"},
    {"seed", HELIOSTAT_FLOAT, {1.0f, 0.0f, 0.0f}, {1.0f, 1e6f}, "", "another number gives another block; constant"},
};

/// Value noise on a lattice of random numbers.
struct Noise {
    std::array<float, 256> values;
    std::array<std::uint8_t, 512> order;

    explicit Noise(std::uint32_t seed)
    {
        // xorshift (Marsaglia, "Xorshift RNGs", 2003)
        auto random = [state = seed * 2654435761u + 1u]() mutable {
            state ^= state << 13;
            state ^= state >> 17;
            return state ^= state << 5;
        };
        for (std::size_t i = 0; i < 256; i++) {
            values[i] = static_cast<float>(random() >> 8) / static_cast<float>(1 << 24);
            order[i] = static_cast<std::uint8_t>(i);
        }
        for (std::size_t i = 255; i > 0; i--) {
            std::swap(order[i], order[random() % (i + 1)]);
        }
        for (std::size_t i = 0; i < 256; i++) {
            order[256 + i] = order[i];
        }
    }

    float at_corner(int x, int y, int z) const
    {
        return values[order[static_cast<std::size_t>(order[static_cast<std::size_t>(order[x & 255] + (y & 255))] + (z & 255))]];
    }

    /// From 0 to 1.
    float operator()(float x, float y, float z) const
    {
        const float cells[3] = {std::floor(x), std::floor(y), std::floor(z)};
        const auto smooth = [](float t) { return t * t * (3.0f - 2.0f * t); };
        const auto mix = [](float a, float b, float t) { return a + (b - a) * t; };
        const int i = static_cast<int>(cells[0]), j = static_cast<int>(cells[1]), k = static_cast<int>(cells[2]);
        const float u = smooth(x - cells[0]), v = smooth(y - cells[1]), w = smooth(z - cells[2]);
        const auto row = [&](int dy, int dz) {
            return mix(at_corner(i, j + dy, k + dz), at_corner(i + 1, j + dy, k + dz), u);
        };
        return mix(mix(row(0, 0), row(1, 0), v), mix(row(0, 1), row(1, 1), v), w);
    }
};

std::int32_t create(const HeliostatConstant *constants, std::uint32_t, void **instance, char *message, std::uint32_t size)
{
    if (constants[SEED].textured != 0) {
        std::snprintf(message, size, "`seed` cannot be a texture");
        return 1;
    }
    // Exceptions must not leave a plug-in: ask for memory without them.
    *instance = new (std::nothrow) Noise(static_cast<std::uint32_t>(constants[SEED].value[0]));
    return *instance != nullptr ? 0 : 2;
}

void destroy(void *instance)
{
    delete static_cast<Noise *>(instance);
}

void shade(const void *instance, const HeliostatPoints *points, const HeliostatInputs *inputs, const HeliostatCallbacks *,
           const HeliostatClosures *closures, std::uint32_t count)
{
    const Noise &noise = *static_cast<const Noise *>(instance);
    const HeliostatVectors &p = *points->object_position;
    const HeliostatVectors &ground = *inputs->values[GROUND], &vein = *inputs->values[VEIN];
    HeliostatVectors &color = *closures->base_color;
    for (std::uint32_t i = 0; i < count; i++) {
        const float spacing = inputs->values[SPACING]->x.lane[i];
        // Points that are no numbers, of broken meshes, must not become indices.
        const auto cell = [&](float at) { return std::fmin(std::fmax(at / spacing, -1e6f), 1e6f); };
        const float x = cell(p.x.lane[i]), y = cell(p.y.lane[i]), z = cell(p.z.lane[i]);
        // Octaves that the footprint covers are left at their mean.
        const float width = points->width->lane[i] / spacing;
        float shake = 0.0f, size = 1.0f;
        for (int octave = 0; octave < 5; octave++, size *= 0.5f) {
            const float kept = std::fmin(std::fmax(2.0f - 2.0f * width / size, 0.0f), 1.0f);
            shake += kept * size * (noise(x / size, y / size, z / size) - 0.5f);
        }
        const float ramp = x + inputs->values[SHAKE]->x.lane[i] * shake;
        const float turn = std::fabs(2.0f * (ramp - std::floor(ramp)) - 1.0f);
        const float share = turn * turn * turn * turn;
        color.x.lane[i] = ground.x.lane[i] + (vein.x.lane[i] - ground.x.lane[i]) * share;
        color.y.lane[i] = ground.y.lane[i] + (vein.y.lane[i] - ground.y.lane[i]) * share;
        color.z.lane[i] = ground.z.lane[i] + (vein.z.lane[i] - ground.z.lane[i]) * share;
        closures->roughness->lane[i] = 0.15f + 0.2f * share;
    }
}

const HeliostatShader shader = {
    "marble", "polished stone with veins", 0, PARAMETERS, parameters, create, destroy, shade,
};

const HeliostatPlugin plugin = {
    HELIOSTAT_ABI_VERSION, sizeof(HeliostatShader), sizeof(HeliostatParameter), 1, &shader,
};

}  // namespace

const HeliostatPlugin *heliostat_plugin(std::uint32_t abi_version)
{
    return abi_version == HELIOSTAT_ABI_VERSION ? &plugin : nullptr;
}
