#pragma once
// The bytes of a document: where each buffer is, each view cut from it (decompressed when first used), each
// accessor read out of its view.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/io/gltf_model.h"
#include "core/io/gltf_refusal.h"

namespace gridcast::io {

/// Every buffer's bytes, at least as many as it declares. Empty for the fallback of compressed views.
struct Buffers {
  std::vector<std::span<const std::byte>> bytes;
  std::vector<std::vector<std::byte>> owned;  ///< what `bytes` shows of data URIs and files
};

/// Finds the buffers of a checked document: the binary chunk, data URIs and, when `folder` is given, relative
/// files. Throws Refusal.
[[nodiscard]] Buffers load_buffers(const Json& document, std::optional<std::span<const std::byte>> bin,
                                   const std::filesystem::path* folder, std::size_t max_bytes);

/// Reads the accessors of a model. Indices given to it are those of the checked document, so in range; what
/// it decodes is taken from the budget. Throws Refusal.
class Storage {
 public:
  Storage(const tinygltf::Model& model, Buffers buffers, Budget& budget)
      : model_(&model), buffers_(std::move(buffers)), budget_(&budget) {}

  [[nodiscard]] const tinygltf::Model& model() const { return *model_; }
  [[nodiscard]] Budget& budget() { return *budget_; }
  [[nodiscard]] std::size_t count(int accessor) const { return this->accessor(accessor).count; }
  [[nodiscard]] const tinygltf::Accessor& accessor(int index) const {
    return model_->accessors[std::size_t(index)];
  }

  /// [count, components] as floats; normalised integers are mapped to [0, 1] or [-1, 1].
  [[nodiscard]] std::vector<float> floats(int accessor, std::size_t components);
  /// [count, components] of an accessor of unsigned integers.
  [[nodiscard]] std::vector<std::uint32_t> integers(int accessor, std::size_t components);
  /// The bytes of a view, decompressed.
  [[nodiscard]] std::span<const std::byte> view(int index);

 private:
  struct Elements;
  [[nodiscard]] Elements elements(const tinygltf::Accessor& accessor, const std::string& where);
  template <class Value, class Convert>
  [[nodiscard]] std::vector<Value> read(int accessor, std::size_t components, Convert convert);
  template <class Value, class Convert>
  void read_sparse(const tinygltf::Accessor& accessor, const std::string& where, std::vector<Value>& values,
                   std::size_t components, Convert convert);

  const tinygltf::Model* model_;
  Buffers buffers_;
  Budget* budget_;
  std::map<int, std::vector<std::byte>> decoded_;
};

}  // namespace gridcast::io
