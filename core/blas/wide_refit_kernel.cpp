// The refit of parts of a wide tree, on vectors of four floats: it waits for memory, not for arithmetic.
// Minimum, maximum and sums in double are the same bits on every processor.

#include "core/blas/wide_refit_kernel.h"

#include <cstring>

#if defined(__SSE__)
#include <immintrin.h>
#endif

#include "core/blas/vertex_rows.h"
#include "core/blas/wide_cost.h"

namespace gridcast::blas {
namespace {

Float4 load(const float* from) {
  Float4 values;
  std::memcpy(&values, from, sizeof values);
  return values;
}

template <RefitStores kStores>
void store(Float4 values, float* to) {
#if defined(__SSE__)
  if constexpr (kStores == RefitStores::kStreaming) return _mm_stream_ps(to, values);
#endif
  std::memcpy(to, &values, sizeof values);
}

/// What was streamed is seen by all before anything that is stored later.
void finish_streaming() {
#if defined(__SSE__)
  _mm_sfence();
#endif
}

/// The least or largest of the lanes of each column, as a row.
template <class Pick>
Float4 across_lanes(const Columns& c, const Pick& pick) {
  const Float4 xy =
      pick(__builtin_shufflevector(c.x, c.y, 0, 4, 1, 5), __builtin_shufflevector(c.x, c.y, 2, 6, 3, 7));
  const Float4 zz = pick(c.z, __builtin_shufflevector(c.z, c.z, 2, 3, 2, 3));
  return pick(__builtin_shufflevector(xy, zz, 0, 1, 4, 4), __builtin_shufflevector(xy, zz, 2, 3, 5, 5));
}

/// Loads the corners of blocks, stores them and joins their boxes.
template <RefitStores kStores>
class LeafWriter {
 public:
  explicit LeafWriter(const RefitJob& job) : job_(job) {}

  Box4 write(std::uint32_t link) {
    lower_.x = lower_.y = lower_.z = Box4{}.lower;
    upper_.x = upper_.y = upper_.z = Box4{}.upper;
    const std::size_t first = wide_child::index(link), end = first + wide_child::block_count(link);
    for (std::size_t i = first; i < end; ++i) {
      const BlockCorners& corners = job_.corners[i];
      if ((corners.ids[3] & BlockCorners::kLoadSingly) == 0) [[likely]] {
        write_block(corners, job_.blocks[i], [&](std::uint32_t v) { return load(&job_.positions[v].x); });
      } else {
        write_block(corners, job_.blocks[i], [&](std::uint32_t v) {
          const Vec3f& p = job_.positions[v];
          return Float4{p.x, p.y, p.z, 0.F};
        });
      }
    }
    return {across_lanes(lower_, [](Float4 a, Float4 b) { return min(a, b); }),
            across_lanes(upper_, [](Float4 a, Float4 b) { return max(a, b); })};
  }

 private:
  template <class Load>
  void write_block(const BlockCorners& corners, TriangleBlock& block, const Load& load_position) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t* v = corners.vertices[c];
      const Columns p =
          transposed(load_position(v[0]), load_position(v[1]), load_position(v[2]), load_position(v[3]));
      store<kStores>(p.x, block.corners[c][0]);
      store<kStores>(p.y, block.corners[c][1]);
      store<kStores>(p.z, block.corners[c][2]);
      // + 0: minimum and maximum of -0 and +0 would depend on their order.
      const Float4 zero = broadcast(0.F);
      const Float4 x = p.x + zero, y = p.y + zero, z = p.z + zero;
      lower_ = {min(x, lower_.x), min(y, lower_.y), min(z, lower_.z)};
      upper_ = {max(x, upper_.x), max(y, upper_.y), max(z, upper_.z)};
    }
    using Ids [[gnu::vector_size(16)]] = std::uint32_t;
    Ids ids;
    std::memcpy(&ids, corners.ids, sizeof ids);
    float* place = nullptr;
    void* raw = block.ids;
    place = static_cast<float*>(raw);
    store<kStores>(Float4(ids & ~BlockCorners::kLoadSingly), place);
  }

  const RefitJob& job_;
  Columns lower_, upper_;
};

