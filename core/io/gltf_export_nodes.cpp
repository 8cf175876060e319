#include <bit>
#include <charconv>
#include <cmath>
#include <limits>

#include "core/io/gltf_export_parts.h"
#include "core/io/gltf_json.h"
#include "core/io/gltf_refusal.h"
#include "core/math/trs.h"

namespace gridcast::io {
namespace {

/// Also of -0 and 0.
bool same_bits(const Affine& a, const Affine& b) {
  for (int c = 0; c < 4; ++c) {
    const Vec3d& x = c < 3 ? a.linear[c] : a.translation;
    const Vec3d& y = c < 3 ? b.linear[c] : b.translation;
    for (int r = 0; r < 3; ++r)
      if (std::bit_cast<std::uint64_t>(x[r]) != std::bit_cast<std::uint64_t>(y[r])) return false;
  }
  return true;
}

/// Importers take numbers that fit a float.
bool fits_a_float(const Affine& affine) {
  double largest = max_abs(affine.translation);
  for (int c = 0; c < 3; ++c) largest = std::max(largest, max_abs(affine.linear[c]));
  return largest <= double(std::numeric_limits<float>::max());
}

}  // namespace

void NodeText::add_instance(std::uint32_t mesh_id, const std::string& name, const Affine& world_from_object) {
  add_renamed_instance(mesh_id, name, world_from_object, kInvalidId);
}

void NodeText::add_renamed_instance(std::uint32_t mesh_id, const std::string& name,
                                    const Affine& world_from_object, std::uint32_t instance_id) {
  begin();
  raw("\"mesh\":");
  integer(mesh_id);
  if (!name.empty()) {
    raw(",\"name\":");
    raw(json_text(name));
    ++values_;
  }
  transform(world_from_object);
  if (instance_id != kInvalidId) {
    raw(",\"extras\":{\"instance_id\":");
    integer(instance_id);
    raw("}");
    ++values_;
  }
  end();
}

void NodeText::add_camera(std::size_t camera, const Affine& world_from_camera) {
  begin();
  raw("\"camera\":");
  integer(camera);
  transform(world_from_camera);
  end();
}

void NodeText::add_light(std::size_t light, const Affine& world_from_light) {
  begin();
  raw("\"extensions\":{\"KHR_lights_punctual\":{\"light\":");
  integer(light);
  raw("}}");
  values_ += 2;
  transform(world_from_light);
  end();
}

std::string NodeText::take_nodes() && {
  return count_ == 0 ? "[]" : std::move(text_) + "]";
}

std::string NodeText::root_list() const {
  std::string list = "[";
  for (std::size_t i = 0; i < count_; ++i) {
    if (i != 0) list += ',';
    list += std::to_string(i);
  }
  return list + "]";
}

void NodeText::begin() {
  raw(count_ == 0 ? "[{" : ",{");
  ++count_;
  values_ += 2;  // the node itself, and its number in the list of roots
}

void NodeText::end() {
  raw("}");
  // The list of roots takes up to 8 bytes a node.
  const bool fits = text_.size() + 8 * count_ <= limits_.json_bytes && values_ <= kMaxJsonValues &&
                    count_ <= limits_.nodes && count_ <= limits_.instances;
  if (fits) return;
  refuse(ErrorCode::kLimitExceeded,
         "the instances are too many for a GLB that can be read again: a file has at most " +
             std::to_string(limits_.nodes) + " nodes and " + std::to_string(limits_.json_bytes) +
             " bytes of JSON",
         "/nodes");
}

void NodeText::number(double value) {
  constexpr std::size_t kLongest = 32;  // "-2.2250738585072014e-308" has 24
  char buffer[kLongest];
  // The shortest text with the same bits; "-0" would be read as an integer without a sign.
  const bool negative_zero = value == 0.0 && std::signbit(value);
  char* end = std::to_chars(buffer, buffer + kLongest, value).ptr;
  text_.append(buffer, std::size_t(end - buffer));
  if (negative_zero) text_.append(".0");
  ++values_;
}

void NodeText::integer(std::uint64_t value) {
  text_.append(std::to_string(value));
  ++values_;
}

void NodeText::numbers(std::string_view name, std::span<const double> values) {
  raw(",\"");
  raw(name);
  raw("\":[");
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i != 0) raw(",");
    number(values[i]);
  }
  raw("]");
  ++values_;
}

/// The shortest of nothing, a translation, that with a scale, and a matrix which gives the same bits.
void NodeText::transform(const Affine& affine) {
  if (!fits_a_float(affine)) {
    // Beyond the range of active transforms: nothing of it is hit, there or here.
    numbers("scale", std::array{0.0, 0.0, 0.0});
    return;
  }
  const Mat3d& m = affine.linear;
  const Trs trs{affine.translation, Trs{}.rotation, {m[0][0], m[1][1], m[2][2]}};
  if (same_bits(affine, affine_from_trs(trs))) {
    const auto write = [&](std::string_view name, const Vec3d& v) {
      numbers(name, std::array{v.x, v.y, v.z});
    };
    if (!same_bits({Mat3d(1.0), trs.translation}, Affine{})) write("translation", trs.translation);
    if (trs.scale != Vec3d(1.0)) write("scale", trs.scale);
    return;
  }
  const Vec3d& t = affine.translation;
  numbers("matrix", std::array{m[0].x, m[0].y, m[0].z, 0.0, m[1].x, m[1].y, m[1].z, 0.0,  //
                               m[2].x, m[2].y, m[2].z, 0.0, t.x, t.y, t.z, 1.0});
}

}  // namespace gridcast::io
