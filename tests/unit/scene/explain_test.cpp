// One ray's way through both levels is the way that the ray takes.

#include "core/scene/explain.h"

#include <set>
#include <vector>

#include "core/scene/trace_one.h"
#include "core/scene/update.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

constexpr Precision kPrecisions[] = {Precision::kRobust, Precision::kFast, Precision::kExact};

Explanation told(const Scene& scene, const Ray& ray, const ExplainOptions& options = {}) {
  auto explanation = explain(scene, ray, options);
  EXPECT_TRUE(explanation.ok());
  return std::move(explanation).value();
}

/// The instances that the top level leads a ray to, in order.
template <Precision kPrecision>
std::vector<std::uint32_t> visits(const Scene& scene, const Ray& ray) {
  std::vector<std::uint32_t> ids;
  Hit best{.t = ray.tfar};
  mesh::ObjectRay object_ray;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    ids.push_back(id);
    const Instance instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (prepare_for(object_ray, instance, blas, ray, best.t, id, {}))
      blas.intersect<kPrecision>(object_ray, best);
    return best.t;
  });
  return ids;
}
std::vector<std::uint32_t> visits(const Explanation& way) {
  std::vector<std::uint32_t> ids;
  for (const WayStep& step : way.steps)
    if (const auto* instance = std::get_if<InstanceStep>(&step))
      if (instance->outcome == InstanceOutcome::kEntered || instance->outcome == InstanceOutcome::kMeshMissed)
        ids.push_back(instance->instance_id);
  return ids;
}

/// What has come up in the ways of a test, so that no kind of step goes untested.
struct Seen {
  std::set<InstanceOutcome> outcomes;
  std::set<TriangleVerdict> verdicts;
  std::set<CellContent> contents;
  WayCounts sums;
};

/// Follows a way step by step.
class WayReader {
 public:
  WayReader(const Scene& scene, Seen& seen) : scene_(scene), seen_(seen) {}

  void operator()(const CellStep& step) {
    const tlas::TopLevelStats& grid = stats();
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_LT(step.cell[axis], grid.cells[axis]);
    EXPECT_TRUE(cells_.insert(step.cell).second) << "a cell twice";
    EXPECT_EQ(open_, 0U) << "the list before was not told of whole";
    EXPECT_LE(step.t_enter, step.t_exit);
    EXPECT_GE(step.t_enter, last_exit_);
    last_exit_ = step.t_enter;
    EXPECT_EQ(step.instances == 0, step.content == CellContent::kEmpty);
    seen_.contents.insert(step.content);
    ++seen_.sums.cells;
    seen_.sums.skipped_blocks += step.skipped_blocks;
    open_ = step.content == CellContent::kList ? step.instances : 0;
  }
  void operator()(const BlockStep& step) {
    EXPECT_LE(step.t_enter, step.t_exit);
    EXPECT_EQ(open_, 0U) << "the block before was not told of whole";
    ++seen_.sums.blocks;
    open_ = step.instances;
  }
  void operator()(const CellNodeStep& step) {
    EXPECT_LE(step.children_hit, step.children);
    ++seen_.sums.cell_nodes;
  }
  void operator()(const InstanceStep& step) {
    seen_.outcomes.insert(step.outcome);
    EXPECT_EQ(step.mesh_id, scene_.instance(step.instance_id).mesh_id);
    EXPECT_EQ(step.outcome == InstanceOutcome::kEntered, !step.structure.empty());
    if (step.outcome == InstanceOutcome::kEntered) {
      EXPECT_TRUE(entered_.insert(step.instance_id).second) << "entered twice";
      now_ = step.instance_id;
    }
    if (step.outcome == InstanceOutcome::kAlreadyTested) {
      EXPECT_TRUE(met_.contains(step.instance_id));
    }
    met_.insert(step.instance_id);
    if (open_ != 0) --open_;
  }
  void operator()(const NodeStep& /*step*/) { ++seen_.sums.nodes; }
  void operator()(const LeafStep& step) {
    EXPECT_EQ(triangles_, 0U) << "the leaf before had more triangles";
    triangles_ = step.triangles;
    ++seen_.sums.leaves;
  }
  void operator()(const TriangleStep& step) {
    seen_.verdicts.insert(step.verdict);
    if (triangles_ != 0) --triangles_;
    if (step.is_best) best_ = {now_, step.primitive_id};
  }
  void operator()(const OpaqueStep& step) { is_opaque_ = is_opaque_ || step.found_best; }

