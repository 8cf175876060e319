#include "core/io/gltf_export.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>
#include <set>

#include "core/io/gltf_export_parts.h"
#include "core/io/gltf_refusal.h"

namespace gridcast::io {
namespace {

constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
/// Instances written between two looks at the stop token.
constexpr std::uint32_t kInstancesPerLook = 4096;

std::size_t padded(std::size_t bytes) {
  return (bytes + 3) / 4 * 4;
}

void stop_if_asked(const std::stop_token& stop) {
  if (stop.stop_requested()) refuse(ErrorCode::kCancelled, "the export was stopped");
}

std::uint64_t all_binary_bytes(const scene::Scene& scene) {
  std::uint64_t bytes = 0;
  for (std::uint32_t m = 0; m < scene.mesh_count(); ++m) bytes += binary_bytes(scene.blas(m).mesh());
  return bytes;
}

/// One scene on its way to a GLB.
class Exporter {
 public:
  Exporter(const scene::Scene& scene, const ExportOptions& options)
      : scene_(scene), options_(options), nodes_(options.limits) {}

  [[nodiscard]] std::string run() {
    const std::uint64_t binary = all_binary_bytes(scene_);
    check_file_bytes(binary);
    begin_document();
    describe_meshes();
    describe_appearance();
    place_instances();
    const std::string json = finish_json(binary);
    return assemble(json, binary);
  }

 private:
  void check_file_bytes(std::uint64_t bytes) const {
    const std::uint64_t most =
        std::min<std::uint64_t>(options_.limits.file_bytes, std::numeric_limits<std::uint32_t>::max());
    if (bytes > most)
      refuse(ErrorCode::kLimitExceeded,
             "the scene takes " + std::to_string(bytes) + " bytes as a GLB, and a file may have " +
                 std::to_string(most),
             "/meshes");
  }

  void begin_document() {
    document_["asset"] = {{"version", "2.0"},
                          {"generator", "gridcast"},
                          {"extras",
                           {{"scene_version", std::to_string(scene_.version())},
                            {"pose", "baked: skins, morph targets and animations are not in this file"}}}};
  }

  void describe_meshes() {
    std::uint64_t offset = 0;
    for (std::uint32_t m = 0; m < scene_.mesh_count(); ++m) {
      stop_if_asked(options_.stop);
      const mesh::TriangleMesh& mesh = scene_.blas(m).mesh();
      plans_.push_back(plan_mesh(mesh));
      describe_mesh(mesh, plans_.back(), offset, scene_.data().materials.size(), document_);
      offset += binary_bytes(mesh);
    }
  }

  void describe_appearance() {
    const scene::SceneData& data = scene_.data();
    for (const scene::Material& material : data.materials)
      document_["materials"].push_back(describe_material(material));
    for (const scene::Camera& camera : data.cameras) document_["cameras"].push_back(describe_camera(camera));
    for (const scene::Light& light : data.lights)
      document_["extensions"]["KHR_lights_punctual"]["lights"].push_back(describe_light(light));
  }

  void place_instances() {
    std::uint32_t next = 0;
    for (std::uint32_t id = 0; id < scene_.instance_slots(); ++id) {
      if (id % kInstancesPerLook == 0) stop_if_asked(options_.stop);
      const auto instance = scene_.find_instance(id);
      if (!instance) continue;
      const std::string& name = scene_.instance_name(id);
      const Affine& place = instance->transform.world_from_object();
      if (id == next)
        nodes_.add_instance(instance->mesh_id, name, place);
      else
        nodes_.add_renamed_instance(instance->mesh_id, name, place, id);
      ++next;
    }
    const scene::SceneData& data = scene_.data();
    for (std::size_t i = 0; i < data.cameras.size(); ++i)
      nodes_.add_camera(i, data.cameras[i].world_from_camera);
    for (std::size_t i = 0; i < data.lights.size(); ++i) nodes_.add_light(i, place_of(data.lights[i]));
  }

