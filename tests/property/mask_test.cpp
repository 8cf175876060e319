// A query with a mask answers like one without of the scene without the instances that it does not see, bit
// for bit: for every structure, precision and question, alone and in batches.

#include <functional>
#include <span>

#include "core/scene/all_hits.h"
#include "core/scene/made_rays.h"
#include "core/scene/points.h"
#include "core/scene/run_tracer.h"
#include "core/scene/update.h"
#include "core/scene/visibility.h"
#include "tests/unit/blas/cases.h"
#include "tests/unit/render/render_scene.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

constexpr HitField kEveryField = HitField::kAll | HitField::kTError;

/// The bits of answers.
class Bits {
 public:
  template <class T, class Allocator>
  void add(const std::vector<T, Allocator>& values) {
    add(values.size());
    for (const T& value : values) add(value);
  }
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void add(const T& value) { text_.append(reinterpret_cast<const char*>(&value), sizeof(T)); }
  void add(const SurfaceHit& hit) {
    add(hit.status);
    for (const double value : {hit.t, hit.u, hit.v, hit.normal.x, hit.normal.y, hit.normal.z}) add(value);
    for (const std::uint32_t id : {hit.instance_id, hit.mesh_id, hit.primitive_id}) add(id);
  }
  void add(const HitColumns& hits) {
    add(hits.status);
    add(hits.t);
    add(hits.uv);
    add(hits.normal);
    add(hits.instance_id);
    add(hits.mesh_id);
    add(hits.primitive_id);
    add(hits.t_error);
  }
  void add(const HitLists& lists) {
    add(lists.status);
    add(lists.splits);
    add(lists.hits);
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// What is asked, the same of every scene.
struct Questions {
  std::vector<Ray> rays;
  std::vector<PrimitiveRef> excluded;  ///< one a ray
  std::vector<double> rows;            ///< of the rays
  std::vector<double> points;

  [[nodiscard]] RayBatch batch() const {
    return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, excluded};
  }
  [[nodiscard]] PointBatch point_batch() const {
    return {std::as_bytes(std::span(points)), ScalarType::kFloat64};
  }
  [[nodiscard]] PairBatch pairs() const {
    return {std::as_bytes(std::span(points)), ScalarType::kFloat64, {}, {}};
  }
  [[nodiscard]] MadeRays made() const {
    return {rays.size(), [this](std::size_t i) { return rays[i]; }, excluded};
  }
};

/// Random ones, some that exclude what they hit first, and a bundle that goes in packets.
Questions questions_about(const Scene& scene, test::Random& random) {
  Questions ask;
  for (int i = 0; i < 150; ++i) ask.rays.push_back(random_ray(scene, random));
  const Ray towards = random_ray(scene, random);
  for (int i = 0; i < 96; ++i) {
    ask.rays.push_back(towards);
    ask.rays.back().direction += 0.002 * max_abs(towards.direction) * random.in_box(1.0);
  }
  for (std::size_t i = 0; i < ask.rays.size(); ++i) {
    const Ray& ray = ask.rays[i];
    const SurfaceHit hit = intersect(scene, ray);
    ask.excluded.push_back(i % 4 == 0 ? PrimitiveRef{hit.instance_id, hit.primitive_id} : PrimitiveRef{});
    for (int c = 0; c < 3; ++c) ask.rows.push_back(ray.origin[c]);
    ask.rows.push_back(ray.tnear);
    for (int c = 0; c < 3; ++c) ask.rows.push_back(ray.direction[c]);
    ask.rows.push_back(ray.tfar);
  }
  for (int i = 0; i < 200; ++i) {
    const auto& instance = scene.instance(random.below(std::uint32_t(scene.instance_slots())));
    const Vec3d point = instance.transform.world_from_object().point(random.in_box(1.2));
    ask.points.insert(ask.points.end(), {point.x, point.y, point.z});
  }
  return ask;
}

using Answer = std::function<std::string(const Scene&, InstanceMask)>;
using Answers = std::map<std::string, Answer>;

template <class Trace>
std::string traced(Precision precision, InstanceMask mask, const Trace& trace) {
  TraceOptions options;
  options.precision = precision;
  options.fields = kEveryField;
  options.mask = mask;
  Bits bits;
  bits.add(trace(options).value());
  return bits.take();
}

Answers about_rays(const Questions& ask, Precision precision) {
  return {
      {"one by one",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         Bits bits;
         for (std::size_t i = 0; i < ask.rays.size(); ++i) {
           bits.add(intersect(scene, ask.rays[i], precision, ask.excluded[i], mask));
           bits.add(occluded(scene, ask.rays[i], precision, ask.excluded[i], mask));
         }
         return bits.take();
       }},
      {"a batch, closest",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) { return intersect(scene, ask.batch(), how); });
       }},
      {"a batch, any",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) { return occluded(scene, ask.batch(), how); });
       }},
      {"made rays, closest",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) { return intersect(scene, ask.made(), how); });
       }},
      {"made rays, any",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) { return occluded(scene, ask.made(), how); });
       }},
      {"pairs, first blockers",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) {
           return first_blockers(scene, ask.pairs(), {how, 0.01});
         });
       }},
      {"pairs, yes or no",
       [&ask, precision](const Scene& scene, InstanceMask mask) {
         return traced(precision, mask, [&](const auto& how) {
           return blocked(scene, ask.pairs(), {how, 0.0});
         });
       }},
      {"a run", [&ask, precision](const Scene& scene, InstanceMask mask) {
         RunTracer tracer(scene, precision, mask);
         std::vector<SurfaceHit> hits(ask.rays.size());
         std::vector<RayStatus> any(ask.rays.size());
         tracer.intersect(ask.rays, ask.excluded, hits);
         tracer.occluded(ask.rays, ask.excluded, any);
         Bits bits;
         bits.add(hits);
         bits.add(any);
         return bits.take();
       }}};
}

