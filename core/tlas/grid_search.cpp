#include "core/tlas/block_search.h"

namespace gridcast::tlas {
namespace {

struct VisitBlocks {
  const GridLayout& layout;
  const BoxTable& boxes;
  const WorldRay& ray;
  const InstanceVisitor& visitor;
  double t_far;

  [[nodiscard]] double far() const { return t_far; }
  bool test(const Cell& block, const Span& /*span*/, const GridBlock* held) {
    if (held == nullptr) return true;
    for (const std::uint32_t id : held->listed()) {
      const InstanceBox& box = boxes[id];
      const Span span = intersect_alone(ray, box, t_far);
      if (!span.empty() && block_to_test_in(layout, ray, box, span.enter) == block)
        t_far = visitor.visit(visitor.object, id);
    }
    return true;
  }
};

}  // namespace

double UniformGrid::search(const WorldRay& ray, double far, const BoxTable& boxes,
                           const InstanceVisitor& visitor) const {
  VisitBlocks blocks{layout_, boxes, ray, visitor, far};
  BlockSearch(*this, ray, blocks).run();
  return blocks.t_far;
}

}  // namespace gridcast::tlas
