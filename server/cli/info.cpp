#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "core/math/instruction_set.h"
#include "proto/replies.h"
#include "server/cli/common.h"
#include "server/describe.h"
#include "server/number_text.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFooter = R"(
Example:
  gridcast info engine.glb
  gridcast info engine.glb --json | jq '.meshes[0].topology.closed')";

class InfoCommand final : public Command {
 public:
  explicit InfoCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, options_);
  }

  int run(const std::stop_token& stop) override {
    const ThreadLimit limit(options_.threads);
    const auto loaded = load_for_command(options_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    const SceneOrigin origin{options_.structure, loaded->import_ms, loaded->build_ms};
    const proto::SceneInfo scene = scene_info(options_.path, origin, *loaded->scene);
    std::vector<proto::MeshInfo> meshes;
    for (std::size_t i = 0; i < loaded->scene->mesh_count(); ++i)
      meshes.push_back(mesh_info(*loaded->scene, std::uint32_t(i), TopologyDetail::kCounted));
    if (options_.style() == OutputStyle::kJson)
      print_json(*loaded->scene, scene, meshes);
    else
      print_table(*loaded->scene, scene, meshes);
    return kExitDone;
  }

 private:
  static void print_json(const scene::Scene& scene, const proto::SceneInfo& info,
                         const std::vector<proto::MeshInfo>& meshes);
  static void print_table(const scene::Scene& scene, const proto::SceneInfo& info,
                          const std::vector<proto::MeshInfo>& meshes);

  FileOptions options_;
};

Json names_of(const auto& items) {
  Json names = Json::array();
  for (const auto& item : items) names.push_back(item.name);
  return names;
}

void InfoCommand::print_json(const scene::Scene& scene, const proto::SceneInfo& info,
                             const std::vector<proto::MeshInfo>& meshes) {
  Json json = Json::parse(to_json(info));
  json["instruction_set"] = instruction_set();
  json["cameras"] = names_of(scene.data().cameras);
  json["lights"] = names_of(scene.data().lights);
  json["animations"] = names_of(scene.data().animations);
  json["skins"] = scene.data().skins.size();
  json["top_level"] = Json::parse(to_json(structure_info(scene)))["top_level"];
  json["meshes"] = Json::array();
  for (const proto::MeshInfo& mesh : meshes)
    json["meshes"].push_back(Json::parse(to_json(mesh, info.version)));
  std::printf("%s\n", json.dump(2, ' ', false, Json::error_handler_t::replace).c_str());
}

/// A file's name as one plain line, cut to `width`.
std::string shown(const std::string& name, std::size_t width) {
  std::string text = name.substr(0, width);
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return text;
}

void print_bounds(const Bounds3d& b) {
  if (b.empty()) {
    std::printf("bounds            empty\n");
    return;
  }
  std::printf("bounds            (%.6g, %.6g, %.6g) to (%.6g, %.6g, %.6g)\n", b.lower.x, b.lower.y, b.lower.z,
              b.upper.x, b.upper.y, b.upper.z);
}

void print_meshes(const std::vector<proto::MeshInfo>& meshes) {
  std::printf("\n%6s  %-24s %11s %11s %10s %-7s %-11s %10s %9s\n", "mesh", "name", "vertices", "triangles",
              "instances", "closed", "structure", "memory", "build ms");
  for (const proto::MeshInfo& m : meshes)
    std::printf("%6u  %-24s %11s %11s %10s %-7s %-11s %10s %9.2f\n", m.mesh_id, shown(m.name, 24).c_str(),
                grouped(m.vertex_count).c_str(), grouped(m.triangle_count).c_str(),
                grouped(m.instance_count).c_str(), m.topology && m.topology->closed ? "yes" : "no",
                m.structure.kind.c_str(), bytes_text(m.structure.memory_bytes).c_str(), m.structure.build_ms);
}

void InfoCommand::print_table(const scene::Scene& scene, const proto::SceneInfo& info,
                              const std::vector<proto::MeshInfo>& meshes) {
  const proto::StructureInfo::TopLevel top = structure_info(scene).top_level;
  std::printf("%s\n", shown(info.id, 200).c_str());
  std::printf("meshes            %s\n", grouped(info.mesh_count).c_str());
  std::printf("instances         %s\n", grouped(info.instance_count).c_str());
  std::printf("triangles         %s stored, %s in the world\n", grouped(info.stored_triangle_count).c_str(),
              grouped(info.world_triangle_count).c_str());
  print_bounds(info.bounds);
  std::printf("memory            %s\n", bytes_text(info.memory_bytes).c_str());
  std::printf("import, build     %.1f ms, %.1f ms\n", info.import_ms, info.build_ms);
  std::printf("instructions      %s\n", std::string(instruction_set()).c_str());
  std::printf("top level         %s, %u x %u x %u cells, %s of %s occupied, %s references, %s\n",
              top.kind.c_str(), top.cells[0], top.cells[1], top.cells[2], grouped(top.occupied_cells).c_str(),
              grouped(top.cell_count).c_str(), grouped(top.reference_count).c_str(),
              bytes_text(top.memory_bytes).c_str());
  std::printf("                  %s\n", top.reason.c_str());
  std::printf("cameras, lights   %zu, %zu\n", info.camera_count, info.light_count);
  std::printf("materials         %zu\n", info.material_count);
  std::printf("animations, skins %zu, %zu\n", scene.data().animations.size(), scene.data().skins.size());
  print_meshes(meshes);
  if (!info.warnings.empty()) std::printf("\nwarnings\n");
  for (const std::string& warning : info.warnings) std::printf("  %s\n", shown(warning, 400).c_str());
}

}  // namespace

std::unique_ptr<Command> make_info_command(CLI::App& program) {
  return std::make_unique<InfoCommand>(
      *program.add_subcommand("info", "Say what a scene holds and how its structures turned out"));
}

}  // namespace gridcast::server
