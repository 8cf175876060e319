#pragma once

#include <cstddef>
#include <stop_token>
#include <string>
#include <vector>

#include "core/error.h"

namespace gridcast::server {

/// Runs the program gnuplot (Debian: gnuplot-nox), found on PATH, without a shell and without the user's
/// settings; the script goes to its standard input, and what it draws comes back. kUnsupported when there is
/// no such program, kCancelled when stopped meanwhile, kInternal with its own words when it fails.
[[nodiscard]] Result<std::vector<std::byte>> run_gnuplot(const std::string& script,
                                                         const std::stop_token& stop);

/// Whether it is there: kUnsupported, naming the package, when not.
[[nodiscard]] Status find_gnuplot();

}  // namespace gridcast::server
