#include <algorithm>
#include <string>

#include "core/blas/kd_tree.h"
#include "core/blas/kd_tree_clip.h"

namespace gridcast::blas {
namespace {

/// Barycentric weights of the sample points: corners, edge midpoints and the middle.
constexpr double kSamples[][3] = {{1, 0, 0},     {0, 1, 0},     {0, 0, 1},        {0.5, 0.5, 0},
                                  {0, 0.5, 0.5}, {0.5, 0, 0.5}, {0.25, 0.25, 0.5}};

Error wrong(std::size_t node, const std::string& what) {
  return {ErrorCode::kInternal, "the node " + what, "/nodes/" + std::to_string(node)};
}

class Validator {
 public:
  Validator(const KdTreeData& tree, const mesh::TriangleMesh& mesh) : tree_(tree), mesh_(mesh) {}

  Status run() {
    if (mesh_.triangle_count() == 0) return tree_.nodes.empty() ? ok_status() : wrong(0, "has no triangles");
    if (tree_.nodes.empty()) return wrong(0, "is missing");
    if (!(tree_.bounds == mesh_.bounds())) return wrong(0, "does not span the mesh's box");
    const Status links = check_links();
    return links ? check_triangles() : links;
  }

 private:
  /// Walks in depth-first order: each node must be the next one in memory, each leaf's range must
  /// begin where the last one ended.
  Status check_links() {
    struct Visit {
      std::size_t node, depth;
      Bounds3f cell;
    };
    std::vector<Visit> pending{{0, 0, tree_.bounds}};
    std::size_t expected_node = 0, expected_reference = 0;
    while (!pending.empty()) {
      const Visit visit = pending.back();
      pending.pop_back();
      if (visit.node != expected_node++ || visit.node >= tree_.nodes.size())
        return wrong(visit.node, "is out of order or range");
      const KdNode& node = tree_.nodes[visit.node];
      if (node.is_leaf()) {
        if (node.first() != expected_reference) return wrong(visit.node, "lists references out of order");
        expected_reference += node.count();
        Status status = check_leaf(visit.node, node);
        if (!status) return status;
        continue;
      }
      const int axis = node.axis();
      if (visit.depth >= kMaxKdDepth) return wrong(visit.node, "is deeper than the traversal's stack");
      if (!(node.plane() > visit.cell.lower[axis] && node.plane() < visit.cell.upper[axis]))
        return wrong(visit.node, "has its plane outside its cell");
      Bounds3f below = visit.cell;
      Bounds3f above = visit.cell;
      below.upper[axis] = above.lower[axis] = node.plane();
      pending.push_back({node.second_child(), visit.depth + 1, above});
      pending.push_back({visit.node + 1, visit.depth + 1, below});
    }
    if (expected_node != tree_.nodes.size()) return wrong(expected_node, "is not reachable from the root");
    if (expected_reference != tree_.references.size()) return wrong(0, "leaves references to no leaf");
    return ok_status();
  }

  Status check_leaf(std::size_t index, const KdNode& leaf) {
    if (std::size_t(leaf.first()) + leaf.count() > tree_.references.size())
      return wrong(index, "lists references beyond their end");
    std::vector<std::uint32_t> ids(tree_.references.begin() + leaf.first(),
                                   tree_.references.begin() + leaf.first() + leaf.count());
    std::sort(ids.begin(), ids.end());
    if (std::adjacent_find(ids.begin(), ids.end()) != ids.end())
      return wrong(index, "lists a triangle twice");
    if (!ids.empty() && ids.back() >= mesh_.triangle_count())
      return wrong(index, "names triangle " + std::to_string(ids.back()));
    return ok_status();
  }

  Status check_triangles() {
    for (std::uint32_t id = 0; id < mesh_.triangle_count(); ++id) {
      const auto corners = mesh_.corners(id);
      const Bounds3d box = to_double(mesh_.triangle_bounds(id));
      for (const auto& [a, b, c] : kSamples) {
        const Vec3d sum = a * Vec3d(corners[0]) + b * Vec3d(corners[1]) + c * Vec3d(corners[2]);
        if (listed(id, glm::clamp(sum, box.lower, box.upper))) continue;
        return Error{ErrorCode::kInternal, "a point of the triangle is in no leaf that lists it",
                     "/triangles/" + std::to_string(id)};
      }
      Status status = check_leaves_of(id);
      if (!status) return status;
    }
    return ok_status();
  }

  /// No leaf whose cell the triangle enters beyond rounding may leave it out.
  Status check_leaves_of(std::uint32_t id) {
    struct Visit {
      std::size_t node;
      Bounds3f cell, box;
    };
    const auto corners = mesh_.corners(id);
    std::vector<Visit> pending{{0, tree_.bounds, mesh_.triangle_bounds(id)}};
    while (!pending.empty()) {
      const auto [index, cell, box] = pending.back();
      pending.pop_back();
      const KdNode& node = tree_.nodes[index];
      if (node.is_leaf()) {
        if (!lists(node, id) && inner_point(corners, cell))
          return wrong(index, "leaves out triangle " + std::to_string(id));
        continue;
      }
      const int axis = node.axis();
      Bounds3f below = cell;
      Bounds3f above = cell;
      below.upper[axis] = above.lower[axis] = node.plane();
      const bool goes_below = box.lower[axis] < node.plane();
      const bool goes_above = box.upper[axis] > node.plane();
      auto visit = [&, whole = box](std::size_t child, const Bounds3f& child_cell) {
        const std::optional<Bounds3f> part =
            goes_below && goes_above ? clip_triangle(corners, child_cell) : whole;
        if (part) pending.push_back({child, child_cell, *part});
      };
      if (goes_below) visit(index + 1, below);
      if (goes_above) visit(node.second_child(), above);
    }
    return ok_status();
  }

  [[nodiscard]] bool lists(const KdNode& leaf, std::uint32_t id) const {
    const auto first = tree_.references.begin() + leaf.first();
    return std::find(first, first + leaf.count(), id) != first + leaf.count();
  }

  /// Whether a leaf whose closed cell holds `p` lists triangle `id`; both sides of a plane through `p`.
  bool listed(std::uint32_t id, const Vec3d& p) {
    pending_.assign(1, 0);
    while (!pending_.empty()) {
      const std::size_t index = pending_.back();
      pending_.pop_back();
      const KdNode& node = tree_.nodes[index];
      if (node.is_leaf()) {
        if (lists(node, id)) return true;
        continue;
      }
      const auto plane = double(node.plane());
      if (p[node.axis()] <= plane) pending_.push_back(index + 1);
      if (p[node.axis()] >= plane) pending_.push_back(node.second_child());
    }
    return false;
  }

  const KdTreeData& tree_;
  const mesh::TriangleMesh& mesh_;
  std::vector<std::size_t> pending_;
};

}  // namespace

Status validate_kd_tree(const KdTreeData& tree, const mesh::TriangleMesh& mesh) {
  return Validator(tree, mesh).run();
}

}  // namespace gridcast::blas
