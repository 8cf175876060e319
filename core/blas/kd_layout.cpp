#include "core/blas/kd_layout.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "core/blas/cost_model.h"
#include "core/math/ray.h"

namespace gridcast::blas {
namespace {

constexpr std::uint32_t kSlots = KdTreelet::kSlots;
constexpr std::uint32_t kBlockSize = 4;
constexpr std::uint32_t kMaxLeaf = KdTreelet::kMaxBlocks * kBlockSize;

/// A part of a cell on its way to become a slot: a binary node, its cell, and the planes of this treelet that
/// bound it from below (0) and above (1) on each axis.
struct Part {
  static constexpr std::uint8_t kNone = 255;
  std::uint32_t node = 0;
  Bounds3f cell;
  std::uint8_t sides[2][3] = {{kNone, kNone, kNone}, {kNone, kNone, kNone}};

  [[nodiscard]] std::uint32_t side_count() const {
    std::uint32_t count = 0;
    for (const auto& side : sides)
      for (const std::uint8_t plane : side) count += std::uint32_t(plane != kNone);
    return count;
  }
  /// The four half spaces, repeated when there are fewer; plane 0 from below when there are none.
  [[nodiscard]] std::uint16_t path() const {
    std::uint32_t codes[6] = {0};
    std::uint32_t count = 0;
    for (std::uint32_t side = 0; side < 2; ++side)
      for (const std::uint8_t plane : sides[side])
        if (plane != kNone) codes[count++] = plane | (side == 0 ? 8U : 0U);
    std::uint32_t packed = 0;
    for (std::uint32_t i = 0; i < KdTreelet::kSides; ++i)
      packed |= codes[count == 0 ? 0 : std::min(i, count - 1)] << (4 * i);
    return std::uint16_t(packed);
  }
};

/// Which planes share a treelet: the choice that makes rays meet the fewest treelets, by dynamic programming
/// over the surface areas of cells, as "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
/// BVHs", H. Ylitie, 2017, does for children; here planes are what a treelet runs out of.
class Packing {
 public:
  explicit Packing(const KdTreeData& tree) : tree_(tree), cost_(tree.nodes.size()) {
    if (tree.nodes.empty()) return;
    measure();
    for (std::size_t i = tree.nodes.size(); i-- > 0;)
      if (!tree.nodes[i].is_leaf()) solve(i);
  }

  /// How many of `planes` the lower child of `node` should get, when `node` takes one itself; none when
  /// `node` should begin a treelet of its own.
  [[nodiscard]] std::optional<std::uint32_t> share_of_below(std::size_t node, std::uint32_t planes) const {
    const Costs& below = cost_[node + 1];
    const Costs& above = cost_[tree_.nodes[node].second_child()];
    if (planes == 0) return std::nullopt;
    std::uint32_t best = 0;
    for (std::uint32_t i = 1; i < planes; ++i)
      if (below[i] + above[planes - 1 - i] < below[best] + above[planes - 1 - best]) best = i;
    if (cost_[node][0] < below[best] + above[planes - 1 - best]) return std::nullopt;
    return best;
  }

 private:
  /// [i]: least cost below a node whose subtree may use i planes of the treelet above; 0: it begins its own.
  using Costs = std::array<float, KdTreelet::kPlanes>;

  /// Puts each inner node's share of the root's area into its cost[0]. A flat tree's cells have lengths
  /// alone.
  void measure() {
    struct Visit {
      std::size_t node;
      Bounds3f cell;
    };
    std::vector<Visit> pending{{0, tree_.bounds}};
    while (!pending.empty()) {
      const auto [index, cell] = pending.back();
      pending.pop_back();
      const KdNode& node = tree_.nodes[index];
      if (node.is_leaf()) continue;
      cost_[index][0] = float(hit_probability(cell, tree_.bounds));
      Visit below{index + 1, cell};
      Visit above{node.second_child(), cell};
      below.cell.upper[node.axis()] = above.cell.lower[node.axis()] = node.plane();
      pending.push_back(below);
      pending.push_back(above);
    }
  }

