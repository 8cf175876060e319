#include "core/blas/embree_tree.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "core/math/instruction_set.h"

// Why no hit is lost. Let M be the mesh's largest coordinate. Embree gets the culling half of the ray, moved
// forward to where it enters the mesh's box (its integer comparisons need distances of at least 0), and
// boxes padded by 2^-16 M + 2^-90 on every side. Lengths below are along one axis.
//
//   a point of the ray at an accepted hit to its triangle's box, `fast` being the   2^-2 ray.pad
//     looser one (see ObjectRay::pad)
//   float origin at most 3 M away, float direction over 5 M, moved origin            2^-20 M
//   direction components below 1e-18 that Embree replaces by +1e-18, over 5 M       2^-56 M
//   Embree's plane distance plane * r - origin * r, with or without FMA, r the      2^-19.7 M
//     reciprocal to 2^-21: 2.1 M 2^-20.9 and the rounding of origin * r
//   rounding of the padded box to float                                             2^-24 M
//
// Embree ignores its ROBUST flag for user geometry, so none of this counts on it. With ray.pad <= 2^-15 M +
// 2^-90 the sum stays below the padding. A larger ray.pad means an origin more than about 2^28 M away, for
// which all triangles are tested. Coordinates end at 1e18, padding included below the 1.844e18 from which on
// Embree ignores primitives. No NaN can arise: origins, directions and planes are finite.
namespace gridcast::blas {
namespace {

constexpr double kBoxPad = 0x1p-16;
constexpr double kMaxRayPad = 0x1p-15;
constexpr double kPadFloor = 0x1p-90;

#if RTC_VERSION_MAJOR >= 4
using Context = RTCRayQueryContext;
#else
using Context = RTCIntersectContext;
#endif

/// What the callbacks need for one ray. Embree hands the pointer to `context` through.
struct Query {
  Context context;
  const mesh::TriangleMesh* mesh;
  const mesh::ObjectRay* ray;
  void* collector;
  double tfar;     ///< the collector's
  double s_start;  ///< s of the moved origin
  bool narrowed;   ///< by an offer, or ended
  Offer (*test)(Query& query, std::uint32_t primitive_id);

  /// tfar for Embree, rounded up.
  [[nodiscard]] float far() const {
    const double s = double(ray->cull_far(tfar)) - s_start;
    const auto nearest = float(s);
    return double(nearest) < s ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
  }
};

template <Precision kPrecision, Collector C>
Offer offer_triangle(Query& query, std::uint32_t primitive_id) {
  const auto [p0, p1, p2] = query.mesh->corners(primitive_id);
  auto& collector = *static_cast<C*>(query.collector);
  const Offer offer = test_triangle<kPrecision>(*query.ray, p0, p1, p2, primitive_id, collector);
  query.tfar = collector.tfar();
  query.narrowed |= offer != Offer::kGoOn;
  return offer;
}

/// For validate(): whether Embree leads the ray to the primitive that `collector` points to.
Offer is_wanted(Query& query, std::uint32_t primitive_id) {
  if (primitive_id != *static_cast<const std::uint32_t*>(query.collector)) return Offer::kGoOn;
  query.narrowed = true;
  return Offer::kDone;
}

constexpr float kEndsRay = -std::numeric_limits<float>::infinity();

void on_intersect(const RTCIntersectFunctionNArguments* args) {
  Query& query = *reinterpret_cast<Query*>(args->context);
  if (args->valid[0] == 0) return;
  const Offer offer = query.test(query, args->primID);
  if (offer == Offer::kGoOn) return;
  auto& ray_hit = *reinterpret_cast<RTCRayHit*>(args->rayhit);
  ray_hit.ray.tfar = offer == Offer::kDone ? kEndsRay : query.far();
  ray_hit.hit.geomID = args->geomID;
  ray_hit.hit.primID = args->primID;
}

void on_occluded(const RTCOccludedFunctionNArguments* args) {
  Query& query = *reinterpret_cast<Query*>(args->context);
  if (args->valid[0] == 0 || query.test(query, args->primID) != Offer::kDone) return;
  reinterpret_cast<RTCRay*>(args->ray)->tfar = kEndsRay;
}

/// Room for the rounding of float centres, boxes and squares, relative to the largest coordinate; the boxes
/// have their own pad on top.
constexpr double kPointSlack = 0x1p-20;
/// Beyond it Embree's squares come near the end of float.
constexpr double kMaxPoint = 1e18;

struct PointSearch {
  PointSink& sink;
  double slack;