  /// After the last step.
  void expect_led_to(const SurfaceHit& hit) const {
    EXPECT_EQ(triangles_, 0U);
    EXPECT_EQ(open_, 0U) << "the last list was not told of whole";
    if (is_opaque_) return;
    EXPECT_EQ(best_, (PrimitiveRef{hit.instance_id, hit.primitive_id}));
  }

 private:
  const tlas::TopLevelStats& stats() {
    if (!stats_) stats_ = scene_.top_level().stats();
    return *stats_;
  }

  const Scene& scene_;
  Seen& seen_;
  std::optional<tlas::TopLevelStats> stats_;
  std::set<std::array<std::uint32_t, 3>> cells_;
  std::set<std::uint32_t> entered_, met_;
  std::uint32_t now_ = kInvalidId;
  std::uint32_t open_ = 0, triangles_ = 0;
  double last_exit_ = -std::numeric_limits<double>::infinity();
  PrimitiveRef best_;
  bool is_opaque_ = false;
};

void expect_sound(const Scene& scene, const Explanation& way, Seen& seen) {
  WayReader reader(scene, seen);
  for (const WayStep& step : way.steps) std::visit(reader, step);
  reader.expect_led_to(way.hit);
}

void expect_told_as_done(const Scene& scene, test::Random& random, int rays, Seen& seen) {
  for (int i = 0; i < rays && !testing::Test::HasFailure(); ++i) {
    SCOPED_TRACE("ray " + std::to_string(i));
    Ray ray = random_ray(scene, random);
    if (i % 10 == 9) ray.origin += 1e12 * ray.direction / max_abs(ray.direction);
    for (const Precision precision : kPrecisions) {
      const Explanation way = told(scene, ray, {.precision = precision, .max_steps = 1000000});
      ASSERT_TRUE(same(way.hit, intersect(scene, ray, precision)));
      ASSERT_FALSE(way.is_truncated);
      expect_sound(scene, way, seen);
      if (precision == Precision::kExact) continue;
      const bool is_fast = precision == Precision::kFast;
      ASSERT_EQ(visits(way),
                is_fast ? visits<Precision::kFast>(scene, ray) : visits<Precision::kRobust>(scene, ray));
    }
  }
}

TEST(Explain, the_way_leads_to_the_hit_through_the_instances_that_are_visited_in_awkward_scenes) {
  test::Random random(test::seed_or(71));
  Seen seen;
  for (const auto kind :
       {blas::StructureKind::kAuto, blas::StructureKind::kBvh, blas::StructureKind::kWideBvh,
        blas::StructureKind::kCompactBvh, blas::StructureKind::kKdTree, blas::StructureKind::kBruteForce,
        blas::StructureKind::kEmbree}) {
    SceneBuildOptions options;
    options.blas.kind = kind;
    for (auto& [name, data] : awkward_scenes(150, random)) {
      SCOPED_TRACE(name + " in " + std::string(to_string(kind)));
      expect_told_as_done(*built(std::move(data), options), random, 60, seen);
    }
  }
  EXPECT_EQ(seen.outcomes.size(), 6U) << "an outcome of instances never came up";
  EXPECT_GE(seen.verdicts.size(), 4U) << "filtered, missed, hit, out of range";
  EXPECT_GT(seen.sums.nodes, 0U);
  EXPECT_GT(seen.sums.leaves, 0U);
  EXPECT_GT(seen.sums.blocks, 0U) << "no ray came from too far away";
}

