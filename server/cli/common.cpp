#include "server/cli/common.h"

#include <algorithm>
#include <charconv>
#include <cstdio>

#include "core/math/precision_names.h"
#include "proto/vocabulary.h"
#include "server/signals.h"

namespace gridcast::server {

void add_file_options(CLI::App& command, FileOptions& options) {
  command.add_option("SCENE", options.path, "A .glb or .gltf file")->required();
  command
      .add_option("--structure", options.structure,
                  "Tree of each mesh: auto, brute_force, bvh, wide_bvh, compact_bvh, kd_tree or embree")
      ->capture_default_str()
      ->check(CLI::IsMember(
          std::vector<std::string>(proto::kStructureNames.begin(), proto::kStructureNames.end())));
  command.add_option("--split", options.split, "How a BVH splits: midpoint, median or sah")
      ->capture_default_str()
      ->check(CLI::IsMember({"midpoint", "median", "sah"}));
  command
      .add_option("--quality", options.quality,
                  "How a BVH is built: default, for the best rays, or fast, in a quarter of the time")
      ->capture_default_str()
      ->check(CLI::IsMember(
          std::vector<std::string>(proto::kBuildQualityNames.begin(), proto::kBuildQualityNames.end())));
  command.add_option("--scene-index", options.scene_index,
                     "Which scene of the file; without it the file's default scene");
  command.add_option("--threads", options.threads, "Threads to use; 0 = every core")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096));
  command.add_flag("-q,--quiet", options.quiet, "No progress bar, no remarks");
  command.add_flag("--json", options.json, "Print the result as one JSON object on stdout");
}

std::optional<LoadedScene> load_for_command(const FileOptions& options, const std::stop_token& stop) {
  ProgressBar bar("building", options.verbosity());
  LoadOptions load;
  load.blas.kind = blas::parse_structure_kind(options.structure).value();
  load.blas.split = blas::parse_bvh_split(options.split).value();
  load.blas.quality = blas::parse_build_quality(options.quality).value();
  load.gltf.scene_index = options.scene_index;
  load.stop = stop;
  load.progress = bar.callback();
  auto loaded = load_scene_file(options.path, load);
  if (loaded) return std::move(loaded).value();
  report(options.path, loaded.error());
  return std::nullopt;
}

int report(const std::string& file, const Error& error) {
  std::string text = "gridcast: " + file + ": " + error.message;
  if (!error.where.empty()) text += " (" + error.where + ")";
  // One line, whatever a file's names hold.
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  std::fprintf(stderr, "%s\n", text.c_str());
  return error.code == ErrorCode::kCancelled ? kExitInterrupted : kExitFailed;
}

scene::ElementRef parse_animation(const scene::Scene& scene, const std::string& text) {
  const auto& animations = scene.data().animations;
  const auto named = std::ranges::find(animations, text, &scene::Animation::name);
  std::uint32_t number = 0;
  const char* end = text.data() + text.size();
  const bool is_number = !text.empty() && std::from_chars(text.data(), end, number).ptr == end;
  if (named == animations.end() && is_number) return number;
  return text;
}

Result<Precision> parse_precision(const std::string& name) {
  for (const std::string_view known : kPrecisionNames)
    if (known == name) return to_precision(name);
  return Error{ErrorCode::kInvalidArgument, "precision is fast, robust or exact", "--precision"};
}

}  // namespace gridcast::server
