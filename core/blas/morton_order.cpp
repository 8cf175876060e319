#include "core/blas/morton_order.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

namespace gridcast::blas {
namespace {

constexpr int kAxisBits = kMortonBits / 3;
/// Keys that one task counts and moves.
constexpr std::size_t kBlock = std::size_t(1) << 15;
/// Sets below are not worth the counters.
constexpr std::size_t kSmall = std::size_t(1) << 12;
/// 2^11 counters and as many places to write to stay in the first two caches.
constexpr int kDigitBits = 11;
constexpr std::size_t kDigits = std::size_t(1) << kDigitBits;
/// Three passes order by the highest 33 bits, 2048 cells an axis, in which most triangles are alone; the few
/// that share a cell are sorted by comparing.
constexpr int kLowestDigit = kMortonBits - 3 * kDigitBits;

bool precedes(const MortonKey& a, const MortonKey& b) {
  return a.code != b.code ? a.code < b.code : a.reference < b.reference;
}

/// Two zeros after every bit of the lowest 21.
std::uint64_t spread_bits(std::uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffff;
  x = (x | x << 16) & 0x001f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  x = (x | x << 2) & 0x1249249249249249;
  return x;
}

/// Centers to codes. In double: cells per length of a tiny mesh overflow a float.
class Encoder {
 public:
  explicit Encoder(const Box4& centers) : origin_(first_three(centers.lower)) {
    const Float4 extent = centers.extent();
    const double longest = std::max({extent[0], extent[1], extent[2]});
    if (longest > 0.0) scale_ = kCells / longest;
  }
  [[nodiscard]] std::uint64_t operator()(const BuildReference& reference) const {
    const Float4 offset = doubled_center(reference.box()) - origin_;
    return spread_bits(cell(offset[0])) << 2 | spread_bits(cell(offset[1])) << 1 |
           spread_bits(cell(offset[2]));
  }

 private:
  static constexpr double kCells = double(1 << kAxisBits);
  [[nodiscard]] std::uint64_t cell(float offset) const {
    return std::uint64_t(std::min(double(offset) * scale_, kCells - 1.0));
  }
  Float4 origin_;
  double scale_ = 0.0;
};

template <class Visit>
void for_each_block(std::size_t count, const Visit& visit) {
  oneapi::tbb::parallel_for(std::size_t(0), (count + kBlock - 1) / kBlock, [&](std::size_t block) {
    visit(block, block * kBlock, std::min(count, (block + 1) * kBlock));
  });
}

/// One pass of a stable radix sort: every block counts its digits, then moves its keys to where the blocks
/// before it leave off.
class RadixPass {
 public:
  explicit RadixPass(std::size_t count) : counts_((count + kBlock - 1) / kBlock) {}

  void run(const MortonKeys& from, MortonKeys& to, int lowest_bit) {
    const auto digit = [lowest_bit](const MortonKey& key) {
      return std::size_t(key.code >> lowest_bit) & (kDigits - 1);
    };
    for_each_block(from.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
      counts_[block].fill(0);
      for (std::size_t i = begin; i < end; ++i) ++counts_[block][digit(from[i])];
    });
    std::size_t place = 0;
    for (std::size_t d = 0; d < kDigits; ++d)
      for (auto& count : counts_) place += std::exchange(count[d], place);
    for_each_block(from.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) to[counts_[block][digit(from[i])]++] = from[i];
    });
  }

 private:
  std::vector<std::array<std::size_t, kDigits>> counts_;
};

/// Sorts each run of keys that agree in the bits above kLowestDigit; a block sorts those that begin in it.
void finish_runs(MortonKeys& keys) {
  const auto cell = [&](std::size_t i) { return keys[i].code >> kLowestDigit; };
  // Where runs begin and end is found before any key moves: sorting a run would not change it, but another
  // thread must not read keys that move.
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> runs_of((keys.size() + kBlock - 1) / kBlock);
  for_each_block(keys.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
    std::size_t i = begin;
    while (i > 0 && i < end && cell(i) == cell(i - 1)) ++i;
    while (i < end) {
      std::size_t after = i + 1;
      while (after < keys.size() && cell(after) == cell(i)) ++after;
      if (after - i > 1) runs_of[block].emplace_back(i, after);
      i = after;
    }
  });
  oneapi::tbb::parallel_for(std::size_t(0), runs_of.size(), [&](std::size_t block) {
    for (const auto& [begin, end] : runs_of[block]) {
      MortonKey *first = keys.data() + begin, *last = keys.data() + end;
      // Equal centers are in order already.
      if (std::is_sorted(first, last, precedes)) continue;
      if (end - begin > kBlock)
        oneapi::tbb::parallel_sort(first, last, precedes);
      else
        std::sort(first, last, precedes);
    }
  });
}

}  // namespace

MortonKeys morton_order(std::span<const BuildReference> references, const Box4& centers) {
  MortonKeys keys(references.size());
  const Encoder encode(centers);
  for_each_block(keys.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) keys[i] = {encode(references[i]), std::uint32_t(i)};
  });
  if (keys.size() < kSmall) {
    std::sort(keys.begin(), keys.end(), precedes);
    return keys;
  }
  MortonKeys other(keys.size());
  RadixPass pass(keys.size());
  for (int lowest_bit = kLowestDigit; lowest_bit < kMortonBits; lowest_bit += kDigitBits) {
    pass.run(keys, other, lowest_bit);
    keys.swap(other);
  }
  finish_runs(keys);
  return keys;
}

}  // namespace gridcast::blas
