#pragma once
// The exact reference, for tests (link gridcast_measure): what the true answers of a scene are. Its own
// tests, and the second implementation that it is checked against, are in tests/unit/measure and
// rational_oracle.h.

#include <memory>

#include "core/measure/scene_reference.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::test {

/// A scene's reference that keeps its meshes alive.
class ExactScene {
 public:
  /// `data` is valid: finite vertices and transforms, indices in range.
  explicit ExactScene(scene::SceneData data)
      : data_(std::move(data)), reference_(measure::reference_of(data_).value()) {}
  /// One instance of one mesh, instance_id 0.
  explicit ExactScene(std::shared_ptr<const mesh::TriangleMesh> mesh, const Affine& world_from_object = {})
      : ExactScene(one_instance(std::move(mesh), world_from_object)) {}

  const measure::exact::Reference* operator->() const { return &reference_; }
  [[nodiscard]] const scene::SceneData& data() const { return data_; }

 private:
  static scene::SceneData one_instance(std::shared_ptr<const mesh::TriangleMesh> mesh, const Affine& affine) {
    scene::SceneData data;
    data.meshes.push_back(std::move(mesh));
    data.deformations.resize(1);
    data.instances.push_back({{}, affine, 0});
    return data;
  }

  scene::SceneData data_;
  measure::exact::Reference reference_;
};

}  // namespace gridcast::test
