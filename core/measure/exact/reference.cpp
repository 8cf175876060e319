#include "core/measure/exact/reference.h"

#include <algorithm>
#include <cfenv>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>

namespace gridcast::measure::exact {
namespace {

/// Other code of the program may have asked this thread to flush denormals to zero.
class DefaultFloats {
 public:
  DefaultFloats() {
    std::fegetenv(&before_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~DefaultFloats() { std::fesetenv(&before_); }
  DefaultFloats(const DefaultFloats&) = delete;
  DefaultFloats& operator=(const DefaultFloats&) = delete;

 private:
  std::fenv_t before_{};
};

bool finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Status check(const Mesh& mesh, std::size_t index) {
  const std::string where = "/meshes/" + std::to_string(index);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    if (!finite(Vec3d(mesh.positions[i])))
      return Error{ErrorCode::kInvalidArgument, "a position is not finite",
                   where + "/positions/" + std::to_string(i)};
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const std::uint32_t vertex : mesh.triangles[i])
      if (vertex >= mesh.positions.size())
        return Error{ErrorCode::kInvalidArgument, "a vertex number is out of range",
                     where + "/triangles/" + std::to_string(i)};
  return ok_status();
}

Status check(const Instance& instance, std::size_t meshes) {
  const Affine& affine = instance.world_from_object;
  const bool numbers = finite(affine.linear[0]) && finite(affine.linear[1]) && finite(affine.linear[2]) &&
                       finite(affine.translation);
  if (numbers && instance.mesh < meshes) return ok_status();
  return Error{ErrorCode::kInvalidArgument,
               numbers ? "a mesh number is out of range" : "a transform is not finite",
               "/instances/" + std::to_string(instance.instance_id)};
}

std::vector<Box> triangle_boxes(const Mesh& mesh) {
  std::vector<Box> boxes;
  boxes.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3d p(mesh.positions[a]), q(mesh.positions[b]), r(mesh.positions[c]);
    boxes.push_back({glm::min(glm::min(p, q), r), glm::max(glm::max(p, q), r)});
  }
  return boxes;
}

Box around(std::span<const Box> boxes) {
  if (boxes.empty()) return {};
  Box all = boxes[0];
  for (const Box& box : boxes) all = {glm::min(all.lower, box.lower), glm::max(all.upper, box.upper)};
  return all;
}

/// A world box that contains the image of `object`: outward to doubles from a frame whose origin is the
/// world's.
Box world_box(const Affine& world_from_object, const Box& object, double extent) {
  const WideRay from_world_origin(Ray{Vec3d(0.0), Vec3d(0.0)});
  const WideBox wide =
      InstanceFrame(world_from_object, extent, from_world_origin).image(object.lower, object.upper);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = std::nextafter(double(wide.lower[std::size_t(axis)]), -kInfinity);
    box.upper[axis] = std::nextafter(double(wide.upper[std::size_t(axis)]), kInfinity);
  }
  return box;
}

}  // namespace

/// A triangle that the filter could not rule out.
struct Reference::Candidate {
  std::uint32_t instance, primitive_id;
  FilterAnswer answer;
};

/// One ray's way through the boxes.
class Reference::Search {
 public:
  Search(const Reference& reference, const Ray& ray, PrimitiveRef excluded)
      : reference_(reference), ray_(ray), wide_(ray), excluded_(excluded), limit_(ray.tfar) {}

  /// Calls visit(candidate) until it returns false.
  template <class Visit>
  void run(const Visit& visit) {
    if (!finite(ray_.origin) || !finite(ray_.direction)) return;
    // Corners of world boxes lose one rounding when the origin is subtracted.
    const auto enter = [&](const Box& box) {
      WideBox relative;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Wide low = Wide(box.lower[int(axis)]) - wide_.origin[axis];
        const Wide high = Wide(box.upper[int(axis)]) - wide_.origin[axis];
        relative.lower[axis] = low - std::numeric_limits<Wide>::epsilon() * std::abs(low);
        relative.upper[axis] = high + std::numeric_limits<Wide>::epsilon() * std::abs(high);
      }
      return wide_.inside(relative);
    };
    reference_.tree_.search(
        Wide(ray_.tnear), enter, [&] { return limit_; },
        [&](std::uint32_t instance) { return search(instance, visit); });
  }

  /// Nothing beyond t is asked for any more.
  void stop_at(Wide t) { limit_ = std::min(limit_, t); }
  [[nodiscard]] Wide limit() const { return limit_; }

  /// Certainly hit, and certainly in the ray's range.
  [[nodiscard]] bool certain(const FilterAnswer& answer) const {
    return answer.verdict == Verdict::kHit && answer.low >= Wide(ray_.tnear) &&
           answer.high <= Wide(ray_.tfar);
  }

 private:
  /// False when `visit` ended it all.
  template <class Visit>
  bool search(std::uint32_t index, const Visit& visit) {
    const Instance& instance = reference_.instances_[index];
    const Blas& blas = reference_.blas_[instance.mesh];
    const InstanceFrame frame(instance.world_from_object, blas.extent, wide_);
    bool go_on = true;
    const auto test = [&](std::uint32_t primitive_id) {
      if (PrimitiveRef{instance.instance_id, primitive_id} == excluded_) return true;
      const FilterAnswer answer = frame.test(wide_, reference_.corners(instance, primitive_id));
      if (answer.verdict == Verdict::kMiss || answer.high < Wide(ray_.tnear) || answer.low > limit_)
        return true;
      return go_on = visit(Candidate{index, primitive_id, answer});
    };
    blas.tree.search(
        Wide(ray_.tnear), [&](const Box& box) { return wide_.inside(frame.image(box.lower, box.upper)); },
        [&] { return limit_; }, test);
    return go_on;
  }

  const Reference& reference_;
  const Ray& ray_;
  WideRay wide_;
  PrimitiveRef excluded_;
  Wide limit_;
};

