#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/scene/update.h"

namespace gridcast::server {

/// Which instances of a file's scene a subcommand sees: --mask and --instance-mask.
class MaskOptions {
 public:
  void add_to(CLI::App& app);
  /// After parsing: what CLI11 cannot check. A sentence when something is wrong.
  [[nodiscard]] std::optional<std::string> read();

  /// Of the queries.
  [[nodiscard]] InstanceMask mask() const { return InstanceMask(mask_); }
  /// The scene with the masks that were given to instances. kNotFound for one that is not there.
  [[nodiscard]] Result<std::shared_ptr<const scene::Scene>> masked(
      std::shared_ptr<const scene::Scene> scene) const;

 private:
  unsigned mask_ = kFullMask;
  std::vector<std::string> texts_;
  std::vector<scene::SceneEdit> edits_;
};

}  // namespace gridcast::server