/// Writes the boxes of a node's children as planes, and returns the box around them. `rows` beyond the slots
/// are overwritten.
template <RefitStores kStores>
Box4 write_node(const RefitJob& job, std::uint32_t index, Box4* rows, WideCostSum& cost) {
  const WideNode& links = job.links[index];
  WideNode& node = job.nodes[index];
  for (std::uint32_t slot = links.slots; slot < 8; ++slot) rows[slot] = Box4{};
  alignas(64) float planes[2][3][8];
  Box4 box;
  for (std::size_t half = 0; half < 8; half += 4) {
    const Box4* row = rows + half;
    for (std::size_t i = 0; i < 4; ++i) box.extend(row[i]);
    const Columns lower = transposed(row[0].lower, row[1].lower, row[2].lower, row[3].lower);
    const Columns upper = transposed(row[0].upper, row[1].upper, row[2].upper, row[3].upper);
    const Float4 columns[2][3] = {{lower.x, lower.y, lower.z}, {upper.x, upper.y, upper.z}};
    for (std::size_t side = 0; side < 2; ++side)
      for (std::size_t axis = 0; axis < 3; ++axis)
        std::memcpy(planes[side][axis] + half, &columns[side][axis], sizeof(Float4));
  }
  cost.add(planes, links.child, links.slots);
  for (std::size_t i = 0; i < 48; i += 4)
    store<kStores>(load(&planes[0][0][0] + i), &node.planes[0][0][0] + i);
  if (&links != &node) {
    std::memcpy(node.child, links.child, sizeof node.child);
    node.slots = links.slots;
    std::memcpy(node.unused, links.unused, sizeof node.unused);
  }
  return box;
}

PaddedBox padded(const Box4& box) {
  PaddedBox out;
  std::memcpy(out.lower, &box.lower, sizeof out.lower);
  std::memcpy(out.upper, &box.upper, sizeof out.upper);
  return out;
}

Box4 box4(const PaddedBox& box) {
  return {load(box.lower), load(box.upper)};
}

/// Leaves first to last, so that blocks are written in order; then nodes last to first, which is bottom up.
template <RefitStores kStores>
RefitResult subtree(const RefitJob& job, const WidePart& part) {
  Box4 boxes[kMaxPartNodes], leaves[kMaxPartNodes * 8];
  std::size_t leaf_count = 0;
  LeafWriter<kStores> writer(job);
  for (std::uint32_t i = part.begin; i < part.end; ++i) {
    const WideNode& links = job.links[i];
    for (std::uint32_t slot = 0; slot < links.slots; ++slot)
      if (wide_child::is_leaf(links.child[slot])) leaves[leaf_count++] = writer.write(links.child[slot]);
  }
  WideCostSum cost;
  for (std::uint32_t i = part.end; i-- > part.begin;) {
    const WideNode& links = job.links[i];
    Box4 rows[8];
    for (std::uint32_t slot = links.slots; slot-- > 0;) {
      const std::uint32_t link = links.child[slot];
      rows[slot] = wide_child::is_leaf(link) ? leaves[--leaf_count] : boxes[link - part.begin];
    }
    boxes[i - part.begin] = write_node<kStores>(job, i, rows, cost);
  }
  if (kStores == RefitStores::kStreaming) finish_streaming();
  return {padded(boxes[0]), cost.sum()};
}

}  // namespace

RefitResult refit_subtree(const RefitJob& job, const WidePart& part, RefitStores stores) {
  return stores == RefitStores::kStreaming ? subtree<RefitStores::kStreaming>(job, part)
                                           : subtree<RefitStores::kCached>(job, part);
}

RefitResult refit_node(const RefitJob& job, std::uint32_t node, const std::array<PaddedBox, 8>& children) {
  const WideNode& links = job.links[node];
  LeafWriter<RefitStores::kCached> writer(job);
  Box4 rows[8];
  for (std::uint32_t slot = 0; slot < links.slots; ++slot) {
    const std::uint32_t link = links.child[slot];
    rows[slot] = wide_child::is_leaf(link) ? writer.write(link) : box4(children[slot]);
  }
  WideCostSum cost;
  const Box4 box = write_node<RefitStores::kCached>(job, node, rows, cost);
  return {padded(box), cost.sum()};
}

}  // namespace gridcast::blas
