#include "core/io/gltf_storage.h"

#include <algorithm>
#include <cstring>

#include "core/io/gltf_check.h"
#include "core/io/gltf_meshopt.h"
#include "core/io/gltf_uri.h"

namespace gridcast::io {
namespace {

bool is_packed(const Json& view) {
  return view.contains("extensions") && (view["extensions"].contains(kMeshoptExtensions[0]) ||
                                         view["extensions"].contains(kMeshoptExtensions[1]));
}

bool says_fallback(const Json& buffer) {
  if (!buffer.contains("extensions")) return false;
  return std::ranges::any_of(kMeshoptExtensions, [&](const char* name) {
    const auto found = buffer["extensions"].find(name);
    return found != buffer["extensions"].end() && found->is_object() && found->contains("fallback");
  });
}

/// The buffers that need no bytes: every view of them is compressed, its bytes lying in another buffer.
std::vector<bool> find_fallbacks(const Json& document) {
  const Json& buffers = document["buffers"];
  std::vector<bool> packed(buffers.size()), plain(buffers.size());
  if (document.contains("bufferViews")) {
    for (const Json& view : document["bufferViews"])
      (is_packed(view) ? packed : plain)[view["buffer"].get<std::size_t>()] = true;
  }
  for (std::size_t i = 0; i < buffers.size(); ++i)
    packed[i] = (packed[i] && !plain[i]) || says_fallback(buffers[i]);
  return packed;
}

std::vector<std::byte> load_uri(const std::string& uri, const std::filesystem::path* folder,
                                std::size_t max_bytes, const std::string& where) {
  if (uri.starts_with("data:")) return decode_data_uri(uri, where);
  if (folder == nullptr)
    refuse_invalid("a buffer in another file is not read here: put it into a GLB", where);
  return read_relative_uri(uri, *folder, max_bytes, where);
}

template <class T>
T load(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// One stored component as a float. glTF 2.0, "Animation"/"Accessors": normalised signed values below -1
/// become -1.
float to_float(const std::byte* bytes, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const float v = float(load<std::int8_t>(bytes));
      return normalized ? std::max(v / 127.F, -1.F) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: {
      const float v = float(load<std::uint8_t>(bytes));
      return normalized ? v / 255.F : v;
    }
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const float v = float(load<std::int16_t>(bytes));
      return normalized ? std::max(v / 32767.F, -1.F) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const float v = float(load<std::uint16_t>(bytes));
      return normalized ? v / 65535.F : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return float(load<std::uint32_t>(bytes));
    default:
      return load<float>(bytes);
  }
}

std::uint32_t to_integer(const std::byte* bytes, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<std::uint8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(bytes);
    default:
      return load<std::uint32_t>(bytes);
  }
}

std::size_t component_bytes(int type) {
  return std::size_t(tinygltf::GetComponentSizeInBytes(std::uint32_t(type)));
}

}  // namespace

Buffers load_buffers(const Json& document, std::optional<std::span<const std::byte>> bin,
                     const std::filesystem::path* folder, std::size_t max_bytes) {
  Buffers buffers;
  if (!document.contains("buffers")) return buffers;
  std::size_t left = max_bytes;
  const std::vector<bool> fallbacks = find_fallbacks(document);
  for (std::size_t i = 0; i < document["buffers"].size(); ++i) {
    const Json& description = document["buffers"][i];
    const std::string where = pointer("buffers", i);
    std::span<const std::byte> bytes;
    if (description.contains("uri")) {
      const auto& uri = description["uri"].get_ref<const std::string&>();
      bytes = buffers.owned.emplace_back(load_uri(uri, folder, left, where + "/uri"));
      left -= std::min(left, bytes.size());
    } else if (i == 0 && bin) {
      bytes = *bin;
    } else if (!fallbacks[i]) {
      refuse_invalid("the buffer has neither a uri nor a binary chunk", where);
    }
    const bool fallback = !description.contains("uri") && !(i == 0 && bin);
    if (!fallback && bytes.size() < description["byteLength"].get<std::size_t>())
      refuse_invalid("the buffer holds fewer bytes than its byteLength", where);
    buffers.bytes.push_back(bytes);
  }
  return buffers;
}

/// Where the elements of an accessor lie. `first` is null when all are zero.
struct Storage::Elements {
  const std::byte* first = nullptr;
  std::size_t stride = 0;
};