/// All hits, in pages of three.
Answers about_lists(const Questions& ask, Precision precision) {
  const auto options_of = [precision](InstanceMask mask) {
    AllHitsOptions options;
    options.precision = precision;
    options.fields = kEveryField;
    options.mask = mask;
    options.max_hits = 3;
    return options;
  };
  return {{"lists",
           [&ask, options_of](const Scene& scene, InstanceMask mask) {
             AllHitsOptions options = options_of(mask);
             const HitLists first = intersect_all(scene, ask.batch(), options).value();
             std::vector<HitPosition> after(ask.rays.size());
             for (std::size_t i = 0; i < after.size(); ++i)
               if (const std::uint64_t end = first.splits[i + 1]; end > first.splits[i])
                 after[i] = {first.hits.t[end - 1], first.hits.instance_id[end - 1],
                             first.hits.primitive_id[end - 1]};
             options.after = after;
             Bits bits;
             bits.add(first);
             bits.add(intersect_all(scene, ask.batch(), options).value());
             return bits.take();
           }},
          {"lists of made rays", [&ask, options_of](const Scene& scene, InstanceMask mask) {
             Bits bits;
             bits.add(intersect_all(scene, ask.made(), options_of(mask)).value());
             return bits.take();
           }}};
}

/// What has one precision.
Answers about_the_rest(const Questions& ask) {
  return {{"counts",
           [&ask](const Scene& scene, InstanceMask mask) {
             const HitCounts counts = count_hits(scene, ask.batch(), {{}, {}, mask}).value();
             Bits bits;
             bits.add(counts.status);
             bits.add(counts.count);
             bits.add(counts.crossings);
             bits.add(counts.winding);
             return bits.take();
           }},
          {"nearest points",
           [&ask](const Scene& scene, InstanceMask mask) {
             NearestOptions options;
             options.mask = mask;
             const NearestColumns nearest = nearest_points(scene, ask.point_batch(), options).value();
             Bits bits;
             bits.add(nearest.status);
             bits.add(nearest.distance);
             bits.add(nearest.position);
             bits.add(nearest.uv);
             bits.add(nearest.instance_id);
             bits.add(nearest.primitive_id);
             return bits.take();
           }},
          {"points inside", [&ask](const Scene& scene, InstanceMask mask) {
             InsideOptions options;
             options.mask = mask;
             const InsideColumns inside = points_inside(scene, ask.point_batch(), options).value();
             Bits bits;
             bits.add(inside.place);
             bits.add(inside.splits);
             bits.add(inside.instance_id);
             bits.add(inside.winding);
             bits.add(inside.on_boundary);
             bits.add(inside.open_meshes);
             return bits.take();
           }}};
}

/// The scene without the instances that a query does not see.
std::shared_ptr<const Scene> what_is_seen(const Scene& scene, InstanceMask query) {
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id)
    if ((scene.instance(id).mask & query) == 0) edits.emplace_back(RemoveInstance{id});
  return apply_update(scene, edits).value().scene;
}

std::shared_ptr<const Scene> with_masks(const Scene& scene, const std::vector<InstanceMask>& masks) {
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = 0; id < masks.size(); ++id)
    edits.emplace_back(ChangeInstance{id, {}, masks[id], {}});
  return apply_update(scene, edits).value().scene;
}

struct MaskCase {
  std::string name;
  SceneData data;
  std::vector<InstanceMask> masks;  ///< one an instance
  std::vector<InstanceMask> queries;
};

std::vector<MaskCase> mask_cases(test::Random& random) {
  constexpr InstanceMask kKinds[] = {0x00, 0x01, 0x02, 0x03, 0x10, 0x80, 0x7F, 0xFF};
  std::vector<MaskCase> cases;
  for (auto& [name, data] : awkward_scenes(24, random)) {
    if (name == "line" || name == "flat city") continue;
    std::vector<InstanceMask> masks;
    for (std::size_t i = 0; i < data.instances.size(); ++i) masks.push_back(kKinds[random.below(8)]);
    cases.push_back({name, std::move(data), std::move(masks), {0x01, 0x82, 0xFF}});
  }
  // One instance, or one that is seen: batches have a way of their own for those.
  SceneData alone = meshes_only();
  place(alone, 0, {Mat3d(1.0), Vec3d(3.0, 0.0, 0.0)});
  cases.push_back({"alone", alone, {0x06}, {0x01, 0x04}});
  place(alone, 1, {Mat3d(1.0), Vec3d(3.0, 0.5, 0.0)});
  cases.push_back({"one of two", alone, {0x06, 0x01}, {0x01, 0x02, 0x08}});
  return cases;
}

