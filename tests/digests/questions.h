#pragma once
// What is asked about an input, each through its own door of core/scene or core/render.

#include <span>
#include <string_view>

#include "core/scene/scene.h"
#include "tests/digests/digest.h"
#include "tests/digests/inputs.h"

namespace gridcast::digests {

struct Question {
  std::string_view name;
  std::span<const Precision> precisions;
  /// Adds every bit of the answers. `scene` was built from `input`.
  void (*ask)(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest);
};

[[nodiscard]] std::span<const Question> all_questions();

}  // namespace gridcast::digests
