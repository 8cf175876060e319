#include "core/scene/ray_order.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace gridcast::scene {
namespace {

/// Below this a sort and the tasks around it cost more than they bring.
constexpr std::size_t kFewRays = 8192;

/// The look: this many places of the batch, this many neighbours at each.
constexpr std::size_t kPlaces = 64;
constexpr std::size_t kNeighbours = 4;

/// Neighbours this near, in parts of the scene's diagonal, go through much the same nodes.
constexpr double kNearOrigin = 0.02;
/// Difference of directions (scaled to a largest component of 1) between neighbours that suit a packet.
constexpr double kNearDirection = 0.04;
/// Rays that start within this part of the diagonal come from one camera.
constexpr double kOneOrigin = 0.001;
/// Rays in a stream hide what each of them waits for in the third-level cache. In a tree of up to so many
/// bytes they take 0.77 to 0.90 of the time in random order that they take sorted by origin (S1, S2, S5; 3.6
/// to 54 MB), in a larger one 1.1 (S3, 101 MB); S6, 26 MB, 1.03.
constexpr std::size_t kSmallTree = std::size_t(64) << 20;

struct Look {
  std::size_t pairs = 0;
  std::size_t near_origin = 0;
  std::size_t near_both = 0;
  Bounds3d origins;
  Bounds3d directions;
};

Vec3d unit(const Ray& ray) {
  return ray.direction / max_abs(ray.direction);
}

Look look_at(const RayBatch& rays, double diagonal) {
  Look look;
  const std::size_t stride = rays.size() / kPlaces;
  for (std::size_t place = 0; place < kPlaces; ++place) {
    Ray before = rays[place * stride];
    for (std::size_t i = 0; i <= kNeighbours; ++i) {
      const Ray ray = rays[place * stride + i];
      if (!is_valid(ray) || !is_valid(before)) continue;
      look.origins.extend(ray.origin);
      look.directions.extend(unit(ray));
      if (i != 0) {
        ++look.pairs;
        const bool near = max_abs(ray.origin - before.origin) <= kNearOrigin * diagonal;
        look.near_origin += std::size_t(near);
        look.near_both += std::size_t(near && max_abs(unit(ray) - unit(before)) <= kNearDirection);
      }
      before = ray;
    }
  }
  return look;
}

/// Interleaves the low eight bits of x and y.
std::uint32_t morton2(std::uint32_t x, std::uint32_t y) {
  const auto spread = [](std::uint32_t v) {
    v = (v | (v << 4)) & 0x0F0FU;
    v = (v | (v << 2)) & 0x3333U;
    return (v | (v << 1)) & 0x5555U;
  };
  return spread(x) | (spread(y) << 1);
}

/// Cells of a box; what lies outside counts to the nearest.
class Cells {
 public:
  Cells(const Bounds3d& box, std::array<int, 3> bits) : lower_(box.lower) {
    const Vec3d extent = glm::max(box.extent(), Vec3d(1e-300));
    for (int axis = 0; axis < 3; ++axis) {
      const auto count = double(1 << bits[std::size_t(axis)]);
      last_[axis] = count - 1.0;
      scale_[axis] = count / extent[axis];
    }
  }
  [[nodiscard]] std::uint32_t along(const Vec3d& p, int axis) const {
    const double cell = (p[axis] - lower_[axis]) * scale_[axis];
    return std::uint32_t(cell > 0.0 ? std::min(cell, last_[axis]) : 0.0);  // NaN counts to the first
  }

 private:
  Vec3d lower_, scale_{0.0}, last_{0.0};
};

/// 15 bits: where the ray starts, and below that to which of eight sides it goes. So what one place has in
/// the caches serves all sides, and packets are still of one side. The bits of the place halve the longest
/// side of its cell each, so that a flat slab is cut into squares.
class OriginKey {
 public:
  static constexpr std::uint32_t kCount = 1U << 15;
  explicit OriginKey(const Bounds3d& origins) : cells_(origins, share_bits(origins)) {}
  std::uint32_t operator()(const Ray& ray) const {
    const std::uint32_t octant = std::uint32_t(ray.direction.x < 0.0) |
                                 std::uint32_t(ray.direction.y < 0.0) << 1 |
                                 std::uint32_t(ray.direction.z < 0.0) << 2;
    return (bits_of_[0][cells_.along(ray.origin, 0)] | bits_of_[1][cells_.along(ray.origin, 1)] |
            bits_of_[2][cells_.along(ray.origin, 2)]) +
           octant;
  }

 private:
  static constexpr int kPlaceBits = 12;

  /// Fills bits_of_; returns how many bits each axis has.
  std::array<int, 3> share_bits(const Bounds3d& origins) {
    std::array<int, 3> shares{0, 0, 0};
    Vec3d cell = origins.extent();
    std::array<std::size_t, kPlaceBits> axis_of{};
    for (std::size_t& axis : axis_of) {  // from the highest bit down
      axis = cell.x >= cell.y ? (cell.x >= cell.z ? 0 : 2) : (cell.y >= cell.z ? 1 : 2);
      cell[int(axis)] *= 0.5;
      ++shares[axis];
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bits_of_[axis].resize(std::size_t(1) << shares[axis]);
      for (std::uint32_t i = 0; i < bits_of_[axis].size(); ++i)
        bits_of_[axis][i] = spread(i, shares[axis], axis_of, axis);
    }
    return shares;
  }

