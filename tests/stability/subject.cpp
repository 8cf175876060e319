#include "tests/stability/subject.h"

#include <bit>
#include <cmath>
#include <iomanip>
#include <sstream>

#include <gtest/gtest.h>

namespace gridcast::stability {
namespace {

using blas::StructureKind;

/// Triangle tests that brute force may take for one block of rays.
constexpr std::uint64_t kBruteForceTests = 1'000'000;

std::shared_ptr<const scene::Scene> build(const scene::SceneData& data, StructureKind kind) {
  scene::SceneBuildOptions build_options;
  build_options.blas.kind = kind;
  auto built = scene::build_scene(data, build_options);
  if (built) return *built;
  if (built.error().code != ErrorCode::kUnsupported)
    ADD_FAILURE() << blas::to_string(kind) << ": " << built.error().message << " at " << built.error().where;
  return nullptr;
}

/// The scene and, after its instances, a few of a triangle without area, all over the place: they fill a grid
/// and are never hit.
scene::SceneData among_decoys(scene::SceneData data, const Bounds3d& bounds) {
  constexpr int kDecoys = 64;
  mesh::TriangleMesh decoy;
  decoy.positions = {{-1, -1, -1}, {1, 1, 1}};
  decoy.triangles = {{0, 1, 0}};
  const auto mesh_id = std::uint32_t(data.meshes.size());
  data.meshes.push_back(std::make_shared<const mesh::TriangleMesh>(std::move(decoy)));
  data.deformations.emplace_back();
  test::Random random(7);
  for (int i = 0; i < kDecoys; ++i) {
    const Affine where{Mat3d(0.1 * max_abs(bounds.extent())),
                       bounds.center() + bounds.extent() * random.in_box(0.6)};
    data.instances.push_back({{}, where, mesh_id});
  }
  return data;
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
bool same_bits(const Vec3d& a, const Vec3d& b) {
  return same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z);
}

/// Nothing in an answer is NaN or out of its range.
bool sane(const SurfaceHit& hit, const Ray& ray) {
  if (hit.status != RayStatus::kHit)
    return (hit.status == RayStatus::kMiss || hit.status == RayStatus::kInvalid) &&
           hit.primitive_id == kInvalidId;
  const bool weights = hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0 + 0x1p-20;
  return std::isfinite(hit.t) && hit.t >= ray.tnear && hit.t <= ray.tfar && weights &&
         std::abs(glm::length(hit.normal) - 1.0) < 1e-9;
}

bool as_expected(const SurfaceHit& hit, const Expectation& expected, Precision precision) {
  switch (expected.kind) {
    case Expectation::Kind::kAgreement:
      return true;
    case Expectation::Kind::kMiss:
      return hit.status == RayStatus::kMiss;
    case Expectation::Kind::kInvalid:
      return hit.status == RayStatus::kInvalid;
    case Expectation::Kind::kHit:
      break;
  }
  if (hit.status != RayStatus::kHit) return false;
  const bool near = std::isnan(expected.t) || std::abs(hit.t - expected.t) <= expected.slack;
  const PrimitiveRef got{hit.instance_id, hit.primitive_id};
  const bool named = expected.primitive == PrimitiveRef{} || got == expected.primitive;
  const bool may_tie = precision != Precision::kExact && !std::isnan(expected.t) && expected.slack > 0.0;
  return near && (named || may_tie);
}

std::string in_words(const Expectation& expected) {
  CaseFile file;
  file.shots.push_back({{}, {}, expected, {}});
  std::ostringstream text;
  write_case(text, file);
  return text.str().substr(text.str().rfind("expect "));
}

}  // namespace

std::string_view to_string(Precision precision) {
  return precision == Precision::kFast ? "fast" : precision == Precision::kExact ? "exact" : "robust";
}

bool same_bits(const SurfaceHit& a, const SurfaceHit& b) {
  return a.status == b.status && same_bits(a.t, b.t) && same_bits(a.u, b.u) && same_bits(a.v, b.v) &&
         same_bits(a.normal, b.normal) && a.instance_id == b.instance_id && a.mesh_id == b.mesh_id &&
         a.primitive_id == b.primitive_id;
}

std::string describe(const SurfaceHit& hit) {
  if (hit.status == RayStatus::kMiss) return "a miss";
  if (hit.status == RayStatus::kInvalid) return "invalid";
  std::ostringstream text;
  text << std::setprecision(17) << "instance " << hit.instance_id << " primitive " << hit.primitive_id
       << " at t " << hit.t << " u " << hit.u << " v " << hit.v;
  return text.str();
}

/// The questions of one call of ask().
class Subject::Asking {
 public:
  Asking(const Subject& subject, Row& row, std::span<const Shot> shots)
      : subject_(subject), row_(row), shots_(shots) {
    for (const auto& [ray, excluded, expected, exact] : shots) {
      for (int c = 0; c < 3; ++c) rows_.push_back(ray.origin[c]);
      rows_.push_back(ray.tnear);
      for (int c = 0; c < 3; ++c) rows_.push_back(ray.direction[c]);
      rows_.push_back(ray.tfar);
      excluded_.push_back(excluded);
    }
  }

