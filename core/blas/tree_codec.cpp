#include "core/blas/tree_codec.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "core/blas/bvh.h"
#include "core/blas/compact_bvh.h"
#include "core/blas/kd_tree.h"
#include "core/blas/tree_bytes.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
namespace {

/// "GCTR".
constexpr std::uint32_t kMagic = 0x52544347;
constexpr std::size_t kMaxReasonBytes = 1024;

/// What stands before the columns of a structure.
struct Head {
  std::uint32_t magic = kMagic;
  std::uint32_t format = kTreeFormat;
  std::uint64_t triangle_count = 0;
  std::uint64_t vertex_count = 0;
  double cost_at_build = 0.0;
  double looseness_at_build = 0.0;
  double build_ms = 0.0;
  std::uint32_t refits_since_build = 0;
  std::uint8_t kind = 0;
  std::uint8_t asked_kind = 0;
  std::uint8_t split = 0;
  std::uint8_t spatial = 0;
  std::uint8_t motion = 0;
  std::uint8_t quality = 0;
  std::uint16_t reason_bytes = 0;
  std::uint32_t unused = 0;  ///< no padding: it would be anything
};
static_assert(sizeof(Head) == 64);

Error invalid(std::string message) {
  return {ErrorCode::kInvalidFile, std::move(message), ""};
}

bool is_size(double value) {
  return std::isfinite(value) && value >= 0.0;
}

bool is_plain_text(std::string_view text) {
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
}

Status check(const Head& head, const mesh::TriangleMesh& mesh) {
  if (head.magic != kMagic) return invalid("it holds something else");
  if (head.format != kTreeFormat)
    return Error{ErrorCode::kUnsupported, "it was written in format " + std::to_string(head.format), ""};
  if (head.triangle_count != mesh.triangle_count() || head.vertex_count != mesh.positions.size())
    return invalid("it is the tree of another mesh");
  const bool enums = head.asked_kind <= std::uint8_t(StructureKind::kCompactBvh) &&
                     head.split <= std::uint8_t(BvhSplit::kBinnedSah) &&
                     head.spatial <= std::uint8_t(SpatialSplits::kNever) &&
                     head.motion <= std::uint8_t(MeshMotion::kDeforms) &&
                     head.quality <= std::uint8_t(BuildQuality::kFast);
  if (!enums || !is_size(head.cost_at_build) || !is_size(head.looseness_at_build) ||
      !is_size(head.build_ms) || head.reason_bytes > kMaxReasonBytes)
    return invalid("it breaks its format");
  return ok_status();
}

std::string read_reason(TreeReader& in, std::size_t size) {
  std::string reason(size, '\0');
  for (char& c : reason) c = in.value<char>();
  return reason;
}

}  // namespace

/// Knows what a Blas is made of.
class TreeCodec {
 public:
  static std::string encode(const Blas& blas) {
    const StructureStats& stats = blas.stats();
    const BuildOptions& options = blas.options();
    const std::string reason = stats.reason.substr(0, kMaxReasonBytes);
    TreeWriter out;
    out.value(Head{.triangle_count = blas.mesh().triangle_count(),
                   .vertex_count = blas.mesh().positions.size(),
                   .cost_at_build = stats.cost_at_build,
                   .looseness_at_build = stats.looseness_at_build,
                   .build_ms = stats.build_ms,
                   .refits_since_build = stats.refits_since_build,
                   .kind = std::uint8_t(stats.kind),
                   .asked_kind = std::uint8_t(options.kind),
                   .split = std::uint8_t(options.split),
                   .spatial = std::uint8_t(options.spatial),
                   .motion = std::uint8_t(options.motion),
                   .quality = std::uint8_t(options.quality),
                   .reason_bytes = std::uint16_t(reason.size())});
    for (const char c : reason) out.value(c);
    std::visit(
        [&out](const auto& structure) {
          if constexpr (requires { structure->write(out); }) structure->write(out);
        },
        blas.structure_);
    return out.take();
  }

  static Result<Blas> decode(std::shared_ptr<const mesh::TriangleMesh> mesh, std::string_view bytes) {
    TreeReader in(bytes);
    const auto head = in.value<Head>();
    if (in.failed()) return invalid("it is cut off");
    if (Status status = check(head, *mesh); !status) return status.error();
    Blas blas;
    blas.stats_.reason = read_reason(in, head.reason_bytes);
    if (!is_plain_text(blas.stats_.reason)) return invalid("it breaks its format");
    if (Status status = read(StructureKind(head.kind), *mesh, in, blas); !status) return status.error();
    if (!in.ended()) return invalid("it does not end with its tree");
    blas.set_mesh(std::move(mesh));
    blas.bounds_ = blas.mesh_->bounds();  // whatever the tree's boxes say
    blas.options_ = {StructureKind(head.asked_kind), BvhSplit(head.split), SpatialSplits(head.spatial),
                     MeshMotion(head.motion), BuildQuality(head.quality)};
    blas.stats_.kind = StructureKind(head.kind);
    blas.stats_.cost_at_build = head.cost_at_build;
    blas.stats_.looseness_at_build = head.looseness_at_build;
    blas.stats_.build_ms = head.build_ms;
    blas.stats_.refits_since_build = head.refits_since_build;
    blas.add_structure_stats();
    return blas;
  }

 private:
  template <class T>
  static Status read_as(const mesh::TriangleMesh& mesh, TreeReader& in, Blas& blas) {
    auto structure = T::read(mesh, in);
    if (!structure) return structure.error();
    blas.structure_ = *std::move(structure);
    return ok_status();
  }

  static Status read(StructureKind kind, const mesh::TriangleMesh& mesh, TreeReader& in, Blas& blas) {
    if (kind == StructureKind::kBvh) return read_as<Bvh>(mesh, in, blas);
    if (kind == StructureKind::kWideBvh) return read_as<WideBvh>(mesh, in, blas);
    if (kind == StructureKind::kCompactBvh) return read_as<CompactBvh>(mesh, in, blas);
    if (kind == StructureKind::kKdTree) return read_as<KdTree>(mesh, in, blas);
    return invalid("it holds no tree");
  }
};

bool is_encodable(StructureKind kind) {
  return kind == StructureKind::kBvh || kind == StructureKind::kWideBvh ||
         kind == StructureKind::kCompactBvh || kind == StructureKind::kKdTree;
}

Result<std::string> encode_tree(const Blas& blas) try {
  if (!is_encodable(blas.stats().kind)) {
    return Error{ErrorCode::kUnsupported,
                 "a " + std::string(to_string(blas.stats().kind)) + " structure cannot be written", ""};
  }
  return TreeCodec::encode(blas);
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory to write a tree", ""};
}

Result<Blas> decode_tree(std::shared_ptr<const mesh::TriangleMesh> mesh, std::string_view bytes) try {
  return TreeCodec::decode(std::move(mesh), bytes);
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for this structure", ""};
}

}  // namespace gridcast::blas