  void solve(std::size_t node) {
    const Costs& below = cost_[node + 1];
    const Costs& above = cost_[tree_.nodes[node].second_child()];
    Costs& costs = cost_[node];
    float all = std::numeric_limits<float>::infinity();
    for (std::uint32_t planes = 1; planes <= KdTreelet::kPlanes; ++planes) {
      for (std::uint32_t i = 0; i < planes; ++i) all = std::min(all, below[i] + above[planes - 1 - i]);
      if (planes < KdTreelet::kPlanes) costs[planes] = all;
    }
    costs[0] += all;
    for (float& cost : costs) cost = std::min(cost, costs[0]);
  }

  const KdTreeData& tree_;
  std::vector<Costs> cost_;
};

class Layout {
 public:
  Layout(const KdTreeData& tree, const mesh::TriangleMesh& mesh, KdLayout& out)
      : tree_(tree), mesh_(mesh), out_(out), packing_(tree), number_(mesh.triangle_count(), kInvalidId) {}

  void run() {
    out_.bounds = tree_.bounds;
    if (tree_.nodes.empty()) return;
    out_.treelets.reserve(tree_.nodes.size() / 8 + 1);
    out_.blocks.reserve(tree_.references.size() / 3 + 1);
    out_.triangles.reserve(mesh_.triangle_count());
    out_.treelets.emplace_back();
    pending_.push_back({.treelet = 0, .part = {.node = 0, .cell = tree_.bounds}});
    while (!pending_.empty()) {
      const Pending next = pending_.back();
      pending_.pop_back();
      if (next.range)
        fill_pile(next.treelet, *next.range);
      else
        fill(next.treelet, next.part);
    }
  }

 private:
  struct Range {
    std::uint32_t first, count;
  };
  /// A treelet to fill: from a part, or with the references of a leaf too large for a slot.
  struct Pending {
    std::uint32_t treelet;
    Part part;
    std::optional<Range> range = std::nullopt;
  };

  /// The parts of a treelet as they arise.
  struct Parts {
    KdTreelet treelet = empty_treelet();
    std::uint32_t planes = 0;
    std::uint32_t count = 0;
    std::uint32_t spare = KdTreelet::kSlots - 1;  ///< slots that no part under way needs
    Part parts[KdTreelet::kSlots];
  };

  void fill(std::uint32_t index, const Part& root) {
    Parts parts;
    expand(parts, {.node = root.node, .cell = root.cell}, KdTreelet::kPlanes);
    write(index, parts);
  }

  /// Adds `part` or, where `planes` allow, its children.
  void expand(Parts& out, const Part& part, std::uint32_t planes) const {
    const KdNode& node = tree_.nodes[part.node];
    if (node.is_leaf()) {
      if (node.count() != 0) out.parts[out.count++] = part;
      return;
    }
    const std::optional<std::uint32_t> share = packing_.share_of_below(part.node, planes);
    const int axis = node.axis();
    const bool sides_full = part.side_count() == KdTreelet::kSides &&
                            (part.sides[0][axis] == Part::kNone || part.sides[1][axis] == Part::kNone);
    const bool two_slots = !is_empty(part.node + 1) && !is_empty(node.second_child());
    const bool is_root = part.side_count() == 0;
    if (!is_root && (!share || sides_full || (two_slots && out.spare == 0))) {
      out.parts[out.count++] = part;
      return;
    }
    out.spare -= std::uint32_t(two_slots);
    out.treelet.planes[out.planes] = node.plane();
    out.treelet.axes = std::uint16_t(out.treelet.axes | (axis << (2 * out.planes)));
    Part below = part;
    Part above = part;
    below.node = part.node + 1;
    above.node = node.second_child();
    below.cell.upper[axis] = above.cell.lower[axis] = node.plane();
    below.sides[1][axis] = above.sides[0][axis] = std::uint8_t(out.planes++);
    expand(out, below, share.value_or(0));
    expand(out, above, planes - 1 - share.value_or(0));
  }

