#include <algorithm>
#include <string>
#include <utility>

#include "core/blas/triangle_cover.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
namespace {

Error wrong(std::size_t node, const std::string& what) {
  return {ErrorCode::kInternal, "the node " + what, "/nodes/" + std::to_string(node)};
}

class Validator {
 public:
  Validator(const WideNodes& nodes, const TriangleBlocks& blocks, const mesh::TriangleMesh& mesh,
            SpatialSplits spatial)
      : nodes_(nodes),
        blocks_(blocks),
        mesh_(mesh),
        block_seen_(blocks.size()),
        spatial_(spatial),
        triangle_seen_(mesh.triangle_count()),
        triangle_whole_(mesh.triangle_count()) {}

  Status run() {
    if (nodes_.empty()) return mesh_.triangles.empty() ? ok_status() : wrong(0, "is missing");
    std::vector<std::size_t> depth(nodes_.size(), 0);
    std::vector<bool> linked(nodes_.size(), false);
    linked[0] = true;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (!linked[i]) return wrong(i, "is not reachable from the root");
      if (nodes_[i].slots == 0 || nodes_[i].slots > 8) return wrong(i, "uses no slot or more than eight");
      for (std::uint32_t slot = 0; slot < nodes_[i].slots; ++slot) {
        const std::uint32_t link = nodes_[i].child[slot];
        if (wide_child::is_leaf(link)) {
          if (Status status = leaf(i, slot, link); !status) return status;
          continue;
        }
        if (link <= i || link >= nodes_.size() || linked[link])
          return wrong(i,
                       "links to " + std::to_string(link) + ": out of range, out of order or linked before");
        linked[link] = true;
        depth[link] = depth[i] + 1;
        if (depth[link] > kMaxBvhDepth) return wrong(link, "is deeper than the traversal's stack");
        for (std::uint32_t s = 0; s < nodes_[link].slots && s < 8; ++s) {
          if (!nodes_[i].box(slot).contains(nodes_[link].box(s)))
            return wrong(i, "does not contain its child " + std::to_string(link));
        }
      }
    }
    return everything_seen();
  }

 private:
  Status leaf(std::size_t node, std::uint32_t slot, std::uint32_t link) {
    const std::size_t first = wide_child::index(link);
    const Bounds3f box = nodes_[node].box(slot);
    for (std::size_t b = first; b < first + wide_child::block_count(link); ++b) {
      if (b >= blocks_.size() || block_seen_[b])
        return wrong(node, "links to a block out of range or linked before");
      block_seen_[b] = true;
      for (int lane = 0; lane < 4; ++lane) {
        const std::uint32_t id = blocks_[b].ids[lane];
        if (id >= mesh_.triangle_count()) return wrong(node, "names triangle " + std::to_string(id));
        const bool repeats = lane > 0 && id == blocks_[b].ids[lane - 1];
        if (triangle_seen_[id] && !repeats && spatial_ == SpatialSplits::kNever)
          return wrong(node, "lists a second time triangle " + std::to_string(id));
        triangle_seen_[id] = true;
        if (box.contains(mesh_.triangle_bounds(id)))
          triangle_whole_[id] = true;
        else if (spatial_ == SpatialSplits::kNever)
          return wrong(node, "does not contain triangle " + std::to_string(id));
        else if (!repeats)
          parts_.push_back({id, box});
        const auto corners = mesh_.corners(id);
        for (int corner = 0; corner < 3; ++corner)
          if (blocks_[b].corner(corner, lane) != corners[std::size_t(corner)])
            return wrong(node, "holds old corners of triangle " + std::to_string(id));
      }
    }
    return ok_status();
  }

  Status everything_seen() {
    for (std::size_t i = 0; i < triangle_seen_.size(); ++i) {
      if (!triangle_seen_[i])
        return Error{ErrorCode::kInternal, "the triangle is in no leaf", "/triangles/" + std::to_string(i)};
    }
    return parts_cover();
  }

  /// A triangle that no leaf contains whole lies within the boxes of its leaves together.
  Status parts_cover() {
    std::stable_sort(parts_.begin(), parts_.end(), [](const Part& a, const Part& b) { return a.id < b.id; });
    std::vector<Bounds3f> boxes;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const std::uint32_t id = parts_[i].id;
      boxes.push_back(parts_[i].box);
      if (i + 1 < parts_.size() && parts_[i + 1].id == id) continue;
      if (!triangle_whole_[id] && !covers(boxes, mesh_.corners(id)))
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

  const WideNodes& nodes_;
  const TriangleBlocks& blocks_;
  const mesh::TriangleMesh& mesh_;
  std::vector<bool> block_seen_;
  SpatialSplits spatial_;
  std::vector<bool> triangle_seen_;
  std::vector<bool> triangle_whole_;
  std::vector<Part> parts_;
};

}  // namespace

Status WideBvh::validate(const mesh::TriangleMesh& mesh) const {
  return Validator(nodes(), blocks(), mesh, shape_.spatial).run();
}

}  // namespace gridcast::blas
