#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "core/blas/bvh_node.h"
#include "core/blas/compact_bvh.h"
#include "core/blas/triangle_cover.h"

namespace gridcast::blas {
namespace {

Error wrong(std::size_t node, const std::string& what) {
  return {ErrorCode::kInternal, "the node " + what, "/nodes/" + std::to_string(node)};
}

Bounds3f common(const Bounds3f& a, const Bounds3f& b) {
  return {glm::max(a.lower, b.lower), glm::min(a.upper, b.upper)};
}

class Validator {
 public:
  Validator(const CompactBvh& tree, const mesh::TriangleMesh& mesh, SpatialSplits spatial)
      : nodes_(tree.nodes()),
        ids_(tree.ids()),
        mesh_(mesh),
        spatial_(spatial),
        paths_(nodes_.size()),
        listed_(ids_.size()),
        seen_(mesh.triangle_count()),
        whole_(mesh.triangle_count()) {}

  Status run() {
    if (nodes_.empty()) return mesh_.triangles.empty() ? ok_status() : wrong(0, "is missing");
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    paths_[0] = {{Vec3f(-kInfinity), Vec3f(kInfinity)}, 0, true};
    for (std::uint32_t i = 0; i < nodes_.size(); ++i) {
      const CompactNode& node = nodes_[i];
      if (!paths_[i].linked) return wrong(i, "is not reachable from the root");
      if (node.slot_count() == 0 || node.slot_count() > 8 || node.inner_count() > node.slot_count())
        return wrong(i, "uses no slot or more than eight");
      for (std::uint32_t slot = 0; slot < node.slot_count(); ++slot) {
        Status status = slot < node.inner_count() ? inner(i, slot) : leaf(i, slot);
        if (!status) return status;
      }
    }
    return everything_seen();
  }

 private:
  /// What the boxes on the way to a node have in common: a ray that meets no part of it may not come there.
  struct Path {
    Bounds3f box;
    std::size_t depth = 0;
    bool linked = false;
  };

  Status inner(std::uint32_t index, std::uint32_t slot) {
    const std::uint32_t child = compact_child::of(nodes_[index], slot);
    if (child <= index || child >= nodes_.size() || paths_[child].linked)
      return wrong(index,
                   "links to " + std::to_string(child) + ": out of range, out of order or linked before");
    paths_[child] = {common(paths_[index].box, nodes_[index].box(slot)), paths_[index].depth + 1, true};
    return paths_[child].depth > kMaxBvhDepth ? wrong(child, "is deeper than the traversal's stack")
                                              : ok_status();
  }

  Status leaf(std::uint32_t index, std::uint32_t slot) {
    const std::uint32_t link = compact_child::of(nodes_[index], slot);
    const std::size_t first = compact_child::first_id(link), count = compact_child::count(link);
    const Bounds3f box = common(paths_[index].box, nodes_[index].box(slot));
    for (std::size_t i = first; i < first + count; ++i) {
      if (i >= ids_.size() || listed_[i])
        return wrong(index, "links to a triangle out of range or linked before");
      listed_[i] = true;
      const std::uint32_t id = ids_[i];
      if (id >= mesh_.triangle_count()) return wrong(index, "names triangle " + std::to_string(id));
      if (seen_[id] && spatial_ == SpatialSplits::kNever)
        return wrong(index, "lists a second time triangle " + std::to_string(id));
      seen_[id] = true;
      if (box.contains(mesh_.triangle_bounds(id)))
        whole_[id] = true;
      else if (spatial_ == SpatialSplits::kNever)
        return wrong(index, "does not contain triangle " + std::to_string(id));
      else
        parts_.push_back({id, box});
    }
    return ok_status();
  }

  Status everything_seen() {
    if (std::ranges::find(listed_, false) != listed_.end()) return wrong(0, "leaves out ids");
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      if (!seen_[i])
        return Error{ErrorCode::kInternal, "the triangle is in no leaf", "/triangles/" + std::to_string(i)};
    }
    return parts_cover();
  }

  /// A triangle that no leaf contains whole lies within the boxes of its leaves together.
  Status parts_cover() {
    std::ranges::stable_sort(parts_, {}, &Part::id);
    std::vector<Bounds3f> boxes;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const std::uint32_t id = parts_[i].id;
      boxes.push_back(parts_[i].box);
      if (i + 1 < parts_.size() && parts_[i + 1].id == id) continue;
      if (!whole_[id] && !covers(boxes, mesh_.corners(id)))
        return Error{ErrorCode::kInternal, "its leaves do not cover the triangle",
                     "/triangles/" + std::to_string(id)};
      boxes.clear();
    }
    return ok_status();
  }

  struct Part {
    std::uint32_t id;
    Bounds3f box;
  };

  const CompactNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  const mesh::TriangleMesh& mesh_;
  SpatialSplits spatial_;
  std::vector<Path> paths_;
  std::vector<bool> listed_;
  std::vector<bool> seen_;
  std::vector<bool> whole_;
  std::vector<Part> parts_;
};

}  // namespace

Status CompactBvh::validate(const mesh::TriangleMesh& mesh) const {
  return Validator(*this, mesh, spatial_).run();
}

}  // namespace gridcast::blas