  /// The bits of cell i of an axis, in the places of a key that the axis has.
  static std::uint32_t spread(std::uint32_t i, int left, const std::array<std::size_t, kPlaceBits>& axis_of,
                              std::size_t axis) {
    std::uint32_t key = 0;
    for (const std::size_t owner : axis_of) {
      key <<= 1;
      if (owner == axis) key |= (i >> --left) & 1U;
    }
    return key << 3;
  }

  std::array<std::vector<std::uint32_t>, 3> bits_of_;  ///< set before cells_
  Cells cells_;
};

/// 17 bits: the direction, on the sides of a cube, or on the part of one side that holds them all.
class DirectionKey {
 public:
  static constexpr std::uint32_t kCount = 1U << 17;
  explicit DirectionKey(const Bounds3d& directions) : cells_(directions, {7, 7, 7}) {}
  std::uint32_t operator()(const Ray& ray) const {
    const Vec3d size = glm::abs(ray.direction);
    const int z = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    const Vec3d d = ray.direction * (1.0 / size[z]);
    const int x = z == 2 ? 0 : z + 1;
    const int y = x == 2 ? 0 : x + 1;
    const std::uint32_t side = std::uint32_t(2 * z) + std::uint32_t(d[z] < 0.0);
    return side << 14 | morton2(cells_.along(d, x), cells_.along(d, y));
  }

 private:
  Cells cells_;
};

/// Sorts by counting, stable and in parallel: a histogram for each block of rays, places from all of them.
template <class Key>
RayOrder counting_sort(RayOrderKind kind, const RayBatch& rays, const Key& key_of) {
  const std::size_t count = rays.size();
  const auto blocks = std::size_t(std::clamp(tbb::this_task_arena::max_concurrency(), 1, 16));
  const std::size_t per_block = (count + blocks - 1) / blocks;
  std::vector<std::uint32_t> keys(count);
  std::vector<std::uint32_t> places(blocks * Key::kCount, 0);
  const auto each_block = [&](const auto& body) {
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
      const std::size_t end = std::min(count, (block + 1) * per_block);
      std::uint32_t* place = &places[block * Key::kCount];
      for (std::size_t i = block * per_block; i < end; ++i) body(i, place);
    });
  };
  each_block([&](std::size_t i, std::uint32_t* place) {
    keys[i] = key_of(rays[i]);
    ++place[keys[i]];
  });
  std::uint32_t next = 0;
  for (std::size_t key = 0; key < Key::kCount; ++key) {
    for (std::size_t block = 0; block < blocks; ++block) {
      const std::uint32_t size = places[block * Key::kCount + key];
      places[block * Key::kCount + key] = next;
      next += size;
    }
  }
  RayOrder order{kind, std::vector<std::uint32_t>(count), std::move(keys)};
  each_block([&](std::size_t i, std::uint32_t* place) {
    order.places[i] = place[order.places[i]]++;  // the key before
    order.permutation[order.places[i]] = std::uint32_t(i);
  });
  return order;
}

/// Whether all rays go through one tree that the caches hold, or nearly.
bool is_small_tree(const Scene& scene) {
  const std::optional<std::uint32_t> sole = scene.top_level().sole_instance();
  if (!sole) return false;
  const blas::Blas& blas = scene.blas(scene.instance(*sole).mesh_id);
  return blas.wide_bvh() != nullptr && blas.stats().memory_bytes <= kSmallTree;
}

RayOrder decide(const Scene& scene, const RayBatch& rays, std::string& reason) {
  if (rays.size() < kFewRays) {
    reason = "few rays";
    return {};
  }
  const double diagonal = glm::length(scene.bounds().extent());
  const Look look = look_at(rays, diagonal);
  if (look.pairs == 0) {
    reason = "no valid ray seen";
    return {};
  }
  if (4 * look.near_both >= 3 * look.pairs) {
    reason = "neighbours go the same way";
    return {};
  }
  if (max_abs(look.origins.extent()) <= kOneOrigin * diagonal) {
    reason = "one origin, neighbours look elsewhere";
    return counting_sort(RayOrderKind::kByDirection, rays, DirectionKey(look.directions));
  }
  if (4 * look.near_origin >= 3 * look.pairs) {
    reason = "neighbours start near each other";
    return {};
  }
  if (is_small_tree(scene)) {
    reason = "neighbours start far apart, but the tree is small";
    return {};
  }
  reason = "neighbours start far apart";
  return counting_sort(RayOrderKind::kByOrigin, rays, OriginKey(look.origins));
}

}  // namespace

std::string_view to_string(RayOrderKind kind) {
  switch (kind) {
    case RayOrderKind::kByOrigin:
      return "by_origin";
    case RayOrderKind::kByDirection:
      return "by_direction";
    case RayOrderKind::kAsGiven:
      break;
  }
  return "as_given";
}

RayOrder choose_order(const Scene& scene, const RayBatch& rays, TraceStats& stats) {
  const auto start = std::chrono::steady_clock::now();
  RayOrder order = decide(scene, rays, stats.reason);
  stats.order = order.kind;
  stats.order_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return order;
}

}  // namespace gridcast::scene
