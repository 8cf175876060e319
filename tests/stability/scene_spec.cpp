#include "tests/stability/scene_spec.h"

#include <cmath>
#include <iomanip>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "tests/stability/mesh_spec.h"

namespace gridcast::stability {
namespace {

std::string hex(double value) {
  std::ostringstream out;
  out << std::hexfloat << value;
  return out.str();
}
std::string hex(const Vec3d& v) {
  return hex(v.x) + ' ' + hex(v.y) + ' ' + hex(v.z);
}

std::string to_string(const Expectation& expected) {
  switch (expected.kind) {
    case Expectation::Kind::kMiss:
      return "miss";
    case Expectation::Kind::kInvalid:
      return "invalid";
    case Expectation::Kind::kAgreement:
      return "agreement";
    case Expectation::Kind::kHit:
      break;
  }
  std::string text = "hit";
  if (expected.primitive == PrimitiveRef{}) return text;
  text += ' ' + std::to_string(expected.primitive.instance_id) + ' ' +
          std::to_string(expected.primitive.primitive_id);
  return std::isnan(expected.t) ? text : text + ' ' + hex(expected.t) + ' ' + hex(expected.slack);
}

/// The words of one line.
class Words {
 public:
  explicit Words(std::string line) : line_(std::move(line)), in_(line_) { in_ >> keyword_; }
  [[nodiscard]] const std::string& keyword() const { return keyword_; }
  [[nodiscard]] bool more() { return bool(in_ >> std::ws) && !in_.eof(); }
  [[nodiscard]] std::string word() {
    std::string next;
    if (!(in_ >> next)) fail();
    return next;
  }
  [[nodiscard]] std::string rest() {
    std::string text;
    std::getline(in_ >> std::ws, text);
    return text;
  }
  // Not by operator>>: it reads no hex floats.
  [[nodiscard]] double number() {
    const std::string text = word();
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (end != text.c_str() + text.size()) fail();
    return value;
  }
  [[nodiscard]] std::uint32_t id() { return std::uint32_t(std::stoul(word())); }
  [[nodiscard]] Vec3d vec() {
    const double x = number(), y = number(), z = number();
    return {x, y, z};
  }
  [[noreturn]] void fail() const { throw std::invalid_argument("not understood: '" + line_ + "'"); }

 private:
  std::string line_;
  std::istringstream in_;
  std::string keyword_;
};

Expectation read_expectation(Words& words) {
  const std::string kind = words.word();
  if (kind == "miss") return Expectation::miss();
  if (kind == "invalid") return Expectation::invalid();
  if (kind == "agreement") return {};
  if (kind != "hit") words.fail();
  Expectation expected = Expectation::hit();
  if (words.more()) {
    const std::uint32_t instance_id = words.id();
    expected.primitive = {instance_id, words.id()};
  }
  if (words.more()) {
    expected.t = words.number();
    expected.slack = words.number();
  }
  return expected;
}

Shot read_ray(Words& words) {
  Shot shot;
  shot.ray.origin = words.vec();
  shot.ray.direction = words.vec();
  shot.ray.tnear = words.number();
  shot.ray.tfar = words.number();
  if (words.more()) {
    const std::uint32_t instance_id = words.id();
    shot.excluded = {instance_id, words.id()};
  }
  return shot;
}

Placement read_instance(Words& words) {
  Placement placement;
  placement.mesh = words.id();
  if (!words.more()) return placement;
  for (int column = 0; column < 3; ++column) placement.world_from_object.linear[column] = words.vec();
  placement.world_from_object.translation = words.vec();
  return placement;
}

}  // namespace

MeshSource generated(const std::string& spec) {
  return {spec, std::make_shared<const mesh::TriangleMesh>(make_mesh(spec))};
}

MeshSource given(mesh::TriangleMesh mesh) {
  return {"", std::make_shared<const mesh::TriangleMesh>(std::move(mesh))};
}

SceneSpec placed(MeshSource mesh, const Affine& world_from_object) {
  return {{std::move(mesh)}, {{0, world_from_object}}};
}

scene::SceneData scene_data(const SceneSpec& spec) {
  scene::SceneData data;
  for (const MeshSource& source : spec.meshes) data.meshes.push_back(source.mesh);
  data.deformations.resize(data.meshes.size());
  for (const Placement& placement : spec.instances)
    data.instances.push_back({{}, placement.world_from_object, placement.mesh});
  return data;
}

void write_case(std::ostream& out, const CaseFile& file) {
  out << "gridcast-case 1\nwhat " << file.what << "\nsource " << file.source << '\n';
  for (const MeshSource& source : file.scene.meshes) {
    out << (source.spec.empty() ? "mesh" : "mesh " + source.spec) << '\n';
    if (!source.spec.empty()) continue;
    for (const Vec3f& p : source.mesh->positions) out << "v " << hex(Vec3d(p)) << '\n';
    for (const auto& [a, b, c] : source.mesh->triangles) out << "f " << a << ' ' << b << ' ' << c << '\n';
  }
  for (const auto& [mesh, where] : file.scene.instances) {
    out << "instance " << mesh;
    if (!(where == Affine{}))
      for (const Vec3d& column : {where.linear[0], where.linear[1], where.linear[2], where.translation})
        out << ' ' << hex(column);
    out << '\n';
  }
  for (const auto& [ray, excluded, expected, exact] : file.shots) {
    out << "ray " << hex(ray.origin) << ' ' << hex(ray.direction) << ' ' << hex(ray.tnear) << ' '
        << hex(ray.tfar);
    if (!(excluded == PrimitiveRef{})) out << ' ' << excluded.instance_id << ' ' << excluded.primitive_id;
    out << "\nexpect " << to_string(expected) << '\n';
    if (exact) out << "exact " << to_string(*exact) << '\n';
  }
}

CaseFile read_case(std::istream& in) {
  CaseFile file;
  std::vector<mesh::TriangleMesh> written;  // by mesh; empty for those made by a line
  std::string line;
  if (!std::getline(in, line) || line != "gridcast-case 1")
    throw std::invalid_argument("the first line is not 'gridcast-case 1'");
  while (std::getline(in, line)) {
    Words words(line);
    const std::string& keyword = words.keyword();
    if (keyword.empty() || keyword.front() == '#') continue;
    if (keyword == "what") {
      file.what = words.rest();
    } else if (keyword == "source") {
      file.source = words.rest();
    } else if (keyword == "mesh") {
      file.scene.meshes.push_back(words.more() ? generated(words.rest()) : MeshSource{});
      written.emplace_back();
    } else if (keyword == "v" && !written.empty()) {
      written.back().positions.emplace_back(words.vec());
    } else if (keyword == "f" && !written.empty()) {
      const std::uint32_t a = words.id(), b = words.id(), c = words.id();
      written.back().triangles.push_back({a, b, c});
    } else if (keyword == "instance") {
      file.scene.instances.push_back(read_instance(words));
    } else if (keyword == "ray") {
      file.shots.push_back(read_ray(words));
    } else if (keyword == "expect" && !file.shots.empty()) {
      file.shots.back().expected = read_expectation(words);
    } else if (keyword == "exact" && !file.shots.empty()) {
      file.shots.back().exact = read_expectation(words);
    } else {
      words.fail();
    }
  }
  for (std::size_t i = 0; i < written.size(); ++i)
    if (file.scene.meshes[i].mesh == nullptr) file.scene.meshes[i] = given(std::move(written[i]));
  return file;
}

}  // namespace gridcast::stability
