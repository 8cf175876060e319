#pragma once
// Which vector instructions the kernels use. They are compiled once for each set, and Highway chooses the
// widest that the CPU has; answers are the same bits with any, so a limit is for tests and comparisons.

#include <string_view>
#include <vector>

#include "core/error.h"

namespace gridcast {

/// No limit: the widest set of this CPU.
inline constexpr std::string_view kNativeInstructionSet = "native";

/// The sets that kernels are compiled for and this CPU has, widest first, whatever the limit: avx512, avx2,
/// sse4, ssse3 on x86-64, and in the end scalar, the set without vectors. Names of other machines are
/// Highway's.
[[nodiscard]] std::vector<std::string_view> instruction_sets();

/// The one in use: the first of instruction_sets(), or the limit.
[[nodiscard]] std::string_view instruction_set();

/// From now on kernels use `name`, one of instruction_sets(), and nothing wider; "native", "auto" and "" lift
/// the limit. For the whole process, Embree's trees that are built later included
/// (core/blas/embree_tree.cpp). Rays under way on other threads may use either set. An unknown name is an
/// error that lists what there is.
[[nodiscard]] Status limit_instruction_set(std::string_view name);

/// As the environment variable GRIDCAST_ISA asks; ok where it is not set.
[[nodiscard]] Status limit_instruction_set_by_environment();

}  // namespace gridcast
