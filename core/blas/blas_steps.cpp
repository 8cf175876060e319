#include "core/blas/blas.h"
#include "core/blas/wide_steps.h"

namespace gridcast::blas {

Result<std::optional<double>> Blas::steps_per_ray(std::size_t rays, const std::stop_token& stop) const {
  const auto* const wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure_);
  if (wide == nullptr) return std::optional<double>();
  const auto steps = blas::steps_per_ray((*wide)->nodes(), (*wide)->blocks(), bounds_, rays, stop);
  if (!steps) return steps.error();
  return std::optional(*steps);
}

}  // namespace gridcast::blas