  void name_extensions() {
    std::set<std::string> used;
    if (document_.contains("extensions")) used.insert("KHR_lights_punctual");
    if (document_.contains("materials")) {
      for (const OrderedJson& material : document_["materials"]) {
        if (!material.contains("extensions")) continue;
        for (const auto& extension : material["extensions"].items()) used.insert(extension.key());
      }
    }
    if (!used.empty()) document_["extensionsUsed"] = used;
  }

  [[nodiscard]] std::string finish_json(std::uint64_t binary) {
    name_extensions();
    if (binary != 0) document_["buffers"].push_back({{"byteLength", binary}});
    document_["scene"] = 0;
    std::string text = json_text(document_);
    document_ = {};
    text.back() = ',';
    text += "\"scenes\":[{";
    const std::string& name = scene_.data().name;
    if (!name.empty()) text += "\"name\":" + json_text(name);
    if (nodes_.count() != 0) {
      // glTF has no empty arrays.
      text += std::string(name.empty() ? "" : ",") + "\"nodes\":" + nodes_.root_list();
      text += "}],\"nodes\":" + std::move(nodes_).take_nodes() + "}";
    } else {
      text += "}]}";
    }
    text.resize(padded(text.size()), ' ');
    if (text.size() > options_.limits.json_bytes)
      refuse(ErrorCode::kLimitExceeded,
             "the scene takes " + std::to_string(text.size()) +
                 " bytes of JSON as a GLB, and a file may have " + std::to_string(options_.limits.json_bytes),
             "/nodes");
    return text;
  }

  [[nodiscard]] std::string assemble(const std::string& json, std::uint64_t binary) const {
    const std::uint64_t total =
        kHeaderBytes + kChunkHeaderBytes + json.size() + (binary == 0 ? 0 : kChunkHeaderBytes + binary);
    check_file_bytes(total);
    std::string glb;
    glb.reserve(std::size_t(total));
    const auto word = [&](std::uint64_t value) {
      const auto bits = std::uint32_t(value);
      char bytes[sizeof bits];
      std::memcpy(bytes, &bits, sizeof bits);
      glb.append(bytes, sizeof bytes);
    };
    glb += "glTF";
    word(2);
    word(total);
    word(json.size());
    glb += "JSON";
    glb += json;
    if (binary == 0) return glb;
    word(binary);
    glb.append("BIN\0", 4);
    for (std::uint32_t m = 0; m < scene_.mesh_count(); ++m) {
      stop_if_asked(options_.stop);
      append_mesh(scene_.blas(m).mesh(), plans_[m], glb);
    }
    return glb;
  }

  const scene::Scene& scene_;
  const ExportOptions& options_;
  OrderedJson document_ = OrderedJson::object();
  std::vector<MeshPlan> plans_;
  NodeText nodes_;
};

}  // namespace

std::string json_text(const OrderedJson& value) {
  return value.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
}

Result<std::string> export_glb(const scene::Scene& scene, const ExportOptions& options) {
  try {
    return Exporter(scene, options).run();
  } catch (const Refusal& refusal) {
    return refusal.error();
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kLimitExceeded, "there is not enough memory for the file", ""};
  }
}

std::uint64_t export_memory_bytes(const scene::Scene& scene, const GltfLimits& limits) {
  // A node with a matrix of full digits, a long name and its number among the roots; then the parts of
  // meshes, of which a document of values holds some 2 KiB each. The JSON is there up to three times at the
  // end.
  constexpr std::uint64_t kNodeBytes = 512;
  constexpr std::uint64_t kPartBytes = 2048;
  std::uint64_t parts =
      scene.data().materials.size() + scene.data().cameras.size() + scene.data().lights.size();
  for (std::uint32_t m = 0; m < scene.mesh_count(); ++m) parts += 1 + scene.blas(m).mesh().parts.size();
  const std::uint64_t json =
      std::min<std::uint64_t>(kNodeBytes * scene.instance_count() + kPartBytes * parts, limits.json_bytes);
  return 3 * json + std::min<std::uint64_t>(all_binary_bytes(scene), limits.file_bytes);
}

}  // namespace gridcast::io
