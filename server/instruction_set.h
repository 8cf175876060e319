#pragma once

#include <string_view>

namespace gridcast::server {

/// The widest set of vector instructions that the program was compiled for: sse2, avx2 ...
[[nodiscard]] constexpr std::string_view instruction_set() {
#if defined(__AVX512F__)
  return "avx512";
#elif defined(__AVX2__)
  return "avx2";
#elif defined(__SSE4_2__)
  return "sse4.2";
#elif defined(__SSE2__)
  return "sse2";
#elif defined(__ARM_NEON)
  return "neon";
#else
  return "scalar";
#endif
}

}  // namespace gridcast::server