std::span<const std::byte> Storage::view(int index) {
  const auto& view = model_->bufferViews[std::size_t(index)];
  const std::string where = pointer("bufferViews", std::size_t(index));
  const auto slice = [&](std::size_t buffer, std::size_t offset, std::size_t length) {
    const auto bytes = buffers_.bytes[buffer];
    if (offset > bytes.size() || length > bytes.size() - offset)
      refuse_invalid("the buffer view has no data: its buffer is only a fallback", where);
    return bytes.subspan(offset, length);
  };
  const tinygltf::Value* packed = meshopt_of(view);
  if (packed == nullptr) return slice(std::size_t(view.buffer), view.byteOffset, view.byteLength);
  const auto found = decoded_.find(index);
  if (found != decoded_.end()) return found->second;
  const auto number = [&](const char* key) {
    return packed->Has(key) ? std::size_t(packed->Get(key).GetNumberAsInt()) : std::size_t(0);
  };
  const auto source = slice(number("buffer"), number("byteOffset"), number("byteLength"));
  return decoded_[index] = decode_meshopt(*packed, source, *budget_, where);
}

Storage::Elements Storage::elements(const tinygltf::Accessor& accessor, const std::string& where) {
  if (accessor.bufferView < 0 || accessor.bufferView == zero_view(*model_)) return {};
  const auto& view = model_->bufferViews[std::size_t(accessor.bufferView)];
  const auto bytes = this->view(accessor.bufferView);
  const int components = tinygltf::GetNumComponentsInType(std::uint32_t(accessor.type));
  const std::size_t element = component_bytes(accessor.componentType) * std::size_t(components);
  const std::size_t stride = view.byteStride != 0 ? view.byteStride : element;
  const std::size_t span = (accessor.count - 1) * stride + element;
  if (accessor.byteOffset > bytes.size() || span > bytes.size() - accessor.byteOffset)
    refuse_invalid("reaches past the end of its buffer view", where);
  return {bytes.data() + accessor.byteOffset, stride};
}

template <class Value, class Convert>
void Storage::read_sparse(const tinygltf::Accessor& accessor, const std::string& where,
                          std::vector<Value>& values, std::size_t components, Convert convert) {
  const std::size_t bytes = component_bytes(accessor.componentType);
  const auto count = std::size_t(accessor.sparse.count);
  const auto indices = view(accessor.sparse.indices.bufferView);
  const auto replaced = view(accessor.sparse.values.bufferView);
  const std::size_t index_bytes = component_bytes(accessor.sparse.indices.componentType);
  const auto index_offset = std::size_t(accessor.sparse.indices.byteOffset);
  const auto value_offset = std::size_t(accessor.sparse.values.byteOffset);
  if (index_offset + count * index_bytes > indices.size() ||
      value_offset + count * components * bytes > replaced.size())
    refuse_invalid("the sparse values reach past the end of their buffer view", where + "/sparse");
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t target =
        to_integer(indices.data() + index_offset + i * index_bytes, accessor.sparse.indices.componentType);
    if (target >= accessor.count)
      refuse_invalid("sparse index " + std::to_string(i) + " names an element that does not exist",
                     where + "/sparse/indices");
    for (std::size_t c = 0; c < components; ++c)
      values[target * components + c] =
          convert(replaced.data() + value_offset + (i * components + c) * bytes);
  }
}

template <class Value, class Convert>
std::vector<Value> Storage::read(int index, std::size_t components, Convert convert) {
  const auto& accessor = this->accessor(index);
  const std::string where = pointer("accessors", std::size_t(index));
  if (std::size_t(tinygltf::GetNumComponentsInType(std::uint32_t(accessor.type))) != components)
    refuse_invalid("the accessor's type does not fit its use", where);
  budget_->take(accessor.count, components * sizeof(Value), where);
  std::vector<Value> values(accessor.count * components, Value(0));
  const Elements source = elements(accessor, where);
  const std::size_t bytes = component_bytes(accessor.componentType);
  if (source.first != nullptr) {
    for (std::size_t i = 0; i < accessor.count; ++i)
      for (std::size_t c = 0; c < components; ++c)
        values[i * components + c] = convert(source.first + i * source.stride + c * bytes);
  }
  if (accessor.sparse.isSparse) read_sparse(accessor, where, values, components, convert);
  return values;
}

std::vector<float> Storage::floats(int index, std::size_t components) {
  const auto& accessor = this->accessor(index);
  return read<float>(index, components, [&](const std::byte* bytes) {
    return to_float(bytes, accessor.componentType, accessor.normalized);
  });
}

std::vector<std::uint32_t> Storage::integers(int index, std::size_t components) {
  const auto& accessor = this->accessor(index);
  const int type = accessor.componentType;
  if (type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
      type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
    refuse_invalid("must hold unsigned integers", pointer("accessors", std::size_t(index)));
  return read<std::uint32_t>(index, components,
                             [type](const std::byte* bytes) { return to_integer(bytes, type); });
}

}  // namespace gridcast::io
