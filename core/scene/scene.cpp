#include "core/scene/scene.h"

#include "core/scene/hit_box.h"
#include "core/scene/pose.h"

namespace gridcast::scene {
namespace {

Error at(std::string where, const Error& error) {
  return {error.code, error.message, std::move(where) + error.where};
}

}  // namespace

std::optional<Instance> Scene::find_instance(std::uint32_t instance_id) const {
  if (instance_id >= instances_.size() || !instances_.slot(instance_id).alive) return std::nullopt;
  return instances_[instance_id];
}

const std::string& Scene::instance_name(std::uint32_t instance_id) const {
  static const std::string unnamed;
  if (new_names_ != nullptr)
    if (const auto found = new_names_->find(instance_id); found != new_names_->end()) return found->second;
  if (instance_id < data_->instances.size()) return data_->instances[instance_id].name.str();
  // Binary search: names are added in the order of ids.
  std::size_t low = 0, high = added_names_.size();
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if (added_names_[middle].instance_id < instance_id) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  const bool found = low < added_names_.size() && added_names_[low].instance_id == instance_id;
  return found ? added_names_[low].name : unnamed;
}

std::uint64_t Scene::stored_triangle_count() const {
  std::uint64_t count = 0;
  for (const blas::Blas& blas : blas_) count += blas.mesh().triangle_count();
  return count;
}

std::size_t Scene::memory_bytes() const {
  std::size_t bytes = instances_.memory_bytes() + added_names_.memory_bytes() +
                      data_->instances.capacity() * sizeof(InstanceData) + top_level_.memory_bytes() +
                      scene::memory_bytes(*pose_);
  // Of a tree: three pointers and a colour beside each name.
  if (new_names_ != nullptr)
    for (const auto& entry : *new_names_)
      bytes += 4 * sizeof(void*) + sizeof(entry) + entry.second.capacity();
  for (const blas::Blas& blas : blas_) bytes += blas.mesh().memory_bytes() + blas.stats().memory_bytes;
  return bytes;
}

Status Scene::validate() const {
  for (std::size_t i = 0; i < blas_.size(); ++i) {
    if (Status status = blas_[i].validate(); !status)
      return at("/meshes/" + std::to_string(i), status.error());
  }
  if (Status status = top_level_.validate(); !status) return at("/top_level", status.error());
  if (top_level_.slots() != instances_.size())
    return Error{ErrorCode::kInternal, "the top level has another number of slots", "/top_level"};
  for (std::uint32_t id = 0; id < instances_.size(); ++id) {
    const Instance instance = instances_[id];
    const auto box =
        instance.alive ? hit_box(instance.transform, hull(instance.mesh_id)) : tlas::InstanceBox{};
    if (!(top_level_.box(id) == box))
      return Error{ErrorCode::kInternal, "the box in the top level is not that of the instance",
                   "/instances/" + std::to_string(id)};
  }
  return ok_status();
}

}  // namespace gridcast::scene
