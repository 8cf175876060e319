#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "proto/render_request.h"
#include "server/cli/masks.h"

namespace gridcast::server {

/// What `render` and `play` ask about a picture.
class PictureOptions {
 public:
  void add_to(CLI::App& app);
  /// After parsing, for a picture named `output`: what CLI11 cannot check. A sentence when something is
  /// wrong.
  [[nodiscard]] std::optional<std::string> read(const std::string& output);

  [[nodiscard]] const proto::RenderRequest& request() const { return request_; }
  [[nodiscard]] const MaskOptions& masks() const { return masks_; }

 private:
  [[nodiscard]] std::optional<std::string> read_view();

  proto::RenderRequest request_;
  MaskOptions masks_;
  std::string camera_ = "auto";
  std::string eye_;
  std::string target_ = "0,0,0";
  std::string up_ = "0,1,0";
  double yfov_deg_ = 45.0;
  std::string precision_ = "robust";
};

}  // namespace gridcast::server
