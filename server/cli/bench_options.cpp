#include "server/cli/bench_options.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "core/math/precision_names.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Every contender runs once in every repetition, one after the other, so that a machine that slows down slows all of
them. The table shows medians in millions of rays a second (Mrays/s), the spread (distance of the quartiles by the
median) and the ratios to Embree's single rays, default and ROBUST: 1.25 means a quarter faster. While being timed,
every answer is compared bit for bit with the single rays of the first structure, and a sample with brute force; a
difference ends in exit code 1. Builds and refits are in milliseconds (ms) and millions of triangles a second,
updates of instances in nanoseconds (ns) an instance moved, memory in bytes a triangle or an instance.
deform moves the vertices of S1 and S2, or of the scenes that are named, and compares the time of a query
with that of a fresh tree: 1.5 means half slower. crowd poses skinned figures 30 times a second while two clients
cast rays over HTTP, and compares with the same scene standing still. load puts a server (S1, or the scenes that are
named) under more requests than it can answer, clients that send slowly and clients that go away.

Scenes: S1 to S6 are single meshes, I1 to I3 instances, W1 to W5 worst cases, H1
is made for accuracy; S, I, W and all name groups.
The whole benchmark takes long and about 4 GiB; --quick gives a first idea in about a minute, on smaller scenes whose
figures are not comparable with those of whole ones.

Examples:
  gridcast bench --quick
  gridcast bench --scene S2 --set diffuse_shuffled,ao --structure wide_bvh --repeat 9
  gridcast bench --scene all --threads 1,2 --json bench.json
  gridcast bench --file engine.glb --rays 200000)";

constexpr std::size_t kRays = 1'000'000, kQuickRays = 30'000;
constexpr std::size_t kRepeat = 5, kQuickRepeat = 3;
constexpr std::size_t kFrames = 24, kQuickFrames = 6;
constexpr double kPhaseSeconds = 2.0, kQuickPhaseSeconds = 0.3;
constexpr double kQuickSize = 0.02;

/// What `deform` takes by itself.
constexpr std::array<std::string_view, 2> kDeformScenes{"S1", "S2"};
/// What `load` takes.
constexpr std::string_view kLoadScene = "S1";

std::vector<std::string> set_names() {
  std::vector<std::string> names;
  names.reserve(measure::kAllRaySets.size());
  for (const measure::RaySetKind kind : measure::kAllRaySets) names.emplace_back(measure::to_string(kind));
  return names;
}

std::vector<std::string> scene_words() {
  std::vector<std::string> words{"all", "S", "I", "W"};
  for (const measure::SceneEntry& entry : measure::scene_catalogue()) words.emplace_back(entry.name);
  return words;
}

void add_what(CLI::App& app, BenchRequest& request) {
  app.add_option("--scene", request.scenes,
                 "Scenes, with commas: S1 to S6, I1 to I3, W1 to W5, H1, S, I, W or all; without it S,I")
      ->delimiter(',')
      ->check(CLI::IsMember(scene_words()));
  app.add_option("--file", request.file, "Measure this .glb or .gltf file instead of generated scenes")
      ->excludes("--scene");
  app.add_option("--set", request.sets,
                 "Ray sets, with commas: primary, primary_shuffled, diffuse, diffuse_shuffled, ao, shadow; "
                 "without it all")
      ->delimiter(',')
      ->check(CLI::IsMember(set_names()));
  app.add_option("--structure", request.structures,
                 "Trees of ours, with commas: auto, brute_force (up to 2,000 triangles), bvh, wide_bvh, "
                 "compact_bvh, kd_tree, embree; without it wide_bvh, bvh, kd_tree")
      ->delimiter(',')
      ->check(CLI::IsMember({"auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"}));
  app.add_option("--section", request.sections,
                 "What to measure, with commas: rays, build, refit, instances, deform, serve, crowd, load; "
                 "without it "
                 "all")
      ->delimiter(',')
      ->check(CLI::IsMember({"rays", "build", "refit", "instances", "deform", "serve", "crowd", "load"}));
  app.add_option("--precision", request.precisions, "fast, robust, exact; without it the first two")
      ->delimiter(',')
      ->check(CLI::IsMember({"fast", "robust", "exact"}));
}

