#include <string>

#include "core/io/gltf_check.h"

namespace gridcast::io {
namespace {

/// What a primitive may refer to.
struct Collections {
  const Json* accessors = nullptr;
  std::size_t accessor_count = 0;
  std::size_t view_count = 0;
  std::size_t material_count = 0;
};

std::size_t count_of(const Cursor& root, const char* name) {
  const auto array = root.find(name);
  return array ? array->size() : 0;
}

std::int64_t accessor_number(const Collections& all, std::uint32_t index, const char* key) {
  return (*all.accessors)[index][key].get<std::int64_t>();
}

/// An object of semantic -> accessor index. All have the same number of elements, which is returned (-1 when
/// there are none); `expected` >= 0 is what it must be.
std::int64_t check_semantics(const Collections& all, const Cursor& attributes, std::int64_t expected) {
  attributes.expect_object();
  std::int64_t count = expected;
  for (const auto& [name, value] : attributes.json().items()) {
    const Cursor attribute = attributes.require(name.c_str());
    const std::uint32_t index = attribute.index(all.accessor_count);
    const std::int64_t elements = accessor_number(all, index, "count");
    if (count >= 0 && elements != count)
      attribute.refuse_here("its accessor has another count than the others");
    count = elements;
    const std::string& type = (*all.accessors)[index]["type"].get_ref<const std::string&>();
    if ((name == "POSITION" || name == "NORMAL") && type != "VEC3")
      attribute.refuse_here("must be a VEC3 accessor");
  }
  return count;
}

void check_indices(const Collections& all, const Cursor& primitive) {
  const auto indices = primitive.find("indices");
  if (!indices) return;
  const std::uint32_t index = indices->index(all.accessor_count);
  const std::int64_t type = accessor_number(all, index, "componentType");
  const bool unsigned_integer = type == kUnsignedByte || type == kUnsignedShort || type == kUnsignedInt;
  if (!unsigned_integer || (*all.accessors)[index]["type"] != "SCALAR")
    indices->refuse_here("indices must be unsigned scalars");
}

void check_draco(const Collections& all, const Cursor& primitive) {
  const auto extensions = primitive.find("extensions");
  if (!extensions) return;
  const auto draco = extensions->find("KHR_draco_mesh_compression");
  if (!draco) return;
  (void)draco->require("bufferView").index(all.view_count);
  const Cursor attributes = draco->require("attributes");
  attributes.expect_object();
  for (const auto& item : attributes.json().items())
    (void)attributes.require(item.key().c_str()).integer(0, 0xFFFF);
}

/// Returns the number of morph targets.
std::size_t check_primitive(const Collections& all, const Cursor& primitive) {
  const std::int64_t vertices = check_semantics(all, primitive.require("attributes"), -1);
  check_indices(all, primitive);
  (void)primitive.integer_or("mode", 0, 6, 4);
  (void)primitive.index_in("material", all.material_count);
  check_draco(all, primitive);
  const auto targets = primitive.find("targets");
  if (!targets) return 0;
  for (std::size_t i = 0; i < targets->size(); ++i) (void)check_semantics(all, targets->element(i), vertices);
  return targets->size();
}

}  // namespace

void check_meshes(const Cursor& root) {
  const auto accessors = root.find("accessors");
  const Collections all{accessors ? &accessors->json() : nullptr, count_of(root, "accessors"),
                        count_of(root, "bufferViews"), count_of(root, "materials")};
  root.each_object("meshes", [&](const Cursor& mesh, std::size_t) {
    if (mesh.require("primitives").size() == 0) mesh.refuse_here("a mesh needs at least one primitive");
    std::size_t targets = 0;
    mesh.each_object("primitives", [&](const Cursor& primitive, std::size_t i) {
      const std::size_t n = check_primitive(all, primitive);
      if (i > 0 && n != targets)
        primitive.refuse_here("has another number of morph targets than the first primitive");
      targets = n;
    });
    const auto weights = mesh.find("weights");
    if (!weights) return;
    weights->expect_numbers();
    if (weights->size() != targets) weights->refuse_here("must have one weight per morph target");
  });
}

}  // namespace gridcast::io
