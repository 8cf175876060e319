#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/io/gltf_refusal.h"

namespace gridcast::io {

/// A decoded KHR_draco_mesh_compression primitive.
class DracoMesh {
 public:
  /// Throws Refusal: damaged data, not a mesh, sizes that pass the budget.
  DracoMesh(std::span<const std::byte> packed, Budget& budget, const std::string& where);
  ~DracoMesh();
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;

  [[nodiscard]] std::size_t vertex_count() const;
  [[nodiscard]] std::size_t face_count() const;
  [[nodiscard]] std::vector<std::uint32_t> indices() const;
  /// [vertices, components] of the attribute with this unique id. Throws Refusal.
  [[nodiscard]] std::vector<float> floats(std::uint32_t id, std::size_t components) const;
  [[nodiscard]] std::vector<std::uint32_t> integers(std::uint32_t id, std::size_t components) const;

 private:
  struct Decoded;
  template <class Value>
  [[nodiscard]] std::vector<Value> values(std::uint32_t id, std::size_t components) const;

  std::unique_ptr<Decoded> decoded_;
  Budget* budget_;
  std::string where_;
};

}  // namespace gridcast::io
