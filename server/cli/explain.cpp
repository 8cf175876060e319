#include <cstdio>
#include <string>

#include "core/math/precision_names.h"
#include "proto/explain_reply.h"
#include "proto/explain_request.h"
#include "server/cli/common.h"
#include "server/cli/explain_text.h"
#include "server/cli/vector_option.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Tells what becomes of one ray, step by step: the cells of the grid that it passes, the instances that it looks at
and why others are passed over, the nodes and leaves of their trees, every triangle, and the hit. A structure
can be chosen, to see how each goes about it; Embree does not show its way.

Examples:
  gridcast explain engine.glb --origin 0,0,900 --direction 0,0,-1
  gridcast explain engine.glb --origin 0,0,900 --direction 0,0,-1 --structure kd_tree
  gridcast explain engine.glb --origin 0,0,900 --direction 0,0,-1 --json | jq .counts)";

class ExplainCommand final : public Command {
 public:
  explicit ExplainCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    app.add_option("--origin", origin_, "Where the ray starts: X,Y,Z")->required();
    app.add_option("--direction", direction_, "Where it goes, of any length but zero: X,Y,Z")->required();
    app.add_option("--tnear", ray_.tnear, "Where its range begins, in lengths of the direction")
        ->capture_default_str();
    app.add_option("--tfar", ray_.tfar, "Where its range ends; without it, never");
    app.add_option("--precision", precision_, "fast, robust or exact")
        ->capture_default_str()
        ->check(CLI::IsMember(std::vector<std::string>(kPrecisionNames.begin(), kPrecisionNames.end())));
    app.add_option("--max-steps", max_steps_, "Tell at most so many steps")
        ->capture_default_str()
        ->check(CLI::Range(std::size_t(1), kMostSteps));
  }

  int run(const std::stop_token& stop) override {
    const auto origin = parse_vector(origin_), direction = parse_vector(direction_);
    if (!origin) return usage("--origin is three numbers X,Y,Z");
    if (!direction) return usage("--direction is three numbers X,Y,Z");
    ray_.origin = *origin;
    ray_.direction = *direction;
    if (!is_valid(ray_)) return usage("the direction is zero, or a number is out of range");
    const ThreadLimit limit(file_.threads);
    const auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    const auto told =
        explain(*loaded->scene, ray_, {parse_precision(precision_).value(), {}, max_steps_, stop});
    if (!told) return report(file_.path, told.error());
    print(loaded->scene->version(), *told);
    return kExitDone;
  }

 private:
  static constexpr std::size_t kMostSteps = 100'000'000;

  static int usage(const char* text) {
    std::fprintf(stderr, "gridcast: %s (see gridcast explain --help)\n", text);
    return kExitUsage;
  }

  void print(std::uint64_t version, const scene::Explanation& told) const {
    const std::string text =
        file_.style() == OutputStyle::kJson
            ? proto::write_explain_json({version, told.hit, told.counts, told.steps, told.is_truncated}) +
                  "\n"
            : explain_text(told);
    std::fwrite(text.data(), 1, text.size(), stdout);
  }

  FileOptions file_;
  std::string origin_, direction_;
  Ray ray_;
  std::string precision_ = "robust";
  std::size_t max_steps_ = proto::kDefaultExplainSteps;
};

}  // namespace

std::unique_ptr<Command> make_explain_command(CLI::App& program) {
  return std::make_unique<ExplainCommand>(
      *program.add_subcommand("explain", "Tell one ray's way through a scene step by step"));
}

}  // namespace gridcast::server
