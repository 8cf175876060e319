#include "core/blas/morton_order.h"

#include <algorithm>
#include <array>
#include <utility>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

namespace gridcast::blas {
namespace {

/// Keys that one task counts and moves.
constexpr std::size_t kBlock = std::size_t(1) << 15;
/// Sets below are not worth the counters.
constexpr std::size_t kSmall = std::size_t(1) << 10;
/// 2^11 counters and as many places to write to stay in the first two caches; three passes order all codes.
constexpr int kDigitBits = 11;
constexpr std::size_t kDigits = std::size_t(1) << kDigitBits;
constexpr int kKeyBits = kMortonNumberBits + 3 * kMortonAxisBits;

/// Two zeros after every bit of the lowest 11 of each lane.
Int4 spread_bits(Int4 x) {
  const auto all = [](std::int32_t bits) { return Int4{bits, bits, bits, bits}; };
  x = (x | x << 16) & all(0x070000ff);
  x = (x | x << 8) & all(0x0700f00f);
  x = (x | x << 4) & all(0x430c30c3);
  return (x | x << 2) & all(0x49249249);
}

/// Centers to the codes of their cells.
class Encoder {
 public:
  explicit Encoder(const Box4& bounds) : origin_(first_three(bounds.lower)) {
    const Float4 extent = bounds.extent();
    // Within a tinier mesh cells per length would overflow; it is one cell.
    const float longest = std::max({extent[0], extent[1], extent[2], 0x1p-100F});
    scale_ = broadcast(kCells / longest);
  }
  [[nodiscard]] std::uint64_t operator()(Float4 center) const {
    const Float4 place = min((first_three(center) - origin_) * scale_, broadcast(kCells - 1.F));
    const Int4 bits = spread_bits(__builtin_convertvector(place, Int4));
    return std::uint64_t(std::uint32_t(bits[0])) << 2 | std::uint64_t(std::uint32_t(bits[1])) << 1 |
           std::uint64_t(std::uint32_t(bits[2]));
  }

 private:
  static constexpr float kCells = float(1 << kMortonAxisBits);
  Float4 origin_;
  Float4 scale_;
};

/// The same with 21 bits an axis. In double: cells per length of a tiny mesh overflow a float.
class FineEncoder {
 public:
  explicit FineEncoder(const Box4& bounds) : origin_(first_three(bounds.lower)) {
    const Float4 extent = bounds.extent();
    const double longest = std::max({extent[0], extent[1], extent[2]});
    if (longest > 0.0) scale_ = kCells / longest;
  }
  [[nodiscard]] std::uint64_t operator()(Float4 center) const {
    const Float4 offset = first_three(center) - origin_;
    return spread(cell(offset[0])) << 2 | spread(cell(offset[1])) << 1 | spread(cell(offset[2]));
  }

 private:
  static constexpr double kCells = double(1 << 21);
  [[nodiscard]] std::uint64_t cell(float offset) const {
    return std::uint64_t(std::min(double(offset) * scale_, kCells - 1.0));
  }
  /// Two zeros after every bit of the lowest 21.
  static std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 32) & 0x001f00000000ffff;
    x = (x | x << 16) & 0x001f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    x = (x | x << 2) & 0x1249249249249249;
    return x;
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
    const auto digit = [lowest_bit](MortonKey key) { return std::size_t(key >> lowest_bit) & (kDigits - 1); };
    for_each_block(from.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
      counts_[block].fill(0);
      for (std::size_t i = begin; i < end; ++i) ++counts_[block][digit(from[i])];
    });
    std::uint32_t place = 0;
    for (std::size_t d = 0; d < kDigits; ++d)
      for (auto& count : counts_) place += std::exchange(count[d], place);
    for_each_block(from.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) to[counts_[block][digit(from[i])]++] = from[i];
    });
  }

 private:
  std::vector<std::array<std::uint32_t, kDigits>> counts_;
};

/// Puts the keys of one cell in order.
void order_cell(std::span<MortonKey> keys, std::span<const Float4> centers, const FineEncoder& encode) {
  using Fine = std::pair<std::uint64_t, MortonKey>;
  std::vector<Fine> fine;
  fine.reserve(keys.size());
  for (const MortonKey key : keys) fine.emplace_back(encode(centers[morton_number(key)]), key);
  if (keys.size() > kBlock)
    oneapi::tbb::parallel_sort(fine.begin(), fine.end());
  else
    std::sort(fine.begin(), fine.end());
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = fine[i].second;
}

/// Puts crowded cells in order; a block those that begin in it.
void order_cells(MortonKeys& keys, std::span<const Float4> centers, const FineEncoder& encode) {
  const auto same = [&](std::size_t a, std::size_t b) {
    return (keys[a] ^ keys[b]) >> kMortonNumberBits == 0;
  };
  const std::size_t last = keys.size() - std::min(keys.size(), kMaxUnorderedCell);
  // Codes do not change, so blocks may look at each other's keys; but only between the two loops.
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> cells_of((keys.size() + kBlock - 1) / kBlock);
  for_each_block(keys.size(), [&](std::size_t block, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < std::min(end, last); ++i) {
      if (!same(i, i + kMaxUnorderedCell) || (i > 0 && same(i - 1, i))) continue;
      std::size_t after = i + kMaxUnorderedCell + 1;
      while (after < keys.size() && same(i, after)) ++after;
      cells_of[block].emplace_back(i, after);
      i = after - 1;
    }
  });
  oneapi::tbb::parallel_for(std::size_t(0), cells_of.size(), [&](std::size_t block) {
    for (const auto& [begin, end] : cells_of[block])
      order_cell(std::span(keys).subspan(begin, end - begin), centers, encode);
  });
}

}  // namespace

MortonKeys morton_order(std::span<const Float4> centers, const Box4& bounds) {
  MortonKeys keys(centers.size());
  const Encoder encode(bounds);
  for_each_block(keys.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) keys[i] = encode(centers[i]) << kMortonNumberBits | i;
  });
  if (keys.size() < kSmall) {
    std::sort(keys.begin(), keys.end());
  } else {
    MortonKeys other(keys.size());
    RadixPass pass(keys.size());
    for (int lowest_bit = kMortonNumberBits; lowest_bit < kKeyBits; lowest_bit += kDigitBits) {
      pass.run(keys, other, lowest_bit);
      keys.swap(other);
    }
  }
  order_cells(keys, centers, FineEncoder(bounds));
  return keys;
}

}  // namespace gridcast::blas