class Masks : public testing::TestWithParam<blas::StructureCase> {};

void expect_same(const Answers& answers, const Scene& masked, InstanceMask query, const Scene& seen,
                 std::size_t& differing) {
  for (const auto& [name, answer] : answers) {
    const bool same = answer(masked, query) == answer(seen, kFullMask);
    EXPECT_TRUE(same) << name << " with mask " << int(query);
    differing += std::size_t(!same);
  }
}

TEST_P(Masks, a_masked_scene_is_one_without_what_is_not_seen) {
  test::Random random(test::seed_or(91));
  SceneBuildOptions options;
  options.blas = GetParam().options;
  int hidden = 0;
  for (MaskCase& one : mask_cases(random)) {
    SCOPED_TRACE(one.name);
    const auto plain = built(std::move(one.data), options);
    const auto masked = with_masks(*plain, one.masks);
    const Questions ask = questions_about(*plain, random);
    for (const InstanceMask query : one.queries) {
      const auto seen = what_is_seen(*masked, query);
      std::size_t differing = 0;
      for (const Precision precision : {Precision::kFast, Precision::kRobust, Precision::kExact}) {
        SCOPED_TRACE(int(precision));
        expect_same(about_rays(ask, precision), *masked, query, *seen, differing);
        if (precision != Precision::kExact)
          expect_same(about_lists(ask, precision), *masked, query, *seen, differing);
      }
      expect_same(about_the_rest(ask), *masked, query, *seen, differing);
      if (differing != 0) return;
      const Answer closest = about_rays(ask, Precision::kRobust).at("a batch, closest");
      hidden += int(closest(*masked, query) != closest(*plain, kFullMask));
    }
  }
  EXPECT_GT(hidden, 15) << "masks hid nothing";
}

std::vector<blas::StructureCase> all_structures() {
  std::vector<blas::StructureCase> all = blas::structure_cases();
  all.push_back({"brute_force", {blas::StructureKind::kBruteForce}});
  return all;
}

INSTANTIATE_TEST_SUITE_P(Structures, Masks, testing::ValuesIn(all_structures()),
                         [](const auto& one) { return one.param.name; });

std::string picture(const Scene& scene, render::RenderSettings settings, InstanceMask mask) {
  settings.mask = mask;
  const render::Film film = render::rendered(scene, settings);
  Bits bits;
  bits.add(film.exposure);
  for (const render::Layer& layer : film.layers) {
    bits.add(layer.values);
    bits.add(layer.ids);
  }
  return bits.take();
}

// Floor, mirror and a red ball, with a lamp: a ball that is not there is in no mirror, casts no shadow, and
// is not what the picture is exposed for. With glass, shadow rays go another way.
TEST(MaskedPictures, are_those_of_the_scene_without_what_is_not_seen) {
  using render::matt;
  using render::moved;
  for (const bool with_glass : {false, true}) {
    for (const bool with_lamp : {false, true}) {
      Light lamp;
      lamp.kind = LightKind::kPoint;
      lamp.position = {1.0, 4.0, 2.0};
      lamp.intensity = 500.0;
      Material glass = matt(1.F, 1.F, 1.F);
      glass.transmission = 0.9F;
      render::SceneMaker maker;
      maker.add(test::box({-4, -1.5F, -4}, {4, -1, 4}), matt(0.6F, 0.6F, 0.6F))
          .add(test::box({-3, -1, -3.2F}, {3, 3, -3}), render::mirror())
          .add(test::icosphere(3), matt(0.9F, 0.1F, 0.1F), moved({0.2, 0.0, 0.0}))
          .add(test::icosphere(2), with_glass ? glass : matt(0.F, 0.F, 1.F), moved({-1.5, -0.2, 1.0}));
      if (with_lamp) maker.light(lamp);
      const auto masked = with_masks(*maker.build(), {0xFF, 0xFF, 0x02, 0xFF});
      render::RenderSettings settings;
      settings.camera = render::look_at({1, 2, 6}, {0, 0, 0}, {0, 1, 0}, 0.9).value();
      settings.width_px = 48;
      settings.height_px = 40;
      settings.layers = {render::LayerKind::kDepth, render::LayerKind::kInstanceId};
      for (const Precision precision : {Precision::kFast, Precision::kRobust, Precision::kExact}) {
        settings.precision = precision;
        const std::string without = picture(*masked, settings, 0x01);
        EXPECT_TRUE(without == picture(*what_is_seen(*masked, 0x01), settings, kFullMask))
            << "glass " << with_glass << ", lamp " << with_lamp << ", precision " << int(precision);
        EXPECT_TRUE(without != picture(*masked, settings, 0x02));
      }
    }
  }
}

}  // namespace
}  // namespace gridcast::scene