  static KdTreelet empty_treelet() {
    KdTreelet treelet{};
    for (float& plane : treelet.planes) plane = std::numeric_limits<float>::infinity();
    return treelet;
  }

  [[nodiscard]] bool is_empty(std::uint32_t node) const {
    return tree_.nodes[node].is_leaf() && tree_.nodes[node].count() == 0;
  }

  void write(std::uint32_t index, const Parts& parts) {
    KdTreelet treelet = parts.treelet;
    treelet.first_block = std::uint32_t(out_.blocks.size());
    treelet.first_treelet = std::uint32_t(out_.treelets.size());
    std::uint32_t children = 0;
    for (std::uint32_t slot = 0; slot < parts.count; ++slot) {
      const KdNode& node = tree_.nodes[parts.parts[slot].node];
      treelet.path[slot] = parts.parts[slot].path();
      treelet.used = std::uint8_t(treelet.used | (1U << slot));
      if (node.is_leaf() && node.count() <= kMaxLeaf) {
        add_blocks(treelet, slot, {node.first(), node.count()});
        continue;
      }
      treelet.inner = std::uint8_t(treelet.inner | (1U << slot));
      Pending& next = pending_.emplace_back(Pending{treelet.first_treelet + children++, parts.parts[slot]});
      if (node.is_leaf()) next.range = Range{node.first(), node.count()};
    }
    out_.treelets.resize(out_.treelets.size() + children);
    out_.treelets[index] = treelet;
  }

  /// A treelet without planes whose slots share the references of one cell.
  void fill_pile(std::uint32_t index, const Range& range) {
    KdTreelet treelet = empty_treelet();
    treelet.first_block = std::uint32_t(out_.blocks.size());
    treelet.first_treelet = std::uint32_t(out_.treelets.size());
    const std::uint32_t part = std::max(kMaxLeaf, (range.count + kSlots - 1) / kSlots);
    std::uint32_t children = 0, slot = 0;
    for (std::uint32_t begin = 0; begin < range.count; begin += part, ++slot) {
      const Range piece{range.first + begin, std::min(part, range.count - begin)};
      treelet.used = std::uint8_t(treelet.used | (1U << slot));
      if (piece.count <= kMaxLeaf) {
        add_blocks(treelet, slot, piece);
        continue;
      }
      treelet.inner = std::uint8_t(treelet.inner | (1U << slot));
      pending_.push_back({treelet.first_treelet + children++, {}, piece});
    }
    out_.treelets.resize(out_.treelets.size() + children);
    out_.treelets[index] = treelet;
  }

  void add_blocks(KdTreelet& treelet, std::uint32_t slot, const Range& range) {
    const std::uint32_t blocks = (range.count + kBlockSize - 1) / kBlockSize;
    treelet.block_counts |= blocks << (4 * slot);
    for (std::uint32_t begin = 0; begin < range.count; begin += kBlockSize) {
      KdBlock& block = out_.blocks.emplace_back();
      for (std::uint32_t lane = 0; lane < kBlockSize; ++lane)
        block.triangles[lane] =
            number_of(tree_.references[range.first + std::min(begin + lane, range.count - 1)]);
    }
  }

  std::uint32_t number_of(std::uint32_t id) {
    if (number_[id] != kInvalidId) return number_[id];
    KdTriangle& triangle = out_.triangles.emplace_back();
    const auto corners = mesh_.corners(id);
    for (std::size_t i = 0; i < 9; ++i) triangle.corners[i] = corners[i / 3][int(i % 3)];
    triangle.id = id;
    number_[id] = std::uint32_t(out_.triangles.size() - 1);
    return number_[id];
  }

  const KdTreeData& tree_;
  const mesh::TriangleMesh& mesh_;
  KdLayout& out_;
  Packing packing_;
  std::vector<std::uint32_t> number_;  ///< of each triangle in out_.triangles
  std::vector<Pending> pending_;
};

}  // namespace

KdLayout lay_out(const KdTreeData& tree, const mesh::TriangleMesh& mesh) {
  KdLayout layout;
  Layout(tree, mesh, layout).run();
  return layout;
}

}  // namespace gridcast::blas
