#pragma once
// What the subcommands share: options, how results and errors are printed.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include <CLI/CLI.hpp>

#include "core/blas/blas.h"
#include "core/error.h"
#include "core/scene/update.h"
#include "server/cli/progress_bar.h"
#include "server/load.h"

namespace gridcast::server {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

enum class OutputStyle { kTable, kJson };

/// Options of every subcommand that works on a file.
struct FileOptions {
  std::string path;
  std::string structure = "auto";
  std::string split = "sah";
  std::string quality = "default";
  std::optional<std::uint32_t> scene_index;
  std::size_t threads = 0;
  bool quiet = false;
  bool json = false;

  [[nodiscard]] Verbosity verbosity() const { return quiet ? Verbosity::kQuiet : Verbosity::kNormal; }
  [[nodiscard]] OutputStyle style() const { return json ? OutputStyle::kJson : OutputStyle::kTable; }
};
void add_file_options(CLI::App& command, FileOptions& options);

/// Imports and builds with a bar. Prints the error and returns nothing when it failed.
[[nodiscard]] std::optional<LoadedScene> load_for_command(const FileOptions& options,
                                                          const std::stop_token& stop);

/// `gridcast: FILE: what (where)` on stderr; the exit code that fits.
int report(const std::string& file, const Error& error);

/// The animation that `text` means: one of that name, else the one of that number.
[[nodiscard]] scene::ElementRef parse_animation(const scene::Scene& scene, const std::string& text);

[[nodiscard]] Result<Precision> parse_precision(const std::string& name);

/// A subcommand: its options are read into it, then it runs.
class Command {
 public:
  virtual ~Command() = default;
  [[nodiscard]] virtual int run(const std::stop_token& stop) = 0;
  [[nodiscard]] const CLI::App& app() const { return *app_; }

 protected:
  explicit Command(CLI::App& app) : app_(&app) {}

 private:
  CLI::App* app_;
};

[[nodiscard]] std::unique_ptr<Command> make_serve_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_cast_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_explain_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_render_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_play_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_export_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_info_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_bench_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_chart_command(CLI::App& program);
[[nodiscard]] std::unique_ptr<Command> make_token_command(CLI::App& program);

}  // namespace gridcast::server
