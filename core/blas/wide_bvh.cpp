#include "core/blas/wide_bvh.h"

#include "core/blas/bvh_builder.h"
#include "core/blas/wide_layout.h"

namespace gridcast::blas {

Result<std::shared_ptr<const WideBvh>> WideBvh::build(const mesh::TriangleMesh& mesh,
                                                      const BuildOptions& options, std::stop_token stop) {
  if (mesh.triangle_count() >= wide_child::kIndexMask)
    return Error{ErrorCode::kLimitExceeded, "more than 2^30 triangles in one mesh", "/triangles"};
  auto wide = std::make_shared<WideBvh>();
  if (mesh.triangles.empty()) return std::shared_ptr<const WideBvh>(wide);
  BvhBuildConfig config;
  config.block = LeafBlock::kFour;
  config.spatial = wide->spatial_ = options.spatial;
  Result<BvhTree> tree = build_bvh(mesh, config, std::move(stop));
  if (!tree) return tree.error();
  wide->reference_count_ = tree->primitive_ids.size();
  lay_out(*tree, mesh, wide->nodes_, wide->blocks_);
  return std::shared_ptr<const WideBvh>(wide);
}

}  // namespace gridcast::blas
