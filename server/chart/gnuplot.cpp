#include "server/chart/gnuplot.h"

#include <algorithm>

#include "server/child_process.h"

namespace gridcast::server {
namespace {

/// Longest message of gnuplot that is passed on.
constexpr std::size_t kMaxMessage = 400;

Result<std::vector<std::byte>> run(const std::string& argument, const std::string& input,
                                   const std::stop_token& stop) {
  const MemoryFile in("script"), out("drawing"), messages("messages");
  if (!in.is_open() || !out.is_open() || !messages.is_open() || !in.write_all({input}))
    return Error{ErrorCode::kIo, "gnuplot could not be run: there is no memory for its data", ""};
  // Numbers are written with points.
  const auto end =
      run_child({{"gnuplot", argument}, environment_with("LC_ALL=C.UTF-8"), in, out, messages}, stop);
  if (!end && end.error().code == ErrorCode::kNotFound)
    return Error{ErrorCode::kUnsupported,
                 "drawing SVG and PNG needs the program gnuplot, which is not on PATH: install the Debian "
                 "package gnuplot-nox; .json, .csv and .vl.json need nothing",
                 ""};
  if (!end) return Error{ErrorCode::kIo, "gnuplot could not be run: " + end.error().message, ""};
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the drawing was stopped", ""};
  if (end->went_well()) return out.read_all();
  const auto said = messages.read_all();
  const std::string text(reinterpret_cast<const char*>(said.data()), std::min(said.size(), kMaxMessage));
  return Error{ErrorCode::kInternal, "gnuplot failed: " + text, ""};
}

}  // namespace

Result<std::vector<std::byte>> run_gnuplot(const std::string& script, const std::stop_token& stop) {
  // -d: neither the system's nor the user's settings.
  auto drawn = run("-d", script, stop);
  if (drawn && drawn->empty()) return Error{ErrorCode::kInternal, "gnuplot drew nothing", ""};
  return drawn;
}

Status find_gnuplot() {
  const auto version = run("--version", "", {});
  if (!version) return version.error();
  return ok_status();
}

}  // namespace gridcast::server