Result<Reference> Reference::build(std::vector<Mesh> meshes, std::vector<Instance> instances,
                                   const std::stop_token& stop) {
  const DefaultFloats floats;
  Reference made;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (Status status = check(meshes[i], i); !status) return status.error();
    const std::vector<Box> boxes = triangle_boxes(meshes[i]);
    const Box box = around(boxes);
    const Vec3d extent = glm::max(glm::abs(box.lower), glm::abs(box.upper));
    made.blas_.push_back({meshes[i], BoxTree(boxes, stop), box, std::max({extent.x, extent.y, extent.z})});
  }
  std::stable_sort(instances.begin(), instances.end(),
                   [](const Instance& a, const Instance& b) { return a.instance_id < b.instance_id; });
  std::vector<Box> boxes;
  for (const Instance& instance : instances) {
    if (Status status = check(instance, meshes.size()); !status) return status.error();
    const Blas& blas = made.blas_[instance.mesh];
    const Box box = world_box(instance.world_from_object, blas.box, blas.extent);
    if (!finite(box.lower + box.upper) || !finite(box.upper - box.lower))
      return Error{ErrorCode::kInvalidArgument, "a transform takes its mesh out of the range of double",
                   "/instances/" + std::to_string(instance.instance_id)};
    boxes.push_back(box);
  }
  made.instances_ = std::move(instances);
  made.tree_ = BoxTree(boxes, stop);
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the building was stopped", ""};
  return made;
}

std::array<Vec3f, 3> Reference::corners(const Instance& instance, std::uint32_t primitive_id) const {
  const Mesh& mesh = blas_[instance.mesh].mesh;
  const auto& [a, b, c] = mesh.triangles[primitive_id];
  return {mesh.positions[a], mesh.positions[b], mesh.positions[c]};
}

std::optional<Hit> Reference::decide(const Ray& ray, const Candidate& candidate) const {
  const Instance& instance = instances_[candidate.instance];
  auto at = intersect(ray, instance.world_from_object, corners(instance, candidate.primitive_id));
  if (!at) return std::nullopt;
  return Hit{{instance.instance_id, candidate.primitive_id}, std::move(*at)};
}

namespace {

bool before(const Hit& a, const Hit& b) {
  const int order = compare(a.at.t, b.at.t);
  if (order != 0) return order < 0;
  return std::tie(a.primitive.instance_id, a.primitive.primitive_id) <
         std::tie(b.primitive.instance_id, b.primitive.primitive_id);
}

}  // namespace

std::optional<Hit> Reference::closest(const Ray& ray, PrimitiveRef excluded) const {
  const DefaultFloats floats;
  Search search(*this, ray, excluded);
  std::vector<Candidate> candidates;
  search.run([&](const Candidate& candidate) {
    if (search.certain(candidate.answer)) search.stop_at(candidate.answer.high);
    candidates.push_back(candidate);
    return true;
  });
  std::optional<Hit> best;
  for (const Candidate& candidate : candidates) {
    if (candidate.answer.low > search.limit()) continue;
    auto hit = decide(ray, candidate);
    if (hit && (!best || before(*hit, *best))) best = std::move(hit);
  }
  return best;
}

bool Reference::any(const Ray& ray, PrimitiveRef excluded) const {
  const DefaultFloats floats;
  Search search(*this, ray, excluded);
  bool found = false;
  search.run([&](const Candidate& candidate) {
    found = search.certain(candidate.answer) || decide(ray, candidate).has_value();
    return !found;
  });
  return found;
}

std::vector<Hit> Reference::all(const Ray& ray, PrimitiveRef excluded) const {
  const DefaultFloats floats;
  Search search(*this, ray, excluded);
  std::vector<Hit> hits;
  search.run([&](const Candidate& candidate) {
    if (auto hit = decide(ray, candidate)) hits.push_back(std::move(*hit));
    return true;
  });
  std::sort(hits.begin(), hits.end(), before);
  return hits;
}

std::optional<Hit> Reference::of_primitive(const Ray& ray, PrimitiveRef primitive) const {
  const DefaultFloats floats;
  const auto found =
      std::lower_bound(instances_.begin(), instances_.end(), primitive.instance_id,
                       [](const Instance& instance, std::uint32_t id) { return instance.instance_id < id; });
  if (found == instances_.end() || found->instance_id != primitive.instance_id) return std::nullopt;
  if (primitive.primitive_id >= blas_[found->mesh].mesh.triangles.size()) return std::nullopt;
  return decide(ray, {std::uint32_t(found - instances_.begin()), primitive.primitive_id, {}});
}

}  // namespace gridcast::measure::exact
