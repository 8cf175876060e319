#pragma once
// Batches as columns: what enters and leaves the engine for many rays at once.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/math/hit.h"
#include "core/math/ray.h"
#include "core/math/uninitialized_allocator.h"

namespace gridcast {

enum class ScalarType : std::uint8_t { kFloat32, kFloat64 };
inline constexpr std::size_t size_bytes(ScalarType type) {
  return type == ScalarType::kFloat32 ? 4 : 8;
}

/// A view of N rays as little-endian row-major [N, 6] (ox oy oz dx dy dz) or
/// [N, 8] (ox oy oz tnear dx dy dz tfar). Owns nothing; the bytes need no alignment.
/// `excluded`, when not empty, has N entries: the primitive each ray starts on and must not hit.
struct RayBatch {
  std::span<const std::byte> bytes;
  ScalarType scalar = ScalarType::kFloat64;
  std::size_t columns = 8;  ///< 6 or 8
  std::span<const PrimitiveRef> excluded;

  [[nodiscard]] std::size_t row_bytes() const { return columns * size_bytes(scalar); }
  [[nodiscard]] std::size_t size() const { return bytes.size() / row_bytes(); }

  [[nodiscard]] Ray operator[](std::size_t i) const {
    double row[8];
    if (scalar == ScalarType::kFloat64) {
      copy_row(row, i);
    } else {
      float narrow[8];
      copy_row(narrow, i);
      for (std::size_t c = 0; c < columns; ++c) row[c] = double(narrow[c]);
    }
    if (columns == 6) return {{row[0], row[1], row[2]}, {row[3], row[4], row[5]}};
    return {{row[0], row[1], row[2]}, {row[4], row[5], row[6]}, row[3], row[7]};
  }

 private:
  /// Sizes known when compiled: a few moves instead of a call.
  template <class T>
  void copy_row(T* row, std::size_t i) const {
    const std::byte* from = bytes.data() + i * columns * sizeof(T);
    if (columns == 8) {
      std::memcpy(row, from, 8 * sizeof(T));
    } else {
      std::memcpy(row, from, 6 * sizeof(T));
    }
  }
};

/// Which columns of HitColumns are wanted. `status` and `t` always are. kAll are those that cost next to
/// nothing; the others are computed for who names them.
enum class HitField : std::uint16_t {
  kUv = 1,
  kNormal = 2,
  kInstanceId = 4,
  kMeshId = 8,
  kPrimitiveId = 16,
  kAll = 31,
  kTError = 32
};
inline constexpr HitField operator|(HitField a, HitField b) {
  return HitField(std::uint16_t(a) | std::uint16_t(b));
}
inline constexpr bool has(HitField set, HitField one) {
  return (std::uint16_t(set) & std::uint16_t(one)) != 0;
}

/// A column of many answers: see UninitializedAllocator.
template <class T>
using Column = std::vector<T, UninitializedAllocator<T, HeapMemory>>;

/// Answers in the order of the rays. A miss: t = t_error = +inf, ids = kInvalidId, uv and normal 0. Columns
/// not asked for stay empty.
struct HitColumns {
  std::vector<RayStatus> status;
  Column<double> t;
  Column<float> uv;      ///< [N, 2]
  Column<float> normal;  ///< [N, 3], unit, world space
  Column<std::uint32_t> instance_id;
  Column<std::uint32_t> mesh_id;
  Column<std::uint32_t> primitive_id;
  Column<double> t_error;  ///< certified bound of |t - exact t|; +inf where there is none

  /// `n` misses.
  void resize(std::size_t n, HitField fields) {
    for_each_column(fields,
                    [n](auto& column, std::size_t width, auto miss) { column.assign(width * n, miss); });
  }
  /// `n` rows, of which those that are new are still to be written: what they are until then means nothing.
  void make_room(std::size_t n, HitField fields) {
    for_each_column(fields,
                    [n](auto& column, std::size_t width, auto /*miss*/) { column.resize(width * n); });
  }
  /// Memory for `n` rows, of which none is there yet: rows up to `n` do not move the others.
  void reserve(std::size_t n, HitField fields) {
    for_each_column(fields,
                    [n](auto& column, std::size_t width, auto /*miss*/) { column.reserve(width * n); });
  }

  /// Writes row i; each row is written by one thread.
  void set(std::size_t i, const SurfaceHit& hit) {
    if (!status.empty()) status[i] = hit.status;
    t[i] = hit.t;
    if (!uv.empty()) {
      uv[2 * i] = float(hit.u);
      uv[2 * i + 1] = float(hit.v);
    }
    if (!normal.empty()) set_normal(i, hit.normal);
    if (!instance_id.empty()) instance_id[i] = hit.instance_id;
    if (!mesh_id.empty()) mesh_id[i] = hit.mesh_id;
    if (!primitive_id.empty()) primitive_id[i] = hit.primitive_id;
    if (!t_error.empty()) t_error[i] = hit.t_error;
  }
  /// The normal of row i alone, where normals are wanted.
  void set_normal(std::size_t i, const Vec3d& unit) {
    for (int c = 0; c < 3; ++c) normal[3 * i + std::size_t(c)] = float(unit[c]);
  }

 private:
  /// Calls visit(column, width, value of a miss); the width of a column that is not of `fields` is 0.
  template <class Visit>
  void for_each_column(HitField fields, const Visit& visit) {
    const auto width = [fields](HitField field, std::size_t wide = 1) {
      return has(fields, field) ? wide : 0;
    };
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    visit(status, 1, RayStatus::kMiss);
    visit(t, 1, kInfinity);
    visit(uv, width(HitField::kUv, 2), 0.F);
    visit(normal, width(HitField::kNormal, 3), 0.F);
    visit(instance_id, width(HitField::kInstanceId), kInvalidId);
    visit(mesh_id, width(HitField::kMeshId), kInvalidId);
    visit(primitive_id, width(HitField::kPrimitiveId), kInvalidId);
    visit(t_error, width(HitField::kTError), kInfinity);
  }
};

}  // namespace gridcast
