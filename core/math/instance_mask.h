#pragma once

#include <cstdint>

namespace gridcast {

/// Who sees whom: a query sees the instances whose mask has a bit in common with its own. Eight bits, as in
/// DirectX Raytracing, Vulkan and OptiX (Embree has 32): so many lie in the padding of scene::Instance and
/// take no memory.
using InstanceMask = std::uint8_t;

/// An instance that every query sees; a query that sees every instance but those of mask 0.
inline constexpr InstanceMask kFullMask = 0xFF;

}  // namespace gridcast
