#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "core/blas/kd_tree.h"
#include "core/blas/kd_tree_clip.h"

namespace gridcast::blas {
namespace {

/// Barycentric weights of the sample points: corners, edge midpoints and the middle.
constexpr double kSamples[][3] = {{1, 0, 0},     {0, 1, 0},     {0, 0, 1},        {0.5, 0.5, 0},
                                  {0, 0.5, 0.5}, {0.5, 0, 0.5}, {0.25, 0.25, 0.5}};

Error wrong(std::size_t treelet, const std::string& what) {
  return {ErrorCode::kInternal, "the node " + what, "/nodes/" + std::to_string(treelet)};
}

class Validator {
 public:
  Validator(const KdLayout& layout, const mesh::TriangleMesh& mesh)
      : layout_(layout), mesh_(mesh), number_(mesh.triangle_count(), kInvalidId) {}

  Status run() {
    const KdTreelets& treelets = layout_.treelets;
    if (mesh_.triangle_count() == 0) return treelets.empty() ? ok_status() : wrong(0, "has no triangles");
    if (treelets.empty()) return wrong(0, "is missing");
    if (!(layout_.bounds == mesh_.bounds())) return wrong(0, "does not span the mesh's box");
    if (Status status = check_copies(); !status) return status;
    if (Status status = check_treelets(); !status) return status;
    for (std::uint32_t id = 0; id < mesh_.triangle_count(); ++id)
      if (Status status = check_triangle(id); !status) return status;
    return ok_status();
  }

 private:
  /// Every copied triangle is the mesh's, and none is there twice.
  Status check_copies() {
    for (std::size_t i = 0; i < layout_.triangles.size(); ++i) {
      const KdTriangle& copy = layout_.triangles[i];
      const auto wrong_copy = [&](const std::string& what) {
        return Error{ErrorCode::kInternal, "the copy of a triangle " + what, "/copies/" + std::to_string(i)};
      };
      if (copy.id >= mesh_.triangle_count()) return wrong_copy("names triangle " + std::to_string(copy.id));
      if (number_[copy.id] != kInvalidId) return wrong_copy("is there twice");
      number_[copy.id] = std::uint32_t(i);
      const auto corners = mesh_.corners(copy.id);
      for (std::size_t c = 0; c < 3; ++c)
        if (copy.corner(c) != corners[c]) return wrong_copy("has old corners");
    }
    return ok_status();
  }

  /// Every treelet is linked once, after its parent and within the stack; its slots tile its cell; leaves
  /// take the blocks in order.
  Status check_treelets() {
    struct Visit {
      std::size_t treelet, depth;
      Bounds3f cell;
    };
    std::vector<Visit> pending{{0, 0, layout_.bounds}};
    std::vector<bool> seen(layout_.treelets.size(), false);
    std::vector<bool> block_seen(layout_.blocks.size(), false);
    while (!pending.empty()) {
      const Visit visit = pending.back();
      pending.pop_back();
      if (visit.treelet >= layout_.treelets.size() || seen[visit.treelet])
        return wrong(visit.treelet, "is out of range or linked twice");
      seen[visit.treelet] = true;
      if (7 * (visit.depth + 1) > kKdStackSize)
        return wrong(visit.treelet, "is deeper than the traversal's stack");
      const KdTreelet& treelet = layout_.treelets[visit.treelet];
      if (Status status = check_slots(visit.treelet, visit.cell); !status) return status;
      for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
        if (treelet.is_inner(slot)) {
          pending.push_back({treelet.child(slot), visit.depth + 1, treelet.child_cell(slot, visit.cell)});
          continue;
        }
        if (!treelet.is_used(slot)) continue;
        if (Status status = check_leaf(visit.treelet, slot, block_seen); !status) return status;
      }
    }
    const auto lost = std::find(seen.begin(), seen.end(), false) - seen.begin();
    if (std::size_t(lost) != seen.size()) return wrong(std::size_t(lost), "is not reachable from the root");
    if (std::find(block_seen.begin(), block_seen.end(), false) != block_seen.end())
      return wrong(0, "leaves blocks to no leaf");
    return ok_status();
  }

