#include "core/measure/embree_yardstick.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include <dlfcn.h>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "core/blas/embree_tree.h"
#include "core/io/image.h"
#include "core/scene/flatten.h"

namespace gridcast::measure {
namespace {

enum class Coherence { kNone, kCoherent };

#if RTC_VERSION_MAJOR >= 4
/// What a query takes beside the ray.
struct Arguments {
  explicit Arguments(Coherence coherence) {
    rtcInitIntersectArguments(&intersect);
    rtcInitOccludedArguments(&occluded);
    if (coherence == Coherence::kCoherent) intersect.flags = occluded.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  }
  RTCIntersectArguments intersect;
  RTCOccludedArguments occluded;
};
void closest(RTCScene scene, Arguments& with, RTCRayHit& ray) {
  rtcIntersect1(scene, &ray, &with.intersect);
}
void any(RTCScene scene, Arguments& with, RTCRay& ray) {
  rtcOccluded1(scene, &ray, &with.occluded);
}
void closest(const int* valid, RTCScene scene, Arguments& with, RTCRayHit8& ray) {
  rtcIntersect8(valid, scene, &ray, &with.intersect);
}
void closest(const int* valid, RTCScene scene, Arguments& with, RTCRayHit16& ray) {
  rtcIntersect16(valid, scene, &ray, &with.intersect);
}
void any(const int* valid, RTCScene scene, Arguments& with, RTCRay8& ray) {
  rtcOccluded8(valid, scene, &ray, &with.occluded);
}
void any(const int* valid, RTCScene scene, Arguments& with, RTCRay16& ray) {
  rtcOccluded16(valid, scene, &ray, &with.occluded);
}
#else
struct Arguments {
  explicit Arguments(Coherence coherence) {
    rtcInitIntersectContext(&context);
    if (coherence == Coherence::kCoherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  }
  RTCIntersectContext context;
};
void closest(RTCScene scene, Arguments& with, RTCRayHit& ray) {
  rtcIntersect1(scene, &with.context, &ray);
}
void any(RTCScene scene, Arguments& with, RTCRay& ray) {
  rtcOccluded1(scene, &with.context, &ray);
}
void closest(const int* valid, RTCScene scene, Arguments& with, RTCRayHit8& ray) {
  rtcIntersect8(valid, scene, &with.context, &ray);
}
void closest(const int* valid, RTCScene scene, Arguments& with, RTCRayHit16& ray) {
  rtcIntersect16(valid, scene, &with.context, &ray);
}
void any(const int* valid, RTCScene scene, Arguments& with, RTCRay8& ray) {
  rtcOccluded8(valid, scene, &with.context, &ray);
}
void any(const int* valid, RTCScene scene, Arguments& with, RTCRay16& ray) {
  rtcOccluded16(valid, scene, &with.context, &ray);
}
#endif

using Row = std::array<float, 8>;
using Rows = std::span<const Row>;

RTCRay single_ray(const Row& row) {
  RTCRay ray{};
  ray.org_x = row[0], ray.org_y = row[1], ray.org_z = row[2], ray.tnear = row[3];
  ray.dir_x = row[4], ray.dir_y = row[5], ray.dir_z = row[6], ray.tfar = row[7];
  ray.mask = ~0U;
  return ray;
}

void trace_single(RTCScene scene, Rows rows, std::size_t begin, std::size_t end, QueryKind query,
                  EmbreeAnswers& answers) {
  Arguments arguments(Coherence::kNone);
  for (std::size_t i = begin; i < end; ++i) {
    if (query == QueryKind::kAny) {
      RTCRay ray = single_ray(rows[i]);
      any(scene, arguments, ray);
      answers.hit[i] = ray.tfar < 0.F ? 1 : 0;
      continue;
    }
    RTCRayHit ray;
    ray.ray = single_ray(rows[i]);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    closest(scene, arguments, ray);
    const bool hit = ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    answers.hit[i] = hit ? 1 : 0;
    answers.t[i] = ray.ray.tfar;
    if (!hit) continue;
    answers.uv[2 * i] = ray.hit.u;
    answers.uv[2 * i + 1] = ray.hit.v;
    answers.normal[3 * i] = ray.hit.Ng_x;
    answers.normal[3 * i + 1] = ray.hit.Ng_y;
    answers.normal[3 * i + 2] = ray.hit.Ng_z;
    answers.primitive_id[i] = ray.hit.primID;
    answers.instance_id[i] = ray.hit.instID[0];
  }
}

template <class Rays>
void load_rays(Rays& rays, int* valid, Rows rows, std::size_t begin, std::size_t end, std::size_t width) {
  for (std::size_t lane = 0; lane < width; ++lane) {
    // Lanes beyond the end repeat the last ray and are masked out.
    const Row& row = rows[std::min(begin + lane, end - 1)];
    valid[lane] = begin + lane < end ? -1 : 0;
    rays.org_x[lane] = row[0], rays.org_y[lane] = row[1], rays.org_z[lane] = row[2],
    rays.tnear[lane] = row[3];
    rays.dir_x[lane] = row[4], rays.dir_y[lane] = row[5], rays.dir_z[lane] = row[6], rays.tfar[lane] = row[7];
    rays.time[lane] = 0.F, rays.mask[lane] = ~0U, rays.id[lane] = 0U, rays.flags[lane] = 0U;
  }
}

template <class RayHits>
void store_hits(const RayHits& rays, std::size_t begin, std::size_t count, EmbreeAnswers& answers) {
  for (std::size_t lane = 0; lane < count; ++lane) {
    const std::size_t i = begin + lane;
    const bool hit = rays.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID;
    answers.hit[i] = hit ? 1 : 0;
    answers.t[i] = rays.ray.tfar[lane];
    if (!hit) continue;
    answers.uv[2 * i] = rays.hit.u[lane];
    answers.uv[2 * i + 1] = rays.hit.v[lane];
    answers.normal[3 * i] = rays.hit.Ng_x[lane];
    answers.normal[3 * i + 1] = rays.hit.Ng_y[lane];
    answers.normal[3 * i + 2] = rays.hit.Ng_z[lane];
    answers.primitive_id[i] = rays.hit.primID[lane];
    answers.instance_id[i] = rays.hit.instID[0][lane];
  }
}

template <class RayHits, std::size_t kWidth>
void trace_packets(RTCScene scene, Rows rows, std::size_t begin, std::size_t end, QueryKind query,
                   Coherence coherence, EmbreeAnswers& answers) {
  Arguments arguments(coherence);
  alignas(64) int valid[kWidth];
  alignas(64) RayHits rays;
  for (std::size_t at = begin; at < end; at += kWidth) {
    const std::size_t count = std::min(kWidth, end - at);
    load_rays(rays.ray, valid, rows, at, end, kWidth);
    if (query == QueryKind::kAny) {
      any(valid, scene, arguments, rays.ray);
      for (std::size_t lane = 0; lane < count; ++lane)
        answers.hit[at + lane] = rays.ray.tfar[lane] < 0.F ? 1 : 0;
      continue;
    }
    std::fill_n(rays.hit.geomID, kWidth, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(rays.hit.instID[0], kWidth, RTC_INVALID_GEOMETRY_ID);
    closest(valid, scene, arguments, rays);
    store_hits(rays, at, count, answers);
  }
}

RTCBuildQuality to_embree(EmbreeQuality quality) {
  if (quality == EmbreeQuality::kLow) return RTC_BUILD_QUALITY_LOW;
  return quality == EmbreeQuality::kMedium ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
}

std::array<float, 12> to_embree(const Affine& affine) {
  std::array<float, 12> columns;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) columns[std::size_t(c) * 3 + std::size_t(r)] = float(affine.linear[c][r]);
  for (int r = 0; r < 3; ++r) columns[9 + std::size_t(r)] = float(affine.translation[r]);
  return columns;
}

bool on_memory(void* count, ssize_t bytes, bool /*after*/) {
  static_cast<std::atomic<std::int64_t>*>(count)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

bool on_progress(void* stop, double /*fraction*/) {
  return !static_cast<const std::stop_token*>(stop)->stop_requested();
}

/// Error: kCancelled; others are the device's.
Status commit(RTCScene scene, std::stop_token stop) {
  rtcSetSceneProgressMonitorFunction(scene, on_progress, &stop);
  blas::commit_embree_scene(scene);
  rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the building was stopped", ""};
  return ok_status();
}

/// Debian builds Embree without -DNDEBUG: then its code names the C library's assertion handler.
std::string assertions_of_library() {
  Dl_info where;
  if (dladdr(reinterpret_cast<const void*>(&rtcNewDevice), &where) == 0) return "unknown";
  const auto bytes = io::read_file(where.dli_fname, std::size_t(1) << 30);
  if (!bytes) return "unknown";
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  return text.find("__assert_fail") == std::string_view::npos ? "no" : "yes";
}

}  // namespace

std::string_view to_string(EmbreeQuality quality) {
  if (quality == EmbreeQuality::kLow) return "low";
  return quality == EmbreeQuality::kMedium ? "medium" : "high";
}

std::string_view to_string(EmbreeMode mode) {
  return mode == EmbreeMode::kDefault ? "default" : "robust";
}

std::string_view to_string(EmbreeEntry entry) {
  constexpr std::array<std::string_view, 4> kNames{"single", "packet8", "packet16", "packet16_coherent"};
  return kNames[std::size_t(entry)];
}

EmbreeInfo embree_info() {
  EmbreeInfo info{{}, RTC_VERSION_STRING, {}, assertions_of_library()};
  RTCDevice device = rtcNewDevice(blas::embree_device_config());
  if (device == nullptr) return info;
  const auto property = [&](RTCDeviceProperty which) { return rtcGetDeviceProperty(device, which); };
  const auto version = property(RTC_DEVICE_PROPERTY_VERSION);
  info.version = std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
                 std::to_string(version % 100);
  const auto tasking = property(RTC_DEVICE_PROPERTY_TASKING_SYSTEM);
  info.tasking = tasking == 0 ? "internal" : tasking == 1 ? "tbb" : "ppl";
  info.native_packet8 = property(RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  info.native_packet16 = property(RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  rtcReleaseDevice(device);
  return info;
}

struct EmbreeScene::State {
  std::atomic<std::int64_t> memory_bytes = 0;
  std::int64_t mesh_memory_bytes = 0;
  EmbreeOptions options;
  RTCDevice device = nullptr;
  RTCScene top = nullptr;
  std::vector<RTCScene> meshes;          ///< instanced scenes; empty for a single mesh
  std::vector<std::vector<Vec3f>> lent;  ///< vertices with room behind: Embree reads 16 bytes a vertex
  std::vector<std::shared_ptr<const mesh::TriangleMesh>> sources;

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (top != nullptr) rtcReleaseScene(top);
    for (RTCScene scene : meshes) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  [[nodiscard]] Status check() const {
    const RTCError code = rtcGetDeviceError(device);
    if (code == RTC_ERROR_NONE) return ok_status();
    return Error{code == RTC_ERROR_OUT_OF_MEMORY ? ErrorCode::kLimitExceeded : ErrorCode::kInternal,
                 "Embree failed with error " + std::to_string(int(code)),
                 {}};
  }

  [[nodiscard]] RTCScene new_scene() const {
    RTCScene scene = rtcNewScene(device);
    int flags = RTC_SCENE_FLAG_NONE;
    if (options.mode == EmbreeMode::kRobust) flags |= RTC_SCENE_FLAG_ROBUST;
    if (options.memory == EmbreeMemory::kCompact) flags |= RTC_SCENE_FLAG_COMPACT;
    if (options.use == EmbreeUse::kDynamic) flags |= RTC_SCENE_FLAG_DYNAMIC;
    rtcSetSceneFlags(scene, RTCSceneFlags(flags));
    rtcSetSceneBuildQuality(scene, to_embree(options.quality));
    return scene;
  }

  void attach_mesh(RTCScene scene, const std::shared_ptr<const mesh::TriangleMesh>& mesh) {
    std::vector<Vec3f>& vertices = lent.emplace_back();
    vertices.reserve(mesh->positions.size() + 2);
    vertices = mesh->positions;
    sources.push_back(mesh);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices.data(), 0,
                               sizeof(Vec3f), vertices.size());
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->triangles.data(),
                               0, sizeof(mesh::Triangle), mesh->triangles.size());
    rtcSetGeometryBuildQuality(geometry, to_embree(options.quality));
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, 0);
    rtcReleaseGeometry(geometry);
  }