/// A crowd in one corner of a wide place: cells with trees; and a flat forest, with empty blocks.
TEST(Explain, crowded_cells_and_forests_are_told_as_they_are_walked) {
  test::Random random(test::seed_or(72));
  Seen seen;
  SceneData crowd = meshes_only(), forest = meshes_only();
  for (int i = 0; i < 6000; ++i) {
    const double spread = i % 100 == 0 ? 300.0 : 1.0;
    place(crowd, 2, {Mat3d(0.02), random.in_box(spread)});
    if (i < 3000) {
      const Vec3d ground{random.uniform(-400, 400), random.uniform(-1, 1), random.uniform(-400, 400)};
      if (std::abs(ground.x) > 100.0)
        place(forest, random.below(4), {Mat3d(random.uniform(0.5, 2.0)), ground});
    }
  }
  const auto crowded = built(std::move(crowd));
  ASSERT_EQ(crowded->top_level().kind(), tlas::TopLevelKind::kNestedGrid);
  expect_told_as_done(*crowded, random, 300, seen);
  EXPECT_GT(seen.sums.cell_nodes, 0U);
  EXPECT_EQ(seen.contents.size(), 3U) << "empty, lists, trees";
  seen.sums = {};
  expect_told_as_done(*built(std::move(forest)), random, 300, seen);
  EXPECT_GT(seen.sums.skipped_blocks, 0U);
}

TEST(Explain, a_single_instance_and_none_need_no_cells) {
  SceneData data = meshes_only();
  EXPECT_TRUE(told(*built(data), {}).steps.empty());
  place(data, 2, {});
  const auto scene = built(std::move(data));
  const Explanation way = told(*scene, {{0.2, 0.3, 9}, {0, 0, -1}});
  ASSERT_FALSE(way.steps.empty());
  EXPECT_EQ(std::get<InstanceStep>(way.steps[0]).outcome, InstanceOutcome::kEntered);
  EXPECT_EQ(std::get<InstanceStep>(way.steps[0]).t_enter, std::nullopt) << "no box was tested";
  EXPECT_EQ(way.counts.cells, 0U);
  EXPECT_EQ(way.counts.instances, 1U);
  EXPECT_EQ(way.hit.t, 8.0);
}

TEST(Explain, an_excluded_primitive_is_told_and_never_best) {
  SceneData data;
  data.meshes.push_back(test::share(test::single_triangle()));
  place(data, 0, {});
  place(data, 0, {Mat3d(1.0), Vec3d(0, 0, -1)});
  const auto scene = built(std::move(data));
  const Ray ray{{0.25, 0.25, 1}, {0, 0, -1}};
  const Explanation way = told(*scene, ray, {.excluded = {0, 0}});
  EXPECT_TRUE(same(way.hit, intersect(*scene, ray, Precision::kRobust, {0, 0})));
  std::vector<TriangleVerdict> verdicts;
  for (const WayStep& step : way.steps)
    if (const auto* triangle = std::get_if<TriangleStep>(&step)) verdicts.push_back(triangle->verdict);
  EXPECT_EQ(verdicts, (std::vector{TriangleVerdict::kExcluded, TriangleVerdict::kHit}));
}

TEST(Explain, instances_that_a_mask_does_not_see_are_told_and_passed_over) {
  test::Random random(test::seed_or(76));
  const auto whole = start_scene(random, 200);
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = 0; id < 200; ++id)
    if (whole->find_instance(id))
      edits.emplace_back(ChangeInstance{id, std::nullopt, InstanceMask(1U << (id % 2)), std::nullopt});
  const auto scene = apply_update(*whole, edits).value().scene;
  std::size_t masked = 0;
  for (int i = 0; i < 300; ++i) {
    const Ray ray = random_ray(*scene, random);
    for (const Precision precision : kPrecisions) {
      const Explanation way = told(*scene, ray, {.precision = precision, .mask = 1});
      ASSERT_TRUE(same(way.hit, intersect(*scene, ray, precision, {}, 1)));
      for (const WayStep& step : way.steps) {
        const auto* instance = std::get_if<InstanceStep>(&step);
        if (instance == nullptr) continue;
        if (instance->outcome == InstanceOutcome::kMasked) ++masked;
        const bool is_odd = instance->instance_id % 2 == 1;
        ASSERT_FALSE(is_odd && instance->outcome == InstanceOutcome::kEntered);
        ASSERT_FALSE(!is_odd && instance->outcome == InstanceOutcome::kMasked);
      }
    }
  }
  EXPECT_GT(masked, 100U);
}

