#pragma once

#include <optional>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "server/cli/common.h"
#include "server/http/http_server.h"
#include "server/store/scene_archive.h"

namespace gridcast::server {

struct ServeOptions {
  HttpServerOptions http;
  proto::Limits limits;
  std::size_t threads = 0;
  std::optional<std::size_t> connections_per_address;  ///< without it, what the host asks for
  std::vector<std::string> load;                       ///< NAME=FILE
  std::string log_level = "info";
  std::string log_format = "text";
  bool allow_public = false;
  bool without_access_control = false;
  std::string tokens_file;  ///< empty: no access control
  std::string data_folder;  ///< empty: scenes live in memory alone
  bool ephemeral = false;
  bool import_in_process = false;
  store::ArchiveOptions archive;
};

/// All of `gridcast serve`.
void add_serve_options(CLI::App& app, ServeOptions& options);

/// Why these options do not go together, as one line for people; empty when they do.
[[nodiscard]] std::string complain_about(const ServeOptions& options);

/// Whether only this machine can reach `host`: localhost, or an address in 127.0.0.0/8 or ::1.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace gridcast::server
