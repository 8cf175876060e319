#include "core/scene/raster.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace gridcast::scene {
namespace {

/// Narrower lines are not worth it, of wider ones four do not fit the caches.
constexpr std::size_t kNarrowest = 16, kWidest = 16384;
/// A line ends where a ray is so many times further from the one before it than that is from its own.
constexpr double kBreak = 8.0;
/// Rays may be so many times further apart across the lines than along them, or the other way round.
constexpr double kOblong = 3.0;
/// Places across the batch at which lines must lie as the first ones do.
constexpr std::size_t kPlaces = 16;

/// How far two rays are apart: their directions (scaled to a largest component of 1) and, in parts of the
/// scene, their origins.
class Distance {
 public:
  Distance(const RayBatch& rays, double diagonal) : rays_(rays), diagonal_(diagonal) {}
  [[nodiscard]] double operator()(std::size_t a, std::size_t b) const {
    const Ray p = rays_[a], q = rays_[b];
    return max_abs(p.direction / max_abs(p.direction) - q.direction / max_abs(q.direction)) +
           max_abs(p.origin - q.origin) / diagonal_;
  }

 private:
  const RayBatch& rays_;
  double diagonal_;
};

/// The first ray after `begin` that starts a line; 0 when there is none before `end`.
std::size_t next_line(const Distance& distance, std::size_t begin, std::size_t end) {
  double before = distance(begin, begin + 1);
  for (std::size_t i = begin + 2; i < end; ++i) {
    const double step = distance(i - 1, i);
    if (step > kBreak * before) return i;
    if (!(step > 0.0)) return 0;  // a ray twice, or one that is no ray
    before = step;
  }
  return 0;
}

/// Whether the rays around `i`, which is not at the end of its line, are about as near across as along.
bool is_square(const Distance& distance, std::size_t i, std::size_t width) {
  const double along = distance(i, i + 1), across = distance(i, i + width);
  return across <= kOblong * along && along <= kOblong * across;
}

}  // namespace

std::optional<Raster> find_raster(const RayBatch& rays, double diagonal) {
  const std::size_t count = rays.size();
  const Distance distance(rays, diagonal);
  const std::size_t first = count < 4 * kNarrowest ? 0 : next_line(distance, 0, std::min(count, kWidest));
  if (first == 0) return std::nullopt;
  const std::size_t second = next_line(distance, first, std::min(count, first + kWidest));
  if (second == 0) return std::nullopt;
  const std::size_t width = second - first;
  if (width < kNarrowest || width < first) return std::nullopt;
  const std::size_t lines = (count - first) / width;
  if (lines < 4) return std::nullopt;
  for (std::size_t place = 0; place < kPlaces; ++place) {
    const std::size_t line = first + place * (lines - 1) / kPlaces * width;
    if (!is_square(distance, line, width) || !is_square(distance, line + width / 2, width))
      return std::nullopt;
  }
  return Raster{width, width - first};
}

std::vector<std::uint32_t> order_by_tiles(const Raster& raster, std::size_t count) {
  constexpr std::size_t kSide = 4;
  const auto [width, missing] = raster;
  const std::size_t lines = (count + missing + width - 1) / width;
  std::vector<std::uint32_t> order(count);
  tbb::parallel_for(std::size_t(0), (lines + kSide - 1) / kSide, [&](std::size_t row) {
    const std::size_t top = row * kSide, bottom = std::min(top + kSide, lines);
    std::size_t next = top == 0 ? 0 : top * width - missing;
    for (std::size_t left = 0; left < width; left += kSide) {
      for (std::size_t y = top; y < bottom; ++y) {
        for (std::size_t x = left; x < std::min(left + kSide, width); ++x) {
          const std::size_t place = y * width + x;
          if (place >= missing && place - missing < count) order[next++] = std::uint32_t(place - missing);
        }
      }
    }
  });
  return order;
}

}  // namespace gridcast::scene