  /// The radius for Embree, rounded up.
  [[nodiscard]] float radius() const {
    constexpr auto kInfinity = std::numeric_limits<float>::infinity();
    const double padded = sink.radius() * (1.0 + kPointSlack) + slack;
    return padded < double(std::numeric_limits<float>::max()) ? std::nextafter(float(padded), kInfinity)
                                                              : kInfinity;
  }
};

bool on_point(RTCPointQueryFunctionArguments* args) {
  const PointSearch& search = *static_cast<const PointSearch*>(args->userPtr);
  search.sink.offer(args->primID);
  const float radius = search.radius();
  if (!(radius < args->query->radius)) return false;
  args->query->radius = radius;
  return true;
}

struct BoundsData {
  const mesh::TriangleMesh* mesh;
  float pad;
};

void on_bounds(const RTCBoundsFunctionArguments* args) {
  const auto& data = *static_cast<const BoundsData*>(args->geometryUserPtr);
  const Bounds3f box = data.mesh->triangle_bounds(args->primID);
  RTCBounds& out = *args->bounds_o;
  out.lower_x = box.lower.x - data.pad;
  out.lower_y = box.lower.y - data.pad;
  out.lower_z = box.lower.z - data.pad;
  out.upper_x = box.upper.x + data.pad;
  out.upper_y = box.upper.y + data.pad;
  out.upper_z = box.upper.z + data.pad;
}

bool on_memory(void* counter, ssize_t bytes, bool /*after*/) {
  static_cast<std::atomic<std::int64_t>*>(counter)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

bool on_progress(void* stop, double /*fraction*/) {
  return !static_cast<const std::stop_token*>(stop)->stop_requested();
}

Error to_error(RTCError code) {
  switch (code) {
    case RTC_ERROR_CANCELLED:
      return {ErrorCode::kCancelled, "the build was cancelled", {}};
    case RTC_ERROR_OUT_OF_MEMORY:
      return {ErrorCode::kLimitExceeded, "not enough memory for this structure", {}};
    case RTC_ERROR_UNSUPPORTED_CPU:
      return {ErrorCode::kUnsupported, "Embree does not run on this processor", {}};
    default:
      return {ErrorCode::kInternal, "Embree failed with error " + std::to_string(int(code)), {}};
  }
}

}  // namespace

void commit_embree_scene(RTCSceneTy* scene) {
  static auto& context = *new tbb::task_group_context(tbb::task_group_context::isolated);
  tbb::parallel_for(
      0, 1, [scene](int) { rtcCommitScene(scene); }, tbb::simple_partitioner(), context);
}

const char* embree_device_config() {
  const std::string_view limit = instruction_set();
  if (limit == instruction_sets().front()) return nullptr;
  if (limit == "avx2") return "isa=avx2";
  if (limit == "sse4") return "isa=sse4.2";
  return "isa=sse2";
}

/// A device of its own per tree: made in about 50 us, and its memory monitor then counts this tree alone.
struct EmbreeTree::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::atomic<std::int64_t> memory_bytes = 0;
  std::size_t triangle_count = 0;
  Bounds3f bounds;
  float box_pad = 0.F;
  float max_ray_pad = 0.F;

  Scene() = default;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  Status open(const mesh::TriangleMesh& mesh) {
    triangle_count = mesh.triangle_count();
    bounds = mesh.bounds();
    if (triangle_count == 0) return ok_status();
    const auto magnitude = double(bounds.magnitude());
    box_pad = float(kBoxPad * magnitude + kPadFloor);
    max_ray_pad = float(kMaxRayPad * magnitude + kPadFloor);
    device = rtcNewDevice(embree_device_config());
    if (device == nullptr) return to_error(rtcGetDeviceError(nullptr));
    rtcSetDeviceMemoryMonitorFunction(device, on_memory, &memory_bytes);
    scene = rtcNewScene(device);
    return check();
  }

  Status commit(const mesh::TriangleMesh& mesh, std::stop_token stop) {
    BoundsData data{&mesh, box_pad};
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, unsigned(triangle_count));
    rtcSetGeometryUserData(geometry, &data);
    rtcSetGeometryBoundsFunction(geometry, on_bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, on_intersect);
    rtcSetGeometryOccludedFunction(geometry, on_occluded);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcSetSceneProgressMonitorFunction(scene, on_progress, &stop);
    // Embree flushes denormals on this thread while it builds, so no task of ours may run on it meanwhile.
    tbb::this_task_arena::isolate([this] { commit_embree_scene(scene); });
    rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
    rtcSetGeometryUserData(geometry, nullptr);
    if (stop.stop_requested()) return to_error(RTC_ERROR_CANCELLED);
    return check();
  }

  [[nodiscard]] Status check() const {
    const RTCError code = rtcGetDeviceError(device);
    return code == RTC_ERROR_NONE ? ok_status() : to_error(code);
  }

  /// True when an offer narrowed the range or ended the traversal.
  template <bool kStopsAtFirst>
  bool trace(Query& query) const {
    const mesh::ObjectRay& ray = *query.ray;
    float s_start;
    if (!mesh::intersect_box(ray, bounds.lower, bounds.upper, ray.cull_far(query.tfar), s_start))
      return false;
    query.s_start = double(s_start);
    const Vec3f origin(Vec3d(ray.cull_origin) + query.s_start * Vec3d(ray.cull_direction));
    RTCRayHit ray_hit;
    ray_hit.ray = {origin.x,
                   origin.y,
                   origin.z,
                   0.F,
                   ray.cull_direction.x,
                   ray.cull_direction.y,
                   ray.cull_direction.z,
                   0.F,
                   query.far(),
                   ~0U,
                   0U,
                   0U};
    ray_hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray_hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&query.context);
    if constexpr (kStopsAtFirst) {
      RTCOccludedArguments arguments;
      rtcInitOccludedArguments(&arguments);
      arguments.context = &query.context;
      rtcOccluded1(scene, &ray_hit.ray, &arguments);
    } else {
      RTCIntersectArguments arguments;
      rtcInitIntersectArguments(&arguments);
      arguments.context = &query.context;
      rtcIntersect1(scene, &ray_hit, &arguments);
    }
#else
    rtcInitIntersectContext(&query.context);
    if constexpr (kStopsAtFirst)
      rtcOccluded1(scene, &query.context, &ray_hit.ray);
    else
      rtcIntersect1(scene, &query.context, &ray_hit);
#endif
    return query.narrowed;
  }
};

