#pragma once
// What is cast at, the rays, and what must come back: in memory, and as a file of the corpus.

#include <iosfwd>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/math/affine.h"
#include "core/math/hit.h"
#include "core/math/ray.h"
#include "core/scene/scene_data.h"

namespace gridcast::stability {

/// A mesh and the line that makes it (mesh_spec.h); a mesh without a line is written out.
struct MeshSource {
  std::string spec;
  std::shared_ptr<const mesh::TriangleMesh> mesh;
};
[[nodiscard]] MeshSource generated(const std::string& spec);
[[nodiscard]] MeshSource given(mesh::TriangleMesh mesh);

struct Placement {
  std::uint32_t mesh = 0;
  Affine world_from_object;
};

struct SceneSpec {
  std::vector<MeshSource> meshes;
  std::vector<Placement> instances;
};
/// One instance of one mesh.
[[nodiscard]] SceneSpec placed(MeshSource mesh, const Affine& world_from_object = {});
[[nodiscard]] scene::SceneData scene_data(const SceneSpec& spec);

/// What a ray must get. The default expects no more than that all structures agree.
struct Expectation {
  enum class Kind : std::uint8_t { kAgreement, kMiss, kHit, kInvalid };
  static constexpr double kAny = std::numeric_limits<double>::quiet_NaN();

  Kind kind = Kind::kAgreement;
  PrimitiveRef primitive = {};  ///< of a hit; none = any
  double t = kAny;              ///< of a hit
  /// How far t may be off, and how much farther than the named primitive another one may be that is reported
  /// in its place. Precision::kExact reports the named one whatever this is.
  double slack = 0.0;

  [[nodiscard]] static Expectation miss() { return {.kind = Kind::kMiss}; }
  [[nodiscard]] static Expectation invalid() { return {.kind = Kind::kInvalid}; }
  [[nodiscard]] static Expectation hit(const PrimitiveRef& primitive = {}, double t = kAny,
                                       double slack = 0.0) {
    return {Kind::kHit, primitive, t, slack};
  }
};

struct Shot {
  Ray ray;
  PrimitiveRef excluded = {};
  Expectation expected = {};
  /// What `exact` mode must get where that is more than `expected` says or something else: robust mode
  /// decides about the ray as it is rounded on its way to object space.
  std::optional<Expectation> exact = {};

  [[nodiscard]] const Expectation& expected_of(Precision precision) const {
    return precision == Precision::kExact && exact ? *exact : expected;
  }
};

/// A file of the corpus. Numbers are hex floats, so nothing is lost:
///
///     gridcast-case 1
///     what a ray along a diagonal left the box
///     source found by RC05, seed 1005
///     mesh box -1 -1 -1 1 1 1            a mesh by its line (mesh_spec.h), or
///     mesh                               written out:
///     v 0x1p+0 0x0p+0 0x0p+0
///     f 0 1 2
///     instance 0                         of mesh 0 where it is, or with 12 numbers: x, y, z axis,
///     translation ray ox oy oz dx dy dz tnear tfar   and, where a primitive is left out, its instance and
///     number expect hit 0 7                     or: agreement, miss, invalid, hit, hit I P T SLACK
///     exact miss                         in `exact` mode, where it is something else
struct CaseFile {
  std::string what;
  std::string source;
  SceneSpec scene;
  std::vector<Shot> shots;
};
void write_case(std::ostream& out, const CaseFile& file);
/// Throws std::invalid_argument with the line that it does not understand.
[[nodiscard]] CaseFile read_case(std::istream& in);

}  // namespace gridcast::stability
