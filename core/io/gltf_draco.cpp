#include "core/io/gltf_draco.h"

#include <draco/compression/decode.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>

namespace gridcast::io {
namespace {

constexpr std::uint16_t kMetadataFlag = 0x8000;
constexpr std::uint8_t kSequential = 0;
constexpr std::uint8_t kEdgebreaker = 1;
/// What the decoder holds per face and per vertex while it works: corner table, traversal, values (measured
/// generously; it only has to bound what a header can ask for).
constexpr std::size_t kBytesPerFace = 64;
constexpr std::size_t kBytesPerPoint = 64;

struct DracoSizes {
  std::uint64_t faces = 0;
  std::uint64_t points = 0;
};

/// The counts in the header, which the decoder allocates by before it has seen any data. "Draco 3D Bitstream
/// Specification" 2.2, sections "Draco header" and the two mesh methods.
bool read_sizes(draco::DecoderBuffer buffer, DracoSizes& sizes) {
  char magic[5];
  std::uint8_t major = 0, minor = 0, kind = 0, method = 0;
  std::uint16_t flags = 0;
  if (!buffer.Decode(magic, 5) || std::string_view(magic, 5) != "DRACO") return false;
  if (!buffer.Decode(&major) || !buffer.Decode(&minor) || !buffer.Decode(&kind) || !buffer.Decode(&method) ||
      !buffer.Decode(&flags))
    return false;
  if (kind != 1 || major != 2 || minor != 2) return false;
  buffer.set_bitstream_version(std::uint16_t(DRACO_BITSTREAM_VERSION(major, minor)));
  if ((flags & kMetadataFlag) != 0) return false;
  std::uint32_t faces = 0, points = 0;
  if (method == kSequential) {
    if (!draco::DecodeVarint(&faces, &buffer) || !draco::DecodeVarint(&points, &buffer)) return false;
  } else if (method == kEdgebreaker) {
    std::uint8_t traversal = 0;
    if (!buffer.Decode(&traversal)) return false;
    if (!draco::DecodeVarint(&points, &buffer) || !draco::DecodeVarint(&faces, &buffer)) return false;
  } else {
    return false;
  }
  sizes = {faces, points};
  return true;
}

}  // namespace

struct DracoMesh::Decoded {
  std::unique_ptr<draco::Mesh> mesh;
};

DracoMesh::DracoMesh(std::span<const std::byte> packed, Budget& budget, const std::string& where)
    : decoded_(std::make_unique<Decoded>()), budget_(&budget), where_(where) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  DracoSizes sizes;
  if (!read_sizes(buffer, sizes)) refuse_invalid("the Draco data has no header of a version 2.2 mesh", where);
  budget.take(sizes.faces, kBytesPerFace, where);
  budget.take(sizes.points, kBytesPerPoint, where);
  draco::Decoder decoder;
  auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
  if (!mesh.ok()) refuse_invalid("the Draco data is damaged", where);
  decoded_->mesh = std::move(mesh).value();
  budget.take(decoded_->mesh->num_points(), kBytesPerPoint, where);
}

DracoMesh::~DracoMesh() = default;

std::size_t DracoMesh::vertex_count() const {
  return decoded_->mesh->num_points();
}

std::size_t DracoMesh::face_count() const {
  return decoded_->mesh->num_faces();
}

std::vector<std::uint32_t> DracoMesh::indices() const {
  const draco::Mesh& mesh = *decoded_->mesh;
  budget_->take(mesh.num_faces(), 12, where_);
  std::vector<std::uint32_t> indices;
  indices.reserve(std::size_t(mesh.num_faces()) * 3);
  for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f)
    for (const draco::PointIndex& corner : mesh.face(f)) indices.push_back(corner.value());
  return indices;
}

template <class Value>
std::vector<Value> DracoMesh::values(std::uint32_t id, std::size_t components) const {
  const draco::Mesh& mesh = *decoded_->mesh;
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
  if (attribute == nullptr) refuse_invalid("the Draco data has no attribute " + std::to_string(id), where_);
  if (std::size_t(attribute->num_components()) != components)
    refuse_invalid("a Draco attribute has another number of components than its accessor", where_);
  budget_->take(vertex_count(), components * sizeof(Value), where_);
  std::vector<Value> values(vertex_count() * components);
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p) {
    const draco::AttributeValueIndex at = attribute->mapped_index(p);
    if (at.value() >= attribute->size() ||
        !attribute->ConvertValue<Value>(at, std::int8_t(components), &values[p.value() * components]))
      refuse_invalid("a Draco attribute value is out of range", where_);
  }
  return values;
}

std::vector<float> DracoMesh::floats(std::uint32_t id, std::size_t components) const {
  return values<float>(id, components);
}

std::vector<std::uint32_t> DracoMesh::integers(std::uint32_t id, std::size_t components) const {
  return values<std::uint32_t>(id, components);
}

}  // namespace gridcast::io
