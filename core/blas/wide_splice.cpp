#include "core/blas/wide_splice.h"

#include <algorithm>

#include <oneapi/tbb/parallel_for.h>

namespace gridcast::blas {
namespace {

/// Nodes that one task copies, with their blocks.
constexpr std::uint32_t kTaskNodes = 1024;

std::uint32_t blocks_of(const WideNode& node) {
  std::uint32_t blocks = 0;
  for (std::uint32_t slot = 0; slot < node.slots; ++slot)
    if (wide_child::is_leaf(node.child[slot])) blocks += wide_child::block_count(node.child[slot]);
  return blocks;
}

}  // namespace

Splice::Splice(const WideNodes& nodes, std::span<const Graft> grafts) {
  std::uint32_t begin = 0;
  for (const Graft& graft : grafts) {
    add({begin, graft.replaced.begin}, nullptr);
    add(graft.replaced, &graft);
    begin = graft.replaced.end;
  }
  add({begin, std::uint32_t(nodes.size())}, nullptr);
  place(nodes);
}

void Splice::add(const WideRange& old, const Graft* graft) {
  if (graft != nullptr) return pieces_.push_back({old, graft, 0, 0});
  for (std::uint32_t begin = old.begin; begin < old.end; begin += kTaskNodes)
    pieces_.push_back({{begin, std::min(begin + kTaskNodes, old.end)}, nullptr, 0, 0});
}

void Splice::place(const WideNodes& nodes) {
  std::vector<std::uint32_t> blocks(pieces_.size(), 0);
  oneapi::tbb::parallel_for(std::size_t(0), pieces_.size(), [&](std::size_t i) {
    const Piece& piece = pieces_[i];
    if (piece.graft != nullptr)
      blocks[i] = std::uint32_t(piece.graft->blocks.size());
    else
      for (std::uint32_t n = piece.old.begin; n < piece.old.end; ++n) blocks[i] += blocks_of(nodes[n]);
  });
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    Piece& piece = pieces_[i];
    piece.node = node_count_;
    piece.block = block_count_;
    node_count_ +=
        piece.graft != nullptr ? std::uint32_t(piece.graft->nodes.size()) : piece.old.end - piece.old.begin;
    block_count_ += blocks[i];
  }
}

void Splice::write(const WideBvh& old, const BlockCornersList& corners, const mesh::TriangleMesh& mesh,
                   const WideArrays& out) const {
  out.nodes.resize(node_count_);
  out.blocks.resize(block_count_);
  out.corners.resize(block_count_);
  oneapi::tbb::parallel_for(std::size_t(0), pieces_.size(), [&](std::size_t i) {
    if (pieces_[i].graft != nullptr)
      copy_graft(pieces_[i], mesh, out);
    else
      copy_kept(pieces_[i], old, corners, out);
  });
}

void Splice::copy_kept(const Piece& piece, const WideBvh& old, const BlockCornersList& corners,
                       const WideArrays& out) const {
  std::uint32_t block = piece.block;
  for (std::uint32_t i = piece.old.begin; i < piece.old.end; ++i) {
    WideNode node = old.nodes()[i];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
      std::uint32_t& link = node.child[slot];
      if (!wide_child::is_leaf(link)) {
        link = link < piece.old.end ? link - piece.old.begin + piece.node : new_node(link);
        continue;
      }
      const std::uint32_t from = wide_child::index(link), count = wide_child::block_count(link);
      std::copy_n(old.blocks().begin() + from, count, out.blocks.begin() + block);
      std::copy_n(corners.begin() + from, count, out.corners.begin() + block);
      link = wide_child::leaf(block, count);
      block += count;
    }
    out.nodes[piece.node + (i - piece.old.begin)] = node;
  }
}

void Splice::copy_graft(const Piece& piece, const mesh::TriangleMesh& mesh, const WideArrays& out) {
  const Graft& graft = *piece.graft;
  for (std::size_t i = 0; i < graft.nodes.size(); ++i) {
    WideNode node = graft.nodes[i];
    // A leaf's link holds its first block in the low bits.
    for (std::uint32_t slot = 0; slot < node.slots; ++slot)
      node.child[slot] += wide_child::is_leaf(node.child[slot]) ? piece.block : piece.node;
    out.nodes[piece.node + i] = node;
  }
  std::copy(graft.blocks.begin(), graft.blocks.end(), out.blocks.begin() + piece.block);
  for (std::size_t i = 0; i < graft.blocks.size(); ++i)
    out.corners[piece.block + i] = corners_of(graft.blocks[i], mesh);
}

std::uint32_t Splice::new_node(std::uint32_t old) const {
  const auto after =
      std::upper_bound(pieces_.begin(), pieces_.end(), old,
                       [](std::uint32_t n, const Piece& piece) { return n < piece.old.begin; });
  const Piece& piece = *std::prev(after);
  return piece.node + (old - piece.old.begin);
}

std::uint32_t Splice::old_node(std::uint32_t node) const {
  const auto after = std::upper_bound(pieces_.begin(), pieces_.end(), node,
                                      [](std::uint32_t n, const Piece& piece) { return n < piece.node; });
  const Piece& piece = *std::prev(after);
  return piece.graft != nullptr ? kGrafted : piece.old.begin + (node - piece.node);
}

}  // namespace gridcast::blas
