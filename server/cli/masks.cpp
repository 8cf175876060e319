#include "server/cli/masks.h"

#include <charconv>
#include <utility>

namespace gridcast::server {
namespace {

/// "3=0": instance 3, mask 0.
std::optional<scene::ChangeInstance> parse_instance_mask(const std::string& text) {
  scene::ChangeInstance change;
  unsigned mask = 0;
  const char* end = text.data() + text.size();
  const auto id = std::from_chars(text.data(), end, change.instance_id);
  if (id.ec != std::errc() || id.ptr == end || *id.ptr != '=') return std::nullopt;
  const auto value = std::from_chars(id.ptr + 1, end, mask);
  if (value.ec != std::errc() || value.ptr != end || mask > kFullMask) return std::nullopt;
  change.mask = InstanceMask(mask);
  return change;
}

}  // namespace

void MaskOptions::add_to(CLI::App& app) {
  app.add_option("--mask", mask_, "Only instances whose mask has a bit in common with this one are there")
      ->capture_default_str()
      ->check(CLI::Range(1U, unsigned(kFullMask)));
  app.add_option("--instance-mask", texts_,
                 "Masks of instances, 255 without: ID=MASK,... from 0, which hides it, to 255")
      ->delimiter(',');
}

std::optional<std::string> MaskOptions::read() {
  for (const std::string& text : texts_) {
    auto change = parse_instance_mask(text);
    if (!change) return "--instance-mask is ID=MASK, a mask from 0 to 255";
    edits_.emplace_back(*std::move(change));
  }
  return std::nullopt;
}

Result<std::shared_ptr<const scene::Scene>> MaskOptions::masked(
    std::shared_ptr<const scene::Scene> scene) const {
  if (edits_.empty()) return scene;
  auto updated = apply_update(*scene, edits_);
  if (!updated) return Error{updated.error().code, updated.error().message, "--instance-mask"};
  return std::move(updated->scene);
}

}  // namespace gridcast::server
