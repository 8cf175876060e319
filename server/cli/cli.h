#pragma once

namespace gridcast::server {

/// The whole program. Exit codes: 0 done, 1 the work failed, 2 wrong usage, 130 interrupted.
[[nodiscard]] int run_command_line(int argc, char** argv);

}  // namespace gridcast::server
