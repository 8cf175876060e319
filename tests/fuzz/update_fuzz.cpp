// Sequences of updates against a model: which are refused, and what the scene then answers. Earlier versions
// must stay as they were.

#include <bit>
#include <vector>

#include "core/scene/trace.h"
#include "core/scene/update.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

using MeshPtr = std::shared_ptr<const mesh::TriangleMesh>;

/// A strip of squares: room for a few levels of a tree.
mesh::TriangleMesh strip(std::uint32_t squares) {
  mesh::TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= squares; ++i) {
    mesh.positions.emplace_back(float(i), 0.F, float(i % 3));
    mesh.positions.emplace_back(float(i), 1.F, float(i % 2));
  }
  for (std::uint32_t i = 0; i < squares; ++i) {
    mesh.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    mesh.triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  }
  return mesh;
}

/// What the scene ought to hold, in plain lists.
struct Model {
  struct Placed {
    Affine world_from_object;
    std::uint32_t mesh_id = 0;
    bool alive = true;
    InstanceMask mask = kFullMask;
  };
  std::vector<mesh::TriangleMesh> meshes{strip(3), strip(20)};
  std::vector<Placed> instances{{{}, 0}, {{Mat3d(1.0), Vec3d(0, 2, 0)}, 1}};

  /// Without what a query of this mask does not see.
  [[nodiscard]] scene::SceneData data(InstanceMask query = kFullMask) const {
    scene::SceneData data;
    for (const mesh::TriangleMesh& mesh : meshes)
      data.meshes.push_back(std::make_shared<mesh::TriangleMesh>(mesh));
    data.deformations.resize(meshes.size());
    for (const Placed& placed : instances) {
      // A slot of a removed or hidden instance keeps its number, but is never hit.
      const Affine nowhere{Mat3d(0.0), Vec3d(0.0)};
      const bool there = placed.alive && (placed.mask & query) != 0;
      data.instances.push_back({{}, there ? placed.world_from_object : nowhere, placed.mesh_id});
    }
    return data;
  }

  [[nodiscard]] bool alive(std::uint32_t id) const { return id < instances.size() && instances[id].alive; }
};

bool is_placeable(const Affine& affine) {
  return InstanceTransform(affine).active();
}

/// One edit out of the bytes, done to `model`. False when it must be refused.
bool add_edit(fuzz::FuzzInput& input, Model& model, std::vector<scene::SceneEdit>& edits) {
  const auto mesh_id = input.below(std::uint32_t(model.meshes.size()) + 1);
  const auto instance_id = input.below(std::uint32_t(std::min<std::size_t>(model.instances.size() + 1, 256)));
  switch (input.below(6)) {
    case 0: {
      const Affine where = input.affine();
      edits.emplace_back(scene::AddInstance{mesh_id, where, ""});
      if (mesh_id >= model.meshes.size() || !is_placeable(where)) return false;
      model.instances.push_back({where, mesh_id});
      return true;
    }
    case 1: {
      edits.emplace_back(scene::RemoveInstance{instance_id});
      if (!model.alive(instance_id)) return false;
      model.instances[instance_id].alive = false;
      return true;
    }
    case 2: {
      const Affine where = input.affine();
      edits.emplace_back(scene::MoveInstance{instance_id, where});
      if (!model.alive(instance_id) || !is_placeable(where)) return false;
      model.instances[instance_id].world_from_object = where;
      return true;
    }
    case 3: {
      scene::ReplaceVertices edit{mesh_id, {}, {}, scene::UpdateMode(input.below(3))};
      const std::uint32_t first = input.below(16), count = 1 + input.below(4);
      bool right = mesh_id < model.meshes.size();
      for (std::uint32_t i = 0; i < count; ++i) {
        edit.vertex_ids.push_back(first + i);
        edit.positions.push_back(input.point());
      }
      right = right && mesh::validate_positions(edit.positions).ok() &&
              first + count <= model.meshes[mesh_id].positions.size();
      for (std::uint32_t i = 0; right && i < count; ++i)
        model.meshes[mesh_id].positions[first + i] = edit.positions[i];
      edits.emplace_back(std::move(edit));
      return right;
    }
    case 4: {
      scene::ChangeInstance edit{instance_id, {}, {}, {}};
      if (input.below(3) != 0) edit.mask = InstanceMask(input.below(256));
      if (input.below(3) == 0) edit.world_from_object = input.affine();
      edits.emplace_back(edit);
      if (!model.alive(instance_id) || (edit.world_from_object && !is_placeable(*edit.world_from_object)))
        return false;
      Model::Placed& placed = model.instances[instance_id];
      placed.mask = edit.mask.value_or(placed.mask);
      placed.world_from_object = edit.world_from_object.value_or(placed.world_from_object);
      return true;
    }
    default: {
      if (model.meshes.size() > 6) return true;
      model.meshes.push_back(strip(1 + input.below(6)));
      edits.emplace_back(scene::AddMesh{std::make_shared<mesh::TriangleMesh>(model.meshes.back())});
      return true;
    }
  }
}

std::vector<SurfaceHit> answers(const scene::Scene& scene, InstanceMask query = kFullMask) {
  std::vector<SurfaceHit> hits;
  for (int i = 0; i < 24; ++i)
    hits.push_back(scene::intersect(scene,
                                    {{0.3 * i - 1.0, 0.2 * (i % 5), 30.0}, {0.01 * (i % 7), 0.03, -1.0}},
                                    Precision::kRobust, {}, query));
  return hits;
}

void require_same(const std::vector<SurfaceHit>& a, const std::vector<SurfaceHit>& b, const char* what) {
  for (std::size_t i = 0; i < a.size(); ++i)
    fuzz::require(a[i].status == b[i].status && a[i].instance_id == b[i].instance_id &&
                      a[i].primitive_id == b[i].primitive_id &&
                      std::bit_cast<std::uint64_t>(a[i].t) == std::bit_cast<std::uint64_t>(b[i].t),
                  what);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::FuzzInput input(data, size);
  Model model;
  auto scene = scene::build_scene(model.data()).value();
  const auto first = scene;
  const std::vector<SurfaceHit> first_answers = answers(*first);
  for (int step = 0; step < 12 && !input.empty(); ++step) {
    std::vector<scene::SceneEdit> edits;
    Model next = model;
    const std::uint32_t count = 1 + input.below(3);
    bool right = true;
    for (std::uint32_t i = 0; i < count && right; ++i) right = add_edit(input, next, edits);
    const auto updated = scene::apply_update(*scene, edits);
    fuzz::require(updated.ok() == right, right ? "a good update is refused" : "a bad update is accepted");
    if (!right) continue;
    fuzz::require(updated->scene->version() == scene->version() + 1, "a version is skipped");
    model = std::move(next);
    scene = updated->scene;
  }
  fuzz::require(scene->validate().ok(), "a structure is broken");
  scene::SceneBuildOptions options;
  options.blas.kind = blas::StructureKind::kBruteForce;
  for (const InstanceMask query : {kFullMask, InstanceMask(0x15)})
    require_same(answers(*scene, query), answers(*scene::build_scene(model.data(query), options).value()),
                 "the scene does not answer as its model");
  require_same(answers(*first), first_answers, "an earlier version has changed");
  return 0;
}