  /// Slots are used or not, inner or leaf, and planes inside the cell part it into slots and empty parts.
  [[nodiscard]] Status check_slots(std::size_t index, const Bounds3f& cell) const {
    const KdTreelet& treelet = layout_.treelets[index];
    if ((treelet.inner & ~treelet.used) != 0) return wrong(index, "has a child in an unused slot");
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      const bool leaf = treelet.is_used(slot) && !treelet.is_inner(slot);
      if (leaf != (treelet.block_count(slot) != 0))
        return wrong(index, "has blocks in a slot that is no leaf, or a leaf without");
    }
    std::vector<Part> parts;
    if (!is_pile(treelet) && !part_cell(treelet, cell, cell, treelet.used, parts))
      return wrong(index, "has children that its planes do not part");
    return ok_status();
  }

  /// A part of a treelet's cell: a slot's, or one without triangles.
  struct Part {
    static constexpr std::uint32_t kEmpty = KdTreelet::kSlots;
    std::uint32_t slot;
    Bounds3f cell;
  };

  /// A treelet without planes: its slots share the triangles of one cell.
  static bool is_pile(const KdTreelet& treelet) { return std::isinf(treelet.planes[0]); }

  /// Finds the order of planes again: parts `region`, which holds the slots of `mask`, wherever a plane cuts
  /// no slot. False when slots overlap or a part is left over that no plane explains.
  static bool part_cell(const KdTreelet& treelet, const Bounds3f& cell, const Bounds3f& region,
                        std::uint32_t mask, std::vector<Part>& parts) {
    if (mask == 0) {
      parts.push_back({Part::kEmpty, region});
      return true;
    }
    if (std::has_single_bit(mask)) {
      const auto slot = std::uint32_t(std::countr_zero(mask));
      if (treelet.child_cell(slot, cell) == region) {
        parts.push_back({slot, region});
        return true;
      }
    }
    for (std::uint32_t i = 0; i < KdTreelet::kPlanes; ++i) {
      const int axis = treelet.axis(i);
      const float plane = treelet.planes[i];
      if (axis > 2 || !(plane > region.lower[axis] && plane < region.upper[axis])) continue;
      std::uint32_t below = 0, above = 0;
      for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
        const std::uint32_t bit = mask & (1U << slot);
        const Bounds3f box = treelet.child_cell(slot, cell);
        if (box.upper[axis] <= plane) below |= bit;
        if (box.lower[axis] >= plane) above |= bit;
      }
      if ((below | above) != mask || (below & above) != 0) continue;
      Bounds3f lower_part = region;
      Bounds3f upper_part = region;
      lower_part.upper[axis] = upper_part.lower[axis] = plane;
      return part_cell(treelet, cell, lower_part, below, parts) &&
             part_cell(treelet, cell, upper_part, above, parts);
    }
    return false;
  }

  Status check_leaf(std::size_t index, std::uint32_t slot, std::vector<bool>& block_seen) const {
    const KdTreelet& treelet = layout_.treelets[index];
    std::vector<std::uint32_t> numbers;
    for (std::uint32_t i = 0; i < treelet.block_count(slot); ++i) {
      const std::size_t block = treelet.block(slot) + i;
      if (block >= layout_.blocks.size() || block_seen[block])
        return wrong(index, "links to a block out of range or linked before");
      block_seen[block] = true;
      const std::uint32_t* lanes = layout_.blocks[block].triangles;
      numbers.insert(numbers.end(), lanes, lanes + layout_.blocks[block].size());
    }
    std::sort(numbers.begin(), numbers.end());
    if (std::adjacent_find(numbers.begin(), numbers.end()) != numbers.end())
      return wrong(index, "lists a triangle twice in one leaf");
    if (!numbers.empty() && numbers.back() >= layout_.triangles.size())
      return wrong(index, "names copy " + std::to_string(numbers.back()));
    return ok_status();
  }

  Status check_triangle(std::uint32_t id) {
    const auto corners = mesh_.corners(id);
    const Bounds3d box = to_double(mesh_.triangle_bounds(id));
    for (const auto& [a, b, c] : kSamples) {
      const Vec3d sum = a * Vec3d(corners[0]) + b * Vec3d(corners[1]) + c * Vec3d(corners[2]);
      if (listed(id, glm::clamp(sum, box.lower, box.upper))) continue;
      return Error{ErrorCode::kInternal, "a point of the triangle is in no leaf that lists it",
                   "/triangles/" + std::to_string(id)};
    }
    return check_leaves_of(id);
  }

  /// No part whose cell the triangle enters beyond rounding may leave it out.
  Status check_leaves_of(std::uint32_t id) {
    struct Visit {
      std::uint32_t treelet;
      Bounds3f cell;
    };
    const auto corners = mesh_.corners(id);
    std::vector<Visit> pending{{0, layout_.bounds}};
    std::vector<Part> parts;
    while (!pending.empty()) {
      const auto [index, cell] = pending.back();
      pending.pop_back();
      const KdTreelet& treelet = layout_.treelets[index];
      if (is_pile(treelet)) {
        if (!pile_lists(index, id) && inner_point(corners, cell)) return leaves_out(index, id);
        continue;
      }
      parts.clear();
      part_cell(treelet, cell, cell, treelet.used, parts);
      for (const Part& part : parts) {
        if (!clip_triangle(corners, part.cell)) continue;
        if (part.slot != Part::kEmpty && treelet.is_inner(part.slot)) {
          pending.push_back({treelet.child(part.slot), part.cell});
          continue;
        }
        const bool listed_here = part.slot != Part::kEmpty && lists(treelet, part.slot, id);
        if (!listed_here && inner_point(corners, part.cell)) return leaves_out(index, id);
      }
    }
    return ok_status();
  }

  static Error leaves_out(std::size_t index, std::uint32_t id) {
    return wrong(index, "leaves out triangle " + std::to_string(id));
  }

  [[nodiscard]] bool lists(const KdTreelet& treelet, std::uint32_t slot, std::uint32_t id) const {
    for (std::uint32_t i = 0; i < treelet.block_count(slot); ++i) {
      const auto& lanes = layout_.blocks[treelet.block(slot) + i].triangles;
      if (std::find(std::begin(lanes), std::end(lanes), number_[id]) != std::end(lanes)) return true;
    }
    return false;
  }

  [[nodiscard]] bool pile_lists(std::uint32_t index, std::uint32_t id) const {
    const KdTreelet& treelet = layout_.treelets[index];
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      if (!treelet.is_used(slot)) continue;
      if (treelet.is_inner(slot) ? pile_lists(treelet.child(slot), id) : lists(treelet, slot, id))
        return true;
    }
    return false;
  }

  /// Whether a leaf whose closed cell holds `p` lists triangle `id`; both sides of a plane through `p`.
  [[nodiscard]] bool listed(std::uint32_t id, const Vec3d& p) const {
    struct Visit {
      std::uint32_t treelet;
      Bounds3f cell;
    };
    std::vector<Visit> pending{{0, layout_.bounds}};
    while (!pending.empty()) {
      const auto [index, cell] = pending.back();
      pending.pop_back();
      const KdTreelet& treelet = layout_.treelets[index];
      for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
        if (!treelet.is_used(slot)) continue;
        const Bounds3f part = treelet.child_cell(slot, cell);
        if (!to_double(part).contains(p)) continue;
        if (treelet.is_inner(slot))
          pending.push_back({treelet.child(slot), part});
        else if (lists(treelet, slot, id))
          return true;
      }
    }
    return false;
  }

  const KdLayout& layout_;
  const mesh::TriangleMesh& mesh_;
  std::vector<std::uint32_t> number_;  ///< of each triangle in layout_.triangles
};

}  // namespace

Status validate_kd_tree(const KdLayout& layout, const mesh::TriangleMesh& mesh) {
  return Validator(layout, mesh).run();
}

}  // namespace gridcast::blas