  void one_by_one(const Structure& structure, Precision precision, std::size_t count,
                  std::vector<SurfaceHit>& hits) const {
    hits.resize(count);
    for (std::size_t i = 0; i < count; ++i)
      hits[i] = scene::intersect(*structure.scene, shots_[i].ray, precision, shots_[i].excluded);
  }

  /// Sane, and what was expected.
  void judge(Precision precision, const std::vector<SurfaceHit>& hits) {
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const Shot& shot = shots_[i];
      const Expectation& expected = shot.expected_of(precision);
      if (!sane(hits[i], shot.ray))
        report(i, std::string(to_string(precision)) + " answers " + describe(hits[i]));
      // Fast promises that hits lie near their triangle, not that there are any.
      const bool promised = precision != Precision::kFast || expected.kind == Expectation::Kind::kInvalid;
      if (promised && !as_expected(hits[i], expected, precision)) {
        report(i, std::string(to_string(precision)) + " answers " + describe(hits[i]) + ", not as " +
                      in_words(expected));
      }
    }
  }

  /// One batch door of one structure against what the shots expect.
  void sweep(const Structure& structure, Precision precision, std::size_t turn) {
    const std::size_t count = shots_.size();
    scene::TraceOptions trace;
    trace.precision = precision;
    std::vector<SurfaceHit> hits(count);
    if (turn % 2 == 0) {
      const auto any = scene::occluded(*structure.scene, batch(count), trace);
      for (std::size_t i = 0; i < count; ++i) {
        // Any hit tells the status alone.
        Expectation expected = shots_[i].expected_of(precision);
        if (expected.kind == Expectation::Kind::kHit) expected = Expectation::hit();
        hits[i].status = (*any)[i];
        if (!as_expected(hits[i], expected, precision))
          report(i, structure.name + " any, batch answers " + describe(hits[i]));
      }
    } else {
      trace.fields = HitField::kInstanceId | HitField::kPrimitiveId;
      const auto closest = scene::intersect(*structure.scene, batch(count), trace);
      for (std::size_t i = 0; i < count; ++i) {
        hits[i].status = closest->status[i];
        hits[i].t = closest->t[i];
        hits[i].instance_id = closest->instance_id[i];
        hits[i].primitive_id = closest->primitive_id[i];
        if (!as_expected(hits[i], shots_[i].expected_of(precision), precision))
          report(i, structure.name + " closest, batch answers " + describe(hits[i]));
      }
    }
    row_.count(count, count);
  }

  /// Every door of one structure against the answers of the first one.
  void compare(const Structure& structure, Precision precision, const std::vector<SurfaceHit>& expected) {
    const std::size_t count = subject_.affordable(structure, shots_.size(), precision);
    const std::string door = structure.name + ' ' + std::string(to_string(precision)) + ' ';
    scene::TraceOptions trace;
    trace.precision = precision;
    const auto closest = scene::intersect(*structure.scene, batch(count), trace);
    const auto any = scene::occluded(*structure.scene, batch(count), trace);
    std::vector<SurfaceHit> alone;
    one_by_one(structure, precision, count, alone);
    HitColumns columns;
    columns.resize(count, HitField::kAll);
    for (std::size_t i = 0; i < count; ++i) {
      if (!same_bits(alone[i], expected[i])) differ(i, door + "closest", alone[i], expected[i]);
      const RayStatus one = scene::occluded(*structure.scene, shots_[i].ray, precision, shots_[i].excluded);
      if (one != expected[i].status) differ(i, door + "any", one, expected[i]);
      if ((*any)[i] != expected[i].status) differ(i, door + "any, batch", (*any)[i], expected[i]);
      columns.set(i, expected[i]);
    }
    compare(door, *closest, columns, expected);
    row_.count(0, 4 * count);
  }

