#pragma once
// Built trees as bytes, so that a later process need not build them again.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "core/blas/blas.h"

namespace gridcast::blas {

/// Changes with every change of what is written, and when a builder gets so much better that older trees are
/// not worth keeping; decoding refuses another.
inline constexpr std::uint32_t kTreeFormat = 1;

/// The structures that are worth it: BVHs and the kd-tree. Brute force has nothing to build, and Embree's
/// trees cannot be written.
[[nodiscard]] bool is_encodable(StructureKind kind);

/// The tree without its mesh, and what is known of how it was built. kUnsupported unless is_encodable();
/// kLimitExceeded without the memory.
[[nodiscard]] Result<std::string> encode_tree(const Blas& blas);

/// The tree that encode_tree() was given, over `mesh`, which is valid and has the same triangles and
/// vertices: same answers, same refits, same repairs. Whatever the bytes are, the result can be asked; that
/// they are what was written is for a checksum to say. kInvalidFile, kUnsupported (another format),
/// kLimitExceeded without the memory.
[[nodiscard]] Result<Blas> decode_tree(std::shared_ptr<const mesh::TriangleMesh> mesh,
                                       std::string_view bytes);

}  // namespace gridcast::blas
