#include "tests/digests/questions.h"

#include <array>
#include <cstddef>
#include <vector>

#include "core/render/render.h"
#include "core/scene/all_hits.h"
#include "core/scene/hit_error.h"
#include "core/scene/points.h"
#include "core/scene/spawn.h"
#include "core/scene/trace.h"
#include "core/scene/update.h"

namespace gridcast::digests {
namespace {

constexpr std::array kEvery{Precision::kFast, Precision::kRobust, Precision::kExact};
constexpr std::array kListed{Precision::kFast, Precision::kRobust};
/// Where there is no choice, or where one is enough.
constexpr std::array kOne{Precision::kRobust};

/// The rays of an input as a batch, in doubles.
class Rays {
 public:
  explicit Rays(const Input& input) : excluded_(input.excluded) {
    for (const Ray& ray : input.rays)
      for (const double number : {ray.origin.x, ray.origin.y, ray.origin.z, ray.tnear, ray.direction.x,
                                  ray.direction.y, ray.direction.z, ray.tfar})
        rows_.push_back(number);
  }
  [[nodiscard]] RayBatch batch() const {
    return {std::as_bytes(std::span(rows_)), ScalarType::kFloat64, 8, excluded_};
  }

 private:
  std::vector<double> rows_;
  std::span<const PrimitiveRef> excluded_;
};

void add(Digest& digest, const SurfaceHit& hit) {
  digest.add(hit.status);
  digest.add(hit.t);
  digest.add(hit.u);
  digest.add(hit.v);
  digest.add(hit.normal);
  digest.add(hit.instance_id);
  digest.add(hit.mesh_id);
  digest.add(hit.primitive_id);
  digest.add(hit.t_error);
}

void add(Digest& digest, const HitColumns& hits) {
  digest.add(hits.status);
  digest.add(hits.t);
  digest.add(hits.uv);
  digest.add(hits.normal);
  digest.add(hits.instance_id);
  digest.add(hits.mesh_id);
  digest.add(hits.primitive_id);
  digest.add(hits.t_error);
}

void closest(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  for (std::size_t i = 0; i < input.rays.size(); ++i) {
    SurfaceHit hit = scene::intersect(scene, input.rays[i], precision, input.excluded[i]);
    if (hit.status == RayStatus::kHit) hit.t_error = scene::t_error(scene, input.rays[i], hit);
    add(digest, hit);
  }
}

void closest_batch(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  scene::TraceOptions options;
  options.precision = precision;
  options.fields = HitField::kAll | HitField::kTError;
  add(digest, scene::intersect(scene, Rays(input).batch(), options).value());
}

void any(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  scene::TraceOptions options;
  options.precision = precision;
  digest.add(scene::occluded(scene, Rays(input).batch(), options).value());
  for (std::size_t i = 0; i < input.rays.size(); ++i)
    digest.add(scene::occluded(scene, input.rays[i], precision, input.excluded[i]));
}

void all_hits(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  scene::AllHitsOptions options;
  options.precision = precision;
  options.fields = HitField::kAll | HitField::kTError;
  options.max_hits = 24;
  const HitLists lists = scene::intersect_all(scene, Rays(input).batch(), options).value();
  digest.add(lists.status);
  digest.add(lists.splits);
  add(digest, lists.hits);
}

void counts(const scene::Scene& scene, const Input& input, Precision /*precision*/, Digest& digest) {
  const HitCounts counted = scene::count_hits(scene, Rays(input).batch(), {}).value();
  digest.add(counted.status);
  digest.add(counted.count);
  digest.add(counted.crossings);
  digest.add(counted.winding);
}

PointBatch points_of(const Input& input) {
  return {std::as_bytes(std::span(input.points)), ScalarType::kFloat64};
}

void nearest(const scene::Scene& scene, const Input& input, Precision /*precision*/, Digest& digest) {
  const NearestColumns found = scene::nearest_points(scene, points_of(input), {}).value();
  digest.add(found.status);
  digest.add(found.distance);
  digest.add(found.position);
  digest.add(found.uv);
  digest.add(found.instance_id);
  digest.add(found.mesh_id);
  digest.add(found.primitive_id);
}

void inside(const scene::Scene& scene, const Input& input, Precision /*precision*/, Digest& digest) {
  const InsideColumns found = scene::points_inside(scene, points_of(input), {}).value();
  digest.add(found.place);
  digest.add(found.splits);
  digest.add(found.instance_id);
  digest.add(found.mesh_id);
  digest.add(found.winding);
  digest.add(found.on_boundary);
  digest.add(found.open_meshes);
}

/// Where reflected rays start and what they meet, and where rays to the middle of the scene start.
void secondary(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  for (const Ray& ray : input.rays) {
    const SurfaceHit hit = scene::intersect(scene, ray, precision);
    if (hit.status != RayStatus::kHit) continue;
    const scene::SpawnPoint from(scene, hit);
    const Ray mirrored = from.ray(ray.direction - 2.0 * glm::dot(ray.direction, hit.normal) * hit.normal);
    digest.add(from.position());
    digest.add(mirrored.origin);
    digest.add(from.ray_to(input.bounds.center()).origin);
    add(digest, scene::intersect(scene, mirrored, precision));
  }
}

/// The same rays after an update: every mesh is deformed, which refits its tree or builds another, and the
/// first instance moves.
void updated(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  std::vector<scene::SceneEdit> edits;
  for (std::uint32_t mesh_id = 0; mesh_id < input.deformed.size(); ++mesh_id) {
    edits.emplace_back(scene::ReplaceVertices{mesh_id, input.deformed[mesh_id], {}});
    digest.add(input.deformed[mesh_id]);
  }
  Affine moved = input.data.instances[0].world_from_object;
  moved.translation += 0.01 * input.bounds.extent();
  edits.emplace_back(scene::MoveInstance{0, moved});
  closest_batch(*scene::apply_update(scene, edits).value().scene, input, precision, digest);
}

/// Without perspective, whose tangent belongs to the mathematical library.
void picture(const scene::Scene& scene, const Input& input, Precision precision, Digest& digest) {
  const Vec3d toward = glm::normalize(Vec3d(0.3, 0.4, 1.0)), right = glm::normalize(Vec3d(1.0, 0.0, -0.3));
  const double size = max_abs(input.bounds.extent());
  render::RenderSettings settings;
  settings.camera.kind = scene::CameraKind::kOrthographic;
  settings.camera.xmag = settings.camera.ymag = 0.6 * size;
  settings.camera.world_from_camera = {Mat3d(right, glm::cross(toward, right), toward),
                                       input.bounds.center() + 2.0 * size * toward};
  settings.width_px = settings.height_px = 16;
  settings.samples = 2;
  settings.precision = precision;
  settings.layers = {render::LayerKind::kDepth, render::LayerKind::kNormal, render::LayerKind::kPrimitiveId};
  const render::Film film = render::render(scene, settings).value();
  digest.add(film.exposure);
  for (const render::Layer& layer : film.layers) {
    digest.add(layer.values);
    digest.add(layer.ids);
  }
}

constexpr std::array<Question, 10> kQuestions{{{"closest", kEvery, closest},
                                               {"closest_batch", kEvery, closest_batch},
                                               {"any", kEvery, any},
                                               {"all_hits", kListed, all_hits},
                                               {"counts", kOne, counts},
                                               {"nearest", kOne, nearest},
                                               {"inside", kOne, inside},
                                               {"secondary", kOne, secondary},
                                               {"updated", kEvery, updated},
                                               {"picture", kOne, picture}}};

}  // namespace

std::span<const Question> all_questions() {
  return kQuestions;
}

}  // namespace gridcast::digests
