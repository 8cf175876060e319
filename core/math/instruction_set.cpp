#include "core/math/instruction_set.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>

#include <hwy/highway.h>

namespace gridcast {
namespace {

/// The last resort of Highway, which is one lane at a time or four that the compiler makes something of.
constexpr std::int64_t kFallbacks = HWY_SCALAR | HWY_EMU128;

std::string_view name_of(std::int64_t target) {
  if ((target & kFallbacks) != 0) return "scalar";
  switch (target) {
#if HWY_ARCH_X86
    case HWY_SSSE3:
      return "ssse3";
    case HWY_SSE4:
      return "sse4";
    case HWY_AVX2:
      return "avx2";
    case HWY_AVX3:
      return "avx512";
    case HWY_AVX3_DL:
      return "avx512_dl";
#endif
    default:
      return hwy::TargetName(target);
  }
}

/// Highway's bits of what is compiled and this CPU has; the lower the bit, the wider the set.
std::int64_t native_targets() {
  // Asked once, before any limit can be set.
  static const std::int64_t targets = hwy::SupportedTargets() & HWY_TARGETS;
  return targets;
}

std::int64_t lowest_bit(std::int64_t targets) {
  return targets & -targets;
}

std::string listed(const std::vector<std::string_view>& names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

void use(std::int64_t targets) {
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace

std::vector<std::string_view> instruction_sets() {
  std::vector<std::string_view> names;
  for (std::int64_t targets = native_targets(); targets != 0; targets &= targets - 1)
    names.push_back(name_of(lowest_bit(targets)));
  return names;
}

std::string_view instruction_set() {
  (void)native_targets();
  return name_of(lowest_bit(hwy::SupportedTargets() & HWY_TARGETS));
}

Status limit_instruction_set(std::string_view name) {
  const std::int64_t native = native_targets();
  if (name.empty() || name == kNativeInstructionSet || name == "auto") {
    use(native);
    return ok_status();
  }
  for (std::int64_t targets = native; targets != 0; targets &= targets - 1) {
    if (name_of(lowest_bit(targets)) != name) continue;
    use(targets);
    return ok_status();
  }
  return Error{ErrorCode::kUnsupported,
               "instruction set '" + std::string(name) + "' is unknown or not of this CPU, which has " +
                   listed(instruction_sets()) + " (or native, the first of these)",
               ""};
}

Status limit_instruction_set_by_environment() {
  const char* name = std::getenv("GRIDCAST_ISA");
  Status status = limit_instruction_set(name == nullptr ? "" : name);
  if (status) return status;
  Error error = status.error();
  error.where = "GRIDCAST_ISA";
  return error;
}

}  // namespace gridcast
