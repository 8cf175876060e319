#include <algorithm>
#include <atomic>
#include <new>

#include <tbb/enumerable_thread_specific.h>

#include "core/blas/point_sink.h"
#include "core/mesh/crossing.h"
#include "core/scene/batch_loop.h"
#include "core/scene/crossing_count.h"
#include "core/scene/points.h"

namespace gridcast::scene {
namespace {

constexpr std::size_t kPointsPerBlock = 256;

/// Where the ray of a point goes, in object space: any direction would do. Few bits, so that products are
/// short, and along no plane that models like.
constexpr Vec3d kDirection{0.40625, 0.28125, 1.0};

/// Whether the point lies on a triangle.
class BoundarySink final : public blas::PointSink {
 public:
  BoundarySink(const mesh::TriangleMesh& mesh, const Vec3d& point) : PointSink(point, 0.0), mesh_(mesh) {}

  void offer(std::uint32_t primitive_id) override {
    if (found_) return;
    const auto [p0, p1, p2] = mesh_.corners(primitive_id);
    found_ = mesh::lies_on(center(), Vec3d(p0), Vec3d(p1), Vec3d(p2));
  }
  [[nodiscard]] bool found() const { return found_; }

 private:
  const mesh::TriangleMesh& mesh_;
  bool found_ = false;
};

struct Row {
  std::uint32_t instance_id;
  std::int32_t winding;
  bool on_boundary;
};

/// What is found about the points of a block.
struct BlockRows {
  std::vector<Row> rows;
  std::vector<std::uint32_t> open_meshes;  ///< ascending, each once

  void add_open(std::uint32_t mesh_id) {
    const auto place = std::lower_bound(open_meshes.begin(), open_meshes.end(), mesh_id);
    if (place == open_meshes.end() || *place != mesh_id) open_meshes.insert(place, mesh_id);
  }
};

std::int32_t winding_of(const blas::Blas& blas, const Vec3d& point, CrossingCount& counter) {
  mesh::ObjectRay ray;
  const Ray upward{point, kDirection};
  if (!ray.prepare(upward, blas.bounds())) return 0;
  counter.start(upward.tfar);
  counter.enter(blas.mesh());
  blas.intersect_every<Precision::kRobust>(ray, counter);
  counter.leave();
  return counter.winding();
}

PointPlace place_of(const Scene& scene, const Vec3d& point, InstanceMask mask, CrossingCount& counter,
                    BlockRows& block) {
  PointPlace place = PointPlace::kOutside;
  const std::size_t first = block.rows.size();
  bool inside = false, on_boundary = false, unknown = false;
  scene.top_level().search(point, 0.0, [&](std::uint32_t id) {
    const Instance instance = scene.instance(id);
    if (!instance.seen_by(mask)) return 0.0;
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    const Vec3d object_point = instance.transform.point_to_object(point);
    if (!to_double(blas.bounds()).contains(object_point)) return 0.0;
    BoundarySink boundary(blas.mesh(), object_point);
    blas.search(boundary);
    if (boundary.found()) {
      on_boundary = true;
      block.rows.push_back({id, 0, true});
    } else if (!blas.has_inside()) {
      unknown = true;
      block.add_open(instance.mesh_id);
    } else if (const std::int32_t winding = winding_of(blas, object_point, counter); winding != 0) {
      inside = true;
      block.rows.push_back({id, winding, false});
    }
    return 0.0;
  });
  std::sort(block.rows.begin() + std::ptrdiff_t(first), block.rows.end(),
            [](const Row& a, const Row& b) { return a.instance_id < b.instance_id; });
  if (unknown) place = PointPlace::kUnknown;
  if (inside) place = PointPlace::kInside;
  if (on_boundary) place = PointPlace::kOnBoundary;
  return place;
}

void fill_rows(const Scene& scene, const std::vector<BlockRows>& blocks, InsideColumns& out) {
  for (std::size_t i = 0; i + 1 < out.splits.size(); ++i) out.splits[i + 1] += out.splits[i];
  for (const BlockRows& block : blocks) {
    for (const Row& row : block.rows) {
      out.instance_id.push_back(row.instance_id);
      out.mesh_id.push_back(scene.instance(row.instance_id).mesh_id);
      out.winding.push_back(row.winding);
      out.on_boundary.push_back(std::uint8_t(row.on_boundary));
    }
    out.open_meshes.insert(out.open_meshes.end(), block.open_meshes.begin(), block.open_meshes.end());
  }
  std::sort(out.open_meshes.begin(), out.open_meshes.end());
  out.open_meshes.erase(std::unique(out.open_meshes.begin(), out.open_meshes.end()), out.open_meshes.end());
}

}  // namespace

Result<InsideColumns> points_inside(const Scene& scene, const PointBatch& points,
                                    const InsideOptions& options) try {
  InsideColumns out;
  out.place.assign(points.size(), PointPlace::kOutside);
  out.splits.assign(points.size() + 1, 0);
  std::vector<BlockRows> blocks((points.size() + kPointsPerBlock - 1) / kPointsPerBlock);
  std::atomic<std::uint64_t> total = 0;
  tbb::enumerable_thread_specific<CrossingCount> counters;
  const bool whole = for_each_in_blocks(
      points.size(), kPointsPerBlock, options.stop, options.progress, [&](std::size_t i, std::size_t b) {
        const Vec3d point = points[i];
        if (!is_valid_point(point)) {
          out.place[i] = PointPlace::kInvalid;
          return true;
        }
        const std::size_t before = blocks[b].rows.size();
        out.place[i] = place_of(scene, point, options.mask, counters.local(), blocks[b]);
        out.splits[i + 1] = blocks[b].rows.size() - before;
        return (total += out.splits[i + 1]) <= options.max_total_rows;
      });
  if (!whole) {
    if (options.stop.stop_requested()) return Error{ErrorCode::kCancelled, "the search was cancelled", ""};
    return Error{ErrorCode::kLimitExceeded,
                 "more than " + std::to_string(options.max_total_rows) +
                     " instances around the points of one answer; send fewer points at a time",
                 ""};
  }
  fill_rows(scene, blocks, out);
  return out;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

}  // namespace gridcast::scene
