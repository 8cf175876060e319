#include <string>

#include "core/io/gltf_check.h"

namespace gridcast::io {
namespace {

/// The end of `count` elements `stride` apart, the last one `element` bytes long. No overflow: every
/// factor is bounded (kMaxCount * 256).
std::int64_t end_of(std::int64_t offset, std::int64_t count, std::int64_t stride, std::size_t element) {
  return count == 0 ? offset : offset + (count - 1) * stride + std::int64_t(element);
}

struct ViewShape {
  std::int64_t length = 0;
  std::int64_t stride = 0;  ///< 0 = tightly packed
};

void check_buffers(const Cursor& root) {
  root.each_object("buffers", [](const Cursor& buffer, std::size_t) {
    (void)buffer.require("byteLength").integer(1, kMaxCount);
    if (const auto uri = buffer.find("uri")) uri->expect_string();
  });
}

/// byteOffset and byteLength of `slice` lie within its buffer.
void check_slice(const Cursor& root, const Cursor& slice) {
  const auto buffers = root.find("buffers");
  const auto index = slice.require("buffer").index(buffers ? buffers->size() : 0);
  const std::int64_t available = buffers->element(index).json()["byteLength"].get<std::int64_t>();
  const std::int64_t offset = slice.integer_or("byteOffset", 0, kMaxCount, 0);
  const std::int64_t length = slice.require("byteLength").integer(1, kMaxCount);
  if (length > available - offset) slice.refuse_here("reaches past the end of its buffer");
}

void check_meshopt(const Cursor& root, const Cursor& view, const Cursor& packed) {
  check_slice(root, packed);
  const std::int64_t stride = packed.require("byteStride").integer(1, 256);
  const std::int64_t count = packed.require("count").integer(1, kMaxCount);
  packed.require("mode").expect_string();
  if (const auto filter = packed.find("filter")) filter->expect_string();
  if (stride * count != view.json()["byteLength"].get<std::int64_t>())
    packed.refuse_here("count times byteStride is not the buffer view's byteLength");
}

void check_views(const Cursor& root) {
  root.each_object("bufferViews", [&](const Cursor& view, std::size_t) {
    check_slice(root, view);
    const std::int64_t stride = view.integer_or("byteStride", 4, 252, 4);
    if (stride % 4 != 0) view.require("byteStride").refuse_here("must be a multiple of 4");
    const auto extensions = view.find("extensions");
    if (!extensions) return;
    if (const auto packed = meshopt_extension(*extensions)) check_meshopt(root, view, *packed);
  });
}

ViewShape view_shape(const Cursor& root, std::uint32_t index) {
  const Json& view = root.json()["bufferViews"][index];
  return {view["byteLength"].get<std::int64_t>(), view.value("byteStride", std::int64_t(0))};
}

std::size_t view_count(const Cursor& root) {
  const auto views = root.find("bufferViews");
  return views ? views->size() : 0;
}

void check_within_view(const Cursor& root, const Cursor& owner, std::int64_t count, std::size_t element) {
  const auto index = owner.index_in("bufferView", view_count(root));
  const std::int64_t offset = owner.integer_or("byteOffset", 0, kMaxCount, 0);
  if (!index) return;
  const ViewShape view = view_shape(root, *index);
  const std::int64_t stride = view.stride != 0 ? view.stride : std::int64_t(element);
  if (stride < std::int64_t(element)) owner.refuse_here("its elements are larger than its view's byteStride");
  if (end_of(offset, count, stride, element) > view.length)
    owner.refuse_here("reaches past the end of its buffer view");
}

void check_sparse(const Cursor& root, const Cursor& accessor, std::int64_t count,
                  const ElementLayout& layout) {
  const auto sparse = accessor.find("sparse");
  if (!sparse) return;
  const std::int64_t replaced = sparse->require("count").integer(1, count);
  const Cursor indices = sparse->require("indices");
  const std::int64_t type = indices.require("componentType").integer(kUnsignedByte, kUnsignedInt);
  if (type == kShort) indices.refuse_here("sparse indices must be unsigned");
  const Cursor values = sparse->require("values");
  (void)indices.require("bufferView");
  (void)values.require("bufferView");
  check_within_view(root, indices, replaced, element_layout("SCALAR", type).element_bytes);
  check_within_view(root, values, replaced, layout.element_bytes);
}

void check_accessors(const Cursor& root) {
  root.each_object("accessors", [&](const Cursor& accessor, std::size_t) {
    const Cursor type = accessor.require("type");
    type.expect_string();
    const Cursor component = accessor.require("componentType");
    const ElementLayout layout =
        element_layout(type.json().get_ref<const std::string&>(), component.integer(kByte, kFloat));
    if (layout.components == 0) accessor.refuse_here("unknown type or componentType");
    const std::int64_t count = accessor.require("count").integer(1, kMaxCount);
    if (const auto normalized = accessor.find("normalized"); normalized && !normalized->json().is_boolean())
      normalized->refuse_here("must be true or false");
    accessor.expect_numbers_in("min", layout.components);
    accessor.expect_numbers_in("max", layout.components);
    check_within_view(root, accessor, count, layout.element_bytes);
    check_sparse(root, accessor, count, layout);
  });
}

std::size_t component_bytes(std::int64_t component_type) {
  switch (component_type) {
    case kByte:
    case kUnsignedByte:
      return 1;
    case kShort:
    case kUnsignedShort:
      return 2;
    case kUnsignedInt:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

}  // namespace

ElementLayout element_layout(std::string_view type, std::int64_t component_type) {
  struct Shape {
    std::string_view name;
    std::size_t columns, rows;
  };
  static constexpr Shape kShapes[] = {{"SCALAR", 1, 1}, {"VEC2", 1, 2}, {"VEC3", 1, 3}, {"VEC4", 1, 4},
                                      {"MAT2", 2, 2},   {"MAT3", 3, 3}, {"MAT4", 4, 4}};
  const std::size_t bytes = component_bytes(component_type);
  if (bytes == 0) return {};
  for (const Shape& shape : kShapes) {
    if (shape.name != type) continue;
    // Matrix columns start at multiples of four bytes; a vector is one column without padding.
    const std::size_t column = shape.columns > 1 ? (shape.rows * bytes + 3) / 4 * 4 : shape.rows * bytes;
    return {shape.columns * shape.rows, bytes, shape.columns * column};
  }
  return {};
}

std::optional<Cursor> meshopt_extension(const Cursor& extensions) {
  for (const char* name : kMeshoptExtensions)
    if (auto packed = extensions.find(name)) return packed;
  return std::nullopt;
}

void check_storage(const Cursor& root) {
  check_buffers(root);
  check_views(root);
  check_accessors(root);
}

}  // namespace gridcast::io