  Status attach_instances(const scene::SceneData& data, const std::stop_token& stop) {
    for (const auto& mesh : data.meshes) {
      meshes.push_back(new_scene());
      attach_mesh(meshes.back(), mesh);
      if (Status status = commit(meshes.back(), stop); !status) return status;
    }
    mesh_memory_bytes = memory_bytes;
    for (std::size_t i = 0; i < data.instances.size(); ++i) {
      const scene::InstanceData& instance = data.instances[i];
      if (!InstanceTransform(instance.world_from_object).active()) continue;
      RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(geometry, meshes[instance.mesh_id]);
      rtcSetGeometryTimeStepCount(geometry, 1);
      set_transform(geometry, instance.world_from_object);
      rtcAttachGeometryByID(top, geometry, unsigned(i));
      rtcReleaseGeometry(geometry);
    }
    return ok_status();
  }

  static void set_transform(RTCGeometry geometry, const Affine& world_from_object) {
    const auto columns = to_embree(world_from_object);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.data());
    rtcCommitGeometry(geometry);
  }
};

EmbreeScene::EmbreeScene() : state_(std::make_unique<State>()) {}
EmbreeScene::~EmbreeScene() = default;

Result<std::unique_ptr<EmbreeScene>> EmbreeScene::build(const scene::SceneData& data,
                                                        const EmbreeOptions& options,
                                                        const std::stop_token& stop) {
  if (!scene::is_flat(data))
    return Error{ErrorCode::kUnsupported, "Embree is given meshes as they are: flatten the scene", {}};
  auto made = std::make_unique<EmbreeScene>();
  State& state = *made->state_;
  state.options = options;
  state.device = rtcNewDevice(blas::embree_device_config());
  if (state.device == nullptr)
    return Error{ErrorCode::kUnsupported, "Embree does not run on this processor", {}};
  rtcSetDeviceMemoryMonitorFunction(state.device, on_memory, &state.memory_bytes);
  state.top = state.new_scene();
  if (is_single_mesh(data))
    state.attach_mesh(state.top, data.meshes[data.instances[0].mesh_id]);
  else if (Status status = state.attach_instances(data, stop); !status)
    return status.error();
  if (Status status = commit(state.top, stop); !status) return status.error();
  if (Status status = state.check(); !status) return status.error();
  return made;
}

void EmbreeScene::trace(Rows rows, std::size_t begin, std::size_t end, QueryKind query, EmbreeEntry entry,
                        EmbreeAnswers& answers) const {
  switch (entry) {
    case EmbreeEntry::kSingle:
      return trace_single(state_->top, rows, begin, end, query, answers);
    case EmbreeEntry::kPacket8:
      return trace_packets<RTCRayHit8, 8>(state_->top, rows, begin, end, query, Coherence::kNone, answers);
    case EmbreeEntry::kPacket16:
      return trace_packets<RTCRayHit16, 16>(state_->top, rows, begin, end, query, Coherence::kNone, answers);
    case EmbreeEntry::kPacket16Coherent:
      return trace_packets<RTCRayHit16, 16>(state_->top, rows, begin, end, query, Coherence::kCoherent,
                                            answers);
  }
}

Status EmbreeScene::refit(std::span<const Vec3f> positions) {
  State& state = *state_;
  if (!state.meshes.empty() || state.lent.empty() || state.lent[0].size() != positions.size())
    return Error{ErrorCode::kInvalidArgument, "not a scene of one mesh with as many vertices", {}};
  std::copy(positions.begin(), positions.end(), state.lent[0].begin());
  RTCGeometry geometry = rtcGetGeometry(state.top, 0);
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
  rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(geometry);
  blas::commit_embree_scene(state.top);
  return state.check();
}

Status EmbreeScene::move_instances(std::span<const Move> moves) {
  for (const Move& move : moves)
    State::set_transform(rtcGetGeometry(state_->top, move.instance_id), move.world_from_object);
  blas::commit_embree_scene(state_->top);
  return state_->check();
}

std::size_t EmbreeScene::memory_bytes() const {
  return std::size_t(std::max<std::int64_t>(0, state_->memory_bytes));
}

std::size_t EmbreeScene::mesh_memory_bytes() const {
  return std::size_t(std::max<std::int64_t>(0, state_->mesh_memory_bytes));
}

}  // namespace gridcast::measure
