#include "core/io/gltf_meshopt.h"

#include <meshoptimizer.h>

#include "core/io/gltf_check.h"

namespace gridcast::io {
namespace {

/// First byte of an attribute stream of the codec's second version.
constexpr std::byte kVertexCodecVersion1{0xA1};

std::string text_of(const tinygltf::Value& extension, const char* key) {
  return extension.Has(key) && extension.Get(key).IsString() ? extension.Get(key).Get<std::string>() : "";
}

void check_stride(bool fits, const std::string& where) {
  if (!fits) refuse_invalid("the byteStride does not fit the compression mode or filter", where);
}

int decode_stream(const std::string& mode, std::span<std::byte> out, std::size_t count, std::size_t stride,
                  std::span<const std::byte> packed, const std::string& where) {
  const auto* source = reinterpret_cast<const unsigned char*>(packed.data());
  if (mode == "ATTRIBUTES") {
    check_stride(stride % 4 == 0, where);
    if (packed.front() == kVertexCodecVersion1)
      refuse(ErrorCode::kUnsupported, "version 1 of the meshopt vertex codec is not supported", where);
    return meshopt_decodeVertexBuffer(out.data(), count, stride, source, packed.size());
  }
  check_stride(stride == 2 || stride == 4, where);
  if (mode == "TRIANGLES") {
    if (count % 3 != 0) refuse_invalid("the count of compressed triangles is not a multiple of 3", where);
    return meshopt_decodeIndexBuffer(out.data(), count, stride, source, packed.size());
  }
  if (mode == "INDICES") return meshopt_decodeIndexSequence(out.data(), count, stride, source, packed.size());
  refuse_invalid("unknown meshopt compression mode", where);
}

void apply_filter(const std::string& filter, std::span<std::byte> data, std::size_t count, std::size_t stride,
                  const std::string& where) {
  if (filter.empty() || filter == "NONE") return;
  if (filter == "OCTAHEDRAL") {
    check_stride(stride == 4 || stride == 8, where);
    meshopt_decodeFilterOct(data.data(), count, stride);
  } else if (filter == "QUATERNION") {
    check_stride(stride == 8, where);
    meshopt_decodeFilterQuat(data.data(), count, stride);
  } else if (filter == "EXPONENTIAL") {
    check_stride(stride % 4 == 0, where);
    meshopt_decodeFilterExp(data.data(), count, stride);
  } else {
    refuse(ErrorCode::kUnsupported, "this meshopt filter is not supported", where);
  }
}

}  // namespace

const tinygltf::Value* meshopt_of(const tinygltf::BufferView& view) {
  for (const char* name : kMeshoptExtensions) {
    const auto found = view.extensions.find(name);
    if (found != view.extensions.end()) return &found->second;
  }
  return nullptr;
}

std::vector<std::byte> decode_meshopt(const tinygltf::Value& extension, std::span<const std::byte> packed,
                                      Budget& budget, const std::string& where) {
  const auto count = std::size_t(extension.Get("count").GetNumberAsInt());
  const auto stride = std::size_t(extension.Get("byteStride").GetNumberAsInt());
  const std::string mode = text_of(extension, "mode");
  const std::string filter = text_of(extension, "filter");
  if (packed.empty()) refuse_invalid("the compressed data is empty", where);
  budget.take(count, stride, where);
  std::vector<std::byte> data(count * stride);
  if (decode_stream(mode, data, count, stride, packed, where) != 0)
    refuse_invalid("the meshopt data is damaged", where);
  apply_filter(mode == "ATTRIBUTES" ? filter : "", data, count, stride, where);
  return data;
}

}  // namespace gridcast::io