TEST(Explain, counts_are_those_of_the_steps) {
  test::Random random(test::seed_or(73));
  const auto scene = start_scene(random, 200);
  for (int i = 0; i < 100; ++i) {
    const Explanation way = told(*scene, random_ray(*scene, random));
    WayCounts counts;
    for (const WayStep& step : way.steps) {
      counts.cells += std::holds_alternative<CellStep>(step);
      counts.nodes += std::holds_alternative<NodeStep>(step);
      counts.leaves += std::holds_alternative<LeafStep>(step);
      if (const auto* node = std::get_if<NodeStep>(&step))
        counts.max_stack = std::max(counts.max_stack, node->stack);
      if (const auto* leaf = std::get_if<LeafStep>(&step))
        counts.max_stack = std::max(counts.max_stack, leaf->stack);
      if (const auto* instance = std::get_if<InstanceStep>(&step))
        ++(instance->outcome == InstanceOutcome::kEntered ? counts.instances : counts.passed_instances);
      if (const auto* triangle = std::get_if<TriangleStep>(&step))
        ++(triangle->verdict == TriangleVerdict::kFiltered ? counts.filtered_triangles : counts.triangles);
    }
    EXPECT_EQ(way.counts.cells, counts.cells);
    EXPECT_EQ(way.counts.nodes, counts.nodes);
    EXPECT_EQ(way.counts.leaves, counts.leaves);
    EXPECT_EQ(way.counts.instances, counts.instances);
    EXPECT_EQ(way.counts.passed_instances, counts.passed_instances);
    EXPECT_EQ(way.counts.triangles, counts.triangles);
    EXPECT_EQ(way.counts.filtered_triangles, counts.filtered_triangles);
    EXPECT_EQ(way.counts.max_stack, counts.max_stack);
  }
}

TEST(Explain, a_cut_way_has_the_first_steps_and_still_the_right_hit) {
  test::Random random(test::seed_or(74));
  const auto scene = start_scene(random, 300);
  for (int i = 0; i < 50; ++i) {
    Ray ray = random_ray(*scene, random);
    if (i % 5 == 4) ray.origin += 1e12 * ray.direction / max_abs(ray.direction);
    const Explanation whole = told(*scene, ray, {.max_steps = 1000000});
    const std::size_t count = whole.steps.size();
    for (const std::size_t most : {std::size_t(1), count / 2, count - 1, count}) {
      if (most == 0 || most > count) continue;
      const Explanation cut = told(*scene, ray, {.max_steps = most});
      ASSERT_EQ(cut.steps.size(), most);
      ASSERT_EQ(cut.is_truncated, most < count);
      ASSERT_TRUE(same(cut.hit, whole.hit));
      for (std::size_t k = 0; k < most; ++k) ASSERT_EQ(cut.steps[k].index(), whole.steps[k].index());
    }
  }
}

TEST(Explain, invalid_rays_have_no_way_and_a_stopped_one_is_cancelled) {
  test::Random random(test::seed_or(75));
  const auto scene = start_scene(random, 20);
  const Explanation invalid = told(*scene, {{0, 0, 0}, {0, 0, 0}});
  EXPECT_EQ(invalid.hit.status, RayStatus::kInvalid);
  EXPECT_TRUE(invalid.steps.empty());
  std::stop_source stop;
  stop.request_stop();
  for (const Ray& ray : {random_ray(*scene, random), Ray{{1e12, 1e12, 1e12}, {-1, -1, -1}}}) {
    const auto stopped = explain(*scene, ray, {.stop = stop.get_token()});
    ASSERT_FALSE(stopped.ok());
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
  }
}

}  // namespace
}  // namespace gridcast::scene