void add_how(CLI::App& app, BenchRequest& request) {
  app.add_flag("--quick", request.quick,
               "About a minute: 30,000 rays a set, 3 repetitions, scenes of 2 % size");
  app.add_option("--threads", request.threads, "Numbers of threads, with commas; each is measured")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_option(
         "--clients", request.clients,
         "Cores of those who ask in serve and load, with commas: shared (the server's), apart (one of "
         "their own; the server has as many others as threads)")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::IsMember({"shared", "apart"}));
  app.add_option("--rays", request.rays, "Rays a set; without it 1,000,000")
      ->check(CLI::Range(1, 100'000'000));
  app.add_option("--repeat", request.repeat, "Repetitions that the median is taken of; without it 5")
      ->check(CLI::Range(1, 1000));
  app.add_option("--frames", request.frames, "Frames of every deformation; without it 24")
      ->check(CLI::Range(1, 10'000));
  app.add_option("--phase", request.phase_s,
                 "Seconds (s) that the crowd moves, or stands, or a load lasts, at a time; without it 2")
      ->check(CLI::Range(0.001, 3600.0));
  app.add_option("--size", request.size,
                 "Share of each generated scene's triangles or instances; without it 1")
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--seed", request.seed, "Of scenes and rays")->capture_default_str();
  app.add_option("--json", request.json_path, "Write every figure to this file as one JSON object");
  app.add_flag("-q,--quiet", request.quiet, "No progress bar, no table");
}

}  // namespace

void add_bench_options(CLI::App& app, BenchRequest& request) {
  app.footer(kFooter);
  add_what(app, request);
  add_how(app, request);
}

std::vector<std::string> BenchRequest::scene_names() const {
  std::vector<std::string> words = scenes;
  if (words.empty() && !wants_more_than({"crowd", "load"})) words = {std::string(kLoadScene)};
  if (words.empty() && !wants_more_than({"deform", "crowd", "load"}))
    words.assign(kDeformScenes.begin(), kDeformScenes.end());
  if (words.empty()) words = {"S", "I"};
  std::vector<std::string> names;
  for (const measure::SceneEntry& entry : measure::scene_catalogue()) {
    const std::string name(entry.name);
    const bool wanted = std::any_of(words.begin(), words.end(), [&](const std::string& word) {
      return word == "all" || word == name || word == name.substr(0, 1);
    });
    if (wanted) names.push_back(name);
  }
  return names;
}

bool BenchRequest::names(const std::string& section) const {
  return std::find(sections.begin(), sections.end(), section) != sections.end();
}

bool BenchRequest::wants(const std::string& section) const {
  return sections.empty() || names(section);
}

bool BenchRequest::wants_more_than(const std::vector<std::string>& known) const {
  return sections.empty() || std::any_of(sections.begin(), sections.end(), [&](const std::string& section) {
           return std::find(known.begin(), known.end(), section) == known.end();
         });
}

bool BenchRequest::deforms(const std::string& scene) const {
  const bool chosen = !scenes.empty() || !file.empty();
  return chosen || std::find(kDeformScenes.begin(), kDeformScenes.end(), scene) != kDeformScenes.end();
}

bool BenchRequest::loads(const std::string& scene) const {
  return !file.empty() || !scenes.empty() || scene == kLoadScene;
}

double BenchRequest::scene_size() const {
  if (size > 0.0) return size;
  return quick ? kQuickSize : 1.0;
}

measure::BenchOptions BenchRequest::options(std::stop_token stop) const {
  measure::BenchOptions made;
  made.rays = rays > 0 ? rays : quick ? kQuickRays : kRays;
  made.repeat = repeat > 0 ? repeat : quick ? kQuickRepeat : kRepeat;
  made.frames = frames > 0 ? frames : quick ? kQuickFrames : kFrames;
  made.phase_s = phase_s > 0.0 ? phase_s : quick ? kQuickPhaseSeconds : kPhaseSeconds;
  made.threads = threads;
  made.clients.clear();
  for (const std::string& name : clients)
    made.clients.push_back(name == "apart" ? measure::ClientCores::kApart : measure::ClientCores::kShared);
  made.seed = seed;
  made.stop = std::move(stop);
  if (!sets.empty()) made.sets.clear();
  for (const std::string& name : sets) made.sets.push_back(measure::parse_ray_set(name).value());
  if (!structures.empty()) made.structures.clear();
  for (const std::string& name : structures)
    made.structures.push_back(blas::parse_structure_kind(name).value());
  if (!precisions.empty()) made.precisions.clear();
  for (const std::string& name : precisions) made.precisions.push_back(to_precision(name));
  return made;
}

}  // namespace gridcast::server