 private:
  /// The first `count` rays.
  [[nodiscard]] RayBatch batch(std::size_t count) const {
    return {std::as_bytes(std::span(rows_)).first(count * 8 * sizeof(double)), ScalarType::kFloat64, 8,
            std::span(excluded_).first(count)};
  }
  void compare(const std::string& door, const HitColumns& got, const HitColumns& want,
               const std::vector<SurfaceHit>& expected) {
    for (std::size_t i = 0; i < want.t.size(); ++i) {
      bool same = got.status[i] == want.status[i] && same_bits(got.t[i], want.t[i]) &&
                  got.instance_id[i] == want.instance_id[i] && got.mesh_id[i] == want.mesh_id[i] &&
                  got.primitive_id[i] == want.primitive_id[i];
      for (std::size_t c = 0; c < 2; ++c) same = same && got.uv[2 * i + c] == want.uv[2 * i + c];
      for (std::size_t c = 0; c < 3; ++c) same = same && got.normal[3 * i + c] == want.normal[3 * i + c];
      if (same) continue;
      SurfaceHit hit;
      hit.status = got.status[i];
      hit.t = got.t[i];
      hit.instance_id = got.instance_id[i];
      hit.primitive_id = got.primitive_id[i];
      differ(i, door + "closest, batch", hit, expected[i]);
    }
  }
  void differ(std::size_t i, const std::string& door, RayStatus got, const SurfaceHit& expected) {
    SurfaceHit hit;
    hit.status = got;
    differ(i, door, hit, expected);
  }
  void differ(std::size_t i, const std::string& door, const SurfaceHit& got, const SurfaceHit& expected) {
    report(i, door + " answers " + describe(got) + ", bvh " + describe(expected));
  }
  void report(std::size_t i, const std::string& what) { row_.fail(subject_.spec_, shots_[i], what); }

  const Subject& subject_;
  Row& row_;
  std::span<const Shot> shots_;
  std::vector<double> rows_;
  std::vector<PrimitiveRef> excluded_;
};

Subject::Subject(SceneSpec spec) : spec_(std::move(spec)) {
  const scene::SceneData data = scene_data(spec_);
  const auto add = [this](const std::string& name, const scene::SceneData& what, StructureKind kind) {
    if (auto scene = build(what, kind))
      structures_.push_back({name, std::move(scene), kind == StructureKind::kBruteForce});
  };
  add("bvh", data, StructureKind::kBvh);
  add("brute_force", data, StructureKind::kBruteForce);
  add("wide_bvh", data, StructureKind::kWideBvh);
  add("compact_bvh", data, StructureKind::kCompactBvh);
  add("kd_tree", data, StructureKind::kKdTree);
  add("embree", data, StructureKind::kEmbree);
  const Bounds3d bounds = scene().bounds();
  if (!bounds.empty() && max_abs(bounds.extent()) > kMinScale && max_abs(bounds.extent()) < kMaxScale)
    add("grid", among_decoys(data, bounds), StructureKind::kWideBvh);
  world_triangles_ = scene().world_triangle_count();
}

std::size_t Subject::affordable(const Structure& structure, std::size_t count, Precision precision) const {
  if (precision == Precision::kExact) count = (count + 3) / 4;
  return structure.brute_force ? std::min<std::size_t>(count, 1 + kBruteForceTests / (1 + world_triangles_))
                               : count;
}

const scene::Scene& Subject::next_structure() {
  const Structure& structure = structures_[turn_++ % structures_.size()];
  return structure.brute_force ? next_structure() : *structure.scene;
}

void Subject::shoot(Row& row, std::span<const Shot> shots) {
  if (asked_ < kAskedRays) {
    asked_ += shots.size();
    (void)ask(row, shots);
    return;
  }
  const std::size_t turn = turn_++;
  const Structure& structure = structures_[turn / 2 % structures_.size()];
  if (affordable(structure, shots.size()) < shots.size()) return shoot(row, shots);
  const Precision precision = kPromising[turn / (2 * structures_.size()) % kPromising.size()];
  Asking(*this, row, shots).sweep(structure, precision, turn);
}

Answers Subject::ask(Row& row, std::span<const Shot> shots, std::span<const Precision> precisions) const {
  Asking asking(*this, row, shots);
  Answers answers;
  for (const Precision precision : precisions) {
    std::vector<SurfaceHit>& hits = answers.of(precision);
    asking.one_by_one(structures_.front(), precision, shots.size(), hits);
    asking.judge(precision, hits);
    for (const Structure& structure : structures_) asking.compare(structure, precision, hits);
  }
  row.count(shots.size(), 0);
  return answers;
}

}  // namespace gridcast::stability
