#include "core/scene/scene_editor.h"

#include <algorithm>

#include "core/scene/hit_box.h"

namespace gridcast::scene {

std::uint32_t SceneEditor::add_instance(const Instance& instance, const std::string& name) {
  const auto instance_id = std::uint32_t(scene_->instances_.size());
  scene_->instances_.push_back(instance);
  if (!name.empty()) scene_->added_names_.push_back({instance_id, name});
  ++scene_->live_instances_;
  scene_->world_triangles_ += scene_->blas(instance.mesh_id).mesh().triangle_count();
  return instance_id;
}

void SceneEditor::remove_instance(std::uint32_t instance_id) {
  Instance& instance = scene_->instances_.write(instance_id);
  instance.alive = false;
  --scene_->live_instances_;
  scene_->world_triangles_ -= scene_->blas(instance.mesh_id).mesh().triangle_count();
}

void SceneEditor::count_instances() {
  scene_->live_instances_ = 0;
  scene_->world_triangles_ = 0;
  for (std::size_t i = 0; i < scene_->instances_.size(); ++i) {
    const Instance& instance = scene_->instances_[i];
    if (!instance.alive) continue;
    ++scene_->live_instances_;
    scene_->world_triangles_ += scene_->blas(instance.mesh_id).mesh().triangle_count();
  }
}

void SceneEditor::update_boxes(std::vector<std::uint32_t> instance_ids) {
  std::sort(instance_ids.begin(), instance_ids.end());
  instance_ids.erase(std::unique(instance_ids.begin(), instance_ids.end()), instance_ids.end());
  std::vector<tlas::BoxChange> changes;
  changes.reserve(instance_ids.size());
  for (const std::uint32_t id : instance_ids) changes.push_back({id, hit_box_of(id)});
  scene_->top_level_ = scene_->top_level_.updated(changes);
}

tlas::InstanceBox SceneEditor::hit_box_of(std::uint32_t instance_id) const {
  const Instance& instance = scene_->instance(instance_id);
  if (!instance.alive) return {};
  return hit_box(instance.transform, scene_->hull(instance.mesh_id));
}

}  // namespace gridcast::scene
