#include <chrono>
#include <new>

#include "core/blas/blas.h"
#include "core/blas/wide_repair.h"

namespace gridcast::blas {

Result<Repair> Blas::repair(const std::stop_token& stop) const try {
  const auto start = std::chrono::steady_clock::now();
  const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure_);
  if (wide == nullptr) {
    return Error{ErrorCode::kUnsupported,
                 "a " + std::string(to_string(stats_.kind)) + " cannot be repaired; rebuild it",
                 {}};
  }
  Result<WideRepair> made = (*wide)->repair(*mesh_, stop);
  if (!made) return made.error();
  Repair repair{.blas = *this,
                .outcome = made->outcome,
                .triangles = made->triangles,
                .subtrees = made->subtrees,
                .cost_before = stats_.cost};
  if (made->tree) {
    repair.blas.structure_ = std::move(made->tree);
    repair.blas.add_structure_stats();
    StructureStats& stats = repair.blas.stats_;
    stats.cost_at_build = made->fresh_cost;
    stats.looseness_at_build = stats.looseness * (stats.cost > 0.0 ? made->fresh_cost / stats.cost : 1.0);
  }
  repair.cost_after = repair.blas.stats().cost;
  repair.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return repair;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for this structure", {}};
}

}  // namespace gridcast::blas
