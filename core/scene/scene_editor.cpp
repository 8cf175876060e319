#include "core/scene/scene_editor.h"

#include <algorithm>
#include <functional>

#include "core/scene/chunk_parts.h"
#include "core/scene/hit_box.h"

namespace gridcast::scene {
namespace {

/// Ascending, each once.
void sort_ids(std::vector<std::uint32_t>& ids) {
  const auto is_done = [&] {
    return std::adjacent_find(ids.begin(), ids.end(), std::greater_equal<>()) == ids.end();
  };
  if (is_done()) return;
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

Error singular_transform(std::string where) {
  return {ErrorCode::kInvalidArgument, "the transform is singular, not finite or out of range",
          std::move(where)};
}

std::uint32_t SceneEditor::add_instance(const InstanceTransform& transform, const InstanceSlot& slot,
                                        const std::string& name) {
  const auto instance_id = std::uint32_t(scene_->instances_.size());
  scene_->instances_.push_back(transform, slot);
  if (!name.empty()) scene_->added_names_.push_back({instance_id, name});
  ++scene_->live_instances_;
  scene_->world_triangles_ += scene_->blas(slot.mesh_id).mesh().triangle_count();
  return instance_id;
}

void SceneEditor::set_name(std::uint32_t instance_id, const std::string& name) {
  if (new_names_ == nullptr) {
    new_names_ = scene_->new_names_ == nullptr
                     ? std::make_shared<std::map<std::uint32_t, std::string>>()
                     : std::make_shared<std::map<std::uint32_t, std::string>>(*scene_->new_names_);
    scene_->new_names_ = new_names_;
  }
  (*new_names_)[instance_id] = name;
}

void SceneEditor::remove_instance(std::uint32_t instance_id) {
  InstanceSlot& slot = scene_->instances_.write_slot(instance_id);
  slot.alive = false;
  --scene_->live_instances_;
  scene_->world_triangles_ -= scene_->blas(slot.mesh_id).mesh().triangle_count();
}

void SceneEditor::count_instances() {
  scene_->live_instances_ = 0;
  scene_->world_triangles_ = 0;
  for (std::uint32_t id = 0; id < scene_->instances_.size(); ++id) {
    const InstanceSlot& slot = scene_->instances_.slot(id);
    if (!slot.alive) continue;
    ++scene_->live_instances_;
    scene_->world_triangles_ += scene_->blas(slot.mesh_id).mesh().triangle_count();
  }
}

tlas::BoxTable& SceneEditor::boxes() {
  if (!boxes_) boxes_ = scene_->top_level_.boxes();
  boxes_->grow(scene_->instances_.size());
  return *boxes_;
}

void SceneEditor::update_top_level(std::vector<std::uint32_t> instance_ids) {
  tlas::BoxTable& boxes = this->boxes();
  sort_ids(instance_ids);
  const auto borders = part_borders(instance_ids.size(), [&](std::size_t k) { return instance_ids[k]; });
  for_each_part(borders, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) boxes.write(instance_ids[k]) = hit_box_of(instance_ids[k]);
  });
  if (instance_ids.empty()) {
    instance_ids.swap(moved_);
  } else {
    instance_ids.insert(instance_ids.end(), moved_.begin(), moved_.end());
  }
  sort_ids(instance_ids);
  scene_->top_level_.update(std::move(boxes), instance_ids);
}

tlas::InstanceBox SceneEditor::hit_box_of(std::uint32_t instance_id) const {
  const Instance instance = scene_->instance(instance_id);
  if (!instance.alive) return {};
  return hit_box(instance.transform, scene_->hull(instance.mesh_id));
}

}  // namespace gridcast::scene