EmbreeTree::EmbreeTree() : scene_(std::make_unique<Scene>()) {}
EmbreeTree::~EmbreeTree() = default;

Result<std::shared_ptr<const EmbreeTree>> EmbreeTree::build(const mesh::TriangleMesh& mesh,
                                                            std::stop_token stop) {
  auto made = std::make_shared<EmbreeTree>();
  Status status = made->scene_->open(mesh);
  if (status && made->scene_->scene != nullptr) status = made->scene_->commit(mesh, std::move(stop));
  if (!status) return status.error();
  return std::shared_ptr<const EmbreeTree>(std::move(made));
}

template <Precision kPrecision, Collector C>
bool EmbreeTree::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const {
  Query query{{}, &mesh, &ray, &collector, collector.tfar(), 0.0, false, offer_triangle<kPrecision, C>};
  if (ray.pad <= scene_->max_ray_pad)
    return scene_->scene != nullptr && scene_->trace<C::kStopsAtFirst>(query);
  for (std::uint32_t id = 0; id < scene_->triangle_count; ++id)
    if (query.test(query, id) == Offer::kDone) return true;
  return query.narrowed;
}

template bool EmbreeTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      ClosestHit&) const;
template bool EmbreeTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      AnyHit&) const;
template bool EmbreeTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      HitSink&) const;
template bool EmbreeTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        ClosestHit&) const;
template bool EmbreeTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        AnyHit&) const;
template bool EmbreeTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        HitSink&) const;
template bool EmbreeTree::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactClosest&) const;
template bool EmbreeTree::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactAny&) const;

void EmbreeTree::search(const mesh::TriangleMesh& /*mesh*/, PointSink& sink) const {
  if (scene_->scene == nullptr) return;
  const double size = max_abs(sink.center()) + double(scene_->bounds.magnitude());
  if (!(size <= kMaxPoint)) {
    for (std::uint32_t id = 0; id < scene_->triangle_count; ++id) sink.offer(id);
    return;
  }
  PointSearch search{sink, kPointSlack * size + kPadFloor};
  const Vec3f center(sink.center());
  RTCPointQuery query{center.x, center.y, center.z, 0.F, search.radius()};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene_->scene, &query, &context, on_point, &search);
}

Status EmbreeTree::validate(const mesh::TriangleMesh& mesh) const {
  if (mesh.triangle_count() != scene_->triangle_count) {
    return Error{ErrorCode::kInternal,
                 "built for " + std::to_string(scene_->triangle_count) + " triangles, the mesh has " +
                     std::to_string(mesh.triangle_count()),
                 "/triangles"};
  }
  if (scene_->scene == nullptr) return ok_status();
  RTCBounds box;
  rtcGetSceneBounds(scene_->scene, &box);
  const Bounds3f root{{box.lower_x, box.lower_y, box.lower_z}, {box.upper_x, box.upper_y, box.upper_z}};
  if (!root.contains(mesh.bounds()))
    return Error{ErrorCode::kInternal, "the root leaves out a vertex", "/nodes/0"};

  const std::size_t stride = (mesh.triangle_count() + kMaxProbes - 1) / kMaxProbes;
  for (std::size_t id = 0; id < mesh.triangle_count(); id += stride) {
    const auto [p0, p1, p2] = mesh.corners(std::uint32_t(id));
    const Ray probe{0.5 * Vec3d(p0) + 0.25 * Vec3d(p1) + 0.25 * Vec3d(p2), {0.0, 0.0, 1.0}, 0.0, 0.0};
    mesh::ObjectRay ray;
    auto wanted = std::uint32_t(id);
    Query query{{}, &mesh, &ray, &wanted, 0.0, 0.0, false, is_wanted};
    if (ray.prepare(probe, scene_->bounds) && scene_->trace<true>(query)) continue;
    return Error{ErrorCode::kInternal, "a ray that starts on the triangle is not led to it",
                 "/triangles/" + std::to_string(id)};
  }
  return ok_status();
}

void EmbreeTree::add_stats(StructureStats& stats) const {
  stats.reference_count = scene_->triangle_count;
  stats.memory_bytes =
      sizeof(EmbreeTree) + sizeof(Scene) + std::size_t(std::max<std::int64_t>(0, scene_->memory_bytes));
}

}  // namespace gridcast::blas
