#include "server/cli/cli.h"

#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "core/math/instruction_set.h"
#include "server/cli/common.h"
#include "server/signals.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Examples:
  gridcast info engine.glb
  gridcast cast engine.glb --camera-grid 1024x1024 -o hits.bin
  gridcast explain engine.glb --origin 0,0,900 --direction 0,0,-1
  gridcast render engine.glb -o engine.png --width 800 --height 600
  gridcast play fox.glb --animation Run -o frame_%04d.png
  gridcast serve --port 8080 --load engine=engine.glb
  gridcast bench --quick
  gridcast chart engine.glb -o chart.svg

The environment variable GRIDCAST_ISA limits the vector instructions where --isa does not.

Exit codes: 0 done, 1 the work failed, 2 wrong usage, 130 interrupted.
'gridcast COMMAND --help' says more about each.)";

/// CLI11 reports a mistyped command as a missing one.
bool is_unknown_command(const CLI::App& program, const std::string& word) {
  if (word.empty() || word[0] == '-') return false;
  return program.get_subcommands([&](const CLI::App* command) { return command->check_name(word); }).empty();
}

int run_chosen(CLI::App& program, const std::vector<std::unique_ptr<Command>>& commands,
               const std::stop_token& stop) {
  for (const auto& command : commands)
    if (program.got_subcommand(&command->app())) return command->run(stop);
  return kExitUsage;
}

/// Every command has it, so that it stands where the others do.
void add_isa_option(CLI::App& program, std::string& isa) {
  for (CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    command->add_option("--isa", isa,
                        "The widest vector instructions to use: avx512, avx2, sse4, ssse3, scalar, or native "
                        "for all that the CPU has; answers do not depend on it");
}

/// Exit code for a set of instructions that is not there.
int limit_isa(const std::string& isa) {
  const Status limited = isa.empty() ? limit_instruction_set_by_environment() : limit_instruction_set(isa);
  if (limited) return kExitDone;
  std::fprintf(stderr, "gridcast: %s: %s\n", isa.empty() ? "GRIDCAST_ISA" : "--isa",
               limited.error().message.c_str());
  return kExitUsage;
}

}  // namespace

int run_command_line(int argc, char** argv) {
  CLI::App program("Ray casting and rendering of 3D scenes, from files or as an HTTP service.", "gridcast");
  program.set_version_flag("--version", std::string("gridcast ") + GRIDCAST_VERSION);
  program.require_subcommand(1);
  program.footer(kFooter);
  std::vector<std::unique_ptr<Command>> commands;
  commands.push_back(make_serve_command(program));
  commands.push_back(make_cast_command(program));
  commands.push_back(make_explain_command(program));
  commands.push_back(make_render_command(program));
  commands.push_back(make_play_command(program));
  commands.push_back(make_export_command(program));
  commands.push_back(make_info_command(program));
  commands.push_back(make_bench_command(program));
  commands.push_back(make_chart_command(program));
  commands.push_back(make_token_command(program));
  std::string isa;
  add_isa_option(program, isa);
  if (argc > 1 && is_unknown_command(program, argv[1])) {
    std::fprintf(stderr, "gridcast: unknown command '%s' (see gridcast --help)\n", argv[1]);
    return kExitUsage;
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help and --version
    return program.exit(asked);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "gridcast: %s (see gridcast --help)\n", error.what());
    return kExitUsage;
  }
  if (const int code = limit_isa(isa); code != kExitDone) return code;
  const SignalWatch signals;
  try {
    return run_chosen(program, commands, signals.token());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gridcast: %s\n", error.what());
    return kExitFailed;
  }
}

}  // namespace gridcast::server
